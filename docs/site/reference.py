"""Pages on every public function and class, from the docstrings in the code."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

from scenes import spelled

import flurries as fl
from flurries.camera import importers
from flurries.effects.checks import INNER
from flurries.effects.kinds import OURS
from flurries.output import write as writing

# Pages beside those of the public modules: title, and the names on it.
MORE: dict[str, tuple[ModuleType, tuple[str, ...]]] = {
    "output": (writing, ("write", "Summary")),
    "importers": (importers, ("load",)),
}

SENTENCES = {
    "scene": "What a film is made of, how the camera moves, and what comes out of a frame.",
    "effects": "Parts of effects, for effects of your own; each effect that comes with flurries has a page.",
    "output": "Frames to files: `fl.Scene.write` calls it.",
    "importers": "Cameras of other programs: `flurries render --camera` calls it.",
}


def write(folder: Path) -> None:
    """Write a page for each module, one for effects and one for what belongs to scenes."""
    folder.mkdir(parents=True)
    pages: dict[str, list[tuple[str, str]]] = {"scene": [], "effects": []}
    for name in fl.__all__:
        thing = getattr(fl, name)
        if inspect.ismodule(thing):
            own = [one for one in public(thing) if name not in SENTENCES or one not in fl.__all__]
            pages[name] = pages.get(name, []) + [(f"flurries.{name}", one) for one in own]
        else:
            kind = "effects" if hasattr(thing, "preset") else "scene"
            pages[kind].append(("flurries", name))
    for name, (module, names) in MORE.items():
        pages[name] = [(module.__name__, own) for own in names]
    # An effect has a page of its own; the parts of effects share one.
    classes = {kind.__name__: name for name, kind in OURS.items()}
    for pair in [pair for pair in pages["effects"] if pair[1] in classes]:
        pages["effects"].remove(pair)
        pages.setdefault(classes[pair[1]], []).append(pair)
    for title, names in pages.items():
        (folder / f"{title}.rst").write_text(page(title, names), encoding="utf-8")
    first = ["scene", *OURS, "effects", "scene-toml", "commands", "variables"]
    listed = "\n".join([*first, *sorted(set(pages) - set(first))])
    (folder / "index.md").write_text(f"{INDEX}\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n")


INDEX = """# Reference

Made from the code: what stands here is what `help` says in Python and `--help` on the command line.
In Python, `fl` is `import flurries as fl`. Arrays are `[row, column]`, x goes right, **y goes down**, z goes
away from the camera; lengths are metres, angles radians, times frames unless a name says otherwise.
An argument that is not as described is refused by a `TypeError` or a `ValueError` that names it. `out`, where
a function has it, is an array of the result's shape and dtype to write into and return. `dtype`
is the type of its numbers, `np.float32` or `np.float64`; `shape` is a picture's (H, W) in pixels, and `seed`
any int64.
"""


_shown: set[int] = set()


def public(module: ModuleType) -> list[str]:
    """Return the functions and classes that a module offers."""
    return [
        name for name in getattr(module, "__all__", ())
        if callable(getattr(module, name, None)) and not inspect.ismodule(getattr(module, name))
    ]  # fmt: skip


def page(title: str, names: list[tuple[str, str]]) -> str:
    """Return a page of a module."""
    if title in OURS:
        return effect(title, names[0])
    head = f"fl.{title}" if title in fl.__all__ else title.capitalize()
    module = getattr(fl, title) if title in fl.__all__ else None
    # Words that hold for all of a module stand in its own docstring once.
    about = SENTENCES.get(title) or re.sub(r":\w+:(?=`)", "", inspect.getdoc(module) or "")
    lines = [head, "=" * len(head), "", about.replace("`", "``").replace("````", "``"), ""]
    for path, name in names:
        lines += ["", name, "-" * len(name), ""]
        thing = getattr(__import__(path, fromlist=[name]), name)
        lines += directive(path, name, thing)
        # One thing under two names has one place that links lead to.
        if id(thing) in _shown:
            lines += ["   :no-index:"]
        _shown.add(id(thing))
    return "\n".join(lines) + "\n"


def effect(kind: str, name: tuple[str, str]) -> str:
    """Return an effect's page: the class, with pictures beside its fields, and its presets by their strength."""
    head = spelled(OURS[kind])
    lines = [head, "=" * len(head), "", *directive(*name, OURS[kind])]
    _shown.add(id(OURS[kind]))
    looks = tuple(getattr(OURS[kind], "PRESETS", ()))
    if looks:
        lines += ["", "Presets", "-------", ""]
    for look in looks:
        about = OURS[kind](look)
        lines += [
            f".. figure:: /looks/{kind}_{look.replace(' ', '_')}.webp",
            f"   :alt: {look}",
            "",
        ]
        strong = f": {about.strength()}" if hasattr(about, "strength") else ""
        lines += [f"   ``{head}({look!r})``{strong}", ""]
    return "\n".join(lines) + "\n"


def directive(path: str, name: str, thing: Any) -> list[str]:
    """Return what makes Sphinx show a function, or a class with its methods."""
    if not inspect.isclass(thing):
        return [f".. autofunction:: {path}.{name}"]
    methods = [
        one for one, value in inspect.getmembers(thing)
        if not one.startswith("_") and one not in INNER and inspect.getdoc(value)
        and (inspect.isroutine(value) or isinstance(value, property))
        and one in own_names(thing)
    ]  # fmt: skip
    lines = [f".. autoclass:: {path}.{name}"]
    return lines + ([f"   :members: {', '.join(methods)}"] if methods else [])


def own_names(kind: type) -> set[str]:
    """Return what a class and its bases of this package define."""
    return {
        name
        for base in kind.__mro__
        if base.__module__.startswith("flurries")
        for name in vars(base)
    }

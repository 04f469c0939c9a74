"""The page on scene files: every key with its type, default, range and meaning, from the code."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from functools import cache, partial
from pathlib import Path
from typing import Any

from numpydoc.docscrape import ClassDoc

import flurries as fl
from flurries import effects
from flurries.effects import checks
from flurries.effects.kinds import METHODS, OURS
from flurries.motion.wind import FIELDS
from flurries.scene.toml import reader as tables

TABLES = (
    ("The scene", "", fl.Scene, tables.SCENE),
    ("[camera]: the lens", "camera", fl.Camera, tables.LENS),
    ("[camera]: its way", "camera", fl.CameraPath, tables.WAY),
    ("[depth]: a grey picture as a depth", "depth", fl.scene.DepthMap, tables.DEPTH),
    ("[sun]", "sun", fl.scene.Sun, [field.name for field in fields(fl.scene.Sun)]),
    (
        "[output]: how frames are written",
        "output",
        fl.scene.Output,
        [field.name for field in fields(fl.scene.Output)],
    ),
    # A field of velocities is an array, which no text holds.
    ("wind = {...}", "wind", fl.Wind, [name for name in FIELDS if name != "field"]),
)

HEAD = """# Scene files: the keys of scene.toml

A scene file says what `fl.Scene` and its effects say in Python, with the same names. `flurries render scene.toml`
renders it, `fl.open` and `scene.save` read and write it. A key that is not known is refused with its line and the
nearest known one.

```toml
format = 3
size = [1280, 720]
background = "plate.%04d.exr"
fps = 24.0

[camera]
focal = 1500.0
velocity = [0.0, 0.0, 3.0]

[output]
bits = "half"
motion = "y-up"

[[effects]]
kind = "snow"
preset = "heavy"
amount = {keys = [[0, 0.0], [48, 1.0]]}
wind = {mean = [1.0, 0.0, 0.0], gusts = 0.8}
```

`format = 3` must be there. A number that may vary is `{keys = [[frame, value],
...]}`, linear between its keys and held outside. Files are named from the scene file's own folder. Each
`[[effects]]` table has a `kind`, may have a `preset`, and then any of the fields below.
"""


def spelled(kind: type) -> str:
    """Return how a class of effects, or of what they are made of, is called in Python."""
    return f"fl.{'effects.' * any(kind in own.values() for own in METHODS.values())}{kind.__name__}"


def write(folder: Path) -> None:
    """Write the page."""
    parts = [HEAD]
    for title, _, kind, names in TABLES:
        parts.append(f"## {title}\n\n{table(kind, names, {})}")
    parts.append("`path` in `[camera]`, in place of its way: a `.csv` with x, y, z and rx, ry, rz a frame, "
                 "Nuke's `.chan`, a USD stage, KITTI's poses `.txt`, or a folder of COLMAP's text.\n")  # fmt: skip
    for name, kind in OURS.items():
        looks = getattr(kind, "PRESETS", None)
        named = f"Presets: {', '.join(f'`{look}`' for look in looks)}. " if looks else ""
        names = (*[f.name for f in fields(kind)], *getattr(kind, "KNOBS", ()))
        parts.append(
            f'## kind = "{name}"\n\n{named}In Python `{spelled(kind)}`.\n\n'
            f"{table(kind, names, ranges(kind))}"
        )
    (folder / "scene-toml.md").write_text("\n".join(parts), encoding="utf-8")


def table(kind: type[Any], names: tuple[str, ...], limits: Mapping[str, str]) -> str:
    """Return the rows of some fields of a class."""
    doc = described(kind)
    usual = {f.name: f.default for f in fields(kind) if f.default is not MISSING}
    rows = ["| key | type | default | range | what |", "| --- | --- | --- | --- | --- |"]
    for name in names:
        about, text = doc.get(name, ("", ""))
        optional = "optional" in about
        about = about.replace(", optional", "")
        given = usual.get(name)
        default = "" if name not in usual or given is None else f"`{toml(given)}`"
        text = text or "see the class in Python"
        cells = (
            f"`{name}`",
            about,
            default or ("not given" if optional else ""),
            limits.get(name, ""),
            text,
        )
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


@cache
def described(kind: type[Any]) -> dict[str, tuple[str, str]]:
    """Return type and text of every parameter of a class, by its docstring."""
    found: dict[str, tuple[str, str]] = {}
    for part in (*ClassDoc(kind)["Parameters"], *ClassDoc(kind)["Attributes"]):
        for name in part.name.split(","):
            text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", " ".join(part.desc)).replace("``", "`")
            # numpydoc lists class attributes too, without words.
            if text:
                found.setdefault(name.strip(), other(name.strip(), part.type, text))
    return found


def other(name: str, about: str, text: str) -> tuple[str, str]:
    """Return type and text of a parameter, those of another class if it is "As in" that."""
    match = re.match(r"(As|See)( in)? `(\w+)`\W*", text)
    kind = match and getattr(effects, match[3], None)
    if not match or kind is None or name not in described(kind):
        return about, text
    first, words = described(kind)[name]
    return about or first, " ".join([words, text[match.end() :]]).strip()


def ranges(kind: type[Any]) -> dict[str, str]:
    """Return what the checks of an effect's fields say of their limits."""
    return {name: " ".join(limits(check)) for name, check in checks.checks_of(kind).items()}


def limits(check: Any) -> Iterator[str]:
    """Yield the limits of a check in words."""
    inner = getattr(check, "__closure__", None) or ()
    for cell in inner:
        if callable(cell.cell_contents):
            yield from limits(cell.cell_contents)
        elif isinstance(cell.cell_contents, tuple):
            yield " ".join(f"`{word}`" for word in cell.cell_contents)
    if isinstance(check, partial):
        given = check.keywords
        if "low" in given and "high" in given:
            yield f"{given['low']:,g} to {given['high']:,.10g}"
        elif "low" in given:
            yield f"{given['low']:g} or more"
        elif "above" in given:
            yield f"more than {given['above']:g}"


def toml(value: object) -> str:
    """Return a default as a scene file has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)

"""From a scene to a TOML file: every value that differs from its default."""

import os
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import PathLike
from flurries.camera.path import CameraPath
from flurries.effects.kinds import kind_of
from flurries.effects.notes import Where
from flurries.io import replacing
from flurries.motion.keys import Keys
from flurries.motion.wind import Wind
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import called, listed
from flurries.scene.scene import Scene, expect_scene
from flurries.scene.toml.reader import DEPTH, FORMAT, WAY


def describe(
    scene: Scene, folder: Path | None = None, *, leave_out: tuple[str, ...] = ()
) -> dict[str, Any]:
    table: dict[str, Any] = {"format": FORMAT, "size": list(scene.size)}
    table |= ({} if scene._still else {"fps": scene.fps}) | {"seed": scene.seed}
    if "background" not in leave_out:
        table["background"] = _file("background", scene.background, folder)
    if scene.foreground is not None:
        table["foreground"] = _mattes(scene.foreground, folder, leave_out)
    for name in ("extend", "start", "colorspace", "loop", "space", "sun", "light", "lens"):
        if (value := scene._arguments[name]) not in (None, "stop", "auto"):
            table[name] = _plain(value)
    if scene.lens is None and scene._backdrop.photograph:
        table["lens"] = "none"
    table |= _depth("depth", scene.depth, folder, leave_out)
    if "output" not in leave_out and (said := scene._output.changed()):
        table["output"] = said
    if scene.lights:
        table["lights"] = [_plain(lamp) for lamp in scene.lights]
    path: CameraPath = scene.camera
    way = {name: getattr(path, name) for name in (*WAY, "focal", "extend")}
    said = {name: value for name, value in way.items() if value is not None}
    table["camera"] = _plain(path.camera) | {name: _plain(value) for name, value in said.items()}
    if path.extend == "on":
        del table["camera"]["extend"]
    kinds = [(kind_of(effect), effect) for effect in scene.effects]
    if "effects" in leave_out:
        kinds = [(kind, effect) for kind, effect in kinds if kind is not None]
    bare = "effects" in leave_out
    table["effects"] = [_effect(kind, effect, folder, bare=bare) for kind, effect in kinds]
    return table


def _effect(kind: str | None, effect: Any, folder: Path | None, *, bare: bool) -> dict[str, Any]:
    if kind is None:
        raise ValueError(
            f"effects: a {type(effect).__name__} cannot be written to a file; "
            "flurries.effects.register gives it a kind"
        )
    entry: dict[str, Any] = {"kind": kind}
    for f in fields(effect):
        value = getattr(effect, f.name)
        # A look's version always: a later one has another default.
        if value is not None and (f.name == "look" or f.default is MISSING or value != f.default):
            own = isinstance(value, Where)
            entry[f.name] = _where(value, folder, bare) if own else _plain(value)
    return entry


def _where(where: Where, folder: Path | None, bare: bool) -> dict[str, Any]:
    """Return where flakes are as a file holds it; an array or a function is left out if `bare`."""
    source = where.source
    if isinstance(source, (float, Keys)):
        source = _plain(source)
    elif isinstance(source, str) or not bare:
        source = _file("where", source, folder)
    else:
        source = ""
    return {"source": source, "near": where.near, "far": where.far}


def _plain(value: Any) -> Any:
    """Return a number, keys, an array, or what fields of an object say something."""
    if isinstance(value, Keys):
        return {"keys": [[frame, _plain(v)] for frame, v in value.keys]}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Wind) and value.field is not None:
        raise ValueError("wind: a field is an array, which a text file cannot hold")
    if is_dataclass(value):
        said = {f.name: getattr(value, f.name) for f in fields(value) if f.init}
        return {name: _plain(one) for name, one in said.items() if one is not None}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _file(name: str, value: Any, folder: Path | None) -> Any:
    """Return a file or a color; an opened source is its file."""
    value = getattr(value, "spec", value)
    if isinstance(value, str) and value.startswith("#"):
        return value
    if isinstance(value, (str, os.PathLike)):
        return str(value) if folder is None else os.path.relpath(value, folder)
    if isinstance(value, (tuple, list)):
        return [float(v) for v in value]
    raise ValueError(f"{name} must be a file or a color to be written, got {type(value).__name__}")


def _mattes(value: Any, folder: Path | None, leave_out: tuple[str, ...]) -> Any:
    tables = []
    for number, matte in enumerate(listed(value), 1):
        name = called(number)
        entry = {} if name in leave_out else {"source": _file(name, matte.source, folder)}
        tables.append(entry | _depth(f"{name} depth", matte.depth, folder, leave_out))
    return tables[0]["source"] if len(tables) == 1 and [*tables[0]] == ["source"] else tables


def _depth(
    name: str, value: Any, folder: Path | None, leave_out: tuple[str, ...]
) -> dict[str, Any]:
    """Return a depth as a file holds it; one that is left out without its picture."""
    bare = name in leave_out
    if isinstance(value, DepthMap):
        law = {key: getattr(value, key) for key in DEPTH if key != "source"}
        return {"depth": law if bare else {"source": _file(name, value.source, folder), **law}}
    if value is None or (bare and (isinstance(value, (str, os.PathLike)) or np.ndim(value))):
        return {}
    plain = np.ndim(value) == 0 and not isinstance(value, (str, os.PathLike))
    return {"depth": float(value) if plain else _file(name, value, folder)}


def save(scene: Scene, path: PathLike) -> None:
    expect_scene(scene)
    import tomli_w

    target = Path(path)
    text = tomli_w.dumps(describe(scene, target.resolve().parent))
    with replacing(target) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")

"""From a scene to a TOML file: every value that differs from its default."""

from __future__ import annotations

import os
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from flurries.camera.path import CameraPath
from flurries.effects.kinds import kind_of
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
    """Return the scene as plain values, as a scene file holds them."""
    table: dict[str, Any] = {"format": FORMAT, "size": list(scene.size or ())}
    table |= ({} if scene._still else {"fps": scene.fps}) | {"seed": scene.seed}
    if scene.background is not None and "background" not in leave_out:
        table["background"] = _background("background", scene.background, folder)
    if scene.foreground is not None:
        table["foreground"] = _mattes(scene.foreground, folder, leave_out)
    for name in ("extend", "start", "colorspace", "loop", "space"):
        if getattr(scene, name) not in (None, "stop", "auto"):
            table[name] = getattr(scene, name)
    if scene.depth is not None:
        described = _depth("depth", scene.depth, folder, bare="depth" in leave_out)
        if described is not None:
            table["depth"] = described
    for name in ("sun", "light", "lens"):
        if getattr(scene, name) is not None:
            table[name] = _said(getattr(scene, name))
    if scene.lens is None and scene._backdrop.photograph:
        table["lens"] = "none"
    if "output" not in leave_out and (said := scene.output.changed()):
        table["output"] = said
    if scene.lights:
        table["lights"] = [_said(lamp) for lamp in scene.lights]
    path: CameraPath = scene.camera
    table["camera"] = _said(path.camera)
    for name in (*WAY, "focal"):
        value = getattr(path, name)
        if value is not None:
            table["camera"][name] = _toml(value)
    if path.extend != "on":
        table["camera"]["extend"] = path.extend
    table["effects"] = []
    for effect in scene.effects:
        kind = kind_of(effect)
        if kind is None and "effects" in leave_out:
            continue
        if kind is None:
            raise ValueError(
                f"effects: a {type(effect).__name__} cannot be written to a file; "
                "flurries.effects.register gives it a kind"
            )
        entry: dict[str, Any] = {"kind": kind}
        for f in fields(effect):
            value = getattr(effect, f.name)
            # A look's version always: a later one has another default.
            if value is not None and (
                f.name == "look" or f.default is MISSING or value != f.default
            ):
                entry[f.name] = _toml(value)
        table["effects"].append(entry)
    return table


def _said(part: Any) -> dict[str, Any]:
    """Return the fields of an object that say something."""
    names = [f.name for f in fields(part) if f.init]
    values = {name: getattr(part, name) for name in names}
    return {name: _toml(value) for name, value in values.items() if value is not None}


def _background(name: str, value: Any, folder: Path | None) -> Any:
    if isinstance(value, str) and value.startswith("#"):
        return value
    # An opened source is its file.
    value = getattr(value, "spec", value)
    if isinstance(value, (str, os.PathLike)):
        return str(value) if folder is None else os.path.relpath(value, folder)
    if isinstance(value, (tuple, list)):
        return [float(v) for v in value]
    raise ValueError(f"{name} must be a file or a color to be written, got an array")


def _mattes(value: Any, folder: Path | None, leave_out: tuple[str, ...]) -> Any:
    """Return the foreground: a file, or a table for each."""
    tables = []
    for number, matte in enumerate(listed(value), 1):
        name = called(number)
        entry = {} if name in leave_out else {"source": _background(name, matte.source, folder)}
        if matte.depth is not None:
            bare = f"{name} depth" in leave_out
            depth = _depth(f"{name} depth", matte.depth, folder, bare=bare)
            entry |= {} if depth is None else {"depth": depth}
        tables.append(entry)
    return tables[0]["source"] if len(tables) == 1 and [*tables[0]] == ["source"] else tables


def _depth(name: str, value: Any, folder: Path | None, *, bare: bool) -> Any:
    """Return the depth as a file holds it; a bare one without its picture, or None."""
    if isinstance(value, DepthMap):
        law = {key: getattr(value, key) for key in DEPTH if key != "source"}
        return law if bare else {"source": _background(name, value.source, folder), **law}
    if np.ndim(value) == 0 and not isinstance(value, (str, os.PathLike)):
        return float(value)
    return None if bare else _background(name, value, folder)


def _toml(value: Any) -> Any:
    if isinstance(value, Wind):
        if value.field is not None:
            raise ValueError("wind: a field is an array, which a text file cannot hold")
        return _said(value)
    if isinstance(value, Keys):
        return {"keys": [[frame, _toml(v)] for frame, v in value.keys]}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def save(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a TOML file, under a temporary name first."""
    expect_scene(scene)
    import tomli_w

    target = Path(path)
    text = tomli_w.dumps(describe(scene, target.resolve().parent))
    with replacing(target) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")

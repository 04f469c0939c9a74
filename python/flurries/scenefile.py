"""Scenes as TOML files: strict to read, every value that differs from the default to write.

Paths are relative to the file's folder. Keyed numbers are ``{keys = [[frame, value], ...]}``.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import sys
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from flurries.camera import Camera
from flurries.effects import Snow
from flurries.effects.presets import SNOW
from flurries.path import CameraPath
from flurries.scene import DEFAULT_FOCAL, Scene
from flurries.timeline import Keys

__all__ = ["fingerprint", "load", "save"]

MOST_BYTES = 1 << 20

EFFECTS: dict[str, type[Any]] = {"snow": Snow}

_SCENE = ("size", "background", "camera", "effects", "fps", "seed", "foreground", "space")
_CAMERA = ("focal", "center", "offset", "center_shift", "rotation", "position", "velocity")


class _File:
    """The text of a scene file, to say where something stands."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.lines = text.splitlines()

    def where(self, key: str) -> str:
        """Return the file and the line of a key, as nearly as the text shows it."""
        word = re.compile(rf"(^|[\s{{,\[.]){re.escape(key)}\"?\s*(=|\])")
        for number, line in enumerate(self.lines, 1):
            if word.search(line):
                return f"{self.path}, line {number}"
        return str(self.path)

    def refuse(self, key: str, known: tuple[str, ...], place: str) -> ValueError:
        """Return the error for a key that nobody knows."""
        near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else f"; known are {', '.join(known)}"
        return ValueError(f"{self.where(key)}: unknown key {key!r} in {place}{hint}")


def load(path: str | os.PathLike[str]) -> Scene:
    """Return the scene of a TOML file.

    Parameters
    ----------
    path : path
        At most 1 MiB.

    Raises
    ------
    FileNotFoundError, OSError
        If the file cannot be read.
    ValueError, TypeError
        If it is not TOML, has an unknown key (named with its line and the nearest known one), or a
        value that the scene refuses.
    """
    file = Path(path)
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"{file}: a scene file has at most {MOST_BYTES} bytes")
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    try:
        text = file.read_text(encoding="utf-8")
        values = tomllib.loads(text)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{file}: not a TOML file: {error}") from None
    return _scene(_File(file, text), values)


def _scene(file: _File, values: dict[str, Any]) -> Scene:
    for key in values:
        if key not in _SCENE:
            raise file.refuse(key, _SCENE, "the scene")
    arguments = dict(values)
    folder = file.path.parent
    for key in ("background", "foreground"):
        value = arguments.get(key)
        if isinstance(value, str) and not value.startswith("#"):
            arguments[key] = str(folder / value)
    camera = arguments.pop("camera", None)
    listed = arguments.pop("effects", [])
    if not isinstance(listed, list):
        raise TypeError(f"{file.where('effects')}: effects must be [[effects]] tables")
    try:
        effects = [_effect(file, table) for table in listed]
        scene = Scene(**arguments, effects=effects)
        return scene if camera is None else scene.replace(camera=_camera(file, camera, scene))
    except (ValueError, TypeError) as error:
        message = str(error)
        named = message.split(" ", 1)[0].rstrip(":").split("[")[0]
        if str(file.path) in message:
            raise
        raise type(error)(f"{file.where(named)}: {message}") from None


def _effect(file: _File, table: Any) -> Any:
    if not isinstance(table, dict):
        raise TypeError(f"{file.where('effects')}: effects must be [[effects]] tables")
    kind = table.get("kind")
    if kind not in EFFECTS:
        known = ", ".join(map(repr, EFFECTS))
        raise ValueError(f"{file.where('kind')}: kind must be one of {known}, got {kind!r}")
    known_keys = tuple(f.name for f in fields(EFFECTS[kind]))
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in ("kind", "preset"):
            continue
        if key not in known_keys:
            raise file.refuse(key, ("kind", "preset", *known_keys), f"effect {kind!r}")
        values[key] = _value(file, key, value)
    preset = table.get("preset")
    return EFFECTS[kind](**values) if preset is None else EFFECTS[kind].preset(preset, **values)


def _camera(file: _File, table: Any, scene: Scene) -> CameraPath:
    if not isinstance(table, dict):
        raise TypeError(f"{file.where('camera')}: camera must be a table")
    for key in table:
        if key not in _CAMERA:
            raise file.refuse(key, _CAMERA, "camera")
    values = {key: _value(file, key, value) for key, value in table.items()}
    position, velocity = values.pop("position", None), values.pop("velocity", None)
    values.setdefault("focal", DEFAULT_FOCAL * scene.shape[1])
    if isinstance(position, tuple):
        position = np.asarray(position, dtype=np.float64)
    return CameraPath(Camera(**values), position=position, velocity=velocity)


def _value(file: _File, key: str, value: Any) -> Any:
    """Return a number, a tuple, or keys."""
    if isinstance(value, dict):
        if set(value) != {"keys"}:
            raise ValueError(
                f"{file.where(key)}: {key} must be a value or {{keys = [[frame, value], ...]}}"
            )
        return Keys([tuple(pair) if isinstance(pair, list) else pair for pair in value["keys"]])
    return tuple(value) if isinstance(value, list) else value


def describe(
    scene: Scene, folder: Path | None = None, *, leave_out: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the scene as plain values, as a scene file holds them."""
    table: dict[str, Any] = {"size": list(scene.size or ()), "fps": scene.fps, "seed": scene.seed}
    for name in ("background", "foreground"):
        value = getattr(scene, name)
        if value is None or name in leave_out:
            continue
        table[name] = _background(name, value, folder)
    if scene.space != "auto":
        table["space"] = scene.space
    path: CameraPath = scene.camera
    camera = {f.name: _toml(getattr(path.camera, f.name)) for f in fields(Camera)}
    table["camera"] = {key: value for key, value in camera.items() if value is not None}
    for name in ("position", "velocity"):
        value = getattr(path, name)
        if value is not None:
            table["camera"][name] = _toml(value)
    table["effects"] = []
    kinds = {cls: kind for kind, cls in EFFECTS.items()}
    for effect in scene.effects:
        if type(effect) not in kinds:
            raise ValueError(f"effects: a {type(effect).__name__} cannot be written to a file")
        entry: dict[str, Any] = {"kind": kinds[type(effect)]}
        for f in fields(effect):
            value = getattr(effect, f.name)
            if value is not None and (f.default is MISSING or value != f.default):
                entry[f.name] = _toml(value)
        table["effects"].append(entry)
    return table


def _background(name: str, value: Any, folder: Path | None) -> Any:
    if isinstance(value, str) and value.startswith("#"):
        return value
    if isinstance(value, (str, os.PathLike)):
        return str(value) if folder is None else os.path.relpath(value, folder)
    if isinstance(value, (tuple, list)):
        return [float(v) for v in value]
    raise ValueError(f"{name} must be a file or a colour to be written, got an array")


def _toml(value: Any) -> Any:
    if isinstance(value, Keys):
        return {"keys": [[frame, _toml(v)] for frame, v in value.keys]}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def save(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a TOML file, under a temporary name first.

    Raises
    ------
    ValueError
        If a background or foreground is an array, which a text file cannot hold.
    OSError
        If the file cannot be written.
    """
    import tomli_w

    from flurries.io import replacing

    target = Path(path)
    text = tomli_w.dumps(describe(scene, target.resolve().parent))
    with replacing(target) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")


def fingerprint(scene: Scene) -> str:
    """Return a hash of all that a scene's frames depend on, files' contents included."""
    digest = hashlib.sha256()
    hashed: list[str] = []
    for name in ("background", "foreground"):
        value = getattr(scene, name)
        if isinstance(value, np.ndarray):
            hashed.append(name)
            digest.update(f"{value.shape} {value.dtype}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, (str, os.PathLike)) and Path(value).is_file():
            with Path(value).open("rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
            hashed.append(name)
    table = describe(scene, leave_out=tuple(hashed))
    digest.update(repr(sorted(table.items(), key=lambda item: item[0])).encode())
    return digest.hexdigest()[:16]


PRESETS = {"snow": tuple(SNOW)}

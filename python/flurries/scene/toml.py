"""Scenes as TOML files: strict to read, every value that differs from the default to write.

Paths are relative to the file's folder. Keyed numbers are ``{keys = [[frame, value], ...]}``.
"""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Iterable
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects import ConeRain, ConeSnow, MatchedSnow, Mist, Rain, Snow
from flurries.light.sun import Sun
from flurries.motion.keys import Keys
from flurries.motion.wind import FIELDS, Wind
from flurries.scene.depth import DepthMap
from flurries.scene.scene import DEFAULT_FOCAL, Scene, expect_scene

__all__ = ["load", "save"]

MOST_BYTES = 1 << 20

EFFECTS: dict[str, type[Any]] = {
    "snow": Snow,
    "rain": Rain,
    "mist": Mist,
    "matched_snow": MatchedSnow,
    "cone_snow": ConeSnow,
    "cone_rain": ConeRain,
}

_SCENE = (
    "size", "background", "camera", "effects", "fps", "seed", "foreground", "space", "depth", "sun",
    "tolerance",
)  # fmt: skip
_DEPTH = ("source", "near", "far", "white", "law")
_WAY = ("position", "velocity", "orientation")
_LENS = ("focal", "center", "offset", "center_shift", "rotation", "aspect")
_CAMERA = (*_LENS, "path", *_WAY)


class _File:
    """The text of a scene file, to say where something stands."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self._lines = _key_lines(text)

    def where(self, *keys: str | int) -> str:
        """Return the file, and the line of a key given by its way from the top."""
        for end in range(len(keys), 0, -1):
            line = self._lines.get(keys[:end])
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)

    def refuse(self, known: tuple[str, ...], place: str, *keys: str | int) -> ValueError:
        """Return the error for a key that nobody knows."""
        key = str(keys[-1])
        near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else f"; known are {', '.join(known)}"
        return ValueError(f"{self.where(*keys)}: unknown key {key!r} in {place}{hint}")

    def placed(self, error: Exception, known: Iterable[str], *keys: str | int) -> Exception:
        """Return an argument's error with the line of the argument that its message names."""
        text = str(error)
        if text.startswith(str(self.path)):
            return error
        named = [key for key in known if re.search(rf"\b{re.escape(key)}\b", text)]
        # The first word that is a key of this table: messages begin with the argument's name.
        named.sort(key=text.find)
        place = self.where(*keys, *named[:1])
        return type(error)(f"{place}: {text}") if type(error) in (ValueError, TypeError) else error


_HEADER = re.compile(r"\s*\[(\[)?\s*([^\]]+?)\s*\]")
_KEY = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_-]+))\s*(?=[=.])")


def _key_lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Return the lines of keys and tables of a scene file by their way from the top."""
    lines: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            name = header[2].strip("\"'")
            table = (name,)
            if header[1]:
                counts[name] = counts.get(name, -1) + 1
                table = (name, counts[name])
            lines.setdefault((name,), number)
            lines[table] = number
        elif key := _KEY.match(line):
            lines.setdefault((*table, key[1] or key[2] or key[3]), number)
    return lines


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
    except (ValueError, RecursionError) as error:
        # Also what is not UTF-8, numbers of thousands of digits, and brackets nested as deep.
        raise ValueError(f"{file}: not a TOML file: {error}") from None
    return _scene(_File(file, text), values)


def _scene(file: _File, values: dict[str, Any]) -> Scene:
    for key in values:
        if key not in _SCENE:
            raise file.refuse(_SCENE, "the scene", key)
    arguments = dict(values)
    folder = file.path.parent
    for key in ("background", "foreground", "depth"):
        value = arguments.get(key)
        if isinstance(value, str) and not value.startswith("#"):
            arguments[key] = str(folder / value)
    if isinstance(arguments.get("depth"), dict):
        arguments["depth"] = _depth_map(file, arguments["depth"])
    if "sun" in arguments:
        arguments["sun"] = _sun(file, arguments["sun"])
    camera = arguments.pop("camera", None)
    listed = arguments.pop("effects", [])
    if not isinstance(listed, list):
        raise TypeError(f"{file.where('effects')}: effects must be [[effects]] tables")
    effects = [_effect(file, table, index) for index, table in enumerate(listed)]
    try:
        scene = Scene(**arguments, effects=effects)
    except (ValueError, TypeError) as error:
        raise file.placed(error, _SCENE) from None
    return scene if camera is None else scene.replace(camera=_camera(file, camera, scene))


def _effect(file: _File, table: Any, index: int) -> Any:
    at = ("effects", index)
    if not isinstance(table, dict):
        raise TypeError(f"{file.where(*at)}: effects must be [[effects]] tables")
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in EFFECTS:
        known = ", ".join(map(repr, EFFECTS))
        raise ValueError(f"{file.where(*at, 'kind')}: kind must be one of {known}, got {kind!r}")
    known_keys = tuple(f.name for f in fields(EFFECTS[kind]))
    known_keys += getattr(EFFECTS[kind], "KNOBS", ())
    for key in table:
        if key not in ("kind", "preset", *known_keys):
            raise file.refuse(("kind", "preset", *known_keys), f"effect {kind!r}", *at, key)
    values = {
        key: _value(file, value, *at, key)
        for key, value in table.items()
        if key not in ("kind", "preset")
    }
    try:
        if "preset" in table:
            return EFFECTS[kind].preset(table["preset"], **values)
        return EFFECTS[kind](**values)
    except (ValueError, TypeError) as error:
        raise file.placed(error, table, *at) from None


def _depth_map(file: _File, table: dict[str, Any]) -> DepthMap:
    for key in table:
        if key not in _DEPTH:
            raise file.refuse(_DEPTH, "depth", "depth", key)
    for key in ("source", "near", "far"):
        if key not in table:
            raise ValueError(f"{file.where('depth')}: depth needs {key}")
    values = dict(table)
    source = values.pop("source")
    if not isinstance(source, str):
        raise TypeError(f"{file.where('depth', 'source')}: source must be a file, got {source!r}")
    try:
        return DepthMap(str(file.path.parent / source), **values)
    except (ValueError, TypeError) as error:
        raise file.placed(error, table, "depth") from None


def _sun(file: _File, table: Any) -> Sun:
    if not isinstance(table, dict):
        raise TypeError(f"{file.where('sun')}: sun must be a table")
    known = tuple(f.name for f in fields(Sun))
    for key in table:
        if key not in known:
            raise file.refuse(known, "sun", "sun", key)
    try:
        return Sun(**table)
    except (ValueError, TypeError) as error:
        raise file.placed(error, table, "sun") from None


def _camera(file: _File, table: Any, scene: Scene) -> CameraPath:
    if not isinstance(table, dict):
        raise TypeError(f"{file.where('camera')}: camera must be a table")
    for key in table:
        if key not in _CAMERA:
            raise file.refuse(_CAMERA, "camera", "camera", key)
    values = {key: _value(file, value, "camera", key) for key, value in table.items()}
    way = {key: values.pop(key) for key in _WAY if key in values}
    values.setdefault("focal", DEFAULT_FOCAL * scene.shape[1])
    zoom = values["focal"] if isinstance(values["focal"], (Keys, tuple)) else None
    if zoom is not None:
        values["focal"] = 1.0
    if "path" in values:
        from flurries.io import read_path

        name = values.pop("path")
        if not isinstance(name, str) or way:
            raise ValueError(
                f"{file.where('camera', 'path')}: path must be a file, and stand without "
                + ", ".join(_WAY)
            )
        if Path(name).suffix.lower() != ".csv":
            from flurries.camera.importers import load as load_camera

            if zoom is not None:
                raise ValueError(f"{file.where('camera', 'focal')}: focal must be a number here")
            return load_camera(file.path.parent / name, scene.shape, camera=Camera(**values))
        way = read_path(file.path.parent / name)
    if zoom is not None:
        way["focal"] = zoom
    try:
        return CameraPath(Camera(**values), **way)
    except (ValueError, TypeError) as error:
        raise file.placed(error, table, "camera") from None


def _value(file: _File, value: Any, *keys: str | int) -> Any:
    """Return a number, a tuple, or keys."""
    if not isinstance(value, dict):
        return tuple(value) if isinstance(value, list) else value
    if keys[-1] == "wind" and "keys" not in value:
        return _wind(file, value, *keys)
    if set(value) != {"keys"}:
        raise ValueError(
            f"{file.where(*keys)}: {keys[-1]} must be a value or {{keys = [[frame, value], ...]}}"
        )
    try:
        return Keys(value["keys"])
    except (ValueError, TypeError) as error:
        raise file.placed(error, (), *keys) from None


def _wind(file: _File, table: dict[str, Any], *keys: str | int) -> Wind:
    known = tuple(name for name in FIELDS if name != "field")
    for key in table:
        if key not in known:
            # Tables in one line have no line of their own for a key.
            raise file.refuse(known, "wind", *keys, key)
    values = {key: _value(file, value, *keys, key) for key, value in table.items()}
    try:
        return Wind(values.pop("mean", (0.0, 0.0, 0.0)), **values)
    except (ValueError, TypeError) as error:
        raise file.placed(error, (), *keys) from None


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
    if scene.tolerance != 0.0:
        table["tolerance"] = scene.tolerance
    if scene.depth is not None:
        described = _depth(scene.depth, folder, bare="depth" in leave_out)
        if described is not None:
            table["depth"] = described
    if scene.sun is not None:
        table["sun"] = {f.name: _toml(getattr(scene.sun, f.name)) for f in fields(Sun)}
    path: CameraPath = scene.camera
    camera = {f.name: _toml(getattr(path.camera, f.name)) for f in fields(Camera)}
    table["camera"] = {key: value for key, value in camera.items() if value is not None}
    for name in (*_WAY, "focal"):
        value = getattr(path, name)
        if value is not None:
            table["camera"][name] = _toml(value)
    table["effects"] = []
    kinds = {cls: kind for kind, cls in EFFECTS.items()}
    for effect in scene.effects:
        if type(effect) not in kinds and "effects" in leave_out:
            continue
        if type(effect) not in kinds:
            raise ValueError(f"effects: a {type(effect).__name__} cannot be written to a file")
        entry: dict[str, Any] = {"kind": kinds[type(effect)]}
        for f in fields(effect):
            value = getattr(effect, f.name)
            # A look's version always: a later one has another default.
            if value is not None and (
                f.name == "look" or f.default is MISSING or value != f.default
            ):
                entry[f.name] = _toml(value)
        table["effects"].append(entry)
    return table


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


def _depth(value: Any, folder: Path | None, *, bare: bool) -> Any:
    """Return the depth as a file holds it; a bare one without its picture, or None."""
    if isinstance(value, DepthMap):
        law = {key: getattr(value, key) for key in _DEPTH if key != "source"}
        return law if bare else {"source": _background("depth", value.source, folder), **law}
    if np.ndim(value) == 0 and not isinstance(value, (str, os.PathLike)):
        return float(value)
    return None if bare else _background("depth", value, folder)


def _toml(value: Any) -> Any:
    if isinstance(value, Wind):
        if value.field is not None:
            raise ValueError("wind: a field is an array, which a text file cannot hold")
        given = {name: getattr(value, name) for name in FIELDS}
        return {name: _toml(part) for name, part in given.items() if part is not None}
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
    expect_scene(scene)
    import tomli_w

    from flurries.io import replacing

    target = Path(path)
    text = tomli_w.dumps(describe(scene, target.resolve().parent))
    with replacing(target) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")

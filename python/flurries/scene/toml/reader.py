"""From a TOML file to a scene: strict, and every refusal says where."""

from __future__ import annotations

import os
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

from flurries.camera.csv import read_path
from flurries.camera.importers import load as load_camera
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects.kinds import class_of
from flurries.io.files import read_text
from flurries.light.sun import Sun
from flurries.motion.keys import Keys
from flurries.motion.wind import Wind
from flurries.scene.depth import DepthMap
from flurries.scene.scene import DEFAULT_FOCAL, Scene, require_few
from flurries.scene.toml.place import SceneText, require_short_keys
from flurries.scene.toml.tables import DEPTH, LENS, SCENE, SUN, WAY, WIND
from flurries.scene.toml.version import upgrade

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_BYTES = 1 << 20


def load(path: str | os.PathLike[str]) -> Scene:
    """Return the scene of a TOML file.

    Parameters
    ----------
    path : path
        A plain file of at most 1 MiB.

    Raises
    ------
    FileNotFoundError, OSError
        If the file cannot be read.
    ValueError, TypeError
        If it is not TOML, has an unknown key (named with its line and the nearest known one), or a
        value that the scene refuses.
    """
    file = Path(path)
    text = read_text(file, MOST_BYTES, "TOML scene file")
    require_short_keys(file, text)
    try:
        values = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # Also numbers of thousands of digits, and brackets nested as deep.
        raise ValueError(f"{file}: not a TOML file: {error}") from None
    scene = SceneText(file, text)
    with scene.errors(("format",)):
        values = upgrade(values)
    return _scene(scene, values)


def _scene(text: SceneText, values: dict[str, Any]) -> Scene:
    arguments = text.table(values, SCENE, "the scene")
    for key in ("background", "foreground", "depth"):
        value = arguments.get(key)
        if isinstance(value, str) and not value.startswith("#"):
            arguments[key] = str(text.path.parent / value)
    if isinstance(arguments.get("depth"), dict):
        arguments["depth"] = _depth_map(text, arguments["depth"])
    if "sun" in arguments:
        given = text.table(arguments["sun"], SUN, "sun", "sun")
        with text.errors(given, "sun"):
            arguments["sun"] = Sun(**given)
    camera = arguments.pop("camera", None)
    listed = arguments.pop("effects", [])
    if not isinstance(listed, list):
        raise TypeError(f"{text.where('effects')}: effects must be [[effects]] tables")
    with text.errors(("effects",)):
        require_few(listed)
    effects = [_effect(text, table, index) for index, table in enumerate(listed)]
    with text.errors(SCENE):
        scene = Scene(**arguments, effects=effects)
    return scene if camera is None else scene.replace(camera=_camera(text, camera, scene))


def _effect(text: SceneText, table: Any, index: int) -> Any:
    at = ("effects", index)
    if not isinstance(table, dict):
        raise TypeError(f"{text.where(*at)}: effects must be [[effects]] tables")
    kind = table.get("kind")
    with text.errors(("kind",), *at):
        effect = class_of(kind)
    keys = ["kind", *(f.name for f in fields(effect)), *getattr(effect, "KNOBS", ())]
    keys += ["preset"] if hasattr(effect, "preset") else []
    given = text.table(table, tuple(keys), f"effect {kind!r}", *at)
    del given["kind"]
    preset = [given.pop("preset")] if "preset" in given else []
    values = {key: _value(text, value, *at, key) for key, value in given.items()}
    with text.errors(table, *at):
        return effect.preset(*preset, **values) if preset else effect(**values)


def _depth_map(text: SceneText, table: dict[str, Any]) -> DepthMap:
    values = text.table(table, DEPTH, "depth", "depth")
    for key in ("source", "near", "far"):
        if key not in table:
            raise ValueError(f"{text.where('depth')}: depth needs {key}")
    source = values.pop("source")
    if not isinstance(source, str):
        raise TypeError(f"{text.where('depth', 'source')}: source must be a file, got {source!r}")
    with text.errors(table, "depth"):
        return DepthMap(str(text.path.parent / source), **values)


def _camera(text: SceneText, table: Any, scene: Scene) -> CameraPath:
    given = text.table(table, (*LENS, "path", *WAY), "camera", "camera")
    values = {key: _value(text, value, "camera", key) for key, value in given.items()}
    way = {key: values.pop(key) for key in WAY if key in values}
    values.setdefault("focal", DEFAULT_FOCAL * scene.shape[1])
    zoom = values["focal"] if isinstance(values["focal"], (Keys, tuple)) else None
    if zoom is not None:
        values["focal"] = 1.0
    if "path" in values:
        name = values.pop("path")
        if not isinstance(name, str) or way:
            raise ValueError(
                f"{text.where('camera', 'path')}: path must be a file, and stand without "
                + ", ".join(WAY)
            )
        file = text.path.parent / name
        if file.suffix.lower() != ".csv":
            if zoom is not None:
                raise ValueError(f"{text.where('camera', 'focal')}: focal must be a number here")
            return load_camera(file, scene.shape, camera=Camera(**values))
        way = read_path(file)
    if zoom is not None:
        way["focal"] = zoom
    with text.errors(table, "camera"):
        return CameraPath(Camera(**values), **way)


def _value(text: SceneText, value: Any, *keys: str | int) -> Any:
    """Return a number, a tuple, keys, or a wind."""
    if not isinstance(value, dict):
        return tuple(value) if isinstance(value, list) else value
    if keys[-1] == "wind" and "keys" not in value:
        given = text.table(value, WIND, "wind", *keys)
        values = {key: _value(text, part, *keys, key) for key, part in given.items()}
        with text.errors((), *keys):
            return Wind(values.pop("mean", (0.0, 0.0, 0.0)), **values)
    if set(value) != {"keys"}:
        raise ValueError(
            f"{text.where(*keys)}: {keys[-1]} must be a value or {{keys = [[frame, value], ...]}}"
        )
    with text.errors((), *keys):
        return Keys(value["keys"])

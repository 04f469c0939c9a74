"""What the viewer leaves behind: a scene file, Python that makes the scene, a short film."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries.effects.kinds import spelled
from flurries.io import write_layers, write_picture
from flurries.scene.scene import Scene

# Seconds of the film.
LENGTH = 3.0


def save(scene: Scene, path: Path) -> None:
    """Write a scene to a TOML file, and pictures that were given as arrays beside it."""
    files: dict[str, Any] = {}
    for name in ("background", "foreground"):
        array = getattr(scene, name)
        if isinstance(array, np.ndarray):
            suffix = ".exr" if array.dtype.kind == "f" else ".png"
            files[name] = path.with_name(f"{path.stem}-{name}{suffix}")
            write_picture(files[name], np.uint8(255) * array if array.dtype == bool else array)
    if isinstance(scene.depth, np.ndarray):
        files["depth"] = path.with_name(f"{path.stem}-depth.exr")
        write_layers(files["depth"], {"depth": scene.depth.astype(np.float32)})
    scene._derive(**files).save(path)


def film(scene: Scene, path: Path) -> Path:
    """Write the first three seconds of a scene beside its scene file, over what was there."""
    target = path.with_suffix(".mp4")
    scene.write(target, range(1, round(LENGTH * scene.fps) + 1), overwrite=True)
    return target


def python_of(scene: Scene) -> str:
    """Return Python that makes a scene; arrays are called `picture` and `depth`."""
    lines = ["import flurries as fl", ""]
    effects = [f"    {call(effect)}," for effect in scene.effects]
    path = scene.camera
    own = [name for name in ("velocity", "orientation", "focal") if getattr(path, name) is not None]
    way = "".join(f", {name}={call(getattr(path, name))}" for name in own)
    lines += ["effects = [", *effects, "]", f"camera = fl.CameraPath({call(path.camera)}{way})"]
    given = scene.background
    background = "picture" if isinstance(given, np.ndarray) else repr(str(given))
    more = "" if scene.seed == 0 else f", seed={scene.seed}"
    more += f", lights={call(scene.lights)}" if scene.lights else ""
    more += f", lens={call(scene.lens)}" if scene.lens or scene._backdrop.photograph else ""
    if scene.depth is not None:
        plain = isinstance(scene.depth, (int, float))
        said = scene.depth if plain else str(scene.depth)
        named = plain or isinstance(scene.depth, (str, Path))
        more += f", depth={said!r}" if named else ", depth=depth"
    more += f", space={scene.space!r}" if scene.space != "auto" else ""
    lines.append(f"scene = fl.Scene({background}, size={scene.size}, camera=camera, "
                 f"effects=effects, fps={scene.fps:g}{more})")  # fmt: skip
    return "\n".join(lines) + "\n"


def call(value: Any) -> str:
    """Return the call that makes an effect or a wind, with the fields that are not usual."""
    if isinstance(value, tuple) and any(map(is_dataclass, value)):
        return "(" + "".join(f"{call(part)}, " for part in value) + ")"
    if not is_dataclass(value):
        return f"fl.{value!r}" if type(value).__name__ == "Keys" else _plain(value)
    shown = [f for f in fields(value) if f.init and f.repr and not f.name.startswith("_")]
    given = [
        f"{f.name}={call(getattr(value, f.name))}"
        for f in shown
        if repr(getattr(value, f.name)) != repr(f.default)
    ]
    return f"{spelled(type(value))}({', '.join(given)})"


def _plain(value: Any) -> str:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (tuple, list)):
        return "(" + ", ".join(map(_plain, value)) + ("," if len(value) == 1 else "") + ")"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)

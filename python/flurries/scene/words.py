"""A scene in words: one line for a terminal, a picture and a table for a notebook."""

from __future__ import annotations

import math
import os
from dataclasses import MISSING, fields, is_dataclass
from typing import TYPE_CHECKING

import numpy as np

from flurries.camera.path import CameraPath
from flurries.frame.show import figure, listing

if TYPE_CHECKING:
    from flurries.scene.scene import Scene


def line_of(scene: Scene) -> str:
    width, height = scene.size
    rate = "a still" if scene._still else f"{scene.fps:g} fps"
    names = ", ".join(type(effect).__name__ for effect in scene.effects) or "none"
    return (
        f"Scene({width} x {height} px, {rate}, background={_value(scene.background)}, "
        f"camera={camera_of(scene.camera)}, effects={names})"
    )


def page_of(scene: Scene) -> str:
    width, height = scene.size
    rows = [
        ("size", f"{width} x {height} px, {scene.fps:g} frames a second"),
        ("background", _value(scene.background)),
        ("camera", camera_of(scene.camera)),
    ]
    rows += [(type(effect).__name__, own_values(effect)) for effect in scene.effects]
    first, last = scene._range or (0, math.inf)
    frame = scene.render(int(min(first + round(scene.fps), last)))
    return f"<div>{figure(frame)}{listing(rows)}</div>"


def camera_of(path: CameraPath) -> str:
    moves = path.position is not None or path.velocity is not None
    does = {"moving": moves, "turning": path.turns, "zooming": path.zooms}
    words = " and ".join(word for word, yes in does.items() if yes)
    return f"{words or 'still'}, focal {path.camera.focal:g} px"


def own_values(effect: object) -> str:
    """Return the fields of an effect that are not as they are without being given."""
    if not is_dataclass(effect):
        return ""
    changed = []
    for field in fields(effect):
        value = getattr(effect, field.name)
        usual = None if field.default is MISSING else field.default
        if not field.name.startswith("_") and repr(value) != repr(usual):
            changed.append(f"{field.name} {_value(value)}")
    return ", ".join(changed) or "as it is by default"


def _value(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} array {value.shape}"
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_value, value)) + ")"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)

"""What a scene has besides effects and camera: a lamp, the opening of the lens, a depth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flurries.camera.optics import Lens
from flurries.io.color import parse_hex, srgb_to_linear
from flurries.light.lamp import Lamp
from flurries.motion.keys import value_at
from flurries.scene.scene import Scene
from flurries.viewer.control import Control, choice_of, color_of

OFF, ON = "off", "on"
LAMP, DEPTH, OPENING = "lamp", "scene.depth", "lens"

# Effects whose flakes and drops a lamp lights, and whose images a lens blurs.
_FLAKES = ("Snow", "Rain", "TentSnow", "TentRain")

# A street lamp: beside the way, above the head, some steps away.
_LAMP = {"x": 1.0, "height": 1.5, "distance": 6.0, "power": 40.0}


def surroundings(scene: Scene) -> list[Control]:
    """Return the rows of lamp, lens and depth; those alone that change something."""
    found: list[Control] = []
    if any(type(effect).__name__ in _FLAKES for effect in scene.effects):
        found += [
            choice_of(f"{LAMP}.on", LAMP, "Lamp", (OFF, ON), OFF),
            Control(f"{LAMP}.x", LAMP, "Place across", "m", -6.0, 6.0, 0.1, _LAMP["x"]),
            Control(f"{LAMP}.height", LAMP, "Height", "m", -3.0, 6.0, 0.1, _LAMP["height"]),
            Control(f"{LAMP}.distance", LAMP, "Distance", "m", 0.5, 30.0, 0.1, _LAMP["distance"]),
            Control(f"{LAMP}.power", LAMP, "Power", "", 0.0, 300.0, 1.0, _LAMP["power"]),
            color_of(f"{LAMP}.color", LAMP, "Color", "#ffd9a0"),
        ]
        lens = scene.lens
        focus = 4.0 if lens is None else float(np.clip(value_at(lens.focus, 0.0), 0.3, 60.0))
        stop = 2.0 if lens is None else float(np.clip(value_at(lens.f_stop, 0.0), 0.7, 22.0))
        found += [
            choice_of(f"{OPENING}.on", OPENING, "Blur", (OFF, ON), OFF if lens is None else ON),
            Control(f"{OPENING}.focus", OPENING, "Focus", "m", 0.3, 60.0, 0.1, focus),
            Control(f"{OPENING}.f_stop", OPENING, "f-stop", "", 0.7, 22.0, 0.1, stop),
        ]
    if scene.depth is not None:
        found.append(choice_of(DEPTH, "scene", "Depth", (ON, OFF), ON))
    return found


def surrounded(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of the scene that change with the rows that were touched."""
    changes: dict[str, Any] = {}
    if values.get(f"{LAMP}.on") == ON:
        changes["lights"] = (*scene.lights, _lamp(values))
    touched = {name: values.get(f"{OPENING}.{name}") for name in ("on", "focus", "f_stop")}
    if any(value is not None for value in touched.values()):
        stands = {row.key: row.value for row in surroundings(scene)} | dict(values)
        given = {name: stands[f"{OPENING}.{name}"] for name in ("focus", "f_stop")}
        rest = {} if scene.lens is None else {
            name: getattr(scene.lens, name) for name in ("sensor", "blades", "turn")
        }  # fmt: skip
        changes["lens"] = Lens(**given, **rest) if stands[f"{OPENING}.on"] == ON else None
    if values.get(DEPTH) == OFF:
        changes["depth"] = None
    return changes


def _lamp(values: Mapping[str, Any]) -> Lamp:
    x, height, distance, power = (float(values.get(f"{LAMP}.{n}", _LAMP[n])) for n in _LAMP)
    display = np.array(parse_hex("color", values.get(f"{LAMP}.color", "#ffd9a0"))) / 255.0
    light = tuple(round(float(part), 4) for part in srgb_to_linear(display))
    return Lamp((x, -height, distance), color=light, power=power)

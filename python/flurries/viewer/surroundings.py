"""What a scene has besides effects and camera: a lamp, the opening of the lens, a depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from flurries.camera.optics import Lens
from flurries.io.color import parse_hex, srgb_to_linear
from flurries.light.lamp import Lamp
from flurries.motion.keys import value_at
from flurries.scene.scene import Scene
from flurries.viewer.control import Control

OFF, ON = "off", "on"
LAMP, DEPTH, OPENING = "lamp", "scene.depth", "lens"

# Effects whose flakes and drops a lamp lights, and whose images a lens blurs.
_FLAKES = ("Snow", "Rain", "TentSnow", "TentRain")

# A street lamp: beside the way, above the head, some steps away.
_LAMP = {
    "x": ("Place across", "m", -6.0, 6.0, 0.1, 1.0),
    "height": ("Height", "m", -3.0, 6.0, 0.1, 1.5),
    "distance": ("Distance", "m", 0.5, 30.0, 0.1, 6.0),
    "power": ("Power", "", 0.0, 300.0, 1.0, 40.0),
}


def surroundings(scene: Scene) -> list[Control]:
    """Return the rows of lamp, lens and depth; those alone that change something."""
    found: list[Control] = []
    if any(type(effect).__name__ in _FLAKES for effect in scene.effects):
        found += [
            Control(f"{LAMP}.on", LAMP, "Lamp", value=OFF, kind="choice", choices=(OFF, ON)),
            *(Control(f"{LAMP}.{name}", LAMP, *row) for name, row in _LAMP.items()),
            Control(f"{LAMP}.color", LAMP, "Color", value="#ffd9a0", kind="color"),
        ]
        lens, on = scene.lens, OFF if scene.lens is None else ON
        focus = 4.0 if lens is None else float(np.clip(value_at(lens.focus, 0.0), 0.3, 60.0))
        stop = 2.0 if lens is None else float(np.clip(value_at(lens.f_stop, 0.0), 0.7, 22.0))
        found += [
            Control(f"{OPENING}.on", OPENING, "Blur", value=on, kind="choice", choices=(OFF, ON)),
            Control(f"{OPENING}.focus", OPENING, "Focus", "m", 0.3, 60.0, 0.1, focus),
            Control(f"{OPENING}.f_stop", OPENING, "f-stop", "", 0.7, 22.0, 0.1, stop),
        ]
    if scene.depth is not None:
        found.append(Control(DEPTH, "scene", "Depth", value=ON, kind="choice", choices=(ON, OFF)))
    return found


def surrounded(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of the scene that change with the rows that were touched."""
    changes: dict[str, Any] = {}
    if values.get(f"{LAMP}.on") == ON:
        x, height, distance, power = (
            float(values.get(f"{LAMP}.{name}", row[-1])) for name, row in _LAMP.items()
        )
        display = np.array(parse_hex("color", values.get(f"{LAMP}.color", "#ffd9a0"))) / 255.0
        light = tuple(round(float(part), 4) for part in srgb_to_linear(display))
        lamp = Lamp((x, -height, distance), color=light, power=power)
        changes["lights"] = (*scene.lights, lamp)
    touched = {name: values.get(f"{OPENING}.{name}") for name in ("on", "focus", "f_stop")}
    if any(value is not None for value in touched.values()):
        stands = {row.key: row.value for row in surroundings(scene)} | dict(values)
        given = {name: stands[f"{OPENING}.{name}"] for name in ("focus", "f_stop")}
        lens = Lens(**given) if scene.lens is None else replace(scene.lens, **given)
        changes["lens"] = lens if stands[f"{OPENING}.on"] == ON else None
    if values.get(DEPTH) == OFF:
        changes["depth"] = None
    return changes

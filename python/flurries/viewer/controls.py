"""What can be tuned by hand in a scene, and the scene that the sliders stand for.

Only sliders that were touched count: what is keyed or unusual in a scene stays until somebody moves
its slider, which then holds for the whole film.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from flurries.camera.path import CameraPath
from flurries.motion.keys import Keys, value_at
from flurries.motion.wind import FIELDS, Wind
from flurries.scene.scene import Scene
from flurries.viewer.charts import field_of
from flurries.viewer.control import COLOR, Control, color_control, dressed, preset_of
from flurries.viewer.surroundings import surrounded, surroundings

DIRECTION, SPEED, GUSTS, SEED = "direction", "speed", "gusts", "seed"
OCTAVES, LONGEST = "octaves", "longest"
EYES = "eyes"
LENS = "camera.lens"

# Sizes of what is in the air, as tuples in metres, largest last.
_SIZES = {"flake_size": "Flake size", "drop_size": "Drop size"}
_LAST_SEED = 99


# field: label, unit, low, high, step
_FIELDS: dict[str, tuple[str, str, float, float, float]] = {
    "amount": ("Amount", "", 0.0, 1.0, 0.01),
    "texture": ("Texture", "", 0.0, 1.0, 0.01),
    "flakes": ("Flakes", "", 0, 30000, 100),
    "drops": ("Drops", "", 0, 20000, 100),
    "count": ("Particles", "", 0, 4000, 10),
    "density": ("Density", "", 0.0, 1.0, 0.01),
    "haze": ("Haze", "", 0.0, 1.0, 0.01),
    "opacity": ("Opacity", "", 0.0, 1.0, 0.01),
    "mean": ("Mean", "", -0.5, 0.6, 0.01),
    "exponent": ("Softness", "", 0.0, 2.0, 0.05),
    "shutter": ("Shutter", "frames", 0.0, 2.0, 0.05),
}
# The camera's axes: label, place in a velocity, sign.
_CAMERA = {
    "camera.forward": ("Forward", 2, 1.0),
    "camera.lateral": ("Sideways", 0, 1.0),
    "camera.rise": ("Upwards", 1, -1.0),
}
_FASTEST_CAMERA = 12.0


def controls_of(scene: Scene, values: Mapping[str, Any] | None = None) -> list[Control]:
    """Return the rows of a scene, each where the scene stands at frame 0."""
    chosen = values or {}
    scene = dressed(scene, chosen)
    found: list[Control] = []
    for index, effect in enumerate(scene.effects):
        group = names(scene)[index]
        looks = preset_of(scene, index, chosen, group)
        color = color_control(index, group, effect)
        found += [row for row in (looks, color) if row is not None]
        if moves(effect):
            angle, speed = _polar(effect)
            top = max(4.0, 2.0 * math.ceil(speed))
            found += [
                Control(f"{index}.{DIRECTION}", group, "Direction", "°", -180, 180, 1, angle),
                Control(f"{index}.{SPEED}", group, "Speed", "m/s", 0.0, top, 0.05, speed),
            ]
        if _takes_gusts(effect):
            gusts = effect.wind.gusts if isinstance(effect.wind, Wind) else 0.0
            most = max(4.0, 2.0 * gusts)
            found.append(Control(f"{index}.{GUSTS}", group, "Gusts", "m/s", 0.0, most, 0.05, gusts))
        found += _of_fields(index, group, effect)
        found += [
            Control(
                f"{index}.{name}", group, label, "mm", 0.05 * mean, 4.0 * mean, 0.01 * mean, mean
            )
            for name, label in _SIZES.items()
            if (mean := _mean_size(effect, name)) is not None
        ]
        if hasattr(effect, "seed"):
            seed = scene.seed if effect.seed is None else effect.seed
            if 0 <= seed <= _LAST_SEED:
                found.append(Control(f"{index}.{SEED}", group, "Seed", "", 0, _LAST_SEED, 1, seed))
        field = field_of(effect)
        if field is not None and hasattr(effect, "wavelengths"):
            shortest, longest = field.band(scene.shape)
            octaves = math.log2(longest / shortest)
            high = max(64.0, 2.0 * longest)
            found += [
                Control(f"{index}.{OCTAVES}", group, "Octaves", "", 0.5, 5.0, 0.05, octaves),
                Control(f"{index}.{LONGEST}", group, "Longest wave", "px", 4, high, 0.5, longest),
            ]
    found += [
        Control(key, "camera", label, "m/s", -_FASTEST_CAMERA, _FASTEST_CAMERA, 0.1, value)
        for key, label, value in _camera(scene)
    ]
    focal = scene.camera.camera.focal
    if not scene.camera.zooms:
        found.append(Control(LENS, "camera", "Lens", "px", 0.2 * focal, 5 * focal, 1.0, focal))
    found.append(Control(EYES, "camera", "Eye distance", "mm", 0, 200, 1, 0))
    return found + surroundings(scene)


def names(scene: Scene) -> list[str]:
    """Return a name for each effect: its class, numbered where there are several."""
    kinds = [type(effect).__name__ for effect in scene.effects]
    return [
        kind if kinds.count(kind) == 1 else f"{kind} {kinds[: index + 1].count(kind)}"
        for index, kind in enumerate(kinds)
    ]


def fall_of(effect: Any) -> Any:
    """Return the speed at which an effect falls; a population's is its flakes', unless it says."""
    fall = getattr(effect, "fall", 0.0)
    return effect.parts.motion.fall if fall is None else fall


def moves(effect: Any) -> bool:
    """Whether an effect falls, blows, or both."""
    return hasattr(effect, "wind")


def applied(scene: Scene, values: Mapping[str, Any]) -> Scene:
    return scene.replace(**settings(scene, values))


def settings(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the touched rows as arguments of a scene: effects, camera, and perhaps others."""
    known = {control.key: control for control in controls_of(scene, values)}
    checked: dict[str, Any] = {}
    for key, value in values.items():
        if key not in known:
            raise ValueError(f"values must have keys of sliders, got {key!r}")
        checked[key] = known[key].checked(value)
    effects = tuple(
        _changed(effect, index, checked, known)
        for index, effect in enumerate(dressed(scene, checked).effects)
    )
    path: CameraPath = scene.camera
    if any(key in checked for key in _CAMERA):
        velocity = [0.0, 0.0, 0.0]
        for key, (_, axis, sign) in _CAMERA.items():
            velocity[axis] = sign * checked.get(key, known[key].value)
        path = CameraPath(path.camera, velocity=tuple(velocity), orientation=path.orientation)
    if LENS in checked:
        path = replace(path, camera=replace(path.camera, focal=checked[LENS]))
    return {"effects": effects, "camera": path, **surrounded(scene, checked)}


def _changed(effect: Any, index: int, values: Mapping[str, Any], known: Mapping[str, Any]) -> Any:
    prefix = f"{index}."
    own = {key[len(prefix) :]: v for key, v in values.items() if key.startswith(prefix)}
    changes: dict[str, Any] = {}
    for name in own.keys() & _FIELDS.keys():
        whole = isinstance(getattr(effect, name), int)
        changes[name] = round(own[name]) if whole else own[name]
    if DIRECTION in own or SPEED in own:
        angle, speed = (own.get(n, known[f"{index}.{n}"].value) for n in (DIRECTION, SPEED))
        changes |= _moving(effect, math.radians(angle), speed)
    if GUSTS in own:
        wind = changes.get("wind", effect.wind)
        rest = {name: getattr(wind, name) for name in FIELDS if isinstance(wind, Wind)}
        changes["wind"] = Wind(**{"mean": wind, **rest, "gusts": own[GUSTS]})
    for name in own.keys() & _SIZES.keys():
        factor = own[name] / known[f"{index}.{name}"].value
        changes[name] = tuple(factor * size for size in getattr(effect, name))
    if COLOR in own:
        changes[COLOR] = own[COLOR]
    if SEED in own:
        changes[SEED] = round(own[SEED])
    if OCTAVES in own or LONGEST in own:
        octaves, longest = (own.get(n, known[f"{index}.{n}"].value) for n in (OCTAVES, LONGEST))
        shortest = max(longest / 2.0**octaves, 2.0)
        changes["wavelengths"] = (shortest, max(longest, 1.05 * shortest))
    return replace(effect, **changes) if changes else effect


def _of_fields(index: int, group: str, effect: Any) -> list[Control]:
    if not is_dataclass(effect):
        return []
    found = []
    for name in _FIELDS.keys() & {f.name for f in fields(effect)}:
        value = value_at(getattr(effect, name), 0.0)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        label, unit, low, high, step = _FIELDS[name]
        if name == "density" and value > high:
            unit, high, step = "per m3", 4.0 * value, max(round(0.01 * value), 1)
        # A scene may stand where no slider would have thought.
        low, high = min(low, value), high if value <= high else 2.0 * value
        found.append(Control(f"{index}.{name}", group, label, unit, low, high, step, float(value)))
    order = list(_FIELDS)
    return sorted(found, key=lambda control: order.index(control.key.split(".")[1]))


def _mean_size(effect: Any, name: str) -> float | None:
    """Return the mean of an effect's sizes in millimetres; None where it has not several."""
    sizes = getattr(effect, name, None)
    if not isinstance(sizes, tuple):
        return None
    return 1e3 * (sizes[1] if len(sizes) == 3 else sum(sizes) / len(sizes))


def _takes_gusts(effect: Any) -> bool:
    """Whether a wind may differ from place to place: a gas has one, and a cone one axis."""
    return moves(effect) and hasattr(effect, "fall") and not hasattr(effect, "repeats")


def _air(effect: Any) -> tuple[float, float, float]:
    """Return the velocity of the air and of all that falls in it at frame 0, metres per second."""
    wind = effect.wind.mean if isinstance(effect.wind, Wind) else effect.wind
    x, y, z = (float(v) for v in np.asarray(value_at(wind, 0.0)))
    return x, y + float(value_at(fall_of(effect), 0.0)), z


def _polar(effect: Any) -> tuple[float, float]:
    x, y, _ = _air(effect)
    return math.degrees(math.atan2(y, x)), math.hypot(x, y)


def _moving(effect: Any, angle: float, speed: float) -> dict[str, Any]:
    """Return wind and fall for a direction; what falls keeps to falling, the wind is level."""
    across, down = speed * math.cos(angle), speed * math.sin(angle)
    falls = hasattr(effect, "fall")
    wind: Any = (across, 0.0 if falls else down, _air(effect)[2])
    if isinstance(effect.wind, Wind):
        rest = {name: getattr(effect.wind, name) for name in FIELDS if name != "mean"}
        wind = Wind(wind, **rest)
    return {"wind": wind, "fall": down} if falls else {"wind": wind}


def _camera(scene: Scene) -> list[tuple[str, str, float]]:
    path = scene.camera
    velocity = path.velocity
    if velocity is None:
        velocity = path.rate(0.0, fps=scene.fps) * scene.fps
    elif isinstance(velocity, Keys):
        velocity = velocity.at(0.0)
    most = _FASTEST_CAMERA
    return [
        (key, label, float(np.clip(sign * velocity[axis], -most, most)) + 0.0)
        for key, (label, axis, sign) in _CAMERA.items()
    ]

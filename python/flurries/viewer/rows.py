"""What a page shows for one number, choice or color of a scene, and what it may send back.

Here are the rows that are no numbers of an effect: its look and color, a lamp, the opening of the
lens, a depth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from flurries._contract import choice, real
from flurries.camera.optics import Lens
from flurries.effects.color import AMBIENT, LOCAL
from flurries.io.color import parse_hex, srgb_to_linear
from flurries.light.lamp import Lamp
from flurries.motion.keys import Keys, value_at
from flurries.scene.scene import Scene

Kind: TypeAlias = Literal["slider", "choice", "color"]

PRESET, COLOR = "preset", "color"
OFF, ON = "off", "on"
LAMP, DEPTH, OPENING = "lamp", "scene.depth", "lens"

# The look that a scene came with.
GIVEN = "as given"

# Effects whose colors may differ from place to place; and those whose flakes and drops a lamp
# lights, and whose images a lens blurs.
_PLACED = ("Snow", "Rain")
_FLAKES = (*_PLACED, "TentSnow", "TentRain")

# A street lamp: beside the way, above the head, some steps away.
_LAMP = {
    "x": ("Place across", "m", -6.0, 6.0, 0.1, 1.0),
    "height": ("Height", "m", -3.0, 6.0, 0.1, 1.5),
    "distance": ("Distance", "m", 0.5, 30.0, 0.1, 6.0),
    "power": ("Power", "", 0.0, 300.0, 1.0, 40.0),
}
_GLOW = "#ffd9a0"


@dataclass(frozen=True)
class Control:
    """One row of the page; a slider's range is in its unit, a color may be one of the choices."""

    key: str  # Place of the effect and field ("0.amount"), or "camera.forward", or "eyes".
    group: str
    label: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    value: float | str = 0.0  # Where it stands now: a number, one of `choices`, or "#rrggbb".
    kind: Kind = "slider"
    choices: tuple[str, ...] = ()

    def checked(self, value: Any) -> Any:
        """Return a value that came from a page, if it is one that this row can have."""
        name = f"values[{self.key!r}]"
        if self.kind == "slider":
            return real(name, value, low=self.low, high=self.high)
        if self.kind == "color" and isinstance(value, str) and value.startswith("#"):
            parse_hex(name, value)
            return value
        return choice(name, value, self.choices)


def dressed(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """Return the scene with the looks by name that were chosen, before any slider counts."""
    effects = list(scene.effects)
    for index, effect in enumerate(effects):
        name = values.get(f"{index}.{PRESET}", GIVEN)
        if name == GIVEN:
            continue
        looks = preset_of(scene, index)
        if looks is None:
            raise ValueError(f"values must have keys of sliders, got '{index}.{PRESET}'")
        seed = getattr(effect, "seed", None)
        effects[index] = type(effect)(
            looks.checked(name), **({} if seed is None else {"seed": seed})
        )
    changed = any(new is not old for new, old in zip(effects, scene.effects, strict=True))
    return scene._derive(effects=tuple(effects)) if changed else scene


def preset_of(scene: Scene, index: int, group: str = "", stands: Any = GIVEN) -> Control | None:
    """Return the choice of an effect's look; None where it has none."""
    names = tuple(getattr(scene.effects[index], "PRESETS", ()))
    now = stands if stands in names else GIVEN
    key, every = f"{index}.{PRESET}", (GIVEN, *names)
    return Control(key, group, "Preset", value=now, kind="choice", choices=every) if names else None


def color_control(index: int, group: str, scene: Scene) -> Control | None:
    """Return the color of an effect at frame 0; None where it has none."""
    effect = scene.effects[index]
    color = getattr(effect, COLOR, None)
    if color is None:
        return None
    words = (AMBIENT, LOCAL) if type(effect).__name__ in _PLACED else (AMBIENT,)
    stands = color
    if not isinstance(color, str):
        now = np.broadcast_to(value_at(color, 0.0) if isinstance(color, Keys) else color, 3)
        stands = "#" + "".join(f"{round(255 * part):02x}" for part in np.clip(now, 0.0, 1.0))
    key = f"{index}.{COLOR}"
    return Control(key, group, "Color", value=stands, kind="color", choices=words)


def surroundings(scene: Scene) -> list[Control]:
    """Return the rows of lamp, lens and depth; those alone that change something."""
    found: list[Control] = []

    if any(type(effect).__name__ in _FLAKES for effect in scene.effects):
        found += [
            Control(f"{LAMP}.on", LAMP, "Lamp", value=OFF, kind="choice", choices=(OFF, ON)),
            *(Control(f"{LAMP}.{name}", LAMP, *row) for name, row in _LAMP.items()),
            Control(f"{LAMP}.color", LAMP, "Color", value=_GLOW, kind="color"),
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
        display = np.array(parse_hex("color", values.get(f"{LAMP}.color", _GLOW))) / 255.0
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

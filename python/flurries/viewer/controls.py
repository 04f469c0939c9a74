"""What can be tuned by hand in a scene, which rows change nothing, and what sliders stand for."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Literal

import numpy as np

from flurries._contract import choice, real
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath
from flurries.effects.color import AMBIENT, LOCAL
from flurries.effects.motion import HALF_OPEN
from flurries.frame.needs import has_keys, needs_of
from flurries.io.color import parse_hex, srgb_to_linear
from flurries.light.lamp import Lamp
from flurries.motion.keys import Keys, value_at
from flurries.motion.wind import FIELDS, Wind
from flurries.scene.scene import Scene
from flurries.viewer.charts import field_of

PRESET, COLOR = "preset", "color"
OFF, ON = "off", "on"
LAMP, DEPTH, OPENING = "lamp", "scene.depth", "lens"

GIVEN = "as given"  # The look that a scene came with.

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
    kind: Literal["slider", "choice", "color"] = "slider"
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
        more = {} if seed is None else {"seed": seed}
        effects[index] = type(effect)(looks.checked(name), **more)
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
    if not isinstance(color, str):
        now = np.clip(np.broadcast_to(value_at(color, 0.0), 3), 0.0, 1.0)
        color = "#" + "".join(f"{round(255 * part):02x}" for part in now)
    key = f"{index}.{COLOR}"
    return Control(key, group, "Color", value=color, kind="color", choices=words)


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


def surrounded(
    scene: Scene, checked: Mapping[str, Any], stands: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the parts of the scene that change with the rows that were touched."""
    changes: dict[str, Any] = {}
    if stands.get(f"{LAMP}.on") == ON:
        x, height, distance, power = (float(stands[f"{LAMP}.{name}"]) for name in _LAMP)
        display = np.array(parse_hex("color", stands[f"{LAMP}.color"])) / 255.0
        light = tuple(round(float(part), 4) for part in srgb_to_linear(display))
        lamp = Lamp((x, -height, distance), color=light, power=power)
        changes["lights"] = (*scene.lights, lamp)
    if any(key.startswith(f"{OPENING}.") for key in checked):
        given = {name: stands[f"{OPENING}.{name}"] for name in ("focus", "f_stop")}
        lens = Lens(**given) if scene.lens is None else replace(scene.lens, **given)
        changes["lens"] = lens if stands[f"{OPENING}.on"] == ON else None
    if stands.get(DEPTH) == OFF:
        changes["depth"] = None
    return changes


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
    "time": ("Time", "", 0.0, 2.0, 0.05),
    "turbulence": ("Turbulence", "", 0.0, 4.0, 0.05),
}
# The camera's axes: label, place in a velocity, sign.
CAMERA = {
    "camera.forward": ("Forward", 2, 1.0),
    "camera.lateral": ("Sideways", 0, 1.0),
    "camera.rise": ("Upwards", 1, -1.0),
}
_FASTEST_CAMERA = 12.0


def controls_of(scene: Scene, values: Mapping[str, Any] | None = None) -> list[Control]:
    """Return the rows of a scene, each where the scene stands at frame 0."""
    scene, found, most = dressed(scene, values or {}), list[Control](), _FASTEST_CAMERA
    for index, group in enumerate(names(scene)):
        stands = (values or {}).get(f"{index}.{PRESET}")
        looks = preset_of(scene, index, group, stands), color_control(index, group, scene)
        found += [row for row in looks if row is not None]
        found += _of_effect(scene, index, group)
    velocity = np.clip(_velocity(scene), -most, most)
    for key, (label, axis, sign) in CAMERA.items():
        value = float(sign * velocity[axis]) + 0.0
        found.append(Control(key, "camera", label, "m/s", -most, most, 0.1, value))
    focal = scene.camera.camera.focal
    if not scene.camera.zooms:
        found.append(Control(LENS, "camera", "Lens", "px", 0.2 * focal, 5 * focal, 1.0, focal))
    found.append(Control(EYES, "camera", "Eye distance", "mm", 0, 200, 1, 0))
    return found + surroundings(scene)


def _of_effect(scene: Scene, index: int, group: str) -> Iterator[Control]:
    effect: Any = scene.effects[index]

    def row(name: str, *about: Any) -> Control:
        return Control(f"{index}.{name}", group, *about)

    if moves(effect):
        x, y, _ = air_of(effect)
        speed = math.hypot(x, y)
        yield row(DIRECTION, "Direction", "°", -180, 180, 1, math.degrees(math.atan2(y, x)))
        yield row(SPEED, "Speed", "m/s", 0.0, max(4.0, 2.0 * math.ceil(speed)), 0.05, speed)
        # A wind may differ from place to place, but a gas has one, and a cone one axis.
        if hasattr(effect, "fall") and not hasattr(effect, "repeats"):
            gusts = effect.wind.gusts if isinstance(effect.wind, Wind) else 0.0
            yield row(GUSTS, "Gusts", "m/s", 0.0, max(4.0, 2.0 * gusts), 0.05, gusts)
    own = {field.name for field in fields(effect)} if is_dataclass(effect) else set()
    for name, (label, unit, low, high, step) in _FIELDS.items():
        if name == "turbulence" and getattr(getattr(effect, "wind", None), "waves", None) is None:
            continue
        value = value_at(getattr(effect, name), 0.0) if name in own else None
        if name == "shutter" and name in own and value is None:
            value = HALF_OPEN
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        if name == "density" and hasattr(effect, "emission"):
            unit, high, step = "per m3", max(4.0 * value, 100.0), max(round(0.01 * value), 1)
        # A scene may stand where no slider would have thought.
        low, high = min(low, value), high if value <= high else 2.0 * value
        yield row(name, label, unit, low, high, step, float(value))
    for name, label in _SIZES.items():
        sizes = getattr(effect, name, None)
        # The mean in millimetres, of several.
        if isinstance(sizes, tuple):
            mean = 1e3 * (sizes[1] if len(sizes) == 3 else sum(sizes) / len(sizes))
            yield row(name, label, "mm", 0.05 * mean, 4.0 * mean, 0.01 * mean, mean)
    if hasattr(effect, SEED):
        seed = scene.seed if effect.seed is None else effect.seed
        if 0 <= seed <= _LAST_SEED:
            yield row(SEED, "Seed", "", 0, _LAST_SEED, 1, seed)
    field = field_of(effect)
    if field is not None and hasattr(effect, "wavelengths"):
        shortest, longest = field.band(scene._shape)
        yield row(OCTAVES, "Octaves", "", 0.5, 5.0, 0.05, math.log2(longest / shortest))
        yield row(LONGEST, "Longest wave", "px", 4, max(64.0, 2.0 * longest), 0.5, longest)


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
    return hasattr(effect, "wind")


def air_of(effect: Any) -> tuple[float, float, float]:
    """Return the velocity of the air and of all that falls in it at frame 0, metres per second."""
    wind = effect.wind.mean if isinstance(effect.wind, Wind) else effect.wind
    x, y, z = (float(v) for v in np.asarray(value_at(wind, 0.0)))
    return x, y + float(value_at(fall_of(effect), 0.0)), z


def _velocity(scene: Scene) -> Any:
    """Return the camera's velocity at frame 0, metres per second."""
    velocity = scene.camera.velocity
    if velocity is None:
        return scene.camera.rate(0.0, fps=scene.fps) * scene.fps
    return velocity.at(0.0) if isinstance(velocity, Keys) else velocity


def applied(scene: Scene, values: Mapping[str, Any]) -> Scene:
    return scene.replace(**settings(scene, values))


def settings(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the touched rows as arguments of a scene: effects, camera, and perhaps others."""
    known = {control.key: control for control in controls_of(scene, values)}
    for key in values:
        if key not in known:
            raise ValueError(f"values must have keys of sliders, got {key!r}")
    checked = {key: known[key].checked(value) for key, value in values.items()}
    # Where every row stands, touched or not.
    stands = {key: control.value for key, control in known.items()} | checked
    effects = tuple(
        _changed(effect, f"{index}.", checked, stands, known)
        for index, effect in enumerate(dressed(scene, checked).effects)
    )
    path: CameraPath = scene.camera
    if CAMERA.keys() & checked.keys():
        velocity = [0.0, 0.0, 0.0]
        for key, (_, axis, sign) in CAMERA.items():
            velocity[axis] = sign * stands[key]
        path = CameraPath(path.camera, velocity=tuple(velocity), orientation=path.orientation)
    if LENS in checked:
        path = replace(path, camera=replace(path.camera, focal=checked[LENS]))
    return {"effects": effects, "camera": path, **surrounded(scene, checked, stands)}


def _changed(
    effect: Any, prefix: str, checked: Mapping[str, Any], stands: Mapping[str, Any],
    known: Mapping[str, Control],
) -> Any:  # fmt: skip
    own = {key.removeprefix(prefix): v for key, v in checked.items() if key.startswith(prefix)}
    changes: dict[str, Any] = {}
    for name in own.keys() & {*_FIELDS, SEED}:
        whole = name == SEED or isinstance(getattr(effect, name), int)
        changes[name] = round(own[name]) if whole else own[name]
    wind = getattr(effect, "wind", None)
    rest = {name: getattr(wind, name) for name in FIELDS} if isinstance(wind, Wind) else {}
    mean: Any = rest.get("mean", wind)
    if DIRECTION in own or SPEED in own:
        angle, speed = math.radians(stands[prefix + DIRECTION]), stands[prefix + SPEED]
        across, down = speed * math.cos(angle), speed * math.sin(angle)
        # What falls keeps to falling, and its wind is level.
        falls = hasattr(effect, "fall")
        mean = (across, 0.0 if falls else down, air_of(effect)[2])
        changes |= {"fall": down} if falls else {}
        changes["wind"] = Wind(**{**rest, "mean": mean}) if rest else mean
    if GUSTS in own:
        changes["wind"] = Wind(**{**rest, "mean": mean, "gusts": own[GUSTS]})
    for name in own.keys() & _SIZES.keys():
        factor = own[name] / float(known[prefix + name].value)
        changes[name] = tuple(factor * size for size in getattr(effect, name))
    if COLOR in own:
        changes[COLOR] = own[COLOR]
    if OCTAVES in own or LONGEST in own:
        longest = stands[prefix + LONGEST]
        shortest = max(longest / 2.0 ** stands[prefix + OCTAVES], 2.0)
        changes["wavelengths"] = (shortest, max(longest, 1.05 * shortest))
    return replace(effect, **changes) if changes else effect


# Rows that shape one part of an effect alone, by the part's name in the plan.
_SHAPES = {
    "texture": ("mean", "exponent", OCTAVES, LONGEST),
    "flakes": ("flake_size", "drop_size"),
}

# Rows that may bring back what is left out.
_SWITCHES = ("amount", "texture", "flakes", "drops", "count", "density", "haze", "opacity", PRESET)

_NONE = "no weather is shown that it could change"


def inert(scene: Scene, values: Mapping[str, Any]) -> dict[str, str]:
    """Return why rows change nothing, by their keys, of a scene as the sliders stand."""
    rows, found = [row.key for row in controls_of(scene)], dict[str, str]()
    shown = drawn = moving = blurred = False
    for index, effect in enumerate(scene.effects):
        prefix, whys = f"{index}.", dict[str, str]()
        shape = (getattr(effect, name, None) for name in ("center", "top", "count"))
        even = getattr(effect, "structure", None) == 0.0 and all(one is None for one in shape)
        still = "the mist is even" if even else ""  # Why no motion of the effect shows.
        own = [key.removeprefix(prefix) for key in rows if key.startswith(prefix)]
        # What is keyed may be left out now, and not later.
        needs = None if has_keys(effect) else needs_of(effect, scene._program.frame(0.0))
        steps = {step.name for step in needs.steps} if needs else {"flakes"}
        for one in needs.left_out if needs else ():
            kept = own if steps else ("amount", PRESET) if "amount" in one.why else _SWITCHES
            whys |= {name: one.why for name in own if name not in kept}
            for name in _SHAPES.get(one.what.rpartition(": ")[2], ()):
                whys.setdefault(name, f"{one.what}: {one.why}")
        veiled = bool(steps) and steps <= {"veil", "join", "local light"}
        if veiled:
            still = "only a veil is shown"
            whys |= {name: still for name in own if name not in (*_SWITCHES, COLOR)}
        if DIRECTION in own and not has_keys(effect) and not any(air_of(effect)[:2]):
            whys.setdefault(DIRECTION, "the speed is 0")
        if still:
            whys = dict.fromkeys((DIRECTION, SPEED, SEED), still) | whys
        shown, drawn = shown or bool(steps), drawn or (bool(steps) and not veiled)
        moving |= bool(steps) and not still
        blurred |= "flakes" in steps or ("texture" in steps and hasattr(effect, "emission"))
        found |= {prefix + name: why for name, why in whys.items()}
    found |= dict.fromkeys(CAMERA, "" if moving else _NONE)
    found[LENS] = "" if drawn else _NONE
    if values.get(f"{LAMP}.on") != ON:
        found |= {key: "the lamp is off" for key in rows if key.startswith(f"{LAMP}.")}
        found[f"{LAMP}.on"] = "" if shown else _NONE
    if scene.lens is None or not blurred:
        why = "the blur is off" if blurred else "no flake is near"
        found |= {key: why for key in rows if key.startswith(f"{OPENING}.")}
        found[f"{OPENING}.on"] = "" if blurred else why
    return {key: why for key, why in found.items() if why and key in rows}

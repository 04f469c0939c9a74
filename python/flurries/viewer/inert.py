"""Which rows change nothing as the sliders stand, and why: mostly what the plan leaves out."""

from collections.abc import Mapping
from typing import Any

from flurries.frame.needs import has_keys, needs_of
from flurries.scene.scene import Scene
from flurries.viewer import controls
from flurries.viewer.controls import DIRECTION, LAMP, OPENING, PRESET

# Rows that shape one part of an effect alone, by the part's name in the plan.
_SHAPES = {
    "texture": ("mean", "exponent", controls.OCTAVES, controls.LONGEST),
    "flakes": ("flake_size", "drop_size"),
}

# Rows that may bring back what is left out.
_SWITCHES = ("amount", "texture", "flakes", "drops", "count", "density", "haze", "opacity", PRESET)

_NONE = "no weather is shown that it could change"


def inert(scene: Scene, values: Mapping[str, Any]) -> dict[str, str]:
    """Return why rows change nothing, by their keys, of a scene as the sliders stand."""
    rows, found = [row.key for row in controls.controls_of(scene)], dict[str, str]()
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
            whys |= {name: still for name in own if name not in (*_SWITCHES, controls.COLOR)}
        if DIRECTION in own and not has_keys(effect) and not any(controls.air_of(effect)[:2]):
            whys.setdefault(DIRECTION, "the speed is 0")
        if still:
            whys = dict.fromkeys((DIRECTION, controls.SPEED, controls.SEED), still) | whys
        shown, drawn = shown or bool(steps), drawn or (bool(steps) and not veiled)
        moving |= bool(steps) and not still
        blurred |= "flakes" in steps or ("texture" in steps and hasattr(effect, "emission"))
        found |= {prefix + name: why for name, why in whys.items()}
    found |= dict.fromkeys(controls.CAMERA, "" if moving else _NONE)
    found[controls.LENS] = "" if drawn else _NONE
    if values.get(f"{LAMP}.on") != controls.ON:
        found |= {key: "the lamp is off" for key in rows if key.startswith(f"{LAMP}.")}
        found[f"{LAMP}.on"] = "" if shown else _NONE
    if scene.lens is None or not blurred:
        why = "the blur is off" if blurred else "no flake is near"
        found |= {key: why for key in rows if key.startswith(f"{OPENING}.")}
        found[f"{OPENING}.on"] = "" if blurred else why
    return {key: why for key, why in found.items() if why and key in rows}

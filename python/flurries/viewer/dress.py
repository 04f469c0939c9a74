"""Looks by name and colors of the effects of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flurries.effects.color import AMBIENT, LOCAL
from flurries.motion.keys import Keys, value_at
from flurries.scene.scene import Scene
from flurries.viewer.control import Control, choice_of, color_of, hex_of

PRESET, COLOR = "preset", "color"

# The look that a scene came with.
GIVEN = "as given"

# Effects whose colors may differ from place to place.
_PLACED = ("Snow", "Rain")


def dressed(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """Return the scene with the looks by name that were chosen, before any slider counts."""
    chosen = {
        index: _look(scene, index, values[f"{index}.{PRESET}"])
        for index in range(len(scene.effects))
        if values.get(f"{index}.{PRESET}", GIVEN) != GIVEN
    }
    if not chosen:
        return scene
    effects = tuple(chosen.get(index, effect) for index, effect in enumerate(scene.effects))
    return scene.derive(effects=effects)


def _look(scene: Scene, index: int, name: Any) -> Any:
    effect: Any = scene.effects[index]
    looks = preset_of(scene, index, {})
    if looks is None:
        raise ValueError(f"values must have keys of sliders, got '{index}.{PRESET}'")
    kept = {"seed": effect.seed} if getattr(effect, "seed", None) is not None else {}
    return type(effect).preset(looks.checked(name), **kept)


def preset_of(
    scene: Scene, index: int, values: Mapping[str, Any], group: str = ""
) -> Control | None:
    """Return the choice of an effect's look; None where it has none."""
    names = tuple(getattr(scene.effects[index], "PRESETS", ()))
    if not names:
        return None
    key = f"{index}.{PRESET}"
    stands = values.get(key, GIVEN)
    return choice_of(key, group, "Preset", (GIVEN, *names), stands if stands in names else GIVEN)


def color_control(index: int, group: str, effect: Any) -> Control | None:
    """Return the color of an effect at frame 0; None where it has none."""
    color = getattr(effect, COLOR, None)
    if color is None:
        return None
    words = (AMBIENT, LOCAL) if type(effect).__name__ in _PLACED else (AMBIENT,)
    if isinstance(color, str):
        stands = color
    else:
        now = np.broadcast_to(value_at(color, 0.0) if isinstance(color, Keys) else color, 3)
        stands = hex_of(now)
    return color_of(f"{index}.{COLOR}", group, "Color", stands, words)

"""What a page shows for one number, choice or color of a scene, and what it may send back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from flurries._contract import choice, real
from flurries.effects.color import AMBIENT, LOCAL
from flurries.io.color import parse_hex
from flurries.motion.keys import Keys, value_at
from flurries.scene.scene import Scene

Kind: TypeAlias = Literal["slider", "choice", "color"]

PRESET, COLOR = "preset", "color"

# The look that a scene came with.
GIVEN = "as given"

# Effects whose colors may differ from place to place.
_PLACED = ("Snow", "Rain")


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
    effects = {}
    for index, effect in enumerate(scene.effects):
        name = values.get(f"{index}.{PRESET}", GIVEN)
        if name == GIVEN:
            continue
        looks = preset_of(scene, index, {})
        if looks is None:
            raise ValueError(f"values must have keys of sliders, got '{index}.{PRESET}'")
        seed = getattr(effect, "seed", None)
        kept = {} if seed is None else {"seed": seed}
        effects[index] = type(effect)(looks.checked(name), **kept)
    if not effects:
        return scene
    return scene._derive(effects=tuple(effects.get(i, e) for i, e in enumerate(scene.effects)))


def preset_of(
    scene: Scene, index: int, values: Mapping[str, Any], group: str = ""
) -> Control | None:
    """Return the choice of an effect's look; None where it has none."""
    names = tuple(getattr(scene.effects[index], "PRESETS", ()))
    key = f"{index}.{PRESET}"
    stands = values.get(key, GIVEN)
    now = stands if stands in names else GIVEN
    row = Control(key, group, "Preset", value=now, kind="choice", choices=(GIVEN, *names))
    return row if names else None


def color_control(index: int, group: str, effect: Any) -> Control | None:
    """Return the color of an effect at frame 0; None where it has none."""
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

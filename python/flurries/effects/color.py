"""The color of an effect: display values, plain or keyed, or the background's own light."""

from __future__ import annotations

from typing import Any, Literal, NewType, TypeAlias

import numpy as np

from flurries._contract import real, suggestion, vector
from flurries.frame.needs import PARTS
from flurries.frame.view import Frame
from flurries.io.color import linear_to_srgb, parse_hex, srgb_to_linear
from flurries.motion.keys import Keys, value_at

# A color as "#rrggbb". Types know it by this name, so that a mistyped word is no color: any text
# will do where nobody checks types.
Hex = NewType("Hex", str)

# One grey, (r, g, b) or "#rrggbb", display values, plain or keyed; or "ambient", the light of the
# background; of some effects "local", that light by places.
Color: TypeAlias = float | tuple[float, float, float] | Keys | Hex | Literal["ambient"]
PlacedColor: TypeAlias = Color | Literal["local"]

# What `color` says instead of a color: the background's own light.
AMBIENT = "ambient"

# The same by places: what lies behind and around each flake.
LOCAL = "local"


def as_color(value: object, words: tuple[str, ...] = (AMBIENT,)) -> Any:
    """Return one grey or (r, g, b), plain or keyed, in 0 to 1, or a word for the plate's light."""
    if isinstance(value, Keys):
        if value.width not in (None, 3):
            raise ValueError(f"color must be keyed with numbers or (r, g, b), got {value!r}")
        for _, v in value.keys:
            as_color(v)
        return value
    if isinstance(value, str):
        if value.startswith("#"):
            return tuple(part / 255 for part in parse_hex("color", value))
        if value not in words:
            raise ValueError(
                f"color must be a number, (r, g, b), '#rrggbb' or {' or '.join(map(repr, words))}, "
                f"got {value!r}{suggestion(value, words)}"
            )
        return value
    if isinstance(value, (float, int, np.number, bytes)) or value is None:
        return real("color", value, low=0.0, high=1.0)
    parts = vector("color", value, 3).tolist()
    return tuple(real("color", part, low=0.0, high=1.0) for part in parts)


def is_local(color: object) -> bool:
    """Whether a color is the plate's light by places; layers are then mixed in linear light."""
    return isinstance(color, str) and color == LOCAL


def reads_of(color: object) -> frozenset[str]:
    """Return the parts of a scene that an effect of a color reads, its depth included."""
    if is_local(color):
        return PARTS - {"ambient"} | {"plate"}
    return PARTS if isinstance(color, str) else PARTS - {"ambient"}


def color_at(color: Any, frame: Frame) -> tuple[float, float, float]:
    """Return the display values, (r, g, b), at a frame."""
    if isinstance(color, str):
        return frame.ambient or (1.0, 1.0, 1.0)
    now = value_at(color, frame.t)
    return (now,) * 3 if isinstance(now, float) else now


def bright(color: tuple[float, float, float], gain: float) -> tuple[float, float, float]:
    """Return the display values of a color's light times a gain; they may exceed 1."""
    if gain == 1.0:
        return color
    red, green, blue = linear_to_srgb(gain * srgb_to_linear(np.array(color))).tolist()
    return red, green, blue

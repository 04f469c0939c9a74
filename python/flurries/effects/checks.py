"""What the fields of effects may be: checked once, when an effect is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any, Literal, TypeAlias, TypeVar, get_args

from flurries._contract import choice, flag, integer, real, seed_of, vector
from flurries.effects.color import as_color
from flurries.motion.keys import as_number, as_vector
from flurries.motion.wind import Wind
from flurries.spectral.tables import ALIAS, band_of
from flurries.spectral.tiles import BLEND

_Part = TypeVar("_Part")

# Versions of the looks of tents, cones and mist.
LOOKS = ("v1",)

# From a field's name and value to the value as it is kept.
Check = Callable[[str, Any], Any]

DepthMode: TypeAlias = Literal["tile", "pixel"]
DEPTH_MODES = get_args(DepthMode)

share: Check = partial(as_number, low=0.0, high=1.0)
positive: Check = partial(as_number, above=0.0)
length: Check = partial(real, above=0.0)
part: Check = partial(real, low=0.0, high=1.0)
gain: Check = partial(real, low=0.0, high=1e4)
population: Check = partial(integer, low=0, high=100_000_000)


def one_of(options: tuple[str, ...]) -> Check:
    return lambda name, value: choice(name, value, options)


def optional(check: Check) -> Check:
    return lambda name, value: None if value is None else check(name, value)


def sizes(name: str, value: object) -> tuple[float, float]:
    low, high = vector(name, value, 2).tolist()
    if not 0.0 < low <= high:
        raise ValueError(f"{name} must be 0 < smallest <= largest, got {(low, high)}")
    return low, high


def pair(name: str, value: object) -> tuple[float, float]:
    first, second = vector(name, value, 2).tolist()
    return first, second


def wavelengths(name: str, value: object) -> tuple[float, float]:
    low, high = band_of(value)
    if not 2.0 <= low < high:
        raise ValueError(f"{name} must be 2 <= shortest < longest, got {(low, high)}")
    return low, high


def wind(name: str, value: object) -> Any:
    return value if isinstance(value, Wind) else as_vector(name, value, 3)


# An exposure in frames: an angle of 180 degrees, which is half a frame, is none.
shutter = partial(as_number, low=0.0, high=16.0)

# What all that falls has.
FALL: Mapping[str, Check] = {
    "look": one_of(LOOKS), "amount": share, "haze": share, "fall": as_number, "wind": wind,
    "color": lambda _, value: as_color(value), "shutter": shutter,
    "seed": optional(lambda _, value: seed_of(value)),
}  # fmt: skip

# What the tent's texture has besides.
TENT: Mapping[str, Check] = {
    **FALL, "texture": share, "mean": as_number, "spread": positive, "power": positive,
    "exponent": real, "near_depth": length, "wavelengths": optional(wavelengths),
    "tile": optional(partial(integer, low=5, high=2**15)),
    "overlap": optional(partial(integer, low=0, high=2**15)), "blend": one_of(BLEND),
    "alias": one_of(ALIAS), "depth_mode": one_of(DEPTH_MODES), "jitter": flag,
}  # fmt: skip


def part_of(kind: type[_Part], effect: Any, **own: Any) -> _Part:
    """Return a part with the fields of an effect that have the same names, and `own` ones."""
    names = {f.name for f in fields(kind)} - set(own)  # type: ignore[arg-type]
    same = {name: getattr(effect, name) for name in names if hasattr(effect, name)}
    return kind(**same, **own)


def settle(effect: Any, checks: Mapping[str, Check]) -> None:
    """Check the fields that an effect has of these, and keep them in one form."""
    own = {f.name for f in fields(effect)}
    for name, check in ((name, check) for name, check in checks.items() if name in own):
        object.__setattr__(effect, name, check(name, getattr(effect, name)))
    tile, overlap = getattr(effect, "tile", None), getattr(effect, "overlap", None)
    if tile is not None and overlap is not None and overlap >= tile:
        raise ValueError(f"overlap must be less than the tile ({tile} px), got {overlap}")
    # Its parts are made here, before threads ask for them.
    getattr(effect, "parts", None)

"""What the fields of effects may be, by their names: checked once, when an effect is made."""

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

share: Check = partial(as_number, low=0.0, high=1.0)
positive: Check = partial(as_number, above=0.0)
length: Check = partial(real, above=0.0)
part: Check = partial(real, low=0.0, high=1.0)
count: Check = partial(integer, low=0, high=100_000)
_number: Check = partial(integer, low=0, high=100_000_000)
_density: Check = partial(real, low=0.0, high=1e6)


def one_of(options: tuple[str, ...]) -> Check:
    return lambda name, value: choice(name, value, options)


def sizes(name: str, value: object) -> tuple[float, float]:
    low, high = vector(name, value, 2).tolist()
    if not 0.0 < low <= high:
        raise ValueError(f"{name} must be 0 < smallest <= largest, got {(low, high)}")
    return low, high


def _wavelengths(name: str, value: object) -> tuple[float, float]:
    low, high = band_of(value)
    if not 2.0 <= low < high:
        raise ValueError(f"{name} must be 2 <= shortest < longest, got {(low, high)}")
    return low, high


def _wind(name: str, value: object) -> Any:
    return value if isinstance(value, Wind) else as_vector(name, value, 3)


# What effects mean by the same names; a field whose default is None may be None.
CHECKS: dict[str, Check] = {
    "look": one_of(LOOKS), "amount": share, "haze": share, "fall": as_number, "wind": _wind,
    "color": lambda _, value: as_color(value), "seed": lambda _, value: seed_of(value),
    # In frames: an angle of 180 degrees, which is half a frame, is none.
    "shutter": partial(as_number, low=0.0, high=16.0),
    "sway": lambda name, value: tuple(vector(name, value, 2).tolist()),
    "gain": partial(real, low=0.0, high=1e4), "near": length, "radius": length,
    # Of what is drawn one by one.
    "flakes": _number, "flake_density": _density, "flake_size": sizes, "flake_opacity": share,
    "drops": _number, "drop_density": _density, "drop_size": sizes, "drop_depth": length,
    # Of the tent's texture.
    "texture": share, "mean": as_number, "spread": positive, "power": positive,
    "exponent": real, "near_depth": length, "wavelengths": _wavelengths,
    "tile": partial(integer, low=5, high=2**15), "overlap": partial(integer, low=0, high=2**15),
    "blend": one_of(BLEND), "alias": one_of(ALIAS), "jitter": flag, "renormalise": flag,
    "depth_mode": one_of(get_args(DepthMode)),
}  # fmt: skip


def checks_of(kind: Any) -> Mapping[str, Check]:
    """Return the checks of a class of effects: those of all, but for its own."""
    return {**CHECKS, **getattr(kind, "CHECKS", {})}


def part_of(kind: type[_Part], effect: Any, **own: Any) -> _Part:
    """Return a part with the fields of an effect that have the same names, and `own` ones."""
    names = {f.name for f in fields(kind)} - set(own)  # type: ignore[arg-type]
    same = {name: getattr(effect, name) for name in names if hasattr(effect, name)}
    return kind(**same, **own)


def settle(effect: Any) -> None:
    """Check the fields of an effect, and keep them in one form."""
    checks = checks_of(type(effect))
    for field in fields(effect):
        value = getattr(effect, field.name)
        if field.name in checks and not (value is None and field.default is None):
            object.__setattr__(effect, field.name, checks[field.name](field.name, value))
    tile, overlap = getattr(effect, "tile", None), getattr(effect, "overlap", None)
    if tile is not None and overlap is not None and overlap >= tile:
        raise ValueError(f"overlap must be less than the tile ({tile} px), got {overlap}")
    # Its parts are made here, before threads ask for them.
    getattr(effect, "parts", None)

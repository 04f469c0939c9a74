"""Arguments of scenes and of their frames, as people write them."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from flurries._contract import _came, integer
from flurries.frame.bands import Window
from flurries.frame.needs import Effect, renderer_of
from flurries.io.sequences import MOST_FRAMES
from flurries.light.lamp import Lamp

_One = TypeVar("_One")

# A file of a few kilobytes could ask for more than anybody would wait for.
MOST_EFFECTS = 1000

# Every lamp shines on every flake.
MOST_LIGHTS = 64


def parse_size(size: object) -> tuple[int, int]:
    """Return (width, height) from a pair or "WIDTHxHEIGHT"."""
    if isinstance(size, str):
        parts = size.lower().split("x")
        if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
            raise ValueError(
                f"size must be (width, height) or 'WIDTHxHEIGHT', got {_came(size)}; "
                "a picture is background="
            )
        size = tuple(map(int, parts))
    if not isinstance(size, (tuple, list, np.ndarray)) or len(size) != 2:
        raise TypeError(
            f"size must be (width, height), got {_came(size)}; a picture is background="
        )
    width, height = (operator.index(integer("size", v, low=1, high=2**17)) for v in size)
    return width, height


def one_or_none(name: str, value: Any, kind: type[_One]) -> _One | None:
    """Return an object of flurries' own, or None where there is none; refuse others."""
    if value is not None and not isinstance(value, kind):
        raise TypeError(f"{name} must be a flurries.{kind.__name__}, got {_came(value)}")
    return value


def number_or_none(name: str, value: Any, *, low: int) -> int | None:
    """Return a frame number, or None where there is none; refuse others."""
    return None if value is None else integer(name, value, low=low, high=MOST_FRAMES)


def parse_region(region: Any, shape: tuple[int, int]) -> Window:
    wanted = "region must be two slices, as from np.s_[100:200, 50:80]"
    try:
        (top, bottom, down), (left, right, along) = map(slice.indices, region, shape)
    except (TypeError, ValueError):
        raise TypeError(f"{wanted}, got {region!r}") from None
    if down != 1 or along != 1 or bottom <= top or right <= left:
        raise ValueError(f"{wanted}, inside {shape} and not empty, got {region!r}")
    return top, bottom, left, right


def require_few(name: str, given: Sequence[object], most: int) -> None:
    if len(given) > most:
        raise ValueError(f"{name} must be at most {most}, got {len(given)}")


def effects_of(given: Effect | Sequence[Effect]) -> tuple[Effect, ...]:
    listed: Any = (given,) if renderer_of(given) is not None else given
    if not isinstance(listed, (list, tuple)):
        raise TypeError(f"effects must be a sequence of effects, got {listed!r}")
    require_few("effects", listed, MOST_EFFECTS)
    for index, effect in enumerate(listed):
        if isinstance(effect, type) or renderer_of(effect) is None:
            raise TypeError(f"effects[{index}] must be an effect such as Snow(), got {effect!r}")
    return tuple(listed)


def lights_of(lights: Any) -> tuple[Lamp, ...]:
    if isinstance(lights, Lamp):
        return (lights,)
    if not isinstance(lights, (list, tuple)) or not all(isinstance(one, Lamp) for one in lights):
        raise TypeError(f"lights must be a sequence of flurries.scene.Lamp, got {lights!r}")
    require_few("lights", lights, MOST_LIGHTS)
    return tuple(lights)

"""Arguments of scenes and of their frames, as people write them."""

import re
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from flurries._contract import _came, integer
from flurries.frame.bands import Window
from flurries.frame.needs import Effect, renderer_of
from flurries.light.lamp import Lamp

_One = TypeVar("_One")

MOST_EFFECTS = 1000  # A file of a few kilobytes could ask for more than anybody would wait for.
MOST_LIGHTS = 64  # Every lamp shines on every flake.


def parse_size(size: object) -> tuple[int, int]:
    """Return (width, height) from a pair or "WIDTHxHEIGHT"."""
    wanted = f"size must be (width, height) or 'WIDTHxHEIGHT', got {_came(size)}"
    if isinstance(size, str):
        found = re.fullmatch(r"\s*(\d+)\s*x\s*(\d+)\s*", size, re.IGNORECASE)
        if found is None:
            raise ValueError(f"{wanted}; a picture is background=")
        size = int(found[1]), int(found[2])
    if not isinstance(size, (tuple, list, np.ndarray)) or len(size) != 2:
        raise TypeError(f"{wanted}; a picture is background=")
    width, height = (integer("size", v, low=1, high=2**17) for v in size)
    return width, height


def one_or_none(name: str, value: Any, kind: type[_One]) -> _One | None:
    """Return an object of flurries' own, or None where there is none; refuse others."""
    if value is not None and not isinstance(value, kind):
        raise TypeError(f"{name} must be a flurries.{kind.__name__}, got {_came(value)}")
    return value


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
    def fits(one: object) -> bool:
        return not isinstance(one, type) and renderer_of(one) is not None

    return _several("effects", given, fits, "effects such as Snow()", MOST_EFFECTS)


def lights_of(given: Lamp | Sequence[Lamp]) -> tuple[Lamp, ...]:
    return _several(
        "lights", given, lambda one: isinstance(one, Lamp), "flurries.scene.Lamp", MOST_LIGHTS
    )


def _several(
    name: str, given: Any, fits: Callable[[object], bool], wanted: str, most: int
) -> tuple[Any, ...]:
    listed = (given,) if fits(given) else given
    wrong = [given]
    if isinstance(listed, (list, tuple)):
        require_few(name, listed, most)
        wrong = [one for one in listed if not fits(one)]
    if wrong:
        raise TypeError(f"{name} must be a sequence of {wanted}, got {_came(wrong[0])}")
    return tuple(listed)

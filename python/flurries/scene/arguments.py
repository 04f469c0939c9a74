"""Arguments of scenes and of their frames, as people write them."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np

from flurries._contract import integer, real
from flurries.frame.bands import whole
from flurries.frame.visible import Window


def parse_size(size: object) -> tuple[int, int]:
    """Return (width, height) from a pair or "WIDTHxHEIGHT"."""
    if isinstance(size, str):
        parts = size.lower().split("x")
        if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
            raise ValueError(f"size must be (width, height) or 'WIDTHxHEIGHT', got {size!r}")
        size = tuple(map(int, parts))
    if not isinstance(size, (tuple, list, np.ndarray)) or len(size) != 2:
        raise TypeError(f"size must be (width, height), got {size!r}")
    width, height = (operator.index(integer("size", v, low=1, high=2**17)) for v in size)
    return width, height


def parse_tolerance(value: object) -> float:
    """Return a tolerance, or refuse it."""
    return real("tolerance", value, low=0.0, high=1.0)


def parse_region(region: Any, shape: tuple[int, int]) -> Window:
    """Return the window of two slices, or of the whole frame."""
    if region is None:
        return whole(shape)
    wanted = "region must be two slices, as from np.s_[100:200, 50:80]"
    if not isinstance(region, tuple) or len(region) != 2:
        raise TypeError(f"{wanted}, got {region!r}")
    window: list[int] = []
    for part, length in zip(region, shape, strict=True):
        if not isinstance(part, slice):
            raise TypeError(f"{wanted}, got {region!r}")
        try:
            start, stop, step = part.indices(length)
        except (TypeError, ValueError):
            raise TypeError(f"{wanted}, got {region!r}") from None
        if step != 1 or stop <= start:
            raise ValueError(f"{wanted}, inside {shape} and not empty, got {region!r}")
        window += [start, stop]
    return window[0], window[1], window[2], window[3]

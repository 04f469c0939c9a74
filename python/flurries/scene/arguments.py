"""Arguments of scenes and of their frames, as people write them: sizes, regions, frame numbers."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from flurries._contract import integer, real
from flurries.frame.bands import whole
from flurries.frame.visible import Window
from flurries.io import frame_range

# Three seconds of film, where neither the caller nor the background says how long.
DEFAULT_SECONDS = 3.0


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


def parse_frames(frames: Any, count: int | None, fps: float) -> list[int]:
    """Return frame numbers, each once, in the order asked for.

    If not given, those of a background of `count` frames, or three seconds from frame 1 on.
    """
    if frames is None:
        if count is not None:
            return list(range(count))
        return list(range(1, math.ceil(DEFAULT_SECONDS * fps) + 1))
    if isinstance(frames, str):
        numbers: Sequence[int] = frame_range(frames)
    elif isinstance(frames, (int, np.integer)):
        numbers = [int(frames)]
    elif isinstance(frames, Iterable):
        numbers = list(frames)
    else:
        raise TypeError(f"frames must be a range such as '1-60' or integers, got {frames!r}")
    result = list(dict.fromkeys(integer("frames", n, low=0, high=10**12) for n in numbers))
    if not result:
        raise ValueError("frames must name at least one frame, got none")
    return result

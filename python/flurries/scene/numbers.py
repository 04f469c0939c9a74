"""Which frames of a scene are meant."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from flurries._contract import integer
from flurries.io import frame_range

if TYPE_CHECKING:
    from flurries.scene.rendering import Rendering

# Which frames: "1-60", a number, numbers, or all there are.
Frames: TypeAlias = str | int | Iterable[int] | None

# Three seconds of film, where neither the caller nor the background says how long.
DEFAULT_SECONDS = 3.0


def frames_of(scene: Rendering, frames: Frames) -> list[int]:
    """Return frame numbers, each once, in the order asked for."""
    # If none are asked for, one round of a scene that repeats, else those of the background's
    # files; of a still those of the first that has numbers of camera, depth and foreground; else
    # three seconds from 1 on.
    if frames is None:
        if scene.lap is not None:
            return list(range(scene.lap.first, scene.lap.end))
        if scene.range is not None:
            return list(range(scene.range[0], scene.range[1] + 1))
        # The camera is the last of them, and goes before depth and foreground.
        for span in reversed(scene.spans):
            return list(range(span.first, span.last + 1))
        return list(range(1, math.ceil(DEFAULT_SECONDS * scene.fps) + 1))
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

"""The frames that a tracked camera has, and what stands for the frames outside."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flurries.camera.path import CameraPath
from flurries.camera.rotation import quaternions_of
from flurries.motion.keys import Keys


def extent(path: CameraPath) -> tuple[int, int] | None:
    """Return the first and last whole frame of a camera that must not go on by itself, or None."""
    if path.extend != "stop":
        return None
    firsts, lasts = [], []
    for value in (path.position, path.orientation, path.focal):
        frames = _frames(value)
        # One pose stands for all frames.
        if len(frames) > 1:
            firsts.append(frames[0])
            lasts.append(frames[-1])
    if not firsts:
        return None
    return int(np.ceil(max(firsts))), int(np.floor(min(lasts)))


def holding(path: CameraPath) -> CameraPath:
    """Return the path with a camera that stands still before its first and after its last frame."""
    # Outside their frames paths go on with the first and the last rate: a rate of 0.
    return replace(
        path,
        position=_padded(path.position),
        orientation=_padded(_vectors(path.orientation)),
        extend="on",
    )


def _frames(value: Any) -> list[float]:
    if value is None:
        return []
    if isinstance(value, Keys):
        return [float(frame) for frame, _ in value.keys]
    return [float(frame) for frame in range(len(value))]


def _vectors(orientation: Any) -> Any:
    """Return matrices as quaternions, which keys may hold."""
    if orientation is None or isinstance(orientation, Keys) or np.ndim(orientation) != 3:
        return orientation
    return quaternions_of(orientation)


def _padded(value: Any) -> Any:
    frames = _frames(value)
    if len(frames) < 2:
        return value
    if isinstance(value, Keys):
        values = [one for _, one in value.keys]
    else:
        values = np.asarray(value).tolist()
    pairs = list(zip(frames, values, strict=True))
    return Keys([(frames[0] - 1.0, values[0]), *pairs, (frames[-1] + 1.0, values[-1])])

"""The frames that a tracked camera has, and what stands for the frames outside."""

from __future__ import annotations

import math
from dataclasses import replace

from flurries.camera.path import CameraPath
from flurries.camera.rotation import quaternions_of
from flurries.motion.keys import Keys


def extent(path: CameraPath) -> tuple[int, int] | None:
    """Return the first and last whole frame of a camera that must not go on by itself, or None."""
    if path.extend != "stop":
        return None
    keyed = [path._places, path._lengths]
    frames = [keys.columns[0] for keys in keyed if keys is not None]
    frames += [] if path._turning is None else [path._turning.frames]
    # One pose stands for all frames.
    several = [own for own in frames if len(own) > 1]
    if not several:
        return None
    return math.ceil(max(own[0] for own in several)), math.floor(min(own[-1] for own in several))


def holding(path: CameraPath) -> CameraPath:
    """Return the path with a camera that stands still before its first and after its last frame."""
    # Outside their frames paths go on with the first and the last rate: a rate of 0. Keys may hold
    # quaternions, and no matrices.
    turned = path.orientation
    if turned is not None and not isinstance(turned, Keys):
        rows = quaternions_of(turned) if turned.ndim == 3 else turned
        turned = Keys(list(enumerate(rows.tolist())))
    return replace(path, position=_padded(path._places), orientation=_padded(turned), extend="on")


def _padded(keys: Keys | None) -> Keys | None:
    if keys is None or len(keys.keys) < 2:
        return keys
    (first, start), (last, end) = keys.keys[0], keys.keys[-1]
    return Keys([(first - 1.0, start), *keys.keys, (last + 1.0, end)])

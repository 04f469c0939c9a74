"""What moves a cone in a scene: its way from the camera's, and charts that stay while it stands.

Everything is a function of the scene and t. What is kept here is kept by content, to save time, and
never changes a bit.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flurries import cone
from flurries._contract import Array, Float64
from flurries._threads import reproducible
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects.moving import _air, _camera
from flurries.frame.layer import Frame
from flurries.motion.keys import Course, Keys, Number, Vector

# Below this speed, m/s, the air hardly moves relative to the camera; a cone that turned over there
# would be seen to.
STILL = 0.1


class Drops(NamedTuple):
    """What a cone's way depends on, besides the camera.

    Attributes
    ----------
    fall, wind : Number, Vector
        Metres per second.
    damping : float
        How much of the camera's motion counts.
    shutter : Number
        Exposure, frames.
    length : float
        Of a drop, metres.
    radius : float
        Of the first layer's cone, metres.
    repeats : int
        Tiles of the first layer around.
    """

    fall: Number
    wind: Vector
    damping: float
    shutter: Number
    length: float
    radius: float
    repeats: int


@lru_cache(maxsize=32)
def way(path: CameraPath, fps: float, drops: Drops) -> cone.Path:
    """Return the cone over a whole film; times are seconds."""
    air, camera = _air(fps, drops.fall, drops.wind), _camera(path, fps)
    shutter = _shutter(drops.shutter)
    knots = np.union1d(air.knots, camera.knots)
    if isinstance(shutter, Keys):
        knots = np.union1d(knots, [frame for frame, _ in shutter.keys])
    # Frames between the first and the last knot, at which the axis is looked at; what lies outside
    # does not change.
    ends = np.array([*knots, 0.0])
    frames = np.union1d(np.arange(np.floor(ends.min()), np.ceil(ends.max()) + 1.0), knots)
    # Both sides of every time, since a velocity may jump.
    twice = np.repeat(frames, 2)
    inside = twice + np.tile([-1e-6, 1e-6], len(frames))
    velocity = [_values(course, twice, inside) * fps for course in (air, camera)]
    return cone.path(
        twice / fps,
        *velocity,
        damping=drops.damping,
        exposure=_exposures(shutter, twice) / fps,
        length=drops.length,
        radius=drops.radius,
        repeats=drops.repeats,
        still=STILL,
    )


def _shutter(shutter: Number) -> Number:
    """Return keys of one value as the number: the same times, and the same bits."""
    if not isinstance(shutter, Keys):
        return shutter
    values = {value for _, value in shutter.keys}
    return values.pop() if len(values) == 1 else shutter


def _exposures(shutter: Number, frames: Float64) -> Float64:
    if not isinstance(shutter, Keys):
        return np.full(len(frames), shutter)
    at, values = zip(*shutter.keys, strict=True)
    return np.asarray(np.interp(frames, at, values))


def _values(course: Course, at: Array, inside: Array) -> Array:
    return course.line(at, inside)[0]


class Pose(NamedTuple):
    """What a chart of a cone depends on: two frames of one pose share it."""

    shape: tuple[int, int]
    camera: Camera
    axis: tuple[float, float, float]
    stretch: float
    slope: float
    repeats: int
    radius: float


# Poses that were asked for once; the second time a chart is made and kept. Two eyes take turns.
_seen: list[Pose] = []
_charts: dict[tuple[Pose, bool], cone.Mapping] = {}
_MOST = 4

# A chart is three words a pixel: those of large pictures are not kept.
LARGEST_CHART = 1 << 22


def chart(pose: Pose) -> cone.Mapping | None:
    """Return a chart of a pose that stays, None for one that is new and may be gone at once."""
    if pose.shape[0] * pose.shape[1] > LARGEST_CHART:
        return None
    # A chart of the reproducible mode is another one.
    key = pose, reproducible()
    found = _charts.get(key)
    if found is not None:
        return found
    if pose not in _seen:
        # New lists in place of changed ones: another thread may be reading.
        _seen[:] = [pose, *_seen[: _MOST - 1]]
        return None
    made = _chart(pose, None)
    while len(_charts) >= _MOST:
        _charts.pop(next(iter(_charts)), None)
    _charts[key] = made
    return made


def _chart(pose: Pose, depth: Array | None, rows: tuple[int, int] | None = None) -> cone.Mapping:
    return cone.Mapping(
        pose.shape,
        pose.camera,
        axis=pose.axis,
        stretch=pose.stretch,
        slope=pose.slope,
        repeats=pose.repeats,
        radius=pose.radius,
        rows=rows,
        depth=depth,
    )


def drawn(
    owner: object, frame: Frame, pose: Pose, texture: cone.Texture, phase: float, **look: Any
) -> Array:
    """Return the joint alpha of the layers over the window, (h, w) float32."""
    top, bottom, left, right = frame.window
    rows = top, bottom
    if frame.depth is None:
        # Asked for once for all bands of a frame, which are not frames of one pose.
        mapping = frame.once_each(owner, "chart", lambda: chart(pose))
    else:
        mapping = _chart(pose, frame.depth, rows)
    alpha = cone.layers(
        pose.shape,
        pose.camera,
        texture,
        axis=pose.axis,
        phase=phase,
        stretch=pose.stretch,
        slope=pose.slope,
        repeats=pose.repeats,
        radius=pose.radius,
        mapping=mapping,
        rows=rows,
        **look,
    )
    return alpha[:, left:right]

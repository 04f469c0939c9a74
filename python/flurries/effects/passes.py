"""What the pixels of a layer show besides color: how it moves, how far it is, which flake it is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.effects.motion import Motion, Way
from flurries.frame.view import Frame
from flurries.trace import stage

# From a frame to the next one and to the one before.
STEPS = (1.0, -1.0)

# Metres before the eye that no depth is below.
NEAREST = 1e-3


class Passes(NamedTuple):
    """What a layer says of its pixels besides their color; see `Layer`."""

    motion: Array
    backward: Array
    depth: Array
    coverage: Array
    ids: Array


def passes_of(
    texture: Any,
    flakes: Any,
    moves: Motion,
    frame: Frame,
    amount: float,
    way: Way,
    planes: tuple[Array | None, Array | None],
) -> Passes:
    """Return motion to both sides, depth, coverage and ids of the window; see `Layer`.

    Parameters
    ----------
    planes : (h, w), each optional
        Opacities of texture and flakes, as far as there are any; flakes are in front.
    """
    top, bottom, left, right = frame.window
    shape = (bottom - top, right - left)
    behind, front = planes
    motions = [np.zeros((*shape, 2), np.float32) for _ in STEPS]
    depth = np.full(shape, np.inf, np.float32)
    coverage = np.zeros(shape, np.float32) if front is None else np.ascontiguousarray(front)
    ids: Array = np.full(shape, -1, np.int32)
    with stage("passes"):
        others = [frame.later(step) for step in STEPS]
        ways = [(way, moves.way(other)) for other in others]
        if texture is not None and behind is not None:
            pairs = zip(others, ways, strict=True)
            found = [texture.passes(frame, other, *both) for other, both in pairs]
            motions, depth = [one[0] for one in found], found[0][1]
        if front is not None:
            ids = frame.crop(flakes.ids(frame, amount, way))
            through: Any = 0.0 if behind is None else behind * (1.0 - front)
            shown = np.nonzero((ids >= 0) & (front > through))
            numbers, which = _distinct(ids[shown])
            for motion, other, both in zip(motions, others, ways, strict=True):
                steps, far = flakes.passes(frame, other, both, numbers)
                motion[shown], depth[shown] = steps[which], far[which]
        if frame.depth is not None:
            # What shows lies before the scene, wherever its layer's mean is.
            scene = frame.crop(frame.depth)
            depth = np.where(np.isfinite(depth), np.minimum(depth, scene), depth)
    forward, backward = motions
    return Passes(forward, backward, np.ascontiguousarray(depth), coverage, ids)


def screen(points: Float64, frame: Frame) -> tuple[Float64, Float64]:
    """Return pixels (n, 2) and depths (n,) of points in the eye's axes, from the camera's place."""
    camera = frame.camera
    local = points - np.array(camera.offset)
    depth = np.maximum(local[:, 2], NEAREST)
    place = np.array(camera.focals) * local[:, :2] / depth[:, None]
    return place + np.array(camera.principal(frame.shape)), depth


def screen_motion(points: Float64, frame: Frame, other: Frame, moved: Float64) -> Float64:
    """Return how the images of points move from a frame to another one, (n, 2) pixels.

    Parameters
    ----------
    points : (n, 3)
        In the eye's axes, metres, from the camera's place.
    moved : (3,)
        Camera minus what the points belong to from one frame to the other, house axes.
    """
    there = other.to_camera(points @ frame.camera.matrix().T - moved)
    now, depth = screen(points, frame)
    then, later = screen(there, other)
    change = then - now
    # What passes the eye meanwhile: as fast as now.
    gone = later < 0.5 * depth
    step, z = (there - points)[gone], depth[gone, None]
    place = (points - np.array(frame.camera.offset))[gone, :2]
    change[gone] = np.array(frame.camera.focals) * (step[:, :2] - step[:, 2:] * place / z) / z
    return change


def plane_motion(depth: Array, frame: Frame, other: Frame, moved: Float64) -> Array:
    """Return how what a window shows at depths moves to another frame, (h, w, 2) float32 pixels.

    Parameters
    ----------
    depth : (h, w)
        Planar, metres; where it is infinite nothing moves.
    moved : (3,)
        As `screen_motion`.
    """
    motion = np.zeros((*depth.shape, 2), np.float32)
    seen = np.isfinite(depth)
    points = (rays(frame)[seen] * depth[seen][:, None]) + np.array(frame.camera.offset)
    motion[seen] = screen_motion(points.astype(np.float64), frame, other, moved)
    return motion


def rays(frame: Frame) -> Float64:
    """Return where each pixel of the window looks, (h, w, 3) in the eye's axes, with z = 1."""
    top, bottom, left, right = frame.window
    center, focals = frame.camera.principal(frame.shape), frame.camera.focals
    y, x = np.mgrid[top:bottom, left:right] + 0.5
    across, down = (x - center[0]) / focals[0], (y - center[1]) / focals[1]
    return np.stack([across, down, np.ones_like(across)], axis=-1)


def _distinct(ids: Array) -> tuple[Array, Array]:
    """Return the different numbers among ids, sorted, and of each id its place among them.

    As `np.unique`, which sorts a picture's worth of ids; they are small, so a table is faster.
    """
    there = np.zeros(int(ids.max(initial=-1)) + 1, bool)
    there[ids] = True
    places = np.cumsum(there) - 1
    return np.flatnonzero(there).astype(ids.dtype), places[ids]

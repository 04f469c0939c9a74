"""What the pixels of the weather show: how it moves, how far away it is, which flake it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera.lens import Camera
from flurries.effects.limited import farthest, weights
from flurries.frame.layer import Frame
from flurries.spectral.motion import tile_motion
from flurries.spectral.tiles import tile_starts
from flurries.trace import stage

if TYPE_CHECKING:
    from flurries.effects.falling import Falling


# Flakes nearer than this are not drawn, see `particles.splat`.
NEAR = 0.1


class Seen(NamedTuple):
    """What a layer says of its pixels besides their color; see `Layer`."""

    motion: Array
    depth: Array
    coverage: Array
    ids: Array


def seen(
    effect: Falling, frame: Frame, amount: float, texture: Array | None, flakes: Array | None
) -> Seen:
    """Return what the pixels of the window show of snow or rain.

    Parameters
    ----------
    texture, flakes : (h, w), optional
        Opacities of the parts, as far as there are any; flakes are in front.
    """
    top, bottom, left, right = frame.window
    shape = (bottom - top, right - left)
    motion = np.zeros((*shape, 2), np.float32)
    depth = np.full(shape, np.inf, np.float32)
    coverage = np.zeros(shape, np.float32) if flakes is None else np.ascontiguousarray(flakes)
    ids: Array = np.full(shape, -1, np.int32)
    with stage("seen"):
        later = frame.later()
        if texture is not None:
            motion, depth = _of_texture(effect, frame, later)
        if flakes is not None:
            ids = frame.crop(effect.ids(frame, amount))
            behind = 0.0 if texture is None else texture * (1.0 - flakes)
            front = (ids >= 0) & (flakes > behind)
            numbers, which = np.unique(ids[front], return_inverse=True)
            way, far = _of_flakes(effect, frame, later, numbers)
            motion[front], depth[front] = way[which], far[which]
    return Seen(motion, depth, coverage, ids)


def _of_texture(effect: Falling, frame: Frame, later: Frame) -> tuple[Array, Array]:
    """Return motion and depth of the texture over the window, from those of its tiles."""
    (height, width), ((tall, wide), overlap) = frame.shape, effect.layout(frame)[0]
    more: dict[str, Any] = {}
    if frame.depth is not None:
        near, longest = effect.near_depth, effect.band(frame.shape)[1]
        with np.errstate(divide="ignore"):
            more["shortest"] = near * longest / farthest(effect, frame).astype(np.float64)
    motion, length = tile_motion(
        effect.texture_request(frame, **more), effect.texture_request(later)
    )
    depth = effect.near_depth * effect.band(frame.shape)[1] / length
    top, bottom, left, right = frame.window
    rows = tile_starts(height, tile=tall, overlap=overlap)
    cols = tile_starts(width, tile=wide, overlap=overlap)
    down = weights(rows, height, tall, overlap)[top:bottom]
    across = weights(cols, width, wide, overlap)[left:right]
    planes = (down @ plane @ across.T for plane in (motion[..., 0], motion[..., 1], depth))
    x, y, z = (plane.astype(np.float32) for plane in planes)
    return np.stack([x, y], axis=-1), z


def _of_flakes(effect: Falling, frame: Frame, later: Frame, numbers: Array) -> tuple[Array, Array]:
    """Return motion (n, 2) and depth (n,) of flakes."""
    points, velocity, _ = effect.placed(frame, numbers)
    after, _, known = effect.placed(later, numbers)
    start, depth = _projected(points, frame.camera, frame.shape)
    end, ahead = _projected(after, later.camera, later.shape)
    way = end - start
    # One that flies past the eye before the next frame, or comes back at the other side of the box:
    # as fast as now.
    jumps = np.abs(after - points).max(axis=1, initial=0.0) > 0.5 * float(effect.box(frame).min())
    gone = ~known | (ahead <= NEAR) | jumps
    local = points[gone] - np.array(frame.camera.offset)
    speed, z = velocity[gone], local[:, 2:]
    way[gone] = frame.camera.focals * (speed[:, :2] - speed[:, 2:] * local[:, :2] / z) / z
    return way.astype(np.float32), depth.astype(np.float32)


def _projected(points: Float64, camera: Camera, shape: tuple[int, int]) -> tuple[Float64, Float64]:
    """Return where points in the eye's axes are seen, (n, 2) px, and their depth."""
    local = points - np.array(camera.offset)
    with np.errstate(divide="ignore", invalid="ignore"):
        px = camera.focals * local[:, :2] / local[:, 2:] + np.array(camera.principal(shape))
    return px, local[:, 2]

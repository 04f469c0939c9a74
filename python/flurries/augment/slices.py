"""What falls, cut into slices of depth: how opaque, how far away and how fast each is."""

import itertools
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.augment.air import Here
from flurries.augment.labels import SEEN
from flurries.effects.air import Air as Request

# Depths that drawn flakes are sorted into.
_SLABS = 8


class Slice(NamedTuple):
    """The flakes at about one depth."""

    opacity: Array
    # (H, W, 2) or (1, 1, 2), pixels (x, y) per frame; (H, W) or (1, 1), metres.
    motion: Array
    depth: Array


def mixture_of(
    here: Here, alpha: Array, flow: Array | None, motion: bool, fps: float
) -> dict[str, Any]:
    """Return the labels of what is seen of picture and weather; holes stay holes."""
    planes, most = falling_of(here, fps)
    depth, came, found = here.distances.given, here.distances.came, dict[str, Any]()
    # A layer of the texture alone may be denser than all of them, which are smoother.
    seen = (most.opacity > SEEN) & (alpha > SEEN)
    left = 1.0 - planes[3]
    if flow is not None:
        found["flow"] = np.where(seen[..., None], most.motion, flow).astype(np.float32)
        found["soft_flow"] = (left[..., None] * flow + np.moveaxis(planes[:2], 0, -1)).astype(
            np.float32
        )
    if depth is not None:
        nearer = np.where(seen, np.minimum(most.depth, depth), depth)
        nearness = left / depth + planes[2]
        soft = np.divide(1.0, nearness, out=np.full_like(nearness, np.inf), where=nearness > 0.0)
        if came is not None:
            holes = np.isnan(came) | (came == 0.0)
            np.copyto(nearer, came, where=holes & ~seen)
            soft[holes] = came[holes]
        found["depth"] = nearer.astype(np.float32)
        found["soft_depth"] = soft.astype(np.float32)
    if here.view.eyes:
        parallax = here.view.focal * 2.0 * here.view.eyes
        found["weather_disparity"] = np.asarray(parallax / most.depth, np.float32)
        if depth is not None:
            known = np.where(nearer == 0.0, np.nan, nearer)
            found["disparity"] = np.asarray(parallax / known, np.float32)
    if motion:
        found["motion"] = most.motion
        found["falling"] = np.ascontiguousarray(np.moveaxis(planes, 0, -1))
    return found


def falling_of(here: Here, fps: float) -> tuple[Array, Slice]:
    """Return the planes of `Weathered.falling`, and at each pixel the slice that is densest."""
    shape, air = here.view.shape, here.air
    left, densest = np.ones(shape, np.float32), np.zeros(shape, np.float32)
    planes, most = np.zeros((4, *shape), np.float32), np.zeros((3, *shape), np.float32)
    most[2] = np.inf
    if air.patches is not None and here.extinction > 0.0:
        # Fog moves as the mean of its patches and is nowhere in particular.
        most[0], most[1] = air.patches.motion(shape, fps)
    for part in slices(here, fps):
        weight = left * part.opacity
        left -= weight
        across, down = part.motion[..., 0], part.motion[..., 1]
        planes[0] += weight * across
        planes[1] += weight * down
        planes[2] += weight / part.depth
        seen = part.opacity > densest
        np.copyto(densest, part.opacity, where=seen)
        for known, value in zip(most, (across, down, part.depth), strict=True):
            np.copyto(known, value, where=seen)
    planes[3] = 1.0 - left
    return planes, Slice(densest, np.ascontiguousarray(np.moveaxis(most[:2], 0, -1)), most[2])


def slices(here: Here, fps: float) -> list[Slice]:
    """Return all that falls, near slices first."""
    found = []
    request = here.request(steps=(-0.5 / fps, 0.5 / fps))
    if request is not None:
        (one,) = request.classes
        first, full, last, end = one.shown
        inner = np.geomspace(full, last, _SLABS + 1)[1:-1].tolist()
        bounds = [(first, full), *((edge, edge) for edge in inner), (last, end)]
        for near, far in itertools.pairwise(bounds):
            part = _drawn(here, request._replace(classes=[one._replace(shown=(*near, *far))]))
            found += [] if part is None else [part]
    focal, speed = here.view.focal, np.asarray(here.air.velocity)
    for layer, own in zip(here.layers, here.sheets.layers if here.layers else (), strict=True):
        plane = np.empty(here.view.shape, np.float32)
        _core.sheet_read(plane, (0, 0), [layer], here.depth, True)
        depth = here.near * own.depth
        step = (speed * (focal / depth / fps)).astype(np.float32)
        # Before a wall inside the layer its flakes are nearer than the wall.
        near = np.minimum(np.float32(depth), here.distances.plane)
        found.append(Slice(plane, step.reshape(1, 1, 2), near))
    return found


def _drawn(here: Here, request: Request) -> Slice | None:
    """Return some of the drawn flakes: at each pixel the one that it shows most says how fast."""
    flakes = _core.fall(request)
    _, rows, others = _core.flake_rows(flakes)
    if len(rows) == 0:
        return None
    shape = here.view.shape
    plane, number = np.empty(shape, np.float32), np.empty(shape, np.int32)
    _core.particle_draw(plane, flakes, request.window, here.depth, number)
    opacity = np.empty(shape, np.float32)
    _core.sheet_read(opacity, (0, 0), [], None, True, (plane, here.falling.gain))
    motion = (others[:, 2:] - others[:, :2]).astype(np.float32)
    # A pixel without any has no opacity either.
    return Slice(opacity, motion[number], rows[:, 5].astype(np.float32)[number])

"""What falls, cut into slices of depth: how opaque, how far away and how fast each is."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.augment.air import Here
from flurries.effects.air import Air as Request

# Depths that drawn flakes are sorted into.
_SLABS = 8


class Slice(NamedTuple):
    """The flakes at about one depth."""

    opacity: Array
    # (H, W, 2) or (1, 1, 2), pixels (x, y) per frame; (H, W) or (1, 1), metres.
    motion: Array
    depth: Array


class Labels(NamedTuple):
    """The flakes at each pixel, the nearer slices before the farther ones, without a veil."""

    alpha: Array
    # Pixels (x, y) per frame, and one over the depth, 1/m; premultiplied with the opacity.
    motion: Array
    nearness: Array
    # The slice that is densest at each pixel.
    most: Slice


def labels_of(here: Here, fps: float) -> Labels:
    """Return the labels of the flakes before a picture."""
    shape, air = here.view.shape, here.air
    left, nearness = np.ones(shape, np.float32), np.zeros(shape, np.float32)
    motion, densest = np.zeros((2, *shape), np.float32), np.zeros(shape, np.float32)
    most = [np.zeros(shape, np.float32) for _ in "xyz"]
    most[2].fill(np.inf)
    if air.patches is not None and here.extinction > 0.0:
        # Fog moves as the mean of its patches and is nowhere in particular.
        most[0][...], most[1][...] = air.patches.motion(shape, fps)
    for part in slices(here, fps):
        weight = left * part.opacity
        left -= weight
        seen = part.opacity > densest
        np.copyto(densest, part.opacity, where=seen)
        values = part.motion[..., 0], part.motion[..., 1], part.depth
        for known, value in zip(most, values, strict=True):
            np.copyto(known, value, where=seen)
        for axis in (0, 1):
            motion[axis] += weight * values[axis]
        nearness += weight / part.depth
    way = np.ascontiguousarray(np.moveaxis(motion, 0, -1))
    return Labels(
        1.0 - left, way, nearness, Slice(densest, np.stack(most[:2], axis=-1), most[2])
    )  # fmt: skip


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
    focal, speed = here.view.camera.focal, np.asarray(here.air.velocity)
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

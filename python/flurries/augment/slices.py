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
_SLABS = 12


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
    """Return the labels of the flakes before a picture, a film's frame or one by itself."""
    shape, air = here.view.shape, here.air
    alpha, nearness = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    motion = np.zeros((*shape, 2), np.float32)
    most = Slice(alpha.copy(), motion.copy(), np.full(shape, np.inf, np.float32))
    if air.loss > 0.0 and air.patches is not None:
        # Fog moves as the mean of its patches and is nowhere in particular.
        most.motion[...] = air.patches.motion(shape, fps)
    for part in slices(here, fps):
        weight = (1.0 - alpha) * part.opacity
        motion += weight[..., None] * part.motion
        nearness += weight / part.depth
        alpha += weight
        seen = part.opacity > most.opacity
        most.opacity[seen] = part.opacity[seen]
        most.motion[seen] = np.broadcast_to(part.motion, (*shape, 2))[seen]
        most.depth[seen] = np.broadcast_to(part.depth, shape)[seen]
    return Labels(alpha, motion, nearness, most)


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
    sheets = here.sheets
    if sheets is not None:
        focal, speed = here.view.camera.focal, np.asarray(here.air.velocity)
        for layer, depth in zip(here.layers, sheets.depths[:, 0].tolist(), strict=True):
            plane = np.empty(here.view.shape, np.float32)
            _core.sheet_read(plane, (0, 0), [layer], here.depth, True)
            step = (speed * (focal / depth / fps)).astype(np.float32)
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
    _core.sheet_read(opacity, (0, 0), [], None, True, (plane, here.gain))
    motion = (others[:, 2:] - others[:, :2]).astype(np.float32)
    # A pixel without any has no opacity either.
    return Slice(opacity, motion[number], rows[:, 5].astype(np.float32)[number])

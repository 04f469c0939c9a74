"""What the pixels of a layer show besides color: how it moves, how far it is, which flake it is."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._trace import current
from flurries.frame.view import Frame

# From a frame to the next one and to the one before.
STEPS = (1.0, -1.0)

# Metres before the eye that no depth is below.
NEAREST = 1e-3

# Rows of a picture that are worked on together.
_ROWS = 32


def passes_of(
    texture: Any, flakes: Any, frame: Frame, amount: float,
    planes: tuple[Array | None, Array | None], alpha: Array,
) -> dict[str, Any]:  # fmt: skip
    """Return motion to both sides, depth, coverage and ids of the window; see `Layer`."""
    behind, front = planes
    with current.get().stage("passes"):
        others = [frame.later(step) for step in STEPS]
        if texture is not None and behind is not None:
            (motion, backward), depth = texture.passes(frame, others)
        else:
            motion, backward = (np.zeros((*alpha.shape, 2), np.float32) for _ in others)
            depth = np.full(alpha.shape, np.inf, np.float32)
        # What shows lies before the scene, wherever its layer's mean is.
        scene = None if frame.depth is None else frame.crop(frame.depth)
        coverage, ids = np.zeros_like(alpha), np.full(alpha.shape, -1, np.int64)
        seen = None
        if front is not None:
            coverage = np.ascontiguousarray(front)
            _, nearest, rows = flakes.seen(frame, amount)
            shown = nearest, coverage, behind
            numbers = _core.layer_seen(shown)
            ways, far = flakes.passes(rows, numbers)
            seen = shown, numbers, np.column_stack([*ways, far])
            ids = np.append(rows[0].astype(np.int64), -1)[nearest]
        _core.layer_finish(motion, backward, depth, alpha, scene, seen)
    return {
        "motion": motion, "backward": backward, "depth": depth, "coverage": coverage, "ids": ids
    }  # fmt: skip


def plane_motion(depth: Array, frame: Frame, other: Frame, moved: Float64) -> Array:
    """Return the motion to another frame of a window's depths, (h, w, 2) float32 pixels."""
    here, there = frame.camera, other.camera
    own, other_axes = here.matrix(), there.matrix()
    turned = own.T @ other_axes - np.eye(3)
    aside = (own @ np.array(here.offset) - moved) @ other_axes - np.array(there.offset)
    middle, turns = here.principal(frame.shape), frame.path.turns
    focals, ends = here.focals, there.focals
    shifted = np.subtract(there.principal(frame.shape), middle)
    a, b = _across(frame, middle, focals)
    motion = np.zeros((*depth.shape, 2), np.float32)
    # Blocks of rows stay in a cache.
    for first in range(0, len(depth), _ROWS):
        rows = slice(first, first + _ROWS)
        far = np.maximum(depth[rows].astype(np.float64), NEAREST)
        seen = np.isfinite(far)
        far[~seen] = 1.0
        down = b[rows]
        x, y, z = (
            (turned[0, i] * a + (turned[1, i] * down + turned[2, i])) * far + aside[i]
            if turns
            else aside[i]
            for i in range(3)
        )
        later = far + z
        # What passes the eye meanwhile: as fast as now.
        scale = np.where(later < 0.5 * far, 1.0 / far, 1.0 / np.maximum(later, NEAREST)) * seen
        for axis, (side, at) in enumerate(((x, a), (y, down))):
            change = ends[axis] * (side - z * at) * scale
            grown = ends[axis] - focals[axis]
            if grown or shifted[axis]:
                change += (grown * at + shifted[axis]) * seen
            motion[rows, :, axis] = change
    return motion


def air_motions(depth: Array, frame: Frame, others: Sequence[Frame], **air: Any) -> list[Array]:
    """Return the motions to other frames of what is at depths and goes with the air."""
    here = frame.displacement(**air)
    return [plane_motion(depth, frame, at, at.displacement(**air) - here) for at in others]


def rays(frame: Frame) -> Float64:
    """Return the ray of each pixel of the window, (h, w, 3) in the eye's axes, with z = 1."""
    camera = frame.camera
    a, b = np.broadcast_arrays(*_across(frame, camera.principal(frame.shape), camera.focals))
    return np.stack([a, b, np.ones_like(a)], axis=-1)


def _across(
    frame: Frame, middle: tuple[float, float], focals: tuple[float, float]
) -> tuple[Float64, Float64]:
    """Return the rays' parts across (w,) and down (h, 1)."""
    top, bottom, left, right = frame.window
    across, down = np.arange(left, right) + 0.5, np.arange(top, bottom)[:, None] + 0.5
    return np.asarray((across - middle[0]) / focals[0]), np.asarray((down - middle[1]) / focals[1])

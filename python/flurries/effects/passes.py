"""What the pixels of a layer show besides color: how it moves, how far it is, which flake it is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array
from flurries.effects.motion import Way
from flurries.frame.view import Frame
from flurries.trace import stage


class Passes(NamedTuple):
    """What a layer says of its pixels besides their color; see `Layer`."""

    motion: Array
    depth: Array
    coverage: Array
    ids: Array


def passes_of(
    texture: Any,
    flakes: Any,
    frame: Frame,
    amount: float,
    way: Way,
    planes: tuple[Array | None, Array | None],
) -> Passes:
    """Return motion, depth, coverage and ids of the window; see `Layer`.

    Parameters
    ----------
    planes : (h, w), each optional
        Opacities of texture and flakes, as far as there are any; flakes are in front.
    """
    top, bottom, left, right = frame.window
    shape = (bottom - top, right - left)
    behind, front = planes
    motion = np.zeros((*shape, 2), np.float32)
    depth = np.full(shape, np.inf, np.float32)
    coverage = np.zeros(shape, np.float32) if front is None else np.ascontiguousarray(front)
    ids: Array = np.full(shape, -1, np.int32)
    with stage("passes"):
        later = frame.later()
        ways = way, flakes.motion.way(later)
        if texture is not None and behind is not None:
            motion, depth = texture.passes(frame, later, *ways)
        if front is not None:
            ids = frame.crop(flakes.ids(frame, amount, way))
            through: Any = 0.0 if behind is None else behind * (1.0 - front)
            shown = np.nonzero((ids >= 0) & (front > through))
            numbers, which = _distinct(ids[shown])
            steps, far = flakes.passes(frame, later, ways, numbers)
            motion[shown], depth[shown] = steps[which], far[which]
    return Passes(motion, depth, coverage, ids)


def _distinct(ids: Array) -> tuple[Array, Array]:
    """Return the different numbers among ids, sorted, and of each id its place among them.

    As `np.unique`, which sorts a picture's worth of ids; they are small, so a table is faster.
    """
    there = np.zeros(int(ids.max(initial=-1)) + 1, bool)
    there[ids] = True
    places = np.cumsum(there) - 1
    return np.flatnonzero(there).astype(ids.dtype), places[ids]

"""Pixels of a depth that show two of them: the near side of a step and the far one."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, sealed
from flurries.frame.matte import NOTHING, Deep

_ALIKE = 1.1  # Sides whose depths are as alike look alike.

# Pixels around one in which both sides of a step are whole: filters are up to 2 px wide.
_REACH = 2

_SLOPE = 2.5  # Slopes change by so many steps of a pixel over them, and by rounding.
_ROWS = 64  # Rows that are looked at together, in the cache.


class Edges(NamedTuple):
    """The two depths of pixels that show both."""

    back: Array  # (H, W) float32: the far one, and elsewhere the only one.
    front: Deep  # The near ones, with the share of the pixel that they take.

    @staticmethod
    def of(near: Array, back: Array, share: Array) -> "Edges | None":
        """Return the edges of three planes, or None without any."""
        two = (share > 0.0) & (near * np.float32(_ALIKE) < back)
        if not two.any():
            return None
        planes = back, np.where(two, share, 0.0), np.where(two, near, NOTHING)
        back, share, near = (sealed(np.asarray(plane, np.float32)) for plane in planes)
        return Edges(back, Deep(share, near))


def edges_of(depth: Array, *, inverse: bool = False) -> Edges | None:
    """Return the edges of a filtered depth, where pixels are means of depths or inverse ones."""
    near, back, share = None, depth, None
    for top in range(0, len(depth), _ROWS):
        first, last = max(top - _REACH - 1, 0), top + _ROWS + _REACH + 1
        if _steps(depth[first:last]):
            if near is None or share is None:
                near, back, share = depth.copy(), depth.copy(), np.zeros_like(depth)
            found = _sides(depth[first:last], inverse=inverse)
            for plane, part in zip((near, back, share), found, strict=True):
                rows = plane[top : top + _ROWS]
                rows[...] = part[top - first :][: len(rows)]
    return None if near is None or share is None else Edges.of(near, back, share)


def edges_by(cover: Array, depth: Array, edges: Edges | None) -> Edges | None:
    """Return edges where a plate with alpha ends before nothing, and those of its depth."""
    two = (cover > 0.0) & (cover < 1.0)
    if not two.any():
        return edges
    # What lies behind is seen beside it.
    near, far = (_grown(depth, _REACH, pick) for pick in (np.minimum, np.maximum))
    two &= near * np.float32(_ALIKE) < far
    back, front = edges or (depth, Deep(np.zeros_like(depth), np.full_like(depth, NOTHING)))
    pairs = (near, front.depth), (far, back), (cover, front.cover)
    return Edges.of(*(np.where(two, *pair) for pair in pairs))


def _sides(depth: Array, *, inverse: bool) -> tuple[Array, Array, Array]:
    """Return the depths of both sides, and the share of the near one, 0 where there is one."""
    # A pixel shows two depths if the nearest and the farthest around it are farther from its own
    # than slopes can be. Slopes are what the nearest and the farthest change by one pixel farther
    # out: there a plane goes on, and a step does not. Inverse depths of planes are even.
    with np.errstate(divide="ignore", invalid="ignore"):
        close = np.float32(1.0) / depth
        # A pixel with a share of infinity is infinite, so others have none of it.
        means = close if inverse else np.where(np.isinf(depth), -depth, depth)
        nearest = _grown(close, _REACH, np.maximum)
        two = nearest - close > _SLOPE * (_grown(nearest, 1, np.maximum) - nearest)
        pick: Any = np.minimum if inverse else np.maximum
        farthest = _grown(means, _REACH, pick)
        two &= abs(farthest - means) > _SLOPE * abs(_grown(farthest, 1, pick) - farthest)
        two &= means != -np.inf
        near = np.float32(1.0) / nearest
        share = (farthest - means) / (farthest - (nearest if inverse else near))
        back = np.float32(1.0) / farthest if inverse else farthest
        return near, np.where(two, back, depth), np.where(two, share, np.float32(0.0))


def _steps(depth: Array) -> bool:
    """Whether any two pixels, one apart, may be the sides of a step."""
    few = np.float32(_ALIKE)
    pairs = (depth[2:], depth[:-2]), (depth[:, 2:], depth[:, :-2])
    return any(bool(((one > few * two) | (two > few * one)).any()) for one, two in pairs)


def _grown(plane: Array, reach: int, pick: Callable[..., Array]) -> Array:
    """Return the largest or least of the pixels up to so many px away."""
    for axis in (0, 1):
        source, plane = np.swapaxes(plane, 0, axis), plane.copy()
        grown = np.swapaxes(plane, 0, axis)
        for step in range(1, reach + 1):
            pick(grown[step:], source[:-step], out=grown[step:])
            pick(grown[:-step], source[step:], out=grown[:-step])
    return plane

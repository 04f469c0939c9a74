"""The light of a plate by depth: what stands in front of a wall takes none from beyond its edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array, Float64

# Levels of depth in metres, each twice as far as the one before; 1,024 m and more are the last.
LEVELS = 10

# Cells along the longer side of a picture in which depths are told apart, and how many of them lie
# along the side of one that is blurred.
FINE, COARSE = 320, 4

# The light from outside the picture counts as so much where hardly anything of a level is near.
_REST = 1e-3


@dataclass(frozen=True, eq=False)
class Levels:
    """The light of a plate on each level: that of what is no farther, or less than twice as far."""

    sums: dict[int, Float64]  # By level, (rows, columns, 4): light and cover of large cells.
    places: Float64  # (rows, columns): between which levels small cells lie.

    @property
    def counts(self) -> tuple[int, ...]:
        """Rows and columns of large cells."""
        return tuple(-(-count // COARSE) for count in self.places.shape)

    @staticmethod
    def of(sums: Array, cell: int, depth: Array) -> Levels:
        """Return the levels of sums of small cells, before a depth in metres, (H, W)."""
        # Of a cell with an edge in it the light is that of the farther, and so none of the nearer;
        # its place, and that of a cell beside it, is the nearer's.
        near, source = (_level(_pooled(depth, cell, of)) for of in (np.minimum, np.maximum))
        places = near
        for _ in range(2):
            around = np.pad(places, ((1, 1), (0, 0)), mode="edge")
            places = np.minimum(np.minimum(around[:-2], around[1:-1]), around[2:]).T
        ends = np.concatenate([np.floor(places), np.ceil(places)], axis=None).astype(int)
        used = np.flatnonzero(np.bincount(ends))
        light = np.maximum(sums, 0.0) / float(cell * cell)
        found = {}
        for level in used.tolist():
            counted = light * np.clip(level + 1.0 - source, 0.0, 1.0)[..., None]
            found[level] = _pooled(counted, COARSE, np.add) / COARSE**2
        return Levels(found, places)

    def blurred(self, blurs: Sequence[Any], outside: Float64) -> Float64:
        """Return the light of small cells: of blurs, weights and matrices of the large ones."""
        result = np.zeros((*self.places.shape, 3))
        for level, sums in self.sums.items():
            light: Float64 = np.zeros(())
            for weight, down, across in blurs:
                parts = across @ (down @ sums.reshape(len(sums), -1)).reshape(sums.shape)
                own = (parts[..., :3] + _REST * outside) / (parts[..., 3:] + _REST)
                light = light + weight * own
            for count in self.places.shape:
                light = np.swapaxes(_between(light, count), 0, 1)
            result += np.clip(1.0 - np.abs(self.places - level), 0.0, 1.0)[..., None] * light
        return result


def _level(depth: Array) -> Float64:
    return np.clip(np.log2(np.maximum(depth, 1.0, dtype=np.float64)), 0.0, LEVELS)


def _pooled(plane: Array, cell: int, of: np.ufunc) -> Array:
    """Return what a function makes of cells of a plane, (rows, columns, ...)."""
    for _ in range(2):
        first = plane[::cell].copy()
        for start in range(1, min(cell, len(plane))):
            part = plane[start::cell]
            of(first[: len(part)], part, out=first[: len(part)])
        plane = np.swapaxes(first, 0, 1)
    return plane


def _between(light: Float64, count: int) -> Float64:
    """Return the light at the middles of `count` small cells, along the first axis."""
    at = np.clip((np.arange(count) + 0.5) / COARSE - 0.5, 0.0, len(light) - 1.0)
    first = at.astype(int)
    low, part = light[first], (at - first)[:, None, None]
    return np.asarray(low + part * (light[np.minimum(first + 1, len(light) - 1)] - low))

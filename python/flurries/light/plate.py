"""The light that falls on the weather out of its own picture: from behind, around, all sides.

With a depth it is told by levels: what stands in front of a wall takes none from beyond its edge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.io.color import decoding_table, to_linear, to_unit
from flurries.light.lamp import within
from flurries.light.shot import cells_of

# Cells along the longer side of a picture: light is sampled no finer.
CELLS = 96

# Light within the first angle (radians) comes from behind a flake, within the second from around.
_NARROW, _WIDE = math.radians(6.0), math.radians(25.0)

# Of a Gaussian: the root mean square radius of a disc and of a ring, over the square root of 2.
_NARROW_SIGMA = _NARROW / 2.0
_WIDE_SIGMA = math.sqrt(0.5 * (_NARROW**2 + _WIDE**2)) / math.sqrt(2.0)

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


@dataclass(frozen=True, eq=False)
class PlateLight:
    """The light of a plate, linear."""

    # (rows, columns, 3) means of squares of the picture, where it has no depth.
    cells: Float64 | None
    cell: int  # Their side, px.
    sky: Float64  # (3,) from above, outside the picture.
    ground: Float64  # (3,) from below, outside.
    levels: Levels | None = None  # The same by depth, where the plate has one.

    def local(self, focal: float, asymmetry: float, albedo: float) -> Float64:
        """Return the radiance of flakes before each cell, (rows, columns, 3) linear light."""
        # The albedo times the light from all sides, weighed by Henyey and Greenstein: what lies
        # behind a flake, around it, and outside the picture, half of it sky, half ground.
        behind = within(asymmetry, _NARROW)
        around = within(asymmetry, _WIDE) - behind
        rest = 1.0 - behind - around
        seen = self.blurred(focal, (behind, _NARROW_SIGMA), (around, _WIDE_SIGMA))
        return np.asarray(albedo * (seen + rest * 0.5 * (self.sky + self.ground)))

    def veil(self, focal: float) -> Float64:
        """Return the light of fog before each cell, (rows, columns, 3) linear light."""
        # Fog loses nothing to absorption: it is as bright as what it hides, or as its surroundings.
        even = 0.5 * (self.blurred(focal, (1.0, _WIDE_SIGMA)) + self.sky)
        return np.maximum(even, self.blurred(focal, (1.0, _NARROW_SIGMA)))

    def blurred(self, focal: float, *blurs: tuple[float, float]) -> Float64:
        """Return the sum of blurs by Gaussians, of weights and deviations in radians."""
        levels, px = self.levels, focal / self.cell
        if levels is not None:
            rows, columns = (-(-count // COARSE) for count in levels.places.shape)
            sides = [(part, px * sigma / COARSE) for part, sigma in blurs]
            made = [(part, _gaussian(rows, s), _gaussian(columns, s)) for part, s in sides]
            return levels.blurred(made, 0.5 * (self.sky + self.ground))
        cells = self.cells
        assert cells is not None
        rows, columns, _ = cells.shape
        result = np.zeros(cells.shape)
        for weight, sigma in blurs:
            down, across = _gaussian(rows, px * sigma), _gaussian(columns, px * sigma)
            vertical = (down @ cells.reshape(rows, -1)).reshape(cells.shape)
            result += weight * (across @ vertical)
        return result


def _gaussian(count: int, sigma: float) -> Float64:
    """Return the matrix of a blur of `count` values, whose rows sum to 1."""
    at = np.arange(count)
    matrix = np.exp(-0.5 * ((at[:, None] - at[None, :]) / max(sigma, 0.3)) ** 2)
    return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))


def cell_sums(picture: Array, encoding: str, cells: int = CELLS) -> tuple[Array, int]:
    """Return sums of light and cover over squares, (rows, columns, 4), and their side, px."""
    # What is not finite does not count.
    height, width = picture.shape[:2]
    cell = max(math.ceil(max(height, width) / cells), 1)
    sums = np.empty((-(-height // cell), -(-width // cell), 4), np.float32)
    table = np.empty(0, np.float32)
    if picture.dtype.kind == "u" and encoding == "display":
        table = decoding_table(picture.dtype.itemsize)
    else:
        alpha = [to_unit(picture[..., 3:])] if picture.shape[2] == 4 else []
        picture = np.concatenate([to_linear(picture[..., :3], encoding), *alpha], axis=2)
        picture = np.ascontiguousarray(picture, np.float32)
    _core.plate_cells(sums, np.ascontiguousarray(picture), table, cell)
    return sums, cell


def plate_light(
    picture: Array, encoding: str, sky: Float64, ground: Float64, depth: Array | None = None
) -> PlateLight:
    """Return the light of a picture by places, and by its depth if it has one."""
    sums, cell = cell_sums(picture, encoding, CELLS if depth is None else FINE)
    if depth is None:
        return PlateLight(cells_of(sums), cell, sky, ground)
    return PlateLight(None, cell, sky, ground, Levels.of(sums, cell, depth))

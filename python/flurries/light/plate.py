"""The light that falls on the weather out of its own picture: from behind, around, all sides."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.io.color import decoding_table, to_linear, to_unit
from flurries.light.levels import COARSE, FINE, Levels
from flurries.light.phase import within
from flurries.light.shot import cells_of

# Cells along the longer side of a picture: light is sampled no finer.
CELLS = 96

# Light within the first angle (radians) comes from behind a flake, within the second from around.
_NARROW, _WIDE = math.radians(6.0), math.radians(25.0)

# Of a Gaussian: the root mean square radius of a disc and of a ring, over the square root of 2.
_NARROW_SIGMA = _NARROW / 2.0
_WIDE_SIGMA = math.sqrt(0.5 * (_NARROW**2 + _WIDE**2)) / math.sqrt(2.0)


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
            rows, columns = levels.counts
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

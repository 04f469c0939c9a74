"""The light that falls on the weather out of its own picture: from behind, around, all sides."""

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

CELLS = 96  # Cells along the longer side of a picture: light is sampled no finer.

# Light within the first angle (radians) comes from behind a flake, within the second from around.
_NARROW, _WIDE = math.radians(6.0), math.radians(25.0)

# Of a Gaussian: the root mean square radius of a disc and of a ring, over the square root of 2.
_NARROW_SIGMA = _NARROW / 2.0
_WIDE_SIGMA = math.sqrt(0.5 * (_NARROW**2 + _WIDE**2)) / math.sqrt(2.0)

# Levels of depth in metres, each twice as far as the one before; 1,024 m and more are the last.
LEVELS = 10

# Cells along the longer side of a picture in which depths are told apart, and how many of them lie
# along the side of one that is blurred; of their rows each third counts.
FINE, COARSE, STEP = 320, 4, 3

# The light from outside the picture counts as so much where hardly anything of a level is near.
_REST = 1e-3


@dataclass(frozen=True, eq=False)
class Levels:
    """The light of a plate on each level: that of what is no farther, or less than twice as far."""

    used: Array  # (n,): the levels of any cell.
    sums: Array  # (n, rows, 4, columns): light and cover of large cells.
    places: Array  # (rows, columns): between which levels small cells lie.

    @staticmethod
    def of(sums: Array, cell: int, depth: Array) -> "Levels":
        """Return the levels of sums of small cells, before a depth in metres, (H, W)."""
        # Of a cell with an edge in it the light is that of the farther, and so none of the nearer;
        # its place, and that of a cell beside it, is the nearer's.
        ends = np.array([_pooled(depth, cell, of) for of in (np.minimum, np.maximum)])
        places, source = np.log2(np.clip(ends, 1.0, 2.0**LEVELS))
        for _ in range(2):
            around = np.pad(places, ((1, 1), (0, 0)), mode="edge")
            places = np.minimum(np.minimum(around[:-2], around[1:-1]), around[2:]).T
        both = np.array([places, np.ceil(places)], np.int8)
        used = np.flatnonzero(np.bincount(both.ravel())).astype(np.float32)
        # Cells by the large one that they lie in, (rows, columns, of one, channels).
        light, far = (_parted(plane) for plane in (np.maximum(sums, 0.0), source[..., None]))
        counted = np.clip(used[:, None] + 1.0 - far[:, :, None, :, 0], 0.0, 1.0)
        found = counted @ light * np.float32(1.0 / (cell * COARSE) ** 2)
        return Levels(used, np.ascontiguousarray(found.transpose(2, 0, 3, 1)), places)

    def blurred(self, px: float, blurs: Sequence[tuple[float, float]], outside: Float64) -> Array:
        """Return the light of small cells: of blurs, weights and deviations in parts of `px`."""
        levels, rows, _, columns = self.sums.shape
        light: Any = np.float32(0.0)
        rest = np.asarray(_REST * outside[:, None], np.float32)
        for weight, sigma in blurs:
            down, across = (_gaussian(n, px * sigma).astype(np.float32) for n in (rows, columns))
            parts = (down @ self.sums.reshape(levels, rows, -1)).reshape(-1, columns) @ across.T
            parts = parts.reshape(self.sums.shape)
            own = (parts[:, :, :3] + rest) / (parts[:, :, 3:] + np.float32(_REST))
            light = light + np.float32(weight) * own
        down, across = (_between(count) for count in self.places.shape)
        result = np.zeros((self.places.shape[0], 3, self.places.shape[1]), np.float32)
        for level, own in zip(self.used, light, strict=True):
            share = np.maximum(1.0 - np.abs(self.places - level), 0.0)
            fine = (down @ own.reshape(rows, -1)).reshape(-1, columns) @ across.T
            result += share[:, None] * fine.reshape(result.shape)
        return np.asarray(result.swapaxes(1, 2))


def _pooled(plane: Array, cell: int, of: np.ufunc) -> Array:
    """Return what a function makes of the rows of a plane's cells that count, (rows, columns)."""
    more = [(0, -count % cell) for count in plane.shape]
    plane = np.pad(plane, more, mode="edge") if np.any(more) else plane
    rows = of.reduce(plane.reshape(-1, cell, plane.shape[1])[:, ::STEP], axis=1)
    return np.asarray(of.reduce([rows[:, k::cell] for k in range(cell)]))


def _parted(plane: Array) -> Array:
    """Return the small cells of each large one, (rows, columns, small ones, channels)."""
    down, across = (-(-count // COARSE) for count in plane.shape[:2])
    whole = np.zeros((down * COARSE, across * COARSE, plane.shape[2]), np.float32)
    whole[: plane.shape[0], : plane.shape[1]] = plane
    parts = whole.reshape(down, COARSE, across, COARSE, -1).swapaxes(1, 2)
    return np.asarray(parts.reshape(down, across, COARSE * COARSE, -1))


def _between(count: int) -> Array:
    """Return the shares of large cells in what is at the middles of `count` small ones."""
    large = np.arange(-(-count // COARSE))
    at = np.clip((np.arange(count) + 0.5) / COARSE - 0.5, 0.0, large[-1])
    return np.asarray(np.maximum(1.0 - np.abs(at[:, None] - large), 0.0), np.float32)


@dataclass(frozen=True, eq=False)
class PlateLight:
    """The light of a plate, linear."""

    cells: Float64  # (rows, columns, 3) means of squares of the picture; none where it has a depth.
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
        seen = self.blurred(focal, (behind, _NARROW_SIGMA), (around, _WIDE_SIGMA))
        rest = 0.5 * (1.0 - behind - around) * (self.sky + self.ground)
        return np.asarray(albedo * (seen + rest.astype(seen.dtype)))

    def veil(self, focal: float) -> Float64:
        """Return the light of fog before each cell, (rows, columns, 3) linear light."""
        # Fog loses nothing to absorption: it is as bright as what it hides, or as its surroundings.
        even = 0.5 * (self.blurred(focal, (1.0, _WIDE_SIGMA)) + self.sky)
        return np.maximum(even, self.blurred(focal, (1.0, _NARROW_SIGMA)))

    def blurred(self, focal: float, *blurs: tuple[float, float]) -> Array:
        """Return the sum of blurs by Gaussians, of weights and deviations in radians."""
        px = focal / self.cell
        if self.levels is not None:
            return self.levels.blurred(px / COARSE, blurs, 0.5 * (self.sky + self.ground))
        rows, columns, _ = self.cells.shape
        result = np.zeros(self.cells.shape)
        for weight, sigma in blurs:
            down, across = _gaussian(rows, px * sigma), _gaussian(columns, px * sigma)
            vertical = (down @ self.cells.reshape(rows, -1)).reshape(result.shape)
            result += weight * (across @ vertical)
        return result


def _gaussian(count: int, sigma: float) -> Float64:
    """Return the matrix of a blur of `count` values, whose rows sum to 1."""
    at = np.arange(count)
    matrix = np.exp(-0.5 * ((at[:, None] - at[None, :]) / max(sigma, 0.3)) ** 2)
    return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))


def cell_sums(
    picture: Array, encoding: str, cells: int = CELLS, step: int = 1
) -> tuple[Array, int]:
    """Return sums of light and cover over squares, (rows, columns, 4), and their side, px."""
    # What is not finite does not count, and of rows each `step`-th does.
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
    _core.plate_cells(sums, np.ascontiguousarray(picture), table, cell, step)
    return sums, cell


def plate_light(
    picture: Array, encoding: str, sky: Float64, ground: Float64, depth: Array | None = None
) -> PlateLight:
    """Return the light of a picture by places, and by its depth if it has one."""
    if depth is None:
        sums, cell = cell_sums(picture, encoding)
        return PlateLight(cells_of(sums), cell, sky, ground)
    # Cells are small, and blurred: a third of their rows says as much.
    sums, cell = cell_sums(picture, encoding, FINE, step=STEP)
    more = np.float32(cell / math.ceil(cell / STEP))
    return PlateLight(np.empty((0, 0, 3)), cell, sky, ground, Levels.of(more * sums, cell, depth))

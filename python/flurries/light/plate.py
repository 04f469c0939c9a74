"""The light that falls on the weather out of its own picture: from behind, around, all sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.io.color import decoding_table, linear_to_srgb, to_linear, to_unit
from flurries.light.phase import within

# Cells along the longer side of a picture: light is sampled no finer.
CELLS = 96

# Of what is outside the picture the upper half shines as the picture's brighter part does, the sky
# where there is one, without lamps, which are small; the lower half as its darker part, the ground.
_BRIGHTER = (0.75, 0.98)
_DARKER = 0.5

# Light within the first angle (radians) comes from behind a flake, within the second from around.
_NARROW, _WIDE = math.radians(6.0), math.radians(25.0)

# Of a Gaussian: the root mean square radius of a disc and of a ring, over the square root of 2.
_NARROW_SIGMA = _NARROW / 2.0
_WIDE_SIGMA = math.sqrt(0.5 * (_NARROW**2 + _WIDE**2)) / math.sqrt(2.0)

# What pictures reflect on average, the grey of exposure meters; and fresh snow.
_GREY, _SNOW = 0.18, 0.9
# A black picture is none: snow on it is meant to be laid over one later.
_BLACK = 1.0, 1.0, 1.0
# The share of places that are darker than the shot's white.
_SKY = 0.98
# That white over the mean, for what is all card and what is all picture.
_CARD = 1.02, 1.1
# The range of the channels of snow's light at most, in parts of their mean: in photographs flakes
# are within 17 of 255, and those that let light through have some of it from what is behind them.
_TINT = 0.01
# What the most saturated color counts for the tint, so that a picture of one color has one.
_LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class PlateLight:
    """The light of a plate, linear."""

    cells: Float64  # (rows, columns, 3) means of squares of the picture.
    cell: int  # Their side, px.
    sky: Float64  # (3,) from above, outside the picture.
    ground: Float64  # (3,) from below, outside.

    def local(self, focal: float, *, asymmetry: float, albedo: float) -> Float64:
        """Return the radiance of flakes before each cell, (rows, columns, 3) linear light."""
        # The albedo times the light from all sides, weighed by Henyey and Greenstein: what lies
        # behind a flake, around it, and outside the picture, half of it sky, half ground.
        behind = within(asymmetry, _NARROW)
        around = within(asymmetry, _WIDE) - behind
        rest = 1.0 - behind - around
        near = self.blurred(focal, _NARROW_SIGMA)
        wide = self.blurred(focal, _WIDE_SIGMA)
        outside = 0.5 * (self.sky + self.ground)
        return np.asarray(albedo * (behind * near + around * wide + rest * outside))

    def veil(self, focal: float) -> Float64:
        """Return the light of fog before each cell, (rows, columns, 3) linear light."""
        # Fog loses nothing to absorption: it is as bright as what it hides, or as its surroundings.
        wide = self.blurred(focal, _WIDE_SIGMA)
        even = 0.5 * (wide + self.sky)
        return np.maximum(even, self.blurred(focal, _NARROW_SIGMA))

    def blurred(self, focal: float, sigma: float) -> Float64:
        """Return the cells blurred by a Gaussian of `sigma` radians; borders take from within."""
        rows, columns, _ = self.cells.shape
        wide = focal * sigma / self.cell
        down, across = _gaussian(rows, wide), _gaussian(columns, wide)
        vertical = (down @ self.cells.reshape(rows, -1)).reshape(self.cells.shape)
        return np.asarray(across @ vertical)


def _gaussian(count: int, sigma: float) -> Float64:
    """Return the matrix of a blur of `count` values, whose rows sum to 1."""
    at = np.arange(count)
    matrix = np.exp(-0.5 * ((at[:, None] - at[None, :]) / max(sigma, 0.3)) ** 2)
    return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))


def cell_sums(picture: Array, encoding: str) -> tuple[Array, int]:
    """Return sums of light and cover over squares, (rows, columns, 4), and their side, px."""
    # What is not finite does not count.
    height, width = picture.shape[:2]
    cell = max(math.ceil(max(height, width) / CELLS), 1)
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


def plate_light(picture: Array, encoding: str) -> PlateLight:
    """Return the light of a picture; what is transparent counts as far as it shows."""
    sums, cell = cell_sums(picture, encoding)
    cover = sums[..., 3:].astype(np.float64)
    light = np.maximum(sums[..., :3].astype(np.float64), 0.0)
    mean = light.sum(axis=(0, 1)) / max(float(cover.sum()), 1e-12)
    # A cell of which nothing shows has the light of the rest.
    cells = np.where(cover > 0.0, light / np.maximum(cover, 1e-12), mean)
    if not cover.any() or not light.any():
        # Black is no picture: what is laid over it is meant for one later.
        cells = np.ones_like(cells)
    places = cells.reshape(-1, 3)
    bright = places.sum(axis=1)
    middle, low, high = np.quantile(bright, (_DARKER, *_BRIGHTER))
    sky = places[(bright >= low) & (bright <= high)].mean(axis=0)
    return PlateLight(cells, cell, sky, places[bright <= middle].mean(axis=0))


def ambient_light(picture: Array, encoding: str) -> tuple[float, float, float]:
    """Return the brightness (r, g, b) of white snow in the light of a picture (H, W, 3 or 4)."""
    return ambient_of([cell_sums(picture, encoding)[0]])


def ambient_of(frames: Sequence[Array]) -> tuple[float, float, float]:
    """Return the brightness (r, g, b), display values, of white snow in the light of a shot.

    `frames` are the sums of `cell_sums`. Light has no end at 1, and goes with the exposure.
    """
    # What is there in less than half of the frames, such as a lamp that enters, is no light of all.
    if not frames:
        return _BLACK
    # `np.median` imports masked arrays, which takes longer than all of this.
    middle = np.sort(frames, axis=0)[(len(frames) - 1) // 2 : len(frames) // 2 + 1]
    sums = np.maximum(middle.mean(axis=0).reshape(-1, 4), 0.0).astype(np.float64)
    sums = sums[sums[:, 3] > 0.0]
    light = sums[:, :3] / sums[:, 3:]
    if not light.any():
        return _BLACK
    bright = light.mean(axis=1)
    sky, mean = float(np.quantile(bright, _SKY)), float(bright.mean())
    # A card has no sky: it is taken as what reflects as much as pictures do.
    card = float(np.interp(sky / max(mean, np.finfo(np.float32).tiny), _CARD, (1.0, 0.0)))
    white = _SNOW * (sky + card * (mean / _GREY - sky))
    # A bright place counts for the tint by its least channel over its largest: coats light nothing.
    there = bright >= np.quantile(bright, _BRIGHTER[0])
    grey = light.min(axis=1) / np.maximum(light.max(axis=1), np.finfo(np.float32).tiny)
    tint = (grey[there] + _LEAST) @ light[there]
    tint /= tint.mean()
    tint = 1.0 + (tint - 1.0) * min(_TINT / max(float(np.ptp(tint)), 1e-12), 1.0)
    red, green, blue = linear_to_srgb(white * tint / max(float(tint.max()), 1.0)).tolist()
    return red, green, blue

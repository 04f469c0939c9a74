"""Which tiles make the texture of a film: decided once for all frames."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.spectral.tiles import starts

# The share of what is left of rain's texture that stands still is 13.5 c / M for wavelengths of 4
# to 32 px, c the cycles of the longest wave in a frame: M = 144 c is a tenth, with some to spare.
PIXELS_PER_CYCLE = 144.0 / (28.0 / math.log(8.0))

# A larger tile costs memory that a picture does not; from here on `jitter` would do.
LARGEST_TILE = 2048


class Tiling(NamedTuple):
    """Tiles of (rows, cols) pixels that share `overlap`."""

    tile: tuple[int, int]
    overlap: int


class Layout(NamedTuple):
    tiling: Tiling
    shape: tuple[int, int]  # (H, W) of the picture.
    band: tuple[float, float]  # Wavelengths in pixels.
    edges: Float64 | None  # Wavelengths between rings, for a wind of places.
    needed: float  # The tile that the motion needs, where a smaller one was asked for; else 0.

    @property
    def grid(self) -> tuple[int, int]:
        """The numbers of tiles, down and across."""
        (height, width), ((tall, wide), overlap) = self.shape, self.tiling
        return len(starts(height, tall, overlap)), len(starts(width, wide, overlap))

    def farthest(self, depth: Array) -> Array:
        """Return the farthest depth of each tile, (rows, cols)."""
        (height, width), ((tall, wide), overlap) = self.shape, self.tiling
        # The farthest of each run of columns first: a pixel is not read for every tile.
        cols, rows = starts(width, wide, overlap), starts(height, tall, overlap)
        bands = np.stack([depth[:, x : x + wide].max(axis=1) for x in cols], axis=1)
        return np.stack([bands[y : y + tall].max(axis=0) for y in rows])

    def warn_small(self) -> None:
        warnings.warn(
            f"rain: with tiles of {self.tiling.tile[0]} px a tenth of the streaks or more stands "
            f"still; take tile={math.ceil(self.needed)}, or leave it out, or jitter=True",
            UserWarning,
            stacklevel=7,
        )


def streaks_tile(cycles: float, band: tuple[float, float]) -> float:
    """Return the tile in pixels from which on less than a tenth of the streaks stands still."""
    shortest, longest = band
    if cycles <= 0.5:
        return 0.0
    return PIXELS_PER_CYCLE * cycles * (longest - shortest) / math.log(longest / shortest)

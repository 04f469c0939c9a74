"""Which tiles make the texture of a film, and what they cost: decided once for all frames."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.frame.costs import milliseconds
from flurries.frame.needs import Cost
from flurries.spectral.operations import smooth, tile_work, tiles_touching
from flurries.spectral.tiles import starts

# A torus must be cheaper by this much: both sides are estimates, and its statistics are equal, but
# its bits are not.
WORTH = 1.25

# Pixels of a tile that stays in a cache with its spectrum.
CACHED = 1 << 17

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
    """The tiles of a film's texture.

    Attributes
    ----------
    tiling : Tiling
        Themselves.
    why : str
        Why it is them and not one torus, or the other way round.
    shape : (H, W)
        Of the picture.
    band : (shortest, longest)
        Wavelengths in pixels.
    edges : (rings + 1,), optional
        Wavelengths between rings, for a wind that differs from place to place.
    needed : float
        The tile that the motion needs, where a smaller one was asked for; else 0.
    """

    tiling: Tiling
    why: str
    shape: tuple[int, int]
    band: tuple[float, float]
    edges: Float64 | None
    needed: float

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
        """Warn that tiles are too small for streaks to move."""
        warnings.warn(
            f"rain: with tiles of {self.tiling.tile[0]} px a tenth of the streaks or more stands "
            f"still; take tile={math.ceil(self.needed)}, or leave it out, or jitter=True",
            UserWarning,
            stacklevel=7,
        )


def streaks_tile(cycles: float, band: tuple[float, float]) -> float:
    """Return the tile in pixels from which on less than a tenth of the streaks stands still.

    `cycles` are those of the longest wave in a frame, at the film's fastest; 0 where no wave is too
    fast for the frame rate.
    """
    shortest, longest = band
    if cycles <= 0.5:
        return 0.0
    return PIXELS_PER_CYCLE * cycles * (longest - shortest) / math.log(longest / shortest)


def tiles_touched(
    shape: tuple[int, int], window: tuple[int, int, int, int], tiling: Tiling
) -> tuple[int, int]:
    """Return the numbers of tiles that touch a window, down and across."""
    top, bottom, left, right = window
    (height, width), shared = tiling
    return (
        len(tiles_touching(top, bottom, shape[0], height, shared)),
        len(tiles_touching(left, right, shape[1], width, shared)),
    )


def operations(
    shape: tuple[int, int],
    window: tuple[int, int, int, int],
    tiling: Tiling,
    wavelengths: tuple[float, float],
    *,
    waves_shown: float = 1.0,
) -> dict[str, float]:
    """Return the operations of a texture's window; `waves_shown` is the share of tiles with any."""
    each = tile_work(tiling.tile, wavelengths)
    down, across = tiles_touched(shape, window, tiling)
    made = down * across * waves_shown
    top, bottom, left, right = window
    # Tiles that leave the second cache wait for memory.
    large = "large " if each.pixels > CACHED else ""
    return {
        "planned bin": each.planned,
        "tile bin": made * each.bins,
        f"{large}tile multiply-add": made * each.dense,
        f"{large}tile fft": made * each.fft,
        "tile pixel": down * across * each.pixels,
        "texture pixel": float((bottom - top) * (right - left)),
    }


@lru_cache(maxsize=64)
def torus_for(
    shape: tuple[int, int], tiling: Tiling, wavelengths: tuple[float, float], least: float
) -> tuple[Tiling | None, str]:
    """Return one torus of the frame's size if it is cheaper than tiles, and why or why not.

    `least` is the side that a tile needs for its motion.
    """
    whole = (0, shape[0], 0, shape[1])
    torus = Tiling(shape, 0)
    tiles = milliseconds(operations(shape, whole, tiling, wavelengths))
    one = milliseconds(operations(shape, whole, torus, wavelengths))
    said = f"by the cost model {tiles:.3g} ms in tiles, {one:.3g} ms as one torus"
    if min(shape) < max(tiling.tile) or min(shape) < least:
        return None, "the frame is smaller than a tile"
    if not all(smooth(n) for n in shape):
        return None, "the frame's sides have large prime factors"
    if one * WORTH >= tiles:
        return None, said
    return torus, said


def tiles_cost(
    shape: tuple[int, int],
    window: tuple[int, int, int, int],
    tiling: Tiling,
    wavelengths: tuple[float, float],
    *,
    hidden: int = 0,
    passes: int = 1,
    jitter: bool = False,
) -> Cost:
    """Return the cost of a texture; `hidden` tiles are not made."""
    down, across = tiles_touched(shape, window, tiling)
    total = max(down * across, 1)
    work = operations(
        shape, window, tiling, wavelengths, waves_shown=1.0 - min(hidden, total) / total
    )
    if jitter:
        work["jittered bin"] = work["tile bin"]
    pixels = (window[1] - window[0]) * (window[3] - window[2])
    height, width = tiling.tile
    if tiling.overlap == 0 and tiling.tile == shape:
        size = f"one torus of {width} x {height} px"
    elif height == width:
        size = f"{total - hidden} tiles of {height} px"
    else:
        size = f"{total - hidden} tiles of {width} x {height} px"
    return Cost(
        work={name: passes * number for name, number in work.items()},
        size=size,
        kept=4 * pixels,
        scratch=8 * pixels if passes > 1 else 0,
    )

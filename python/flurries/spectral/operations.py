"""How much work a frame of the field is: counts of operations, in closed form.

They say which of two ways of making one film is cheaper, and how long it may take. The counts are
those of ``src/spectral/dense.rs`` and ``tile.rs``; the band's waves are counted as lattice points
of an annulus, without listing them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

# As in the kernels.
_LANES = 16
_COLUMNS = 8
_DENSE_ADVANTAGE = 1.5
_MOST_WAVES = 30_000


class TileWork(NamedTuple):
    """The work of one tile.

    Attributes
    ----------
    bins : float
        Places of the spectrum that get a phase.
    dense, fft : float
        Multiply-adds of the dense products or floating-point operations of the FFTs; one is 0.
    pixels : float
        Of the tile.
    planned : float
        Bins looked at to list the waves, for bands too large for the plan to be kept; else 0.
    """

    bins: float
    dense: float
    fft: float
    pixels: float
    planned: float


def _padded(n: int) -> int:
    return -(-n // _LANES) * _LANES


def _sums(n: int) -> int:
    halves, quarters = _padded(-(-n // 2)), _padded(n // 4)
    return quarters if n % 4 == 0 and quarters < halves else halves


def tile_work(tile: tuple[int, int], wavelengths: tuple[float, float]) -> TileWork:
    """Return the work of one tile of (rows, cols) pixels for a band."""
    height, width = tile
    shortest, longest = wavelengths
    reach, across = (min(math.ceil(n / shortest) - 1, n // 2) for n in tile)
    half, columns = reach + 1, across + 1
    stride = -(-columns // _COLUMNS) * _COLUMNS
    dense = 4.0 * stride * half * _sums(height) + 2.0 * stride * height * _sums(width)
    fft = 5.0 * columns * height * max(math.log2(height), 1.0)
    fft += 2.5 * height * width * max(math.log2(width), 1.0)
    waves = 0.5 * math.pi * height * width * (shortest**-2 - longest**-2)
    taken = dense < _DENSE_ADVANTAGE * fft
    return TileWork(
        bins=float(stride * 2 * half),
        dense=dense if taken else 0.0,
        fft=0.0 if taken else fft,
        pixels=float(height * width),
        planned=float(columns * (2 * reach + 1)) if waves > _MOST_WAVES else 0.0,
    )


def tiles_touching(start: int, end: int, length: int, tile: int, overlap: int) -> range:
    """Return the tiles along an axis that touch pixels start to end."""
    step = tile - overlap
    count = 1 if length <= tile else -(-(length - overlap) // step)
    first = max(-(-(start - tile + 1) // step), 0)
    return range(first, min(-(-end // step), count))


def smooth(n: int) -> bool:
    """Whether an FFT of n values is fast: no prime factor above 7."""
    for prime in (2, 3, 5, 7):
        while n % prime == 0:
            n //= prime
    return n == 1

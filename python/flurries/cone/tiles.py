"""Toroidal textures of rain and snow, and the filtered tables made of them as they are needed."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    ArrayLike,
    Float64,
    aligned,
    float_dtype,
    integer,
    output,
    real,
    seed_of,
)
from flurries.cone.sheet import LARGEST_TILE, texture_of

# Streams of counter-based numbers: places, sizes, opacities.
ACROSS, ALONG, SIZE, OPACITY = 311, 312, 313, 314

MOST_DROPS = 1_000_000


def rain_tile(
    size: int, *, seed: int, drops: int = 220, width: float = 0.003, length: float = 0.03,
    spread: float = 0.5, opacity: float = 0.8, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Return a toroidal texture of raindrops, (n, n): ``1 - prod(1 - alpha_i)``, without an edge.

    Parameters
    ----------
    size, drops : int
        n, texels to a side, 4 to 4096; and how many drops.
    width, length : float
        Of a drop, in tiles: two sigma of a Gaussian, below a texel wider and fainter; and along the
        axis, 0 to 0.5, which the cone's `stretch` makes longer.
    spread : float
        Spread of sizes, 0 to 1: drops are ``1 - spread / 2`` to ``1 + spread / 2`` times as large.
    opacity : float
        Opacity in the middle of a drop, 0 to 1, with the same spread.
    """
    rows = _sprites(size, "drops", drops, seed, width, spread, opacity)
    rows[:, 3] = 0.5 * size * real("length", length, low=0.0, high=0.5)
    rows[:, 3] *= rows[:, 2] / max(0.5 * size * width, 1e-300)
    return _drawn(size, rows, dtype, out)


def snow_tile(
    size: int, *, seed: int, flakes: int = 160, width: float = 0.012, spread: float = 0.9,
    opacity: float = 0.85, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return a toroidal texture of snowflakes: Gaussian discs.

    Arguments are those of :func:`rain_tile`; `width` is two sigma of a flake, tiles.
    """
    rows = _sprites(size, "flakes", flakes, seed, width, spread, opacity)
    return _drawn(size, rows, dtype, out)


def _sprites(
    size: int, name: str, many: int, seed: int, width: float, spread: float, opacity: float
) -> Float64:
    """Return rows (u, v, sigma, half length, opacity) in texels."""
    texels = integer("size", size, low=4, high=LARGEST_TILE)
    count = integer(name, many, low=0, high=MOST_DROPS)
    chosen = seed_of(seed)
    draw = np.empty((4, count))
    for row, stream in zip(draw, (ACROSS, ALONG, SIZE, OPACITY), strict=True):
        _core.uniform(row, chosen, stream)
    differ = real("spread", spread, low=0.0, high=1.0)
    peak = real("opacity", opacity, low=0.0, high=1.0)
    rows = np.zeros((count, 5))
    rows[:, 0], rows[:, 1] = texels * draw[0], texels * draw[1]
    rows[:, 2] = 0.5 * texels * real("width", width, above=0.0, high=1.0)
    rows[:, 2] *= 1.0 + differ * (draw[2] - 0.5)
    rows[:, 4] = peak * (1.0 - differ * draw[3] / 2.0)
    return rows


def _drawn(size: int, rows: Float64, dtype: npt.DTypeLike, out: Array | None) -> Array:
    result = output(out, (size, size), float_dtype(dtype))
    _core.cone_tile(result, aligned(rows, np.float64))
    return result


# Words of four neighbours: see src/cone/table.rs.
Table: TypeAlias = npt.NDArray[np.uint32]

# Memory of filtered tables that a texture keeps, in words.
MOST_WORDS = 1 << 26


class Texture:
    """A toroidal texture (n, n) of opacities, copied, and its filtered copies for many frames."""

    def __init__(self, tile: ArrayLike) -> None:
        self.tile = texture_of(tile).copy()
        self.tile.flags.writeable = False
        # Full scale of the tables; a texture without drops has no other.
        self._peak = float(self.tile.max()) or 1.0
        # A box larger than the tile is its mean: two levels to a factor of two.
        self._levels = 2 * math.ceil(math.log2(len(self.tile))) + 1
        self._tables: dict[tuple[int, int], Table] = {}

    def __reduce__(self) -> tuple[type[Texture], tuple[Array]]:
        return Texture, (np.array(self.tile),)

    def _table(self, across: int, along: int) -> Table:
        """Return the table of a level, made when first asked for."""
        found = self._tables.get((across, along))
        if found is not None:
            return found
        size = len(self.tile)
        width, height = 2.0 ** (0.5 * across), 2.0 ** (0.5 * along)
        # Two entries are at most half a box apart.
        shape = _power(min(size, 2.0 * size / height)), _power(min(size, 2.0 * size / width))
        entries = np.empty(shape, np.uint32)
        narrow = _narrowed(width, size, shape[1]), _narrowed(height, size, shape[0])
        _core.cone_table(entries, self.tile, narrow[0], narrow[1], self._peak)
        if sum(kept.size for kept in self._tables.values()) + entries.size > MOST_WORDS:
            # A new dictionary: another thread may be reading the old one.
            self._tables = {}
        self._tables[across, along] = entries
        return entries


def _narrowed(width: float, size: int, count: int) -> float:
    """Return the box, in texels, that looks `width` wide where `count` entries are gone between."""
    # Going linearly between entries h apart blurs by h^2 / 6 in the mean; a texel's own width is 1
    # / 12. What is left of the variance of a box over texels is that of shares of whole texels.
    step = size / count
    wanted = (width**2 + 1.0) / 12.0 - step**2 / 6.0
    low, high = 1.0, max(width, 1.0)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _shares(middle, step) < wanted else (low, middle)
    return 0.5 * (low + high)


def _shares(width: float, step: float) -> float:
    """Return the variance of a box over texels, around the place of an entry."""
    # Entries stand in the middle of texels, or for an even number to an entry between two.
    middle = 0.5 if step <= 1.0 else 0.5 * step % 1.0
    edges = np.arange(-math.ceil(width), math.ceil(width) + 1.0)
    low, high = np.maximum(edges, middle - width / 2), np.minimum(edges + 1, middle + width / 2)
    part = np.maximum(high - low, 0.0) / width
    return float(part @ (edges + 0.5 - middle) ** 2)


def _power(count: float) -> int:
    """Return the least power of two that is not less, 2 at least."""
    return max(2, int(2 ** math.ceil(math.log2(count) - 1e-9)))

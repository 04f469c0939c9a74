"""A tile of a cone's texture, and the filtered tables that are made of it as they are needed."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array
from flurries.cone.sheet import texture_of

__all__ = ["Texture"]

# Words of four neighbours: see src/cone/table.rs.
Table: TypeAlias = npt.NDArray[np.uint32]

# Memory of filtered tables that a texture keeps, in words.
MOST_WORDS = 1 << 26


class Texture:
    """A toroidal texture and its filtered copies, for use in many frames.

    Parameters
    ----------
    tile : (n, n)
        Opacities, 0 to 1; copied.
    """

    def __init__(self, tile: npt.ArrayLike) -> None:
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

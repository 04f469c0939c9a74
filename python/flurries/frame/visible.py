"""Where anything of the weather can be seen: not behind what stands in front of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries._contract import Array
from flurries.spectral.tiles import tile_starts

Window = tuple[int, int, int, int]


class Visible:
    """The pixels that a cover (H, W) does not hide wholly, and the tiles that have any of them."""

    def __init__(self, cover: Array) -> None:
        self._seen = cover < 1.0

    def within(self, window: Window) -> Window | None:
        """Return the smallest window that has all visible pixels of one, or None without any."""
        top, bottom, left, right = window
        seen = self._seen[top:bottom, left:right]
        rows, cols = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        if len(rows) == 0:
            return None
        return (
            top + int(rows[0]),
            top + int(rows[-1]) + 1,
            left + int(cols[0]),
            left + int(cols[-1]) + 1,
        )

    def tiles(self, tile: tuple[int, int], overlap: int) -> npt.NDArray[np.bool_]:
        """Return the tiles that have a visible pixel, (rows, cols) bool."""
        height, width = self._seen.shape
        rows = tile_starts(height, tile=tile[0], overlap=overlap)
        cols = tile_starts(width, tile=tile[1], overlap=overlap)
        bands = [self._seen[:, x : x + tile[1]].any(axis=1) for x in cols]
        columns = np.stack(bands, axis=1)
        return np.stack([columns[y : y + tile[0]].any(axis=0) for y in rows])

"""Windows of a picture, where weather can be seen in them, and the bands of a large one."""

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array
from flurries.spectral.tiles import tile_starts

Window = tuple[int, int, int, int]

# Frames of more pixels than this are made in bands: what a frame is mixed of is larger than it.
WHOLE = 1 << 21

# Pixels of a band, and what its rows are a multiple of: flakes and gas come in tiles of 64 px.
BAND = 1 << 21
_ROWS = 64


def bands_of(window: Window) -> list[Window]:
    """Return the bands of a window from the top down; itself if it is small."""
    top, bottom, left, right = window
    if (bottom - top) * (right - left) <= WHOLE:
        return [window]
    rows = max(BAND // (right - left) // _ROWS, 1) * _ROWS
    # Cut where tiles begin in the frame, whatever the window.
    cuts = range(top // rows * rows, bottom, rows)
    return [(max(cut, top), min(cut + rows, bottom), left, right) for cut in cuts]


def common(first: Window, second: Window) -> Window | None:
    """Return the part that two windows have in common, or None."""
    top, left = max(first[0], second[0]), max(first[2], second[2])
    bottom, right = min(first[1], second[1]), min(first[3], second[3])
    return (top, bottom, left, right) if top < bottom and left < right else None


def within(inner: Window, outer: Window) -> Window:
    """Return a window counted from the first pixel of the one around it."""
    top, left = outer[0], outer[2]
    return inner[0] - top, inner[1] - top, inner[2] - left, inner[3] - left


def crop(plane: Array, window: Window) -> Array:
    top, bottom, left, right = window
    return plane[top:bottom, left:right]


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
        down, across = int(rows[0]), int(cols[0])
        return top + down, top + int(rows[-1]) + 1, left + across, left + int(cols[-1]) + 1

    def tiles(self, tile: tuple[int, int], overlap: int) -> npt.NDArray[np.bool_]:
        """Return the tiles that have a visible pixel, (rows, cols) bool."""
        return by_tiles(self._seen, tile, overlap, np.any)


def by_tiles(plane: Array, tile: tuple[int, int], overlap: int, pick: Any) -> Array:
    """Return what is picked of the pixels of each tile, (rows, cols)."""
    rows = tile_starts(plane.shape[0], tile=tile[0], overlap=overlap)
    cols = tile_starts(plane.shape[1], tile=tile[1], overlap=overlap)
    # Of each run of columns first: a pixel is not read for every tile.
    runs = np.stack([pick(plane[:, x : x + tile[1]], axis=1) for x in cols], axis=1)
    return np.stack([pick(runs[y : y + tile[0]], axis=0) for y in rows])

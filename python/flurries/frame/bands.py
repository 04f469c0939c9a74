"""Windows of a picture, where weather can be seen in them, and the bands of a large one.

The picture that the layers are mixed in, the layers, and what encoding makes on the way are several
times as large as the frame that is asked for. Of a large one only a band of each is ever held.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries._contract import Array
from flurries.spectral.tiles import tile_starts

Window = tuple[int, int, int, int]

# Frames of more pixels than this are made in bands.
WHOLE = 1 << 21

# Pixels of a band, and what its rows are a multiple of: flakes and gas come in tiles of 64 px.
BAND = 1 << 21
_ROWS = 64


def bands_of(window: Window) -> list[Window]:
    """Return the bands of a window from the top down; itself if it is small."""
    top, bottom, left, right = window
    if area(window) <= WHOLE:
        return [window]
    rows = max(BAND // (right - left) // _ROWS, 1) * _ROWS
    # Cut where tiles begin in the frame, whatever the window.
    cuts = range(top // rows * rows, bottom, rows)
    return [(max(cut, top), min(cut + rows, bottom), left, right) for cut in cuts]


def whole(shape: tuple[int, int]) -> Window:
    """Return the window of a whole frame of (H, W)."""
    return 0, shape[0], 0, shape[1]


def shape_of(window: Window) -> tuple[int, int]:
    """Return (h, w) of a window."""
    top, bottom, left, right = window
    return bottom - top, right - left


def area(window: Window | None) -> int:
    """Return the pixels of a window; 0 of none."""
    return 0 if window is None else (window[1] - window[0]) * (window[3] - window[2])


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
    """Return the window of a plane or picture."""
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

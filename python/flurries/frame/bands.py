"""Windows of a picture, and the bands of rows that a large one is made in.

The picture that the layers are mixed in, the layers, and what encoding makes on the way are several
times as large as the frame that is asked for. Of a large one only a band of each is ever held.
"""

from __future__ import annotations

from flurries._contract import Array
from flurries.frame.visible import Window

# Frames of more pixels than this are made in bands.
WHOLE = 1 << 20

# Pixels of a band, and what its rows are a multiple of: flakes and gas come in tiles of 64 px.
BAND = 1 << 19
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

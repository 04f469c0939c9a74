"""Tables of waves of the caller's own: an envelope that is even in k, rates that are odd."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, bounded, table

# Of the largest rate: how far a table of rates may be from odd, which is rounding.
_ROUNDING = 1e-9


def amplitude_of(tile: tuple[int, int], envelope: npt.ArrayLike) -> Float64:
    """Return amplitudes, even in k, 0 at dc, whose squares sum to 1."""
    given = _of_tile("envelope", envelope, tile)
    if (given < 0.0).any():
        raise ValueError(f"envelope must be 0 or more, got {given.min():g}")
    # A real field has its waves in pairs: what is given for one half stands for both.
    even = given + _mirrored(given)
    even[0, 0] = 0.0
    largest = even.max()
    if largest <= 0.0:
        raise ValueError("envelope must have a wave besides that of frequency 0, got none")
    even /= largest
    power: Float64 = even / np.sqrt((even**2).sum())
    return power


def odd_rate(tile: tuple[int, int], rate: npt.ArrayLike) -> Float64:
    """Return rates of waves, with the pairs of waves of a real field turning alike."""
    given = _of_tile("rate", rate, tile)
    rest = given + _mirrored(given)
    # A wave of half a cycle per pixel is its own mirror along that axis, which keeps no sign.
    for axis, side in enumerate(tile):
        if side % 2 == 0:
            np.moveaxis(rest, axis, 0)[side // 2] = 0.0
    worst = np.unravel_index(np.abs(rest).argmax(), rest.shape)
    if np.abs(rest[worst]) > _ROUNDING * max(np.abs(given).max(), 1.0):
        row, col = (int(i) for i in worst)
        raise ValueError(
            "rate must be odd, rate[-row, -col] = -rate[row, col], since the field is real; "
            f"got {given[row, col]:g} at [{row}, {col}] and {given[-row, -col]:g} at its mirror"
        )
    odd: Float64 = 0.5 * (given - _mirrored(given))
    return odd


def _of_tile(name: str, value: npt.ArrayLike, tile: tuple[int, int]) -> Float64:
    array = table(name, value)
    if array.shape != tile:
        raise ValueError(f"{name} must have the shape of a tile, {tile}, got {array.shape}")
    return bounded(name, array)


def _mirrored(waves: Float64) -> Float64:
    """Return the value at -k for every k, in fftfreq order."""
    return np.roll(waves[::-1, ::-1], 1, axis=(0, 1))

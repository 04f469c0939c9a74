"""A frame of the field with a spectrum and a motion of the caller's own, tile by tile.

The kernel knows one band and one law of motion. Here both are tables, so that any noise that moves
can be made of the same tiles with the same phases: clouds of waves (Motion Clouds), water, smoke.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import LARGEST, Array, Float64, bounded, real, table
from flurries.spectral.tables import band_amplitude, random_phase, temporal_gain, tent_rate
from flurries.spectral.tiles import Blend, blend_tiles, starts

if TYPE_CHECKING:
    from flurries.spectral.request import Request
    from flurries.spectral.texture import Texture

# Of the largest rate: how far a table of rates may be from odd, which is rounding.
_ROUNDING = 1e-9

# A wave as long as the limit counts as too short, whatever the rounding of its length.
_EQUAL = 1.0 + 1e-12


class Own(NamedTuple):
    """A spectrum and a motion, checked: amplitudes, cycles per frame, and cycles until now."""

    amplitude: Float64
    rate: Float64
    turns: Float64


def own_of(asked: Request, texture: Texture, time: float) -> Own | None:
    """Return the caller's own band and tent; None where nothing is given."""
    now = real("time", time, low=-LARGEST, high=LARGEST)
    envelope, rate = texture.envelope, texture.rate
    if rate is None and now != 0.0:
        raise ValueError(
            f"time must be 0 without a texture's rate, since drift says the rest, got {now:g}"
        )
    if not texture.is_own:
        return None
    amplitude = (
        band_amplitude(asked.tile, wavelengths=asked.wavelengths, exponent=asked.exponent)
        if envelope is None
        else amplitude_of(asked.tile, envelope)
    )
    turning = np.zeros(asked.tile) if rate is None else odd_rate(asked.tile, rate)
    turns = turning * now
    return Own(amplitude, turning, turns - np.rint(turns))


def own_field(asked: Request, own: Own, result: Array) -> None:
    """Write the field of a checked request into `result`; see `spectral.field`."""
    amplitude, turning, turns = own
    fy, fx, length = _waves(asked.tile)
    longest = asked.wavelengths[1]
    filtered = asked.alias != "keep" or asked.shutter > 0.0
    rows, cols = (
        len(starts(n, side, asked.overlap)) for n, side in zip(asked.shape, asked.tile, strict=True)
    )
    motion = {
        name: _by_tile(name, getattr(asked, name), (rows, cols))
        for name in ("drift", "shift", "velocity", "shift_rate")
    }
    nearest = asked.shortest
    if nearest is not None and nearest.shape != (rows, cols):
        raise ValueError(f"shortest must have shape {(rows, cols)}, got {nearest.shape}")
    tiles = np.empty((rows, cols, *asked.tile), result.dtype)
    for place in np.ndindex(rows, cols):
        waves = amplitude
        if filtered:
            passing = turning + tent_rate(
                asked.tile, motion["velocity"][place], wavelength_max=longest
            )
            across, down = motion["shift_rate"][place]
            passing -= fx * across + fy * down
            waves = waves * temporal_gain(
                passing, alias=asked.alias, soft_from=asked.soft_from, shutter=asked.shutter
            )
        if nearest is not None:
            waves = np.where(length > nearest[place] * _EQUAL, waves, 0.0)
        phase = random_phase(asked.tile, seed=asked.seed, tile=(place[0], place[1])) + turns
        moved = np.empty(asked.tile)
        cycles = motion["drift"][place] / longest
        _core.advance_phase(moved, phase, cycles.tolist(), motion["shift"][place].tolist())
        _core.inverse_transform(tiles[place], np.ascontiguousarray(waves), moved)
    blend_tiles(
        tiles, asked.shape, overlap=asked.overlap, blend=cast("Blend", asked.blend), out=result
    )


def _waves(tile: tuple[int, int]) -> tuple[Float64, Float64, Float64]:
    """Return fy and fx in cycles per pixel, 0 where one is its own mirror, and wavelengths."""
    fy, fx = np.meshgrid(*map(np.fft.fftfreq, tile), indexing="ij")
    with np.errstate(divide="ignore"):
        length = 1.0 / np.hypot(fy, fx)
    return np.where(fy == -0.5, 0.0, fy), np.where(fx == -0.5, 0.0, fx), length


def _by_tile(name: str, vectors: Float64, grid: tuple[int, int]) -> Float64:
    """Return (rows, cols, 2) of what a request has for all tiles or for each."""
    if vectors.shape[:2] not in ((1, 1), grid):
        raise ValueError(
            f"{name} must have shape (2,) or {(*grid, 2)} for these tiles, got "
            f"{(*vectors.shape[:2], 2)}"
        )
    each: Float64 = np.broadcast_to(vectors[:, :, 0], (*grid, 2))
    return each


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
    return np.roll(waves[::-1, ::-1], 1, axis=(0, 1))

"""The texture of a slice of mist: one slope from the size of a frame down to four pixels.

The amplitudes of its waves fall as k^(-11/6), so that nearly all of the power is in long waves.
These are made at a quarter of the frame's size, where one tile holds all of it and has no seams;
what is shorter, one or two per cent of the power, by small tiles at the frame's own size, for half
of the slices at a time.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.camera.lens import Camera
from flurries.camera.tiles import tile_drift, tile_shift
from flurries.effects.motion import comes_nearer
from flurries.frame.view import Frame
from flurries.motion.keys import Vector
from flurries.spectral.request import request

# Amplitudes fall as k^(-11/6), their squares as k^(-11/3), down to waves of 4 px.
EXPONENT, SHORTEST = 11.0 / 6.0, 4.0

# Waves of at least so many pixels are made on a coarse grid, one of whose samples is 4 px.
LONG, COARSE = 32.0, 4

# Tiles and what they share, px of their grid: the largest of the coarse one, that where the air
# comes nearer and flows apart, and those of the short waves.
TILE, APART, FINE = 1024, (128, 32), (64, 10)

# Coarse samples beyond the frame on each side, which smoothing takes.
_MARGIN = 2

# Seeds of the slices lie this far apart; those of short waves begin beyond them.
_STRIDE, _SHORT = 7919, 1_000_003


def long_waves(frame: Frame, wind: Vector, spread: float, depth: float, number: int) -> Array:
    """Return the density of a slice over its mean in its long waves, (H, W) float32, mean 1."""
    height, width = frame.shape
    shape = (-(-height // COARSE) + 2 * _MARGIN, -(-width // COARSE) + 2 * _MARGIN)
    tile, overlap = _tiles(frame, wind, shape)
    seed = (frame.seed + _STRIDE * number) % 2**62
    band = (LONG / COARSE, float(max(tile)))
    field = _field(frame, wind, depth, shape, (tile, overlap), band, seed, 1.0 / COARSE)
    # A logarithm of mean -v/2 and variance v has the mean 1.
    variance = spread * spread * (1.0 - short_share(tile))
    field *= np.float32(math.sqrt(variance))
    field -= np.float32(0.5 * variance)
    np.exp(field, out=field)
    smooth = _doubled(_doubled(_doubled(_doubled(field, 1), 1), 0), 0)
    # Their first sample that is the frame's own.
    first = COARSE * _MARGIN - 3
    rows, columns = slice(first, first + height), slice(first, first + width)
    return np.ascontiguousarray(smooth[rows, columns], np.float32)


def short_waves(frame: Frame, wind: Vector, spread: float, depth: float, half: int) -> Array:
    """Return the factor of density that the short waves of some slices are, (H, W) float32."""
    height, width = frame.shape
    shape = (-(-height // COARSE) + 2 * _MARGIN, -(-width // COARSE) + 2 * _MARGIN)
    share = short_share(_tiles(frame, wind, shape)[0])
    seed = (frame.seed + _STRIDE * half + _SHORT) % 2**62
    field = _field(frame, wind, depth, frame.shape, FINE, (SHORTEST, LONG), seed, 1.0)
    # The exponential of something so small.
    field *= np.float32(spread * math.sqrt(share))
    field += np.float32(1.0)
    np.maximum(field, np.float32(0.0), out=field)
    return field


@lru_cache(maxsize=32)
def short_share(tile: tuple[int, int]) -> float:
    """Return the share of the power below `LONG`, for a tile of the coarse grid."""
    height, width = (side * COARSE for side in tile)
    ky = np.arange(-(height // LONG), height // LONG + 1.0) / height
    kx = np.arange(-(width // LONG), width // LONG + 1.0) / width
    k = np.hypot(ky[:, None], kx[None, :])
    # As much for each wave as there is room for in the plane of waves.
    room = 1.0 / (height * width)
    long_power = room * float((k[(k > 0.0) & (k <= 1.0 / LONG)] ** (-2.0 * EXPONENT)).sum())
    power = 2.0 - 2.0 * EXPONENT
    short_power = 2.0 * math.pi / -power * (LONG**-power - SHORTEST**-power)
    return float(short_power / (short_power + long_power))


def _tiles(frame: Frame, wind: Vector, shape: tuple[int, int]) -> tuple[tuple[int, int], int]:
    """Return tile and overlap of the coarse grid: one tile, if the view moves as one."""
    path = frame.path
    axis = frame.camera.matrix()[:, 2]
    flows = path.turns or path.zooms or comes_nearer(path, axis, 0.0, wind)
    if max(shape) > TILE or (flows and max(shape) > APART[0]):
        return (APART[0], APART[0]), APART[1]
    down, across = (_quick(side) for side in shape)
    return (down, across), 0


def _quick(side: int) -> int:
    """Return the next even size that a Fourier transform is quick for."""
    side = max(side + side % 2, 16)
    while _rest(side) > 1:
        side += 2
    return side


def _rest(size: int) -> int:
    """Return what is left of a size without its factors 2, 3 and 5."""
    for factor in (2, 3, 5):
        while size % factor == 0:
            size //= factor
    return size


def _field(
    frame: Frame, wind: Vector, depth: float, shape: tuple[int, int], tiles: tuple[Any, int],
    band: tuple[float, float], seed: int, scale: float,
) -> Array:  # fmt: skip
    """Return a field of variance 1 that moves as the air does at a depth, on a grid."""

    def shift_at(then: Frame) -> Float64:
        return _shift(then, wind, depth, shape, tiles, scale)

    asked = request(
        shape, drift=(0.0, 0.0), shift=shift_at(frame), seed=seed, wavelengths=band,
        exponent=EXPONENT, tile=tiles[0], overlap=tiles[1],
    )  # fmt: skip
    lap = frame.lap
    if lap is not None:
        begin, end = (shift_at(frame.later(t - frame.t)) for t in (lap.first, lap.end))
        whole = np.ascontiguousarray((end - begin)[:, :, None])
        asked = asked._replace(lap=(np.zeros_like(whole), whole, lap.part(frame.t)))
    field = np.empty(shape, np.float32)
    _core.field(field, asked, None, False)
    return field


def _shift(
    frame: Frame, wind: Vector, depth: float, shape: tuple[int, int], tiles: tuple[Any, int],
    scale: float,
) -> Float64:  # fmt: skip
    """Return how far what is at a depth has moved at each tile of a grid, (rows, cols, 2)."""
    eye = frame.camera
    camera = eye if scale == 1.0 else _coarse(eye, frame.shape, scale)
    sizes: dict[str, Any] = {"tile": tiles[0], "overlap": tiles[1]}
    shift = tile_drift(shape, frame.travel(wind=wind), camera, near_depth=depth, **sizes)
    if frame.path.turns:
        shift = shift + tile_shift(shape, frame.rotation(), camera, **sizes)
    return np.asarray(shift + scale * np.array(eye.center_shift))


def _coarse(eye: Camera, shape: tuple[int, int], scale: float) -> Camera:
    """Return the eye before the coarse grid."""
    cx, cy = (
        scale * (at - aside) + _MARGIN
        for at, aside in zip(eye.principal(shape), eye.center_shift, strict=True)
    )
    aside = (scale * eye.center_shift[0], scale * eye.center_shift[1])
    return eye.derive(focal=scale * eye.focal, center=(cx, cy), center_shift=aside)


def _doubled(samples: Array, axis: int) -> Array:
    """Return twice as many samples along an axis, without the half ones at the ends.

    Twice over this is a quadratic spline, to whose corners no ghosts of the coarse grid stick.
    """
    low, high = (
        samples[:-1] if axis == 0 else samples[:, :-1],
        samples[1:] if axis == 0 else samples[:, 1:],
    )
    shape = list(samples.shape)
    shape[axis] = 2 * (shape[axis] - 1)
    result = np.empty(shape, np.float32)
    difference = np.float32(0.25) * (high - low)
    first = result[0::2] if axis == 0 else result[:, 0::2]
    second = result[1::2] if axis == 0 else result[:, 1::2]
    np.add(low, difference, out=first)
    np.subtract(high, difference, out=second)
    return result

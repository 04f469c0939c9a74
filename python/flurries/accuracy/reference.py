"""The texture's slow reference, written from the equations; extended precision where there is one.

It takes the tables of hashed phases from the package, since those are data, and nothing else.
"""

from __future__ import annotations

import numpy as np

from flurries import spectral
from flurries._contract import Array

Long = np.longdouble
HALF_TURN = np.arctan2(Long(0), Long(-1))

Band = tuple[float, float]


def waves(size: int) -> tuple[Array, Array, Array]:
    """Return (ky, kx, |k|) of a square tile in fftfreq order."""
    k = np.fft.fftfreq(size, 1.0 / size).astype(Long)
    ky, kx = np.meshgrid(k, k, indexing="ij")
    return ky, kx, np.sqrt(ky * ky + kx * kx)


def amplitude(size: int, band: Band) -> Array:
    """Return 1/|k| in the band, squares summing to 1."""
    length = waves(size)[2]
    inside = (length * Long(band[0]) < size) & (length * Long(band[1]) >= size)
    result = np.zeros_like(length)
    result[inside] = 1 / length[inside]
    return np.asarray(result / np.sqrt(np.sum(result**2)))


def torus(size: int, seed: int, drift: Array, band: Band, place: tuple[int, int] = (0, 0)) -> Array:
    """Return a tile after a drift (x, y) px of the longest wave: the real part of its sum."""
    ky, kx, length = waves(size)
    length[0, 0] = 1
    moved = (Long(drift[0]) * kx + Long(drift[1]) * ky) / (length * Long(band[1]))
    turns = spectral.random_phase((size, size), seed=seed, tile=place).astype(Long) - moved
    angle = 2 * HALF_TURN * (turns - np.floor(turns))
    spectrum = amplitude(size, band) * (np.cos(angle) + 1j * np.sin(angle))
    return np.asarray(np.fft.ifft2(spectrum, norm="forward").real)


def field(
    shape: tuple[int, int],
    *,
    drift: Array,
    seed: int,
    tile: int = 64,
    overlap: int = 10,
    band: Band = (4.0, 32.0),
) -> Array:
    """Return a frame of tiles blended by powers (Langer 2004, section 5)."""
    step = tile - overlap
    down, across = (_weights(length, tile, overlap) for length in shape)
    picture = np.zeros((len(down) * step + overlap, len(across) * step + overlap), Long)
    for row, vertical in enumerate(down):
        for col, level in enumerate(across):
            one = torus(tile, seed, drift, band, (row, col))
            y, x = row * step, col * step
            picture[y : y + tile, x : x + tile] += vertical[:, None] * level * one
    return picture[: shape[0], : shape[1]]


def _weights(length: int, tile: int, overlap: int) -> Array:
    """Return a row of weights for each tile of a line; their squares sum to 1 at every pixel."""
    step = tile - overlap
    count = 1 if length <= tile else -(-(length - tile) // step) + 1
    i = np.arange(tile, dtype=Long) + Long(0.5)
    ramp = np.minimum(1, np.minimum(i, tile - i) / overlap) if overlap else np.ones(tile, Long)
    share = np.sin(HALF_TURN / 2 * ramp) ** 2
    total = np.zeros((count - 1) * step + tile, Long)
    for n in range(count):
        total[n * step : n * step + tile] += share
    return np.stack([np.sqrt(share / total[n * step : n * step + tile]) for n in range(count)])

"""Slow references, written from the equations; extended precision where the platform has it.

They take the tables of hashed phases from the package, since those are data, and nothing else.
"""

from __future__ import annotations

import numpy as np

from flurries import spectral
from flurries._contract import Array

Long = np.longdouble


def waves(size: int) -> tuple[Array, Array, Array]:
    """Return (ky, kx, |k|) of a square tile in fftfreq order, extended precision."""
    k = np.fft.fftfreq(size, 1.0 / size).astype(Long)
    ky, kx = np.meshgrid(k, k, indexing="ij")
    return ky, kx, np.sqrt(ky * ky + kx * kx)


def amplitude(size: int, band: tuple[float, float], exponent: float = 1.0) -> Array:
    """Return 1/|k|^exponent in the band, squares summing to 1."""
    length = waves(size)[2]
    inside = (length * Long(band[0]) < size) & (length * Long(band[1]) >= size)
    result = np.zeros_like(length)
    result[inside] = length[inside] ** Long(-exponent)
    return np.asarray(result / np.sqrt(np.sum(result**2)))


def phase(size: int, seed: int, tile: tuple[int, int], drift: Array, longest: float) -> Array:
    """Return the phases in cycles after a drift (x, y) px of the longest wave."""
    ky, kx, length = waves(size)
    length[0, 0] = 1
    start = spectral.random_phase((size, size), seed=seed, tile=tile).astype(Long)
    moved = (Long(drift[0]) * kx + Long(drift[1]) * ky) / (length * Long(longest))
    return np.asarray(start - moved)


def transform(amplitudes: Array, phases: Array) -> Array:
    """Return the real part of the unnormalised inverse transform."""
    turns = phases - np.floor(phases)
    angle = 2 * np.arctan2(Long(0), Long(-1)) * turns
    spectrum = amplitudes * (np.cos(angle) + 1j * np.sin(angle))
    return np.asarray(np.fft.ifft2(spectrum, norm="forward").real)


def torus(size: int, seed: int, drift: Array, band: tuple[float, float]) -> Array:
    """Return one tile."""
    return transform(amplitude(size, band), phase(size, seed, (0, 0), drift, band[1]))


def field(
    shape: tuple[int, int],
    *,
    drift: Array,
    seed: int,
    tile: int = 64,
    overlap: int = 10,
    band: tuple[float, float] = (4.0, 32.0),
) -> Array:
    """Return a frame of tiles blended by powers (Langer 2004, section 5)."""
    across, down = (_weights(length, tile, overlap) for length in (shape[1], shape[0]))
    picture = np.zeros((len(down) * (tile - overlap) + overlap,
                        len(across) * (tile - overlap) + overlap), Long)  # fmt: skip
    amplitudes = amplitude(tile, band)
    for row, vertical in enumerate(down):
        for col, level in enumerate(across):
            one = transform(amplitudes, phase(tile, seed, (row, col), drift, band[1]))
            y, x = row * (tile - overlap), col * (tile - overlap)
            picture[y : y + tile, x : x + tile] += vertical[:, None] * level[None, :] * one
    return picture[: shape[0], : shape[1]]


def _weights(length: int, tile: int, overlap: int) -> Array:
    step = tile - overlap
    count = 1 if length <= tile else -(-(length - tile) // step) + 1
    i = np.arange(tile, dtype=Long)
    ramp = np.ones(tile, Long)
    if overlap:
        ramp = np.minimum(1, np.minimum((i + 0.5) / overlap, (tile - i - 0.5) / overlap))
    share = np.sin(np.arctan2(Long(0), Long(-1)) / 2 * ramp) ** 2
    total = np.zeros((count - 1) * step + tile, Long)
    for n in range(count):
        total[n * step : n * step + tile] += share
    return np.stack([np.sqrt(share / total[n * step : n * step + tile]) for n in range(count)])

"""The axes of the texture's arithmetic: precision, modes, the shutter, the two methods.

The reference is the sum of waves in extended precision. It takes the table of hashed phases from
the package, since that is data, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries._threads import reproducible, set_reproducible
from flurries.accuracy.ways import Way, axis, both, largest, rms

Long = np.longdouble
HALF_TURN = np.arctan2(Long(0), Long(-1))

SIZE, BAND = 256, (4.0, 32.0)
DRIFT = np.array([37.25, 411.5])
frame: Callable[..., Array] = partial(spectral.field, (SIZE, SIZE), seed=7, tile=SIZE, overlap=0)


def amplitude(size: int, band: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Return 1/|k| in the band, squares summing to 1, and (ky, kx) / |k|, in fftfreq order."""
    k = np.fft.fftfreq(size, 1.0 / size).astype(Long)
    ky, kx = np.meshgrid(k, k, indexing="ij")
    length = np.hypot(ky, kx)
    length[0, 0] = 1
    inside = (length * Long(band[0]) < size) & (length * Long(band[1]) >= size)
    inside[0, 0] = False
    share = inside / length
    return share / np.sqrt(np.sum(share**2)), ky / length, kx / length


def torus(size: int, seed: int, drift: Array, band: tuple[float, float] = BAND) -> Array:
    """Return a tile after a drift (x, y) px of the longest wave: the real part of its sum."""
    share, down, right = amplitude(size, band)
    moved = (Long(drift[0]) * right + Long(drift[1]) * down) / Long(band[1])
    turns = spectral.random_phase((size, size), seed=seed).astype(Long) - moved
    angle = 2 * HALF_TURN * (turns - np.floor(turns))
    spectrum = share * (np.cos(angle) + 1j * np.sin(angle))
    return np.asarray(np.fft.ifft2(spectrum, norm="forward").real)


@axis("in sigma, largest", "phases and transform in extended precision")
def precision() -> Iterator[Way]:
    """Precision, kernels and modes of the texture, one tile of 256 px."""
    off = largest(torus(SIZE, 7, DRIFT))
    fused = partial(frame, drift=DRIFT)
    yield from both("field", fused, off)
    yield from both("field, reproducible", partial(_reproducible, fused), off)
    yield from both("step by step", _steps, off)
    yield from both("plain NumPy", _plain, off)


def _reproducible(make: Any, dtype: Any) -> Any:
    before = reproducible()
    set_reproducible(True)
    try:
        return make(dtype=dtype)
    finally:
        set_reproducible(before)


def _steps(dtype: Any) -> Array:
    shape = (SIZE, SIZE)
    phase = spectral.advance_phase(spectral.random_phase(shape, seed=7), DRIFT)
    return spectral.inverse_transform(spectral.band_amplitude(shape), phase, dtype=dtype)


def _plain(dtype: Any) -> Array:
    """Return a tile all in one precision, the phase too."""
    half = (slice(None), slice(SIZE // 2 + 1))
    share, down, right = (part[half].astype(dtype) for part in amplitude(SIZE, BAND))
    moved = (DRIFT[0].astype(dtype) * right + DRIFT[1].astype(dtype) * down) / dtype(BAND[1])
    start = spectral.random_phase((SIZE, SIZE), seed=7)[half]
    turns = (2 * np.pi * (start - moved)).astype(dtype)
    spectrum = share * (np.cos(turns) + 1j * np.sin(turns))
    whole = spectrum.astype(np.result_type(dtype, np.complex64))
    return np.fft.irfft2(whole, s=(SIZE, SIZE), norm="forward").astype(dtype)


@axis("in sigma, rms", "16 Gauss-Legendre nodes over the exposure")
def shutter() -> Iterator[Way]:
    """Shutter by sinc or by sub-frames, 256 x 256."""
    velocity = np.array([2.0, 8.0])
    # Waves turn by a quarter of a cycle at most: 16 nodes are exact to the last bits.
    nodes, weights = np.polynomial.legendre.leggauss(16)
    moments = (torus(SIZE, 7, DRIFT + velocity * n / 2) for n in nodes)
    off = rms(np.asarray(sum(w / 2 * one for w, one in zip(weights, moments, strict=True))))

    def parts(count: int) -> Array:
        total = np.zeros((SIZE, SIZE), np.float32)
        for at in (np.arange(count) + 0.5) / count - 0.5:
            total += frame(drift=DRIFT + velocity * at)
        return np.asarray(total / np.float32(count))

    yield from both("sinc", partial(frame, drift=DRIFT, velocity=velocity, shutter=1.0), off)
    for count in (1, 2, 4, 8, 16, 64):
        yield Way(f"{count} sub-frames", partial(parts, count), off)


@axis("in sigma, rms", "the 2-D sum with unrounded rates, in extended precision")
def film() -> Iterator[Way]:
    """2-D method against 3-D method, 64 x 64."""
    velocity, count = np.array([0.5, 2.0]), 32
    off = rms(np.stack([torus(64, 5, velocity * t) for t in range(count)]))

    def flat(dtype: Any) -> Array:
        one = partial(spectral.field, (64, 64), seed=5, overlap=0, dtype=dtype)
        return np.stack([one(drift=velocity * t) for t in range(count)])

    yield from (way._replace(per=count) for way in both("2-D", flat, off))
    for length in (32, 64, 128, 256):
        solid = partial(spectral.volume, length, 64, velocity, seed=5)
        yield Way(f"3-D, {length} frames", solid, lambda made: off(made[:count]), length)

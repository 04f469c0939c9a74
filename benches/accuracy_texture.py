"""The axes of the texture: its arithmetic, and its look, whose errors are derived.

The reference is the sum of waves in extended precision. It takes the table of hashed phases from
the package, since that is data, and nothing else.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from accuracy_ways import Array, Way, axis, both, largest, rms

from flurries import reproducible, set_reproducible, spectral

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


# The look: octaves, tile size, blending -----------------------------------------------------------

SHAPE = (512, 512)
LAGS = np.arange(1, 33)


def _way(setting: str, error: float, **options: Any) -> Way:
    """Return a frame whose error does not depend on its pixels."""

    def make() -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return spectral.field(SHAPE, drift=(3.0, 11.0), seed=3, **options)

    return Way(setting, make, lambda _: error)


def continuum(low: float, high: float) -> Array:
    """Return the autocorrelation of a 1/f band of all directions: J0's mean over log frequency."""
    log_f = np.linspace(np.log(1.0 / high), np.log(1.0 / low), 2001)
    angle = (np.arange(256) + 0.5) * np.pi / 256.0
    across = 2.0 * np.pi * np.exp(log_f)[:, None] * np.cos(angle)
    bessel = np.array([np.cos(lag * across).mean(axis=1) for lag in LAGS])
    # The trapezoidal rule: the ends count half.
    return np.asarray((bessel[:, 1:] + bessel[:, :-1]).mean(axis=1) / 2.0)


def lattice(size: int, band: tuple[float, float]) -> Array:
    """Return the autocorrelation of a tile along x and along y: a sum over its waves."""
    along = np.asarray(amplitude(size, band)[0] ** 2, np.float64).sum(axis=0)
    return np.asarray(np.cos(2.0 * np.pi * np.outer(LAGS, np.fft.fftfreq(size))) @ along)


@axis("of the autocorrelation, rms", "the four-octave 1/f band in the continuum: an integral of J0")
def octaves() -> Iterator[Way]:
    """Octaves of waves, 512 x 512."""
    off = rms(continuum(2.0, 32.0))
    for count in (0.5, 1.0, 2.0, 3.0, 4.0):
        band = (32.0 / 2.0**count, 32.0)
        how: dict[str, Any] = {"tile": 128, "overlap": 20, "wavelengths": band}
        yield _way(f"{count:g} octaves, tile 128", off(lattice(128, band)), **how)


@axis("of the autocorrelation, rms", "the same band in the continuum")
def tile() -> Iterator[Way]:
    """Size of the tile, 512 x 512."""
    off = rms(continuum(4.0, 32.0))
    for size in (32, 48, 64, 96, 128, 256, 512):
        yield _way(f"tile {size}", off(lattice(size, (4.0, 32.0))), tile=size, overlap=size // 6)


@axis(
    "of the contrast", "contrast 1 everywhere, from the weights; and no waves finer than the band"
)
def blend() -> Iterator[Way]:
    """Overlap and blend law, 512 x 512."""
    for law, overlaps in (("power", (0, 4, 10, 20, 32)), ("linear", (4, 10, 20, 32))):
        for overlap in overlaps:
            how: dict[str, Any] = {"overlap": overlap, "blend": law}
            error = float(np.hypot(_uneven(**how), _leaked(**how)))
            yield _way(f"{law}, overlap {overlap}", error, **how)


def _uneven(**how: Any) -> float:
    """Return the distance of independent tiles' deviation from 1, by the squared weights."""
    length = 256
    count = len(spectral.tile_starts(length, overlap=how["overlap"]))
    share = np.zeros(length)
    for one in np.eye(count):
        tiles = np.broadcast_to(one[:, None, None, None], (count, 1, 64, 64)).copy()
        share += spectral.blend_tiles(tiles, (length, 64), **how)[:, 0] ** 2
    return rms(np.ones((length, length)))(np.sqrt(np.outer(share, share)))


def _leaked(**how: Any) -> float:
    """Return the amplitude below 6 px of a field whose shortest wave has 8 px; four frames."""
    how |= {"drift": (3.0, 11.0), "wavelengths": (8.0, 32.0), "dtype": np.float64}
    window = np.hanning(SHAPE[0] + 1)[:-1]
    fine = np.hypot(*np.meshgrid(*(np.fft.fftfreq(length) for length in SHAPE))) > 1.0 / 6.0
    fields = np.stack([spectral.field(SHAPE, seed=seed, **how) for seed in range(4)])
    power = np.abs(np.fft.fft2(fields * np.outer(window, window))) ** 2
    return float(np.sqrt(power[:, fine].sum() / power.sum()))

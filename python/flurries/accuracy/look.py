"""The axes of the texture's look: octaves, tile size, blending, shutter."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries.accuracy import reference
from flurries.accuracy.texture import DRIFT
from flurries.accuracy.ways import Way, axis, both, rms
from flurries.spectral.tiles import Blend

SHAPE = (512, 512)
LAGS = np.arange(1, 33)


def _way(setting: str, error: float, **options: Any) -> Way:
    """Return a frame whose error is derived, and does not depend on its pixels."""

    def make() -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return spectral.field(SHAPE, drift=(3.0, 11.0), seed=3, **options)

    return Way(setting, make, lambda made: error)


def continuum(low: float, high: float) -> Array:
    """Return the autocorrelation of a 1/f band of all directions: J0's mean over log frequency."""
    log_f = np.linspace(np.log(1.0 / high), np.log(1.0 / low), 2001)
    angle = (np.arange(256) + 0.5) * np.pi / 256.0
    weights = np.ones(2001)
    weights[[0, -1]] = 0.5
    across = 2.0 * np.pi * np.exp(log_f)[:, None] * np.cos(angle)
    bessel = [np.cos(lag * across).mean(axis=1) for lag in LAGS]
    return np.asarray(bessel @ weights / weights.sum())


def lattice(size: int, band: tuple[float, float]) -> Array:
    """Return the autocorrelation of a tile along x and along y: a sum over its waves."""
    along = np.asarray(reference.amplitude(size, band) ** 2, np.float64).sum(axis=0)
    return np.asarray(np.cos(2.0 * np.pi * np.outer(LAGS, np.fft.fftfreq(size))) @ along)


@axis("of the autocorrelation, rms", "the four-octave 1/f band in the continuum: an integral of J0")
def octaves() -> Iterator[Way]:
    """Octaves of waves, 512 x 512."""
    off = rms(continuum(2.0, 32.0))
    for count in (0.5, 1.0, 2.0, 3.0, 4.0):
        band = (32.0 / 2.0**count, 32.0)
        yield _way(f"{count:g} octaves, tile 128", off(lattice(128, band)), tile=128, overlap=20,
                   wavelengths=band)  # fmt: skip


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
            error = float(np.hypot(_contrast(**how), _leaked(**how)))
            yield _way(f"{law}, overlap {overlap}", error, **how)


def _contrast(overlap: int, blend: Blend) -> float:
    """Return how far the deviation of independent tiles is from 1: from the squared weights."""
    length = 256
    count = len(spectral.tile_starts(length, overlap=overlap))
    share = np.zeros(length)
    for one in np.eye(count):
        tiles = np.broadcast_to(one[:, None, None, None], (count, 1, 64, 64)).copy()
        made = spectral.blend_tiles(tiles, (length, 64), overlap=overlap, blend=blend)
        share += made[:, 0] ** 2
    return rms(np.ones((length, length)))(np.sqrt(np.outer(share, share)))


def _leaked(overlap: int, blend: Blend) -> float:
    """Return the amplitude below 6 px of a field whose shortest wave has 8 px; four frames."""
    window = np.hanning(SHAPE[0] + 1)[:-1]
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SHAPE[0]), np.fft.fftfreq(SHAPE[1])))
    total = fine = 0.0
    for seed in range(4):
        z = spectral.field(SHAPE, drift=(3.0, 11.0), seed=seed, overlap=overlap, blend=blend,
                           wavelengths=(8.0, 32.0), dtype=np.float64)  # fmt: skip
        power = np.abs(np.fft.fft2(z * np.outer(window, window))) ** 2
        total += float(power.sum())
        fine += float(power[frequency > 1.0 / 6.0].sum())
    return float(np.sqrt(fine / total))


@axis("in sigma, rms", "16 Gauss-Legendre nodes over the exposure")
def shutter() -> Iterator[Way]:
    """Shutter by sinc or by sub-frames, 256 x 256."""
    shape, velocity = (256, 256), np.array([2.0, 8.0])
    # Waves turn by a quarter of a cycle at most: 16 nodes are exact to the last bits.
    nodes, weights = np.polynomial.legendre.leggauss(16)
    frames = (reference.field(shape, drift=DRIFT + velocity * n / 2, seed=7) for n in nodes)
    off = rms(np.asarray(sum(w / 2 * frame for w, frame in zip(weights, frames, strict=True))))
    frame: Callable[..., Array] = partial(spectral.field, shape, seed=7)

    def parts(count: int) -> Array:
        total = np.zeros(shape, np.float32)
        for at in (np.arange(count) + 0.5) / count - 0.5:
            total += frame(drift=DRIFT + velocity * at)
        return np.asarray(total / np.float32(count))

    yield from both("sinc", partial(frame, drift=DRIFT, velocity=velocity, shutter=1.0), off)
    for count in (1, 2, 4, 8, 16, 64):
        yield Way(f"{count} sub-frames", partial(parts, count), off)

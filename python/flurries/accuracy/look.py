"""The axes of the texture's look: octaves, tile size, blending. Their errors are derived."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries.accuracy.texture import amplitude
from flurries.accuracy.ways import Way, axis, rms

SHAPE = (512, 512)
LAGS = np.arange(1, 33)


def _way(setting: str, error: float, **options: Any) -> Way:
    """Return a frame whose error does not depend on its pixels."""

    def make() -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return spectral.field(SHAPE, drift=(3.0, 11.0), seed=3, **options)

    return Way(setting, make, lambda made: error)


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

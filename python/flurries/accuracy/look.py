"""What changes the look: octaves, tile size, blending, depth."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries.accuracy import reference
from flurries.accuracy.ways import Way, known, rms

SHAPE = (512, 512)
DRIFT = (3.0, 11.0)
LAGS = np.arange(1, 33)


def _continuum(low: float, high: float) -> Array:
    """The autocorrelation of a 1/f band of all directions: the mean of J0 over log frequency."""
    log_f = np.linspace(np.log(1.0 / high), np.log(1.0 / low), 2001)
    angle = (np.arange(256) + 0.5) * np.pi / 256.0
    steps = np.full(2001, log_f[1] - log_f[0])
    steps[[0, -1]] *= 0.5
    values = []
    for lag in LAGS:
        turned = 2.0 * np.pi * lag * np.exp(log_f)[:, None] * np.cos(angle)[None, :]
        bessel = np.cos(turned).mean(axis=1)
        values.append(np.sum(bessel * steps) / np.sum(steps))
    return np.array(values)


def _lattice(size: int, low: float, high: float) -> Array:
    """The autocorrelation of a tile, along x and along y: a sum over its waves."""
    power = np.asarray(reference.amplitude(size, (low, high)) ** 2, np.float64)
    kx = np.fft.fftfreq(size)
    along = power.sum(axis=0)
    return np.array([np.sum(along * np.cos(2.0 * np.pi * kx * lag)) for lag in LAGS])


def _off(size: int, low: float, high: float, wanted: Array) -> float:
    return float(np.sqrt(np.mean(np.square(_lattice(size, low, high) - wanted))))


def _frame(**options: Any) -> Any:
    def make() -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return spectral.field(SHAPE, drift=DRIFT, seed=3, **options)

    return make


def octaves() -> list[Way]:
    """One octave to four, the longest wave the same."""
    wanted = _continuum(2.0, 32.0)
    ways = []
    for count in (0.5, 1.0, 2.0, 3.0, 4.0):
        low = 32.0 / 2.0**count
        ways.append(Way(f"{count:g} octaves, tile 128",
                        _frame(tile=128, overlap=20, wavelengths=(low, 32.0)),
                        known(_off(128, low, 32.0, wanted))))  # fmt: skip
    return ways


def tile() -> list[Way]:
    """Larger tiles have more waves, and more directions."""
    wanted = _continuum(4.0, 32.0)
    return [
        Way(f"tile {size}", _frame(tile=size, overlap=size // 6),
            known(_off(size, 4.0, 32.0, wanted)))
        for size in (32, 48, 64, 96, 128, 256, 512)
    ]  # fmt: skip


def blend() -> list[Way]:
    """Contrast where tiles meet, and what seams add to waves finer than the band."""
    ways = []
    for law in ("power", "linear"):
        for overlap in (0, 4, 10, 20, 32):
            if law == "power" or overlap:
                off = float(np.hypot(_contrast(overlap, law), _leaked(overlap, law)))
                ways.append(Way(f"{law}, overlap {overlap}",
                                _frame(overlap=overlap, blend=law), known(off)))  # fmt: skip
    return ways


def _leaked(overlap: int, law: str) -> float:
    """The amplitude below 6 px of a field whose shortest wave has 8 px; four frames."""
    window = np.hanning(SHAPE[0] + 1)[:-1]
    window = np.outer(window, window)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SHAPE[0]), np.fft.fftfreq(SHAPE[1])))
    total, fine = 0.0, 0.0
    for seed in range(4):
        z = spectral.field(SHAPE, drift=DRIFT, seed=seed, overlap=overlap, blend=law,
                           wavelengths=(8.0, 32.0), dtype=np.float64)  # fmt: skip
        power = np.abs(np.fft.fft2(z * window)) ** 2
        total += float(power.sum())
        fine += float(power[frequency > 1.0 / 6.0].sum())
    return float(np.sqrt(fine / total))


def _contrast(overlap: int, law: str) -> float:
    """How far the standard deviation of independent tiles is from 1: from the squared weights."""
    length = 256
    count = len(spectral.tile_starts(length, overlap=overlap))
    share = np.zeros(length)
    for i in range(count):
        tiles = np.zeros((count, 1, 64, 64))
        tiles[i] = 1.0
        column = spectral.blend_tiles(tiles, (length, 64), overlap=overlap, blend=law)[:, 0]
        share += column**2
    deviation = np.sqrt(np.outer(share, share))
    return float(np.sqrt(np.mean(np.square(deviation - 1.0))))


def depth() -> list[Way]:
    """A floor that goes away, and the texture that it hides."""
    from flurries.effects import Snow
    from flurries.scene.scene import Scene

    size = (320, 240)
    floor = np.broadcast_to(np.geomspace(120.0, 8.0, 240, dtype=np.float32)[:, None], (240, 320))

    def scene(mode: str, depth: Any) -> Scene:
        snow = Snow(flakes=0, haze=0.0, depth_mode=mode, wavelengths=(2.0, 16.0))
        return Scene(size, effects=[snow], depth=depth, seed=3)

    def alpha(view: Scene) -> Array:
        made: Array = view.render(40, layers=True).alpha
        return made

    levels = np.geomspace(120.0, 8.0, 96)
    nearest = np.argmin(np.abs(np.log(floor[..., None]) - np.log(levels)), axis=-1)
    walls = np.stack([alpha(scene("tile", float(level))) for level in levels])
    exact = np.take_along_axis(walls, nearest[None], axis=0)[0].astype(np.float64)
    whole = np.array(floor)
    return [
        Way(name, partial(alpha, scene(mode, wall)), rms(exact))
        for name, mode, wall in (
            ("by tile", "tile", whole), ("by pixel", "pixel", whole), ("no depth", "tile", None),
        )
    ]  # fmt: skip

"""Flakes, and the hybrid of flakes and texture."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from flurries import hybrid as matching
from flurries import particles
from flurries._contract import Array
from flurries.accuracy.ways import Way, rms
from flurries.camera.lens import Camera

SHAPE = (512, 512)
EYE = Camera(600.0)


def flakes() -> list[Way]:
    """Footprints that keep their energy, and point samples."""
    rng = np.random.default_rng(4)
    count = 2000
    depth = rng.uniform(4.0, 20.0, count)
    px = rng.uniform(10.0, 502.0, (count, 2))
    points = np.column_stack([(px - 256.0) * depth[:, None] / EYE.focal, depth])
    sigma = rng.uniform(0.3, 2.0, count)
    radius = 3.0 * sigma * depth / EYE.focal
    off = rms(_integrated(px, sigma))

    def splat(dtype: Any) -> Way:
        return Way(
            f"splat, {np.dtype(dtype).name}",
            lambda: particles.splat(SHAPE, points, radius, EYE, opacity=0.5, dtype=dtype),
            off,
        )

    def samples(reach: float) -> Way:
        return Way(f"NumPy, samples to {reach:g} sigma", lambda: _sampled(px, sigma, reach), off)

    return [splat(np.float32), splat(np.float64), samples(2.0), samples(3.0), samples(4.0)]


def _integrated(px: Array, sigma: Array) -> Array:
    """The mean of every Gaussian over every pixel near it, by error functions."""
    through = np.ones(SHAPE)
    for (x, y), s in zip(px, sigma, strict=True):
        reach = math.ceil(6.0 * s) + 2
        left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
        right, bottom = min(int(x) + reach, SHAPE[1]), min(int(y) + reach, SHAPE[0])
        across, down = (
            math.sqrt(math.pi / 2.0) * s * np.diff(
                [math.erf((edge - at) / (s * math.sqrt(2.0))) for edge in range(low, high + 1)])
            for low, high, at in ((left, right, x), (top, bottom, y))
        )  # fmt: skip
        through[top:bottom, left:right] *= 1.0 - 0.5 * down[:, None] * across[None, :]
    return 1.0 - through


def _sampled(px: Array, sigma: Array, reach: float) -> Array:
    """What people write: each Gaussian at the pixels' centres, cut off."""
    through = np.ones(SHAPE)
    for (x, y), s in zip(px, sigma, strict=True):
        r = math.ceil(reach * s)
        left, top = max(int(x) - r, 0), max(int(y) - r, 0)
        right, bottom = min(int(x) + r + 1, SHAPE[1]), min(int(y) + r + 1, SHAPE[0])
        dx = np.arange(left, right) + 0.5 - x
        dy = np.arange(top, bottom) + 0.5 - y
        square = (dx * dx)[None, :] + (dy * dy)[:, None]
        spot = np.exp(-square / (2.0 * s * s)) * (square <= (reach * s) ** 2)
        through[top:bottom, left:right] *= 1.0 - 0.5 * spot
    return 1.0 - through


def hybrid() -> list[Way]:
    """All flakes, or the small ones as texture, from several sizes on."""
    snow = matching.Population(density=40.0, radius=(0.006, 0.014), opacity=0.9, depth=(1.5, 24.0))
    shape, camera = (192, 192), Camera(1229.0)
    edges = (2.0, 4.0, 8.0, 16.0)
    wanted = matching.statistics(snow, camera.focal, edges=edges).power
    seeds = range(200)

    def off(make: Any) -> Any:
        def error(_: Any) -> float:
            found = np.mean([_octaves(make(seed), edges) for seed in seeds], axis=0)
            return float(np.sqrt(np.mean(np.square(found / wanted - 1.0))))

        return error

    def simulated(seed: int) -> Array:
        return matching.simulate(shape, snow, camera, seed=seed)

    ways = [Way("every flake", lambda: simulated(0), off(simulated))]
    for handover in ((0.4, 0.6), (0.8, 1.2), (1.5, 2.2), (3.0, 4.5)):
        found = matching.match(snow, camera.focal, handover=handover)

        def mixed(seed: int, found: Any = found) -> Array:
            return matching.render(shape, found, camera, seed=seed)

        low, high = handover
        ways.append(Way(f"texture below {low:g}-{high:g} px", partial(mixed, 0), off(mixed)))
    return ways


def _octaves(picture: Array, edges: tuple[float, ...]) -> Array:
    """Return the variance of a picture in each octave of wavelengths, through a Hann window."""
    side = picture.shape[0]
    window = np.hanning(side + 1)[:-1]
    window = np.outer(window, window)
    rest = picture.astype(np.float64)
    rest = (rest - rest.mean()) * window
    power = np.abs(np.fft.fft2(rest)) ** 2 / (side**2 * np.sum(window**2))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    with np.errstate(divide="ignore"):
        wavelength = 1.0 / frequency
    return np.array([
        np.sum(power[(wavelength > low) & (wavelength <= high)])
        for low, high in pairwise(edges)
    ])  # fmt: skip

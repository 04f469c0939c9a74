"""The twin that judges falling snow is judged here: by fine sums, and by closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flurries as fl
from twin_falling import View, film
from twin_footprints import POINT, Canvas, middle_depth, profile
from twin_law import Law

SNOW = Law(density=60.0, sizes=(0.003, 0.007, 0.022), near=2.0, far=15.0)
VIEW = View(size=(120, 90), focal=200.0, wind=(3.0, 0.0, 0.0), sway=(0.02, 4.0))


def sampled(way: np.ndarray, diameter: float) -> np.ndarray:
    """A flake in 24 x 24 px: rings of its disc at many times, counted by pixels."""
    r2, angle = (np.arange(60) + 0.5) / 60, 2.0 * math.pi * (np.arange(90) + 0.5) / 90
    weight = profile(r2, middle_depth(0.9))[:, None] + 0.0 * angle
    weight *= 0.25 * math.pi * diameter**2 / weight.size
    disc = 0.5 * diameter * np.sqrt(r2)[:, None] * np.array([np.cos(angle), np.sin(angle)])[:, None]
    total, times = np.zeros((24, 24)), 300
    for n in range(times):
        u = 2.0 * (n + 0.5) / times
        a, b = way[int(u)], way[int(u) + 1]
        x, y = (a + (u - int(u)) * (b - a))[:, None, None] + disc
        total += np.histogram2d(
            y.ravel(), x.ravel(), bins=24, range=((0, 24), (0, 24)), weights=weight.ravel()
        )[0]
    return total / times


def painted(way: np.ndarray, diameter: float, opacity: float = 0.9) -> np.ndarray:
    canvas = Canvas((24, 24), opacity)
    canvas.add(way[:, :, None], np.array([diameter]), np.ones(1))
    return canvas.alpha()


WAYS = {
    "rest": np.tile([11.37, 12.81], (3, 1)),
    "short": np.array([[11.37, 12.81], [11.6, 13.1], [11.8, 13.4]]),
    "bent": np.array([[8.2, 6.1], [11.3, 9.2], [16.4, 10.3]]),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("diameter", [0.11, 0.19, 0.21, 0.8, 1.9, 2.1, 6.0])
def test_a_flake_is_its_samples(way: np.ndarray, diameter: float):
    if diameter < POINT:
        # A flake so small goes straight, from the opening to the close.
        way = np.array([way[0], 0.5 * (way[0] + way[2]), way[2]])
    want, got = sampled(way, diameter), painted(way, diameter)
    assert got.sum() == pytest.approx(0.9 * 0.25 * math.pi * diameter**2, rel=0.01)
    # Points: unbiased, and off by a share of the brightest pixel.
    assert np.abs(got - want).max() < 0.1 * want.max()


def test_its_laws_are_those_of_the_package():
    share, at = (np.arange(1000) + 0.5) / 1000, np.linspace(0.0005, 0.02, 99)
    snow = fl.Snow(flake_size=SNOW.sizes).parts.texture.weather.population
    np.testing.assert_allclose(SNOW.diameters(share), snow.sizes.quantile(share))
    np.testing.assert_allclose(SNOW.speed(at), snow.speed(at))
    slow = Law(density=1.0, sizes=SNOW.sizes, fall=0.5)
    assert slow.speed(np.array([0.007, 0.014])) == pytest.approx([0.5, 0.5 * 2**0.16])
    rain, drops = fl.Rain(), Law(density=1.0, sizes=(0.0005, 0.0009, 0.006), kind="rain")
    np.testing.assert_allclose(drops.speed(at), rain.parts.texture.weather.population.speed(at))


def test_coverage_is_a_formula():
    means = [film(SNOW, VIEW, [0.0], seed).mean() for seed in range(8)]
    # All depths cover alike, half of what fades counts.
    want = -math.expm1(-SNOW.extinction() * (SNOW.far - 0.9 * SNOW.near))
    assert np.mean(means) == pytest.approx(want, rel=0.02)

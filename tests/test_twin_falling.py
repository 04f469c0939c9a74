"""The twin that judges falling snow is judged here: by fine sums, and by closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flurries as fl
from twin_falling import View, film
from twin_footprints import POINT, Canvas, middle_depth, profile
from twin_law import Law, rain_of

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


def test_opacity_is_the_mean_over_the_disc():
    for opacity in (0.1, 0.5, 0.9):
        r2 = (np.arange(100_000) + 0.5) / 100_000
        assert profile(r2, middle_depth(opacity)).mean() == pytest.approx(opacity, rel=1e-6)
    assert middle_depth(0.9) == pytest.approx(4.3, abs=0.05)
    assert profile(np.zeros(1), middle_depth(0.9))[0] == pytest.approx(0.986, abs=1e-3)


def test_sizes_and_speeds_are_those_of_the_law():
    share = (np.arange(100_000) + 0.5) / 100_000
    found = SNOW.diameters(share)
    assert found.min() >= 0.003 and found.max() <= 0.022
    assert found.mean() == pytest.approx(0.007, rel=1e-4)
    # Halves of an exponential decay alike: as many times fewer for every step of size.
    counts = np.histogram(found, np.linspace(0.003, 0.022, 5))[0]
    np.testing.assert_allclose(counts[1:] / counts[:-1], counts[1] / counts[0], rtol=0.01)
    assert SNOW.speed(np.array([0.01]))[0] == pytest.approx(0.8 * 10**0.16)
    slow = Law(density=1.0, sizes=SNOW.sizes, fall=0.5)
    assert slow.speed(np.array([0.007, 0.014])) == pytest.approx([0.5, 0.5 * 2**0.16])
    rain = Law(density=1.0, sizes=(0.0005, 0.001, 0.006), kind="rain")
    assert rain.speed(np.array([0.002]))[0] == pytest.approx(9.65 - 10.3 * math.exp(-1.2))


def test_rain_carries_its_rate():
    rain = fl.Rain(rate_mm_h=10.0)
    density, sizes = rain_of(10.0)
    assert density == pytest.approx(rain.density, rel=1e-4)
    assert sizes == pytest.approx(rain.drop_size, rel=1e-4)


def test_coverage_is_a_formula():
    means = [film(SNOW, VIEW, [0.0], seed).mean() for seed in range(8)]
    # All depths cover alike, half of what fades counts.
    want = -math.expm1(-SNOW.extinction() * (SNOW.far - 1.125 * SNOW.near))
    assert np.mean(means) == pytest.approx(want, rel=0.02)


def test_windows_and_times_show_the_same_flakes():
    whole = film(SNOW, VIEW, [3.0, 40.0], 5)
    part = film(SNOW, VIEW, [40.0], 5, window=(20, 70, 30, 90))
    # Points that stand for middle flakes are other ones.
    assert np.abs(part[0] - whole[1, 20:70, 30:90]).max() < 0.05
    other = film(SNOW, VIEW, [40.0], 6)[0]
    assert np.abs(other - whole[1]).max() > 0.3


def moved(view: View, t: float) -> np.ndarray:
    """The shift of a far, narrow layer between two frames: the highest of their correlation."""
    slab = Law(density=3.0, sizes=(0.03, 0.03, 0.03), near=10.0, far=11.0, fades=(1.001, 0.001))
    a, b = (picture - picture.mean() for picture in film(slab, view, [t, t + 5.0], 2))
    both = np.fft.ifft2(np.fft.fft2(b) * np.fft.fft2(a).conj()).real
    y, x = np.unravel_index(np.argmax(both), both.shape)
    return np.array([(x + 60) % 120 - 60, (y + 45) % 90 - 45])


@pytest.mark.parametrize(
    ("view", "want"),
    [
        ({}, (0.0, 1.0)),
        ({"wind": (3.0, 0.0, 0.0)}, (3.0, 1.0)),
        ({"velocity": (2.0, 0.0, 0.0)}, (-2.0, 1.0)),
        ({"velocity": (0.0, 0.0, 2.0)}, (0.0, 1.0)),
        ({"spin": 0.3}, (-0.3 * 10.5, 1.0)),
    ],
)
def test_flakes_move_as_their_depth_says(view: dict, want: tuple[float, float]):
    about = {"size": (120, 90), "focal": 200.0, "shutter": 0.0, **view}
    fall = 0.8 * 30.0**0.16
    got = moved(View(**about), 0.0)
    wanted = np.array([want[0], fall]) * 5.0 / 30.0 * 200.0 / 10.5
    assert np.abs(got - wanted).max() < 1.5


def test_a_flake_sways_by_its_amplitude():
    view = View(size=(9, 9), focal=1.0, sway=(0.02, 4.0))
    ways = np.array([view.swing(np.array([[0.3], [1.1]]), t)[:, 0] for t in range(500)])
    assert np.ptp(ways, axis=0) == pytest.approx([0.04, 0.0, 0.04], abs=1e-3)

"""Flakes drawn by `fl.particles`, and what is known of them in closed form.

The judge of the closed form is the picture of every flake. Bands of wavelengths are measured on
windowed pictures, with a window and a lattice of the test's own.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy import integrate

import flurries as fl
import measure
from twin_space import Space, correlation, seen, simulate, statistics

FOCAL, SIZE = 1229.0, 1024
SNOW = Space(density=110.0, radius=(0.006, 0.014), opacity=0.9, depth=(1.5, 24.0))
EDGES = (2.0, 4.0, 8.0, 16.0, 32.0)
LENS = fl.Camera(FOCAL)
STEP = 0.2 * 1.5 / FOCAL  # the nearest flake moves by a fifth of a pixel
SEEDS = 4


# Measuring a film ---------------------------------------------------------------------------------


def of_pictures(draw, seeds: int = SEEDS) -> tuple[float, np.ndarray, np.ndarray]:
    """(mean, power per octave, speed per octave) of pictures and how they change."""
    mean, power, flux = 0.0, 0.0, 0.0
    hann = np.hanning(SIZE + 2)[1:-1]
    window = np.outer(hann, hann)
    for seed in range(seeds):
        pair = np.array([draw(seed, way) for way in (0.0, STEP)], np.float64)
        mean += pair[0].mean() / seeds
        first, second = np.fft.fft2((pair - np.average(pair[0], weights=window)) * window)
        power = power + np.abs(first) ** 2 / (seeds * SIZE**2 * np.sum(window**2))
        turned = (first * second.conj()).imag / (2.0 * np.pi * STEP)
        flux = flux + turned / (seeds * SIZE**2 * np.sum(window**2))
    fx = np.fft.fftfreq(SIZE)[None, :] + np.zeros((SIZE, 1))
    length = np.hypot(fx, fx.T)
    powers, speeds = [], []
    for i in range(len(EDGES) - 1):
        band = (length < 1.0 / EDGES[i]) & (length >= 1.0 / EDGES[i + 1])
        powers.append(power[band].sum())
        speeds.append((fx * flux)[band].sum() / (fx**2 * power)[band].sum())
    return mean, np.array(powers), np.array(speeds)


def simulated(seed: int, way: float) -> np.ndarray:
    return simulate((SIZE, SIZE), SNOW, LENS, seed=seed, displacement=(-way, 0.0, 0.0))


@pytest.fixture(scope="module")
def truth() -> tuple[float, np.ndarray, np.ndarray]:
    return of_pictures(simulated)


# The closed form ----------------------------------------------------------------------------------


def test_the_closed_form_is_that_of_the_pictures(truth):
    found = statistics(SNOW, FOCAL, edges=EDGES)
    mean, power, speed = truth
    # Four pictures: measured within 1 and 2 %.
    assert found.mean_opacity == pytest.approx(mean, rel=0.02)
    assert found.power == pytest.approx(power, rel=0.05)
    assert found.speed == pytest.approx(speed, rel=0.05)
    # It is no tent, whose speeds would double from octave to octave.
    assert found.speed[3] / found.speed[0] < 4.0


def test_coverage_without_fades_is_a_formula():
    # Every depth covers alike: L = 2 pi density opacity E[r^2] / 9 (far - near).
    # Fades take a half of 0.15 at the near and of 2.4 at the far end.
    squares = (0.006**2 + 0.006 * 0.014 + 0.014**2) / 3.0
    depth = 24.0 - 1.5 - 0.5 * (0.15 + 2.4)
    covered = 110.0 * 2.0 * np.pi * 0.9 * squares / 9.0 * depth
    found = statistics(SNOW, FOCAL).mean_opacity
    assert found == pytest.approx(-math.expm1(-covered), rel=2e-3)


def test_the_overlap_is_campbells_integral():
    # By quadrature over depth, for flakes of one size, at a few distances.
    snow = dataclasses.replace(SNOW, radius=(0.009, 0.0090001))
    flakes = seen(snow, FOCAL)
    overlap, change = correlation(flakes, FOCAL, flakes.amplitude**2)

    def fade(z: float) -> float:
        def part(t: float) -> float:
            t = min(max(t, 0.0), 1.0)
            return t * t * (3.0 - 2.0 * t)

        return part((z - 1.5) / 0.15) * part((24.0 - z) / 2.4)

    def integrand(z: float, x: float, y: float, moved: bool) -> float:
        sigma2 = (FOCAL * 0.009 / (3.0 * z)) ** 2
        drawn = max(sigma2 + 1.0 / 12.0, 0.38)
        a = 0.9 * fade(z) * sigma2 / drawn * (1.0 + 4.8e-4 / drawn)
        n = 110.0 * (z / FOCAL) ** 2
        bell = n * a * a * np.pi * drawn * np.exp(-(x * x + y * y) / (4.0 * drawn))
        return bell * (FOCAL / z) * x / (2.0 * drawn) if moved else bell

    for y, x in ((0, 0), (1, 2), (-3, 4)):
        for moved, got in ((False, overlap), (True, change)):
            want = sum(
                integrate.quad(integrand, *ends, args=(x, y, moved), epsabs=1e-13, limit=200)[0]
                for ends in ((1.5, 1.65), (1.65, 6.2), (6.2, 21.6), (21.6, 24.0))
            )
            assert got[y, x] == pytest.approx(want, rel=1e-3, abs=1e-12)


# Pictures -----------------------------------------------------------------------------------------

FEW = Space(density=30.0, radius=(0.01, 0.03), opacity=0.8, depth=(1.0, 8.0))
SMALL = fl.Camera(150.0)


def few(place: np.ndarray, **options) -> np.ndarray:
    return simulate((90, 120), FEW, SMALL, seed=5, displacement=place, **options)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("camera", [SMALL, fl.Camera(150.0, offset=(0.2, -0.1, 0.0))])
def test_no_flake_pops_where_the_box_wraps(axis: int, camera: fl.Camera):
    way = np.zeros(3)
    way[axis] = 0.1
    times = np.random.default_rng(1).uniform(0.0, 60.0, 20)

    def frame(t: float) -> np.ndarray:
        return simulate((90, 120), FEW, camera, seed=5, displacement=t * way)

    assert measure.smooth(measure.largest_changes(frame, times))

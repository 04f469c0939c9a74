"""Flakes drawn by `fl.particles`, and what is known of them in closed form.

The judge of the closed form is the picture of every flake. Bands of wavelengths are measured on
windowed pictures, with a window and a lattice of the test's own.
"""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
from twin_space import Space, simulate, statistics

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


# Pictures -----------------------------------------------------------------------------------------

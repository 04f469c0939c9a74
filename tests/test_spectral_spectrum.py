"""The spectrum of a film: its power lies on the tent, and what the paper says about that holds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate

import flurries as fl
import twin

FRAMES = 64
SPEED = 0.2 * 32.0  # c = 0.2 cycles per frame


def film(frames: int, angle: float = 63.0, **options) -> np.ndarray:
    """(frames, 64, 64) of one torus at c = 0.2."""
    velocity = SPEED * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    return np.array(
        [
            fl.spectral.field((64, 64), drift=t * velocity, seed=1, overlap=0, dtype=np.float64,
                              **options)
            for t in range(frames)
        ]
    )  # fmt: skip


def power_near_the_tent(pictures: np.ndarray, angle: float, bins: int, window: np.ndarray) -> float:
    """Share of the power within so many temporal bins of the tent's rate, circularly."""
    spectrum = np.abs(np.fft.fftn(pictures * window[:, None, None])) ** 2
    velocity = SPEED * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    rate = twin.tent_rate((64, 64), velocity)
    temporal = np.fft.fftfreq(len(pictures))
    distance = np.abs(twin.reduced(temporal[:, None, None] - rate)) * len(pictures)
    return float(np.sum(spectrum[distance <= bins]) / np.sum(spectrum))


def hann() -> np.ndarray:
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / FRAMES)


def test_power_within_one_bin_of_the_tent():
    # A wave between two bins leaves 2*int_0^1 sinc^2 = .903 of its power in them on average.
    theory = 2 * integrate.quad(lambda x: np.sinc(x) ** 2, 0.0, 1.0)[0]
    assert theory == pytest.approx(0.903, abs=1e-3)
    near = power_near_the_tent(film(FRAMES), 63.0, 1, np.ones(FRAMES))
    assert near == pytest.approx(theory, abs=0.02)


def test_power_within_two_bins_with_a_hann_window():
    assert power_near_the_tent(film(FRAMES), 63.0, 2, hann()) > 0.998


def test_a_flipped_direction_would_be_seen():
    # Negative controls: the mirrored tent (Eq. 6 as printed) and frames out of order.
    assert power_near_the_tent(film(FRAMES), 63.0 + 180.0, 2, hann()) < 0.2
    shuffled = film(FRAMES)[np.random.default_rng(0).permutation(FRAMES)]
    assert power_near_the_tent(shuffled, 63.0, 2, hann()) < 0.2


def test_jitter_stays_near_the_tent():
    # Section 4: .986 of the power within two bins, where the plain tent has .9995.
    near = power_near_the_tent(film(FRAMES, jitter=True), 63.0, 2, hann())
    assert 0.97 < near < 0.998


@pytest.mark.parametrize(("rate", "shown"), [(0.51, -0.49), (0.9, -0.1), (0.3, 0.3)])
def test_fast_waves_show_their_alias(rate: float, shown: float):
    # The wave (4, 0), straight along a drift of minus `rate` cycles per frame.
    pictures = np.array(
        [
            fl.spectral.field((64, 64), drift=(-32.0 * rate * t, 0.0), seed=1, overlap=0,
                              dtype=np.float64)
            for t in range(50)
        ]
    )  # fmt: skip
    turns = np.unwrap(np.angle(np.fft.fft2(pictures)[:, 0, 4])) / (2 * np.pi)
    assert np.diff(turns) == pytest.approx(shown, abs=1e-12)


def test_rates_of_rendered_jitter_are_the_twins():
    # The rate of every wave, measured from two frames, with and without jitter.
    amplitude = twin.band_amplitude((64, 64))
    for jitter in (False, True):
        first, second = np.fft.fft2(film(2, jitter=jitter))
        turns = np.angle(second * first.conj())[amplitude > 0] / (2 * np.pi)
        where = twin.directions((64, 64))
        if jitter:
            where = twin.jittered_directions((64, 64), 1, (0, 0))
        velocity = 0.2 * np.array([np.cos(np.radians(63.0)), np.sin(np.radians(63.0))])
        want = -(velocity[0] * where[1] + velocity[1] * where[0])[amplitude > 0]
        assert np.abs(turns - want).max() < 1e-12


def test_waves_across_the_motion_never_move():
    # The mean of 300 falling frames keeps sqrt(.083) = .288 sigma as vertical bars; with jitter the
    # bars go, 0.12 to 0.15 is left of 300 frames.
    bars = film(300, angle=90.0).mean(axis=0)
    assert bars.std() == pytest.approx(0.29, abs=0.01)
    assert np.abs(bars - bars.mean(axis=0)).max() < 0.1
    assert film(300, angle=90.0, jitter=True).mean(axis=0).std() < 0.2


@pytest.mark.parametrize(("size", "kurtosis"), [(8, -0.42), (16, -0.15), (32, -0.07)])
def test_excess_kurtosis(size: int, kurtosis: float):
    # -1.5 sum p^2, p the power share of each real wave, a pair of bins. 2000 seeds: the standard
    # error of a pooled kurtosis is below sqrt(24/2000/2) for the two or more values of a tile.
    band = (4.0, min(32.0, float(size)))
    share = (
        2.0 * twin.band_amplitude((size, size), wavelengths=band)[twin.leaders((size, size))] ** 2
    )
    theory = -1.5 * np.sum(share**2)
    assert theory == pytest.approx(kurtosis, abs=0.01)
    pictures = np.array(
        [
            fl.spectral.field((size, size), drift=(0.0, 0.0), seed=seed, tile=size, overlap=0,
                              wavelengths=band)
            for seed in range(2000)
        ]
    )  # fmt: skip
    assert np.mean(pictures.astype(np.float64) ** 4) - 3.0 == pytest.approx(theory, abs=0.08)

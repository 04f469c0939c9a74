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

"""Snow that falls straight down does not meet itself."""

from __future__ import annotations

import numpy as np

import flurries as fl

SPEED = 2.9
LAGS = np.array([2, 3, 5, 8, 13, 22, 23, 44, 45, 66, 88, 110, 132, 154, 176, 200])


def correlations(shear: float) -> np.ndarray:
    """Of pixels with themselves, over lags in frames; one layer of 60 flakes a tile."""
    spectra = fl.spectral.flake_patterns(
        64, counts=[60.0], diameters=[[1.5, 3.0]], patterns=16, shear=shear, seed=8
    )
    size, frames = (512, 512), np.arange(0, 32, 4)
    found = np.zeros(len(LAGS))

    def depth(time: int) -> np.ndarray:
        moved = fl.spectral.optical_depth(
            size, spectra, drift=[(0.0, SPEED * time)], shear=shear, seed=5
        )
        return moved.astype(np.float64)

    for start in frames:
        first = depth(start)
        for at, lag in enumerate(LAGS):
            found[at] += np.corrcoef(first.ravel(), depth(start + lag).ravel())[0, 1]
    return found / len(frames)


def test_a_film_forgets_as_drawn_flakes_do():
    # Drawn flakes leave for good: after 2 frames, 5.8 px, nothing is left of a flake of 3 px.
    # With h = 5 M / 13 twelve turns of the torus come back 4.9 px aside or more.
    assert np.abs(correlations(5 / 13)).max() < 0.02


def test_a_square_torus_remembers():
    # The control: after 22 frames, 63.8 px, the same flakes come back.
    assert correlations(0.0)[5] > 0.1

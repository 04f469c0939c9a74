"""Structural similarity of photographs in weather: less with every step, and in hard weather."""

import numpy as np
import pytest
from skimage import data
from skimage.metrics import structural_similarity

import flurries as fl

NAMES = ("astronaut", "coffee", "camera", "rocket")
KINDS = ("Snowfall", "Rainfall", "Fog")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [128, 512])
def test_similarity_falls_at_every_step_and_hard_is_below_natural(kind: str, size: int):
    found = np.zeros((2, 5))
    for number, name in enumerate(NAMES):
        picture = getattr(data, name)()
        grey = fl.io.fit(np.ascontiguousarray(picture), (size, size))
        grey = grey if grey.ndim == 2 else np.ascontiguousarray(grey[..., 1])
        for (row, column), _ in np.ndenumerate(found):
            profile = ("natural", "hard")[row]
            weather = getattr(fl.augment, kind)(severity=column + 1, profile=profile, seed=3)
            seen = weather(grey, index=10 * number)
            found[row, column] += structural_similarity(grey, seen) / len(NAMES)
    assert (np.diff(found) < 0.0).all() and (found[1] < found[0]).all(), found


def test_far_flakes_leave_no_lattice():
    """What alternates from pixel to pixel is no stronger than the waves beside it."""
    alphas = [
        fl.augment.Snowfall(severity=5, seed=2).apply(np.zeros((128, 128)), index=k).alpha
        for k in range(8)
    ]
    power = sum(np.abs(np.fft.fft2(a.astype(np.float64) - a.mean())) ** 2 for a in alphas)
    for along in (power, power.T):
        beside = along[54:64].sum(axis=1).mean()
        assert along[64].sum() < 1.15 * beside

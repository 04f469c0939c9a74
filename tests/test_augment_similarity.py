"""Structural similarity of ten photographs in weather: monotone, even over sizes, calibrated."""

from functools import lru_cache

import numpy as np
import pytest
from skimage import data
from skimage.metrics import structural_similarity

import flurries as fl

NAMES = (
    "astronaut", "coffee", "chelsea", "rocket", "camera", "hubble_deep_field",
    "immunohistochemistry", "retina", "coins", "page",
)  # fmt: skip
KINDS = ("Snowfall", "Rainfall", "Fog")


@lru_cache(maxsize=8)
def photographs(size: int, grey: bool, count: int) -> list[np.ndarray]:
    found = []
    for name in NAMES[:count]:
        picture = getattr(data, name)()
        colors = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
        fitted = fl.io.fit(np.ascontiguousarray(colors[..., :3]), (size, size))
        found.append(fitted[..., 1].copy() if grey else fitted)
    return found


def similarity(
    kind: str, severity: int, size: int, *, profile: str = "natural", grey: bool = True,
    count: int = 10,
) -> np.ndarray:  # fmt: skip
    """Of each of the first photographs with itself in weather."""
    weather = getattr(fl.augment, kind)(severity=severity, profile=profile, seed=3)
    return np.array([
        structural_similarity(
            picture, weather(picture, index=10 * number), channel_axis=None if grey else 2
        )
        for number, picture in enumerate(photographs(size, grey, count))
    ])  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_severity_takes_as_much_at_every_size(kind: str):
    found = [similarity(kind, 4, size, count=4).mean() for size in (224, 512, 1024)]
    assert max(found) - min(found) <= 0.05, found


@pytest.mark.parametrize("kind, first, last", [
    ("Snowfall", 0.66, 0.42), ("Rainfall", 0.66, 0.42), ("Fog", 0.79, 0.63),
])  # fmt: skip
def test_the_hard_profile_is_that_of_published_corruptions(kind: str, first: float, last: float):
    for severity, wanted in ((1, first), (5, last)):
        found = similarity(kind, severity, 512, profile="hard", grey=False).mean()
        assert found == pytest.approx(wanted, abs=0.02), severity


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

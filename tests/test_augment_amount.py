"""How much a severity takes: the same of every picture, at every size, more with each step."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.augment import contrast_loss
from flurries.augment.calibration import extinction
from test_augment import EACH, KINDS


def test_the_scale_of_severities():
    assert [round(contrast_loss(n / 5), 3) for n in range(6)] == [0, 0.06, 0.14, 0.25, 0.38, 0.55]
    for kind, hardest in (("snow", 0.152), ("rain", 0.262), ("fog", 0.6)):
        hard = [contrast_loss(n / 5, profile="hard", weather=kind) for n in range(6)]  # type: ignore[arg-type]
        assert hard[0] == 0.0 and hard[5] == hardest and (np.diff(hard) > 0.0).all()
        # It begins harder.
        assert hard[1] > contrast_loss(0.2)
    for wrong in (-0.1, 1.1, math.nan, "x"):
        with pytest.raises((TypeError, ValueError), match="amount"):
            contrast_loss(wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="profile"):
        contrast_loss(0.5, profile="easy")  # type: ignore[arg-type]


@EACH
@pytest.mark.parametrize("severity, size, count", [
    (1, 64, 12), (1, 512, 6), (3, 64, 12), (3, 224, 8), (3, 2160, 2), (5, 64, 12), (5, 512, 6),
])  # fmt: skip
def test_a_severity_takes_its_share_at_every_size(kind: str, severity: int, size: int, count: int):
    """As contrast of two pictures that is lost; 5 %, and what falls to three standard errors."""
    dark = np.zeros((size, size))
    weather = KINDS[kind](severity=severity, seed=1)
    lost = [
        1.0 - (weather(dark + 1.0, index=k) - weather(dark, index=k)).mean() for k in range(count)
    ]
    error = 3.0 * np.std(lost) / math.sqrt(count)
    assert np.mean(lost) == pytest.approx(contrast_loss(severity / 5), rel=0.05, abs=error)


@EACH
@pytest.mark.parametrize("ground, depth", [
    (fl.augment.Ground(), None), (None, "steps"), (None, 40.0),
])  # fmt: skip
def test_severities_with_grounds_and_depths(kind: str, ground: Any, depth: Any):
    if depth == "steps":
        rng = np.random.default_rng(1)
        depth = np.exp(rng.uniform(np.log(3.0), np.log(300.0), (256, 256)))
    weather, black = KINDS[kind](severity=3, seed=2, ground=ground), np.zeros((256, 256))
    lost = [
        1.0 - (weather(black + 1.0, index=k, depth=depth) - weather(black, index=k, depth=depth))
        for k in range(6)
    ]  # fmt: skip
    assert np.mean(lost) == pytest.approx(contrast_loss(0.6), rel=0.05)


def test_extinction_is_the_root():
    rng = np.random.default_rng(2)
    for _ in range(50):
        depth = rng.uniform(0.5, 200.0, 100)
        clear = rng.uniform(0.9, 1.0, (100, 1))
        density = np.maximum(1.0 + 0.3 * rng.standard_normal(7), 0.05)
        loss = rng.uniform(0.12, 0.6)
        found = extinction(loss, depth, clear, density)
        left = (clear * np.exp(-found * depth[:, None] * density)).mean()
        assert left == pytest.approx(1.0 - loss, rel=1e-6)
    assert extinction(0.05, depth, np.full((100, 1), 0.9), np.ones(1)) == 0.0


@pytest.mark.parametrize("kind", ["snow", "rain"])
@pytest.mark.parametrize("profile, size", [
    ("natural", 224), ("natural", 1024), ("hard", 512),
])  # fmt: skip
def test_structure_grows_with_every_severity(kind: str, profile: str, size: int):
    """The deviation of what is finer than 8 px; and a veil holds at most a third."""
    fine = []
    for severity in range(1, 6):
        weather = KINDS[kind](severity=severity, seed=3, profile=profile)
        alphas = [weather.apply(np.zeros((size, size)), index=k).alpha for k in range(2)]
        rows = np.stack(alphas)[:, : size // 8 * 8, : size // 8 * 8].astype(np.float64)
        cells = rows.reshape(2, size // 8, 8, size // 8, 8)
        fine.append((cells - cells.mean(axis=(2, 4), keepdims=True)).std())
        loss = contrast_loss(severity / 5, profile=profile, weather=kind)
        assert np.mean([alpha.min() for alpha in alphas]) <= loss / 3.0
    assert (np.diff(fine) > 0.0).all(), fine

"""How much a severity takes: the same of every picture, at every size, more with each step."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flurries as fl
from flurries.augment import contrast_loss
from flurries.augment.calibration import extinction
from flurries.effects.looks import mean_square
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


def boxed(plane: np.ndarray, cells: int = 64) -> np.ndarray:
    """Means over cells of equal area, parts of pixels as parts."""
    size = plane.shape[0]
    edges = np.arange(cells + 1) * size / cells
    sums = np.zeros(size + 1)

    def along(values: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        first = np.minimum(edges.astype(int), size - 1)
        at = sums[first] + (edges - first)[:, None] * (sums[first + 1] - sums[first])
        return np.diff(at, axis=0) * cells / size

    assert sums.shape == (size + 1,)
    return along(along(plane.astype(np.float64)).T).T


@EACH
@pytest.mark.parametrize("severity", [1, 3, 5])
def test_a_severity_is_the_same_at_every_size(kind: str, severity: int):
    """Three statistics, box-filtered to cells, agree within 5 % at 64 to 2160 px.

    Flakes differ from size to size, so many pictures are taken. Below 512 px they are fewer and
    denser on purpose, so that their structure counts for as much (test_augment_similarity.py): by
    the power 0.6 of the size. The unevenness of what is rarer by n is sqrt(n) times as large, at
    most; at 64 px cells are no wider than flakes are drawn, and it is not compared.
    """
    weather = KINDS[kind](severity=severity, seed=5)
    found = {}
    sizes = ((512, 6), (64, 6), (224, 6)) if kind == "fog" else ((512, 6), (64, 12), (224, 8))
    if severity == 3:
        # Large ones once: a law of sizes and one of severities.
        sizes = (*sizes, (2160, 1 if kind == "fog" else 2))
    cells = 64 if kind == "fog" else 32
    for size, count in sizes:
        values = []
        for index in range(count):
            dark, bright = np.zeros((size, size)), np.ones((size, size))
            low, high = (boxed(weather(p, index=index), cells) for p in (dark, bright))
            alpha = 1.0 - (high - low)
            # The contrast of two pictures that is lost; the light that is added; its unevenness.
            values.append([alpha.mean(), low.mean(), alpha.std()])
        found[size] = np.array(values)
    for size, values in found.items():
        # Fog is the same at every size; what falls has other flakes, so its deviations are known
        # to three standard errors.
        same = found[512][: len(values) if kind == "fog" else None]
        want, error = same.mean(axis=0), np.zeros(3)
        most = np.full(3, 1.05)
        if kind != "fog":
            for some in (values, same):
                error += 3.0 * some.std(axis=0) / np.sqrt(len(some))
            most[2] = {64: np.inf, 224: 1.05 * (512 / 224) ** 0.3}.get(size, 1.05)
        got = values.mean(axis=0)
        assert (got <= most * want + error).all(), size
        least = np.array([0.95, 0.95, 0.0 if kind != "fog" and size == 64 else 0.95])
        assert (got >= least * want - error).all(), size
        assert values[:, 0].mean() == pytest.approx(contrast_loss(severity / 5), rel=0.05)


@EACH
def test_severities_without_a_ground_and_with_depths(kind: str):
    rng = np.random.default_rng(1)
    depth = np.exp(rng.uniform(np.log(3.0), np.log(300.0), (256, 256)))
    for arguments, given in (({"ground": None}, None), ({}, depth), ({}, 40.0)):
        weather = KINDS[kind](severity=3, seed=2, **arguments)
        black = np.zeros((256, 256))
        loss = [
            1.0 - (weather(black + 1.0, index=k, depth=given)
                   - weather(black, index=k, depth=given)).mean()
            for k in range(6)
        ]  # fmt: skip
        assert np.mean(loss) == pytest.approx(contrast_loss(0.6), rel=0.05)


def test_the_control_of_the_sizes_notices_a_texture_in_pixels():
    # The same tile of pixels at every size: what the usual libraries do. The statistic sees it.
    spread = []
    for size in (64, 512):
        alpha = fl.spectral.alpha((size, size), drift=(0.0, 0.0), seed=1, mean=0.2, spread=2.0)
        spread.append(boxed(alpha).std())
    assert abs(spread[1] / spread[0] - 1.0) > 0.4


@pytest.mark.parametrize("mean", [-0.4, -0.1, 0.0, 0.14, 0.5, 1.2])
@pytest.mark.parametrize("deviation", [0.05, 0.25, 1.0])
def test_mean_square_is_the_integral(mean: float, deviation: float):
    z = np.linspace(-10.0, 10.0, 400_001)
    weight = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) * (z[1] - z[0])
    want = (np.clip(mean + deviation * z, 0.0, 1.0) ** 2 * weight).sum()
    assert mean_square(mean, deviation) == pytest.approx(want, rel=1e-6, abs=1e-12)


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

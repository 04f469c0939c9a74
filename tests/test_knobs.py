"""One number in place of many: severities, rates, visibilities, and sizes of the picture."""

import copy
import hashlib
import math
import pickle
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.effects.checks import LOOKS
from flurries.effects.maps import map_at, power_share
from measure import cover

KINDS = [fl.Snow, fl.Rain, fl.Mist]


def test_a_density_is_the_same_behind_any_lens():
    snow = fl.effects.TentSnow(texture=0.0, haze=0.0, flake_density=20.0)
    covers = []
    for focal, size in ((300.0, (256, 192)), (600.0, (256, 192)), (307.2, (256, 256))):
        scene = fl.Scene(size=size, effects=[snow], camera=fl.Camera(focal))
        alphas = [cover(scene.replace(seed=s), 3).mean() for s in range(6)]
        covers.append(np.mean(alphas))
    # Flakes behind a pixel are as many whatever the lens; the nearest and largest ones fade.
    assert np.ptp(covers) < 0.15 * np.mean(covers)
    # As many lie in the pyramid of view, to the distance up to which they are drawn.
    drawn = fl.Scene(size=(256, 192), effects=[snow], camera=fl.Camera(100.0))
    counts = []
    for seed in range(6):
        flakes = fl.flakes(drawn.replace(seed=seed), 0.0)
        inside = (flakes["pixel"] > 0.0).all(axis=1) & (flakes["pixel"] < (256, 192)).all(axis=1)
        counts.append((inside & (flakes["depth"] < 11.0)).sum())
    assert np.mean(counts) == pytest.approx(20.0 * 2.56 * 1.92 * 11.0**3 / 3.0, rel=0.03)


@pytest.mark.parametrize(("make", "named"), [
    (lambda: fl.Rain(rate=3.0, severity=2), "severity and rate"),
    (lambda: fl.Snow("heavy", severity=3), "severity and a preset"),
    (lambda: fl.Mist(severity=2, visibility=30.0), "severity and visibility"),
    (lambda: replace(fl.Snow(severity=2), severity=3), "severity"),
    (lambda: fl.Snow(severity=2, method="tent"), "severity"),
])  # fmt: skip
def test_knobs_are_refused_by_name(make: Any, named: str):
    with pytest.raises((TypeError, ValueError), match=named):
        make()


@pytest.mark.parametrize("kind", KINDS)
def test_a_knob_leaves_what_is_given_and_is_written_out(kind: Any, tmp_path: Path):
    plain = kind(severity=3)
    if kind is not fl.Mist:
        assert kind(severity=3, density=60.0).density == 60.0 != plain.density
    for made in (pickle.loads(pickle.dumps(plain)), copy.copy(plain), replace(plain, amount=1.0)):
        assert made == plain and "_given" not in vars(made)
    scene = fl.Scene(size=(32, 24), effects=[plain])
    scene.save(tmp_path / "scene.toml")
    assert "severity" not in (tmp_path / "scene.toml").read_text()
    assert fl.open(tmp_path / "scene.toml").effects == (plain,)
    text = f'format = 3\n[[effects]]\nkind = "{kind.NAME}"\nseverity = 3\n'
    (tmp_path / "own.toml").write_text(text)
    assert fl.open(tmp_path / "own.toml").effects == (plain,)


def boxed(alpha: np.ndarray, times: int) -> np.ndarray:
    """Means over squares."""
    height, width = alpha.shape
    return alpha.reshape(height // times, times, width // times, times).mean(axis=(1, 3))


def opacities(effect: Any, width: int, count: int) -> np.ndarray:
    scenes = [fl.Scene(size=(width, width), effects=[effect], seed=seed) for seed in range(count)]
    return np.stack([cover(s, 3).astype(np.float64) for s in scenes])


# (effect, error of the mean, of the standard deviation). Streaks of rain at 256 px have waves of
# 2 to 3 px, few in a tile; flakes are never narrower than .62 px of sigma, which takes variance.
SIZES = {
    "texture": (fl.effects.TentSnow(flakes=0, haze=0.0), 0.02, 0.08),
    "heavy texture": (fl.effects.TentSnow("heavy", flakes=0, haze=0.0), 0.02, 0.06),
    "snow": (fl.effects.TentSnow(), 0.02, 0.15),
    "rain": (fl.effects.TentRain(), 0.03, 0.2),
}


@pytest.mark.parametrize("name", SIZES)
def test_a_small_picture_is_the_large_one_made_smaller(name: str):
    effect, mean, deviation = SIZES[name]
    whole = opacities(effect, 1024, 2)
    for width, count in ((256, 12), (512, 6)):
        large = np.stack([boxed(alpha, 1024 // width) for alpha in whole])
        small = opacities(effect, width, count)
        assert small.mean() == pytest.approx(large.mean(), rel=mean), width
        assert small.std() == pytest.approx(large.std(), rel=deviation), width


def test_the_tuned_size_is_left_alone_and_maps_keep_their_moments():
    assert power_share((3.0, 24.0), 0.75, 1024) == 1.0
    assert map_at(0.05, 2.0, 2.0, 1.0) == (0.05, 2.0)
    z = np.random.default_rng(3).standard_normal((2, 400_000))
    for share in (0.2, 0.6, 1.1):
        rho = min(share, 1.0 / share)
        # Two pictures that share what is seen, and differ in what is not.
        again = rho * z[0] + math.sqrt(1.0 - rho**2) * z[1]
        mean, spread = map_at(0.05, 2.0, 2.0, share)

        def mapped(field: np.ndarray, mean: float, spread: float) -> np.ndarray:
            return np.clip(mean + field / (2.0 * spread), 0.0, 1.0) ** 2

        def seen(mean: float, spread: float, z1: np.ndarray, z2: np.ndarray) -> tuple[float, float]:
            """Mean and variance of what is left when only a share of the field is seen."""
            first, second = mapped(z1, mean, spread), mapped(z2, mean, spread)
            return float(first.mean()), float(np.cov(first, second)[0, 1])

        part, whole = (z[0], again), (z[0], z[0])
        tuned = seen(0.05, 2.0, *(part if share < 1.0 else whole))
        fitted = seen(mean, spread, *(whole if share < 1.0 else part))
        assert fitted[0] == pytest.approx(tuned[0], rel=0.01)
        assert fitted[1] == pytest.approx(tuned[1], rel=0.03)


# A change of any number of a look needs another version.
KEPT = {"v1": "3a05f3713e29d59b"}


def digest(version: str) -> str:
    kinds = TentSnow, TentRain, ConeSnow, ConeRain, fl.Mist
    looks = [asdict(kind(name, look=version)) for kind in kinds for name in kind.PRESETS]
    numbers = repr([sorted(look.items()) for look in looks])
    return hashlib.sha256(numbers.encode()).hexdigest()[:16]


def test_a_look_is_as_it_was():
    assert {version: digest(version) for version in LOOKS} == KEPT

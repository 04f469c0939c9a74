"""Density, size and color of a population over time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects.population import product
from measure import cover


def film(effect: Any) -> fl.Scene:
    return fl.Scene((192, 128), (0.0, 0.0, 0.0), effects=[effect], seed=3)


def depth_of(effect: Any, frames: range) -> float:
    scene = film(effect)
    alphas = [cover(scene, t) for t in frames]
    return float(np.mean([-np.log1p(-np.minimum(a, 0.999)).mean() for a in alphas]))


@pytest.mark.parametrize("kind", [fl.Snow, fl.Rain])
def test_a_keyed_density_is_that_density(kind: Any):
    keyed = kind(density=fl.Keys([(0, 40.0), (100, 10.0)]), wind=(0.0, 0.0, 0.0))
    for frame, density in ((0, 40.0), (100, 10.0)):
        plain = kind(density=density, wind=(0.0, 0.0, 0.0))
        frames = range(0, 60, 12) if frame == 0 else range(100, 160, 12)
        if frame == 0:
            keyed = kind(density=fl.Keys([(60, 40.0), (100, 10.0)]), wind=(0.0, 0.0, 0.0))
        found, wanted = depth_of(keyed, frames), depth_of(plain, frames)
        assert abs(found / wanted - 1.0) < 0.15, (found, wanted)


def test_a_key_that_says_the_same_changes_nothing_but_who_is_there():
    snow = film(fl.Snow(density=fl.Keys([(0, 30.0), (50, 30.0)])))
    assert np.isfinite(snow.render(20)).all()


def test_keyed_sizes_are_those_of_their_keys():
    small, large = (0.002, 0.004, 0.012), (0.006, 0.014, 0.04)
    keyed = film(fl.Snow(flake_size=fl.Keys([(0, small), (80, large)]), color=1.0))
    for frame, size in ((0, small), (80, large), (200, large)):
        alone = film(fl.Snow(flake_size=size)).render(frame, layers=True)
        found = keyed.render(frame, layers=True)
        assert abs(float(found.alpha.mean() / alone.alpha.mean()) - 1.0) < 0.3
    half = keyed.render(40, layers=True)
    assert len(half.layers) == 2
    steps = [keyed.render(t).astype(np.float64).mean() for t in (79.0, 79.9, 80.0, 80.1)]
    assert np.ptp(steps) < 0.2 * np.mean(steps)


def test_keyed_color_goes_between_its_keys():
    snow = fl.Snow.preset("heavy", color=fl.Keys([(0, (1.0, 0.0, 0.0)), (10, (0.0, 0.0, 1.0))]))
    scene = film(snow)
    assert scene.render(0)[..., 2].max() == 0.0 and scene.render(10)[..., 0].max() == 0.0


def test_products_of_keys():
    first, second = fl.Keys([(0, 0.0), (10, 1.0)]), fl.Keys([(5, 2.0), (20, 0.0)])
    found = product(first, second)
    for t in np.linspace(0.0, 20.0, 33).tolist():
        wanted = first.value(t) * second.value(t)
        assert abs(found.value(t) - wanted) < 0.02  # type: ignore[union-attr]


def test_keys_are_saved_and_refused(tmp_path: Any):
    scene = film(
        fl.Snow(
            density=fl.Keys([(0, 5.0), (9, 9.0)]),
            flake_size=fl.Keys([(0, (0.002, 0.004, 0.01)), (9, (0.003, 0.006, 0.02))]),
        )
    )
    scene.save(tmp_path / "keys.toml")
    again = fl.Scene.load(tmp_path / "keys.toml")
    assert np.array_equal(again.render(4), scene.render(4))
    with pytest.raises(ValueError, match="density"):
        fl.Snow(density=fl.Keys([(0, -1.0), (9, 9.0)]))
    with pytest.raises(ValueError, match="flake_size"):
        fl.Snow(flake_size=fl.Keys([(0, 1.0), (9, 9.0)]))

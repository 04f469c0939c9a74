"""Opacity: the map, its mean and spread, and the mean that a shutter takes away."""

import numpy as np
import pytest

import flurries as fl
import textured
import twin
from every import every

MAPS = [
    {}, {"mean": 0.3}, {"spread": 2.0}, {"power": 1.0}, {"amount": 0.0},
    {"power": 0.5, "amount": 0.8}, {"mean": 0.1, "spread": 5.0, "power": 3.5, "amount": 0.25},
]  # fmt: skip


@every(("dtype", "limit"), [(np.float64, 1e-15), (np.float32, 1e-6)])
@every("options", MAPS)
def test_opacity_is_the_twins(options: dict, dtype: type, limit: float):
    z = np.random.default_rng(1).normal(0.0, 1.5, (33, 50)).astype(dtype)
    got = fl.spectral.opacity(z, **options)
    assert got.dtype == dtype and got.shape == z.shape and got.flags.c_contiguous
    amount = options.get("amount", 1.0)
    assert got.min() >= 0.0 and got.max() <= dtype(amount)
    assert np.abs(got - twin.opacity(z, **options)).max() <= limit


MAPPED = {"mean": 0.4, "spread": 2.5, "amount": 0.9}
FIELD = {"drift": (3.0, 8.0), "seed": 17, "tile": 31, "overlap": 10, "wavelengths": (3.0, 30.0)}
FIELD |= {"velocity": (5.0, 20.0), "shutter": 0.5, "alias": "soft", "shift": (1.0, 0.5)}


@every("power", [1.0, 2.0, 2.5])
@every(("dtype", "limit"), [(np.float64, 1e-12), (np.float32, 2e-6)])
def test_alpha_is_opacity_of_field(dtype: type, limit: float, power: float):
    got = textured.alpha((70, 45), **FIELD, **MAPPED, power=power, dtype=dtype)
    steps = textured.field((70, 45), **FIELD, dtype=dtype)
    assert got.dtype == dtype and got.shape == (70, 45)
    want = fl.spectral.opacity(steps, **MAPPED, power=power)
    assert np.abs(got - want).max() <= limit
    slow = twin.opacity(twin.field((70, 45), **FIELD), **MAPPED, power=power)
    assert np.abs(got - slow).max() <= limit


def blurred(c: float, shutter: float, seed: int, **options) -> np.ndarray:
    """One torus of opacity, falling at c cycles per frame at 70 degrees."""
    velocity = (32.0 * c * np.cos(1.22), 32.0 * c * np.sin(1.22))
    return textured.alpha(
        (64, 64), drift=options.pop("drift", (0.0, 0.0)), seed=seed, overlap=0, velocity=velocity,
        shutter=shutter, dtype=np.float64, **options,
    )  # fmt: skip


@pytest.mark.parametrize("c", [0.3, 0.9, 2.0])
def test_preserve_mean(c: float):
    # Blurring the field and then squaring loses mean opacity; sigma^2 (1 - kappa) gives
    # it back, to 1e-3. Without it at least 0.003 is missing, and 0.0175 for fast snow.
    sharp = np.mean([blurred(c, 0.0, seed) for seed in range(40)])
    without = np.mean([blurred(c, 1.0, seed) for seed in range(40)])
    kept = np.mean([blurred(c, 1.0, seed, preserve_mean=True) for seed in range(40)])
    assert sharp == pytest.approx(twin.opacity_mean(), abs=5e-4)
    assert kept == pytest.approx(sharp, abs=1e-3)
    assert without < sharp - {0.3: 0.003, 0.9: 0.012, 2.0: 0.0175}[c]

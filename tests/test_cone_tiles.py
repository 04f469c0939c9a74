"""Toroidal textures: drops by the twin, sizes and seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

import twin_cone as twin
from flurries import cone

MAKERS = [cone.rain_tile, cone.snow_tile]


def test_rain_is_the_twins():
    size, count, width, length, spread, opacity = 48, 9, 0.05, 0.2, 0.6, 0.7
    got = cone.rain_tile(
        size, seed=11, drops=count, width=width, length=length, spread=spread, opacity=opacity,
        dtype=np.float64,
    )  # fmt: skip
    u, v, s, o = (twin.unit(11, stream, count) for stream in (311, 312, 313, 314))
    factor = 1 + spread * (s - 0.5)
    places, peaks = [size * u, size * v], opacity * (1 - spread * o / 2)
    sizes = [size * width / 2 * factor, size * length / 2 * factor]
    rows = np.stack([*places, *sizes, peaks], axis=1)
    # The kernel ends a Gaussian where it is 8e-7.
    np.testing.assert_allclose(got, twin.drops(size, rows), atol=9 * 8e-7)


def test_snow_is_the_twins():
    got = cone.snow_tile(40, seed=-3, flakes=7, width=0.08, spread=0.0, opacity=0.5,
                         dtype=np.float64)  # fmt: skip
    u, v = (twin.unit(-3, stream, 7) for stream in (311, 312))
    rows = np.stack([40 * u, 40 * v, np.full(7, 1.6), np.zeros(7), np.full(7, 0.5)], axis=1)
    np.testing.assert_allclose(got, twin.drops(40, rows), atol=7 * 8e-7)


@pytest.mark.parametrize("make", MAKERS)
def test_seeds_sizes_and_dtypes(make):
    one, two = make(64, seed=1), make(64, seed=2)
    assert one.dtype == np.float32 and (one != two).any()
    np.testing.assert_array_equal(one, make(64, seed=1))
    out = np.full((64, 64), np.nan)
    assert make(64, seed=1, dtype=np.float64, out=out) is out
    np.testing.assert_allclose(out, one, atol=6e-8)
    # The same drops at any resolution: means of two by two texels agree.
    fine = make(256, seed=1, dtype=np.float64)
    coarse = make(128, seed=1, dtype=np.float64)
    halved = fine.reshape(128, 2, 128, 2).mean(axis=(1, 3))
    assert abs(halved.mean() / coarse.mean() - 1.0) < 0.02


def test_drops_smaller_than_a_texel_keep_their_energy():
    for size in (32, 64, 128):
        tile = cone.snow_tile(size, seed=9, flakes=50, width=0.01, spread=0.0, opacity=0.01,
                              dtype=np.float64)  # fmt: skip
        wanted = 50 * 0.01 * 2 * math.pi * 0.005**2
        assert abs(tile.mean() / wanted - 1.0) < 3e-3

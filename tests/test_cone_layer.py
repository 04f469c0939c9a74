"""One texture on the cone: drops, the box, the seam, the pole, energy."""

from __future__ import annotations

import math

import numpy as np
import pytest

import twin_cone as twin
from every import every
from flurries import cone
from flurries.camera import Camera

SHAPE = (30, 40)
CAMERA = Camera(30.0, rotation=(0.2, -0.4, 0.1))


@pytest.mark.parametrize(
    "given",
    [
        {"axis": (0, 1, 0), "phase": 0.0},
        {"axis": (0.3, 0.9, -0.4), "phase": 0.7, "stretch": 2.5, "repeats": 3, "slope": 0.2},
        {"axis": (0.1, 0.3, 1.0), "phase": -8.25, "offset": (0.3, -0.7), "gain": 0.5},
        {"axis": (-1, 0.02, 0), "phase": 1e6 + 0.125, "repeats": 1},
        {"axis": (0, -1, 0), "phase": 0.3, "repeats": 32},
    ],
)
@pytest.mark.parametrize("size", [8, 33])
def test_a_layer_is_the_twins(given, size):
    tile = np.random.default_rng(0).random((size, size))
    got = cone.layer(SHAPE, CAMERA, tile, **given, dtype=np.float64)
    want = twin.layer(SHAPE, CAMERA, tile, **given)
    # The twin's footprints come from differences, right to 1e-7.
    np.testing.assert_allclose(got, want, atol=2e-6)
    single = cone.layer(SHAPE, CAMERA, tile, **given)
    np.testing.assert_allclose(single, got, atol=6e-8)


@every("axis", [(0.3, 1, 0.2), (0.1, 0.4, 1.0)])
@every("repeats", [8, 16, 24])
def test_against_ten_by_ten_samples(axis, repeats):
    # Strong reduction of a dense tile: 256 texels to a tile that is some pixels wide.
    shape, camera = (90, 120), Camera(75.0)
    tile = cone.snow_tile(256, seed=1, flakes=1500, width=0.009, opacity=1.0, dtype=np.float64)
    given = {"axis": axis, "phase": 0.37, "repeats": repeats, "slope": 0.2}
    want = twin.supersampled(shape, camera, tile, **given)
    got = cone.layer(shape, camera, tile, **given, dtype=np.float64)
    assert abs(got - want).mean() <= 0.012
    # Without the box, by the nearest texel: what a filter is for.
    points = twin.centres(shape)
    bare = twin.point_alpha(points, shape, camera, tile, **given).reshape(shape)
    assert abs(bare - want).mean() > 0.05


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_nothing_happens_at_the_pole(dtype):
    # Looking along the axis: rings around the apex, the fade hides its middle, no step anywhere.
    shape, camera = (96, 96), Camera(40.0)
    tile = cone.snow_tile(64, seed=2)
    alpha = cone.layers(shape, camera, tile, axis=(0.0, 0.0, 1.0), phase=0.4, dtype=dtype)
    assert np.isfinite(alpha).all()
    y, x = np.mgrid[:96, :96] + 0.5 - 48
    distance = np.hypot(x, y)
    # 89.4 degrees from the equator is 0.42 px from the apex here; 82.4 is 5.3 px.
    assert alpha[distance < 0.4].size == 0 or alpha[distance < 0.4].max() == 0.0
    inner, outer = alpha[distance < 2.0], alpha[(distance > 8) & (distance < 40)]
    assert inner.mean() < 0.5 * outer.mean()
    jumps = np.maximum(np.abs(np.diff(alpha, axis=0))[:, :-1], np.abs(np.diff(alpha, axis=1))[:-1])
    near = distance[:-1, :-1] < 8
    assert jumps[near].max() <= jumps[~near].max()


def test_longer_streaks_keep_the_light():
    shape, camera, tile = (64, 64), Camera(60.0), cone.rain_tile(128, seed=1, opacity=0.3)
    given = {"axis": (0, 1, 0), "phase": 0.0, "dtype": np.float64}
    short = cone.layer(shape, camera, tile, **given)
    # A tile of eight times the height is not seen whole: many phases give its mean.
    long = np.mean(
        [
            cone.layer(shape, camera, tile, **{**given, "phase": p}, stretch=8.0, offset=(u, 0.0))
            for p in np.arange(16) / 16
            for u in np.arange(8) / 8
        ],
        axis=0,
    )
    assert abs(long.mean() * 8.0 / tile.mean() - 1.0) < 0.01
    bright = cone.layer(shape, camera, tile, **given, stretch=8.0, conserve=False)
    dim = cone.layer(shape, camera, tile, **given, stretch=8.0)
    np.testing.assert_allclose(bright, 8.0 * dim, rtol=1e-12)
    assert short.max() > dim.max()


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


@pytest.mark.parametrize("make", [cone.rain_tile, cone.snow_tile])
def test_tiles_have_the_same_drops_at_any_resolution(make):
    # Means of two by two texels agree.
    fine, coarse = (make(size, seed=1, dtype=np.float64) for size in (256, 128))
    halved = fine.reshape(128, 2, 128, 2).mean(axis=(1, 3))
    assert abs(halved.mean() / coarse.mean() - 1.0) < 0.02
    assert (make(128, seed=2, dtype=np.float64) != coarse).any()


def test_drops_smaller_than_a_texel_keep_their_energy():
    for size in (32, 64, 128):
        tile = cone.snow_tile(size, seed=9, flakes=50, width=0.01, spread=0.0, opacity=0.01,
                              dtype=np.float64)  # fmt: skip
        wanted = 50 * 0.01 * 2 * math.pi * 0.005**2
        assert abs(tile.mean() / wanted - 1.0) < 3e-3

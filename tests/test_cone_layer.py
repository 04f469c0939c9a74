"""One texture on the cone: drops, the box, the seam, the pole, energy."""

import numpy as np
import pytest

import twin_cone as twin
from every import every
from flurries import cone
from flurries.camera import Camera
from twin import hashed, unit

SHAPE = (30, 40)
CAMERA = Camera(30.0, rotation=(0.2, -0.4, 0.1))


@pytest.mark.parametrize("given", [
    {"axis": (0, 1, 0), "phase": 0.0},
    {"axis": (0.3, 0.9, -0.4), "phase": 0.7, "stretch": 2.5, "repeats": 3, "slope": 0.2},
    {"axis": (0.1, 0.3, 1.0), "phase": -8.25, "offset": (0.3, -0.7), "gain": 0.5},
    {"axis": (-1, 0.02, 0), "phase": 1e6 + 0.125, "repeats": 1},
    {"axis": (0, -1, 0), "phase": 0.3, "repeats": 32},
])  # fmt: skip
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


def test_longer_streaks_keep_the_light():
    given = {"axis": (0, 1, 0), "phase": 0.0, "stretch": 8.0, "dtype": np.float64}
    tile = cone.rain_tile(128, seed=1, opacity=0.3)
    bright, dim = (cone.layer(SHAPE, CAMERA, tile, **given, conserve=c) for c in (False, True))
    np.testing.assert_allclose(bright, 8.0 * dim, rtol=1e-12)


@pytest.mark.parametrize(("length", "spread"), [(0.2, 0.6), (None, 0.0)], ids=["rain", "snow"])
def test_tiles_are_the_twins(length, spread):
    size, count, width, opacity = 48, 9, 0.05, 0.7
    about = {"seed": -11, "width": width, "spread": spread, "opacity": opacity, "dtype": np.float64}
    if length is None:
        got = cone.snow_tile(size, flakes=count, **about)
    else:
        got = cone.rain_tile(size, drops=count, length=length, **about)
    u, v, s, o = (unit(hashed(-11, stream, np.arange(count))) for stream in (311, 312, 313, 314))
    factor, peaks = 1 + spread * (s - 0.5), opacity * (1 - spread * o / 2)
    sizes = [size * width / 2 * factor, size * (length or 0.0) / 2 * factor]
    # The kernel ends a Gaussian where it is 8e-7.
    want = twin.drops(size, np.stack([size * u, size * v, *sizes, peaks], axis=1))
    np.testing.assert_allclose(got, want, atol=9 * 8e-7)

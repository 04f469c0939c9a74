"""Four layers at once: against their composition, and the chart that is kept."""

from functools import partial

import numpy as np
import pytest

import twin_cone as twin
from every import every
from flurries import cone
from flurries.camera import Camera

TILE = cone.snow_tile(128, seed=3)
RAIN = cone.rain_tile(256, seed=3)
OFFSETS = ((0, 0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.83))
AXES = [(0, 1, 0), (0.3, 0.9, -0.4), (0.05, 0.1, 1.0), (1, 0.05, 0.0), (0, -1, 0)]


@every("axis", AXES)
def test_float64_is_the_composition_of_the_twins_layers(axis):
    shape, camera = (24, 32), Camera(25.0, rotation=(0.1, 0.2, 0.0))
    given = {"axis": axis, "phase": 0.7, "stretch": 1.5, "slope": 0.1}
    got = cone.layers(shape, camera, TILE, **given, dtype=np.float64)
    clear = np.ones(shape)
    for factor, offset in zip((1, 2, 4, 8), OFFSETS, strict=True):
        clear *= 1 - twin.layer(shape, camera, TILE, **given, repeats=4 * factor, offset=offset)
    np.testing.assert_allclose(got, 1 - clear, atol=4e-6)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("tile, focal", [(TILE, 120.0), (RAIN, 600.0)], ids=["snow", "rain"])
def test_float32_is_close_to_float64(axis, tile, focal):
    shape, camera = (150, 200), Camera(focal, rotation=(0.1, 0.2, 0.0))
    given = {"axis": axis, "phase": 0.7, "slope": 0.1}
    fast = cone.layers(shape, camera, tile, **given)
    exact = cone.layers(shape, camera, tile, **given, dtype=np.float64)
    # Footprints in steps of the square root of two, 8 bits: as sharp in the mean, as bright.
    assert abs(fast - exact).mean() < 0.011
    assert abs(fast.mean() / exact.mean() - 1.0) < 0.005
    assert abs(fast.std() / exact.std() - 1.0) < 0.02
    # What another phase would do: the limit can fail.
    other = cone.layers(shape, camera, tile, **{**given, "phase": 0.75}, dtype=np.float64)
    assert abs(other - exact).mean() > 0.02


@every("axis", AXES)
def test_a_chart_that_is_kept_changes_no_bit(axis):
    texture, phases = cone.Texture(TILE), (0.0, 0.33, -7.5)
    draw = partial(cone.layers, (70, 101), Camera(80.0), texture, axis=axis, stretch=1.3, slope=0.2)

    def first(phase):
        for focal in (1.0, 2.0, 3.0, 4.0):
            # Four other eyes push what is kept out.
            cone.layers((8, 8), Camera(focal), texture, axis=axis, phase=0.0)
        return draw(phase=phase)

    alone = [first(phase).tobytes() for phase in phases]
    first(0.5)
    assert [draw(phase=phase).tobytes() for phase in phases] == alone


@every("rows", [(0, 16), (5, 37), (33, 34), (64, 70)])
@every("offset", [(0, 0, 0), (0.03, 0, 0)])
@every("depth", [None, np.linspace(0.5, 20.0, 70 * 101).reshape(70, 101)])
def test_a_part_has_the_bits_of_the_whole(rows, offset, depth):
    shape, camera = (70, 101), Camera(80.0, offset=offset)
    look = {"axis": (0.2, 1, 0.4), "radius": 2.0, "phase": 0.2, "depth": depth}
    for dtype, tile in ((np.float32, cone.Texture(TILE)), (np.float64, TILE)):
        whole = cone.layers(shape, camera, tile, **look, dtype=dtype)
        out = np.full((rows[1] - rows[0], 101), np.nan, dtype)
        assert cone.layers(shape, camera, tile, **look, dtype=dtype, rows=rows, out=out) is out
        assert out.tobytes() == whole[rows[0] : rows[1]].tobytes()


def test_what_stands_in_the_picture_hides_the_layers_behind_it():
    shape, camera, axis = (48, 64), Camera(60.0), (0, 1, 0)
    depth = np.full(shape, np.inf, np.float32)
    depth[:, 20:40] = 5.0
    depth[:, 40:50] = 0.1
    depth[:, 50:] = np.nan
    texture = cone.Texture(TILE)
    alpha, exact = (
        cone.layers(shape, camera, TILE, axis=axis, phase=0.3, radius=2.0, depth=depth, dtype=dtype)
        for dtype in (np.float32, np.float64)
    )
    assert abs(alpha - exact).mean() < 0.011
    free = cone.layers(shape, camera, texture, axis=axis, phase=0.3)
    # On the cylinder straight ahead the radii are the depths: 2 and 4 m stand before 5 m.
    near = cone.layers(shape, camera, texture, axis=axis, phase=0.3, gains=(1, 1, 0, 0))
    np.testing.assert_array_equal(alpha[:, :20], free[:, :20])
    np.testing.assert_array_equal(alpha[:, 50:], free[:, 50:])
    np.testing.assert_array_equal(alpha[:, 40:50], 0.0)
    np.testing.assert_allclose(alpha[:, 24:40], near[:, 24:40], atol=2e-7)


def test_an_empty_texture_and_one_texel():
    for tile in (np.zeros((16, 16)), np.ones((1, 1)), np.ones((5, 5))):
        alpha = cone.layers((20, 20), Camera(20.0), tile, axis=(0, 1, 0), phase=0.1, gains=0.5)
        wanted = 0.0 if tile.max() == 0 else 1 - 0.5**4
        np.testing.assert_allclose(alpha, wanted, atol=1e-6)

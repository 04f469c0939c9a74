"""The double cone: rays, one texture, four layers and their chart, and the way of its axis."""

import math
from functools import partial

import mpmath
import numpy as np
import pytest

import twin_cone as twin
from every import every
from flurries import cone
from flurries.camera import Camera, image_velocity
from twin import hashed, unit

WIDE = (90, 120)
EYE = Camera(100.0, rotation=(0.2, -0.4, 0.1))
AXES = [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0, 0, 1), (0.3, 0.9, -0.4), (-0.5, 0.2, 0.8)]


@every("axis", AXES)
@every("slope", [0.0, 0.2])
def test_rays_are_the_twins(axis, slope):
    seen = cone.rays(WIDE, EYE, axis=axis, slope=slope)
    points = twin.centres(WIDE)
    rays = twin.directions(points, EYE, WIDE)
    azimuth, height = twin.hit(rays, axis, slope)
    off = seen.azimuth.ravel() - azimuth
    # Near the axis a rounding of the ray is a large turn: 1e-15 over the distance from it.
    across = np.sqrt(1 - np.minimum((rays @ twin.basis(axis)[0]) ** 2, 1.0))
    assert (np.abs(off - np.round(off)) <= 1e-15 / np.maximum(across, 1e-8)).all()
    # The same where it is seen, in heights: d w is d e / c^2.
    assert (np.abs(seen.height.ravel() - height) * across**2 <= 3e-15).all()
    np.testing.assert_allclose(seen.fade.ravel(), twin.fade(rays, axis), atol=1e-12)
    around, up = twin.steps(points, EYE, WIDE, axis, slope)
    away = across > 0.05
    np.testing.assert_allclose(seen.azimuth_step.ravel()[away], around[away], rtol=1e-5)
    np.testing.assert_allclose(seen.height_step.ravel()[away], up[away], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("travel", [(0.5, 2, 8), (-3, 1, 2), (0.1, 4, -6), (0.3, 1.0, 1e-3)])
def test_the_apex_is_the_focus_of_expansion(travel):
    # The one position from which nothing seems to move, found from Eq. 8 alone.
    camera, shape = Camera(500.0, rotation=(0.1, 0.2, -0.3)), (480, 640)
    points = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
    # The velocity is camera minus drop.
    flow = image_velocity(points, np.ones(3), -np.array(travel, float), camera, shape)
    focus = np.linalg.solve((flow[1:] - flow[0]).T / 100.0, -flow[0])
    axis = cone.path([0.0], travel).axis[0]  # The apex: where the ray is the axis itself.
    local = axis @ camera.matrix()
    apex = np.array(camera.principal(shape)) + camera.focal * local[:2] / local[2]
    assert np.abs(apex - focus).max() <= 1e-9 * max(1.0, np.abs(apex).max())
    # And the rays there agree: nothing is shown, nothing lies across.
    seen = cone.rays(shape, camera, axis=axis, points_px=[apex])
    assert seen.fade[0] == 0.0 and abs(seen.height[0]) > 1e5


def test_two_eyes_see_the_cone_at_its_distance():
    # A point of the cylinder straight ahead: its disparity is f b / R.
    shape, radius, apart = (64, 128), 2.0, 0.064
    eyes = [Camera(200.0, offset=(side * apart / 2, 0, 0)) for side in (-1, 1)]
    x = 64.0 + np.linspace(-3, 3, 7)
    look = {"axis": (0, 1, 0), "points_px": np.stack([x, np.full(7, 32.0)], axis=1)}
    left, right = (cone.rays(shape, eye, radius=radius, **look).azimuth for eye in eyes)
    # The right eye sees a point farther left.
    disparity = np.mean(left - right) / np.polyfit(x, left, 1)[0]
    assert abs(disparity - (-200.0 * apart / radius)) < 0.02
    # Without a distance the eyes see the same.
    np.testing.assert_array_equal(*[cone.rays(shape, eye, **look).azimuth for eye in eyes])


def test_azimuths_stay_in_one_turn_and_a_pixel_on_the_axis_is_finite():
    # Rays that turn back from the seam by 1e-32 to 1e-14 among them: a wrap may round up to 1.
    across = np.concatenate([np.logspace(-30, -12, 200), -np.logspace(-30, -12, 200)])
    places = np.column_stack([np.full(400, 20.0), across])
    for seen in (
        cone.rays(WIDE, Camera(30.0), axis=(0.0, 1e-30, 1.0), slope=0.0),
        cone.rays((16, 16), Camera(30.0, center=(8.0, 0.0)), axis=(0, 0, 1), points_px=places),
        cone.rays((60, 80), Camera(100.0, center=(40.5, 30.5)), axis=(0.0, -0.0, -1.0), slope=0.2),
    ):
        assert (seen.azimuth >= 0.0).all() and (seen.azimuth < 1.0).all()
        numbers = seen.azimuth, seen.height, seen.azimuth_step, seen.height_step, seen.fade
        assert all(np.isfinite(part).all() for part in numbers)


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
    bright = cone.layer(SHAPE, CAMERA, tile, **given, dtype=np.float64, conserve=False)
    np.testing.assert_allclose(bright, given.get("stretch", 1.0) * got, rtol=1e-12)


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


SNOW = cone.snow_tile(128, seed=3)
RAIN = cone.rain_tile(256, seed=3)
OFFSETS = ((0, 0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.83))
WAYS = [(0, 1, 0), (0.3, 0.9, -0.4), (0.05, 0.1, 1.0), (1, 0.05, 0.0), (0, -1, 0)]


@every("axis", WAYS)
def test_float64_is_the_composition_of_the_twins_layers(axis):
    shape, camera = (24, 32), Camera(25.0, rotation=(0.1, 0.2, 0.0))
    given = {"axis": axis, "phase": 0.7, "stretch": 1.5, "slope": 0.1}
    got = cone.layers(shape, camera, SNOW, **given, dtype=np.float64)
    clear = np.ones(shape)
    for factor, offset in zip((1, 2, 4, 8), OFFSETS, strict=True):
        clear *= 1 - twin.layer(shape, camera, SNOW, **given, repeats=4 * factor, offset=offset)
    np.testing.assert_allclose(got, 1 - clear, atol=4e-6)


@pytest.mark.parametrize("axis", WAYS)
@pytest.mark.parametrize("tile, focal", [(SNOW, 120.0), (RAIN, 600.0)], ids=["snow", "rain"])
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


@every("axis", WAYS)
def test_a_chart_that_is_kept_changes_no_bit(axis):
    texture, phases = cone.Texture(SNOW), (0.0, 0.33, -7.5)
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
    for dtype, tile in ((np.float32, cone.Texture(SNOW)), (np.float64, SNOW)):
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
    texture = cone.Texture(SNOW)
    alpha, exact = (
        cone.layers(shape, camera, SNOW, axis=axis, phase=0.3, radius=2.0, depth=depth, dtype=dtype)
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


DROP = (0.4, 5.0, -0.3)


def cycles_apart(a, b):
    off = np.asarray(a) - np.asarray(b)
    return np.abs(off - np.round(off)).max()


def test_the_speed_at_the_equator_is_a_drops():
    # Where the ray is square to the axis, layer i moves as a drop at its radius does.
    radius, repeats, fps = 2.0, 4, 30.0
    camera, shape = Camera(800.0), (101, 101)
    moving = cone.path([0.0, 1.0], (0.0, 5.0, 0.0), radius=radius, repeats=repeats)
    a, b = moving.at(0.3), moving.at(0.3 + 1e-4)
    assert a.axis == (0.0, 1.0, 0.0)
    for factor, wanted in [(1, 2.5), (2, 1.25), (4, 0.625), (8, 0.3125)]:
        # V = n w / (2 pi L) - phase: what stays the same V moves in w by this.
        rate = (b.phase - a.phase) / 1e-4 * 2 * math.pi * a.stretch / (repeats * factor)
        assert abs(rate - wanted) < 1e-6 * wanted
        flow = image_velocity([(50.5, 50.5)], radius * factor, (0, -5.0 / fps, 0), camera, shape)
        assert abs(flow[0, 1] - camera.focal * rate / fps) < 1e-5


def integral(start, end, ends, length, t, root):
    """Tiles of scroll up to t of one second, in 30 digits: s |v| / (1 + |v| blur)."""
    mpmath.mp.dps = 30
    start, change = [mpmath.mpf(x) for x in start], [mpmath.mpf(x) for x in end - start]

    def rate(u):
        pace = mpmath.sqrt(sum((a + b * u) ** 2 for a, b in zip(start, change, strict=True)))
        blur = (mpmath.mpf(ends[0]) + (mpmath.mpf(ends[1]) - ends[0]) * u) / length
        return (1 if u < root else -1) * pace / (1 + pace * blur)

    near = [abs(place - 2.0**-k) for k in range(1, 14) for place in (0.0, 1.0)]
    tiles = mpmath.quad(rate, sorted({x for x in (0.0, *near, root, t) if 0.0 <= x <= t}))
    return float(mpmath.frac(tiles / mpmath.pi))


COURSES = [
    # A velocity that passes near zero inside a piece, at several distances from it.
    *[((miss, 3.0, 0.0), (0, 5, 0), (0.01, 0.01)) for miss in (1.0, 1e-2, 1e-4, 1e-8, 0.0)],
    # Up to 500 drops long in a second: the integrand has a pole close to where the exposure is 0.
    *[(DROP, camera, ends) for camera in ((0, 0, 0), (0, 7.3, 0))
      for ends in ((0.0, 0.5), (0.4, 0.1), (2.0, 0.0), (0.02, 0.03))],
]  # fmt: skip


@pytest.mark.parametrize(("start", "camera", "ends"), COURSES)
def test_the_phase_is_the_integral_in_exact_arithmetic(start, camera, ends):
    start, end = np.array(start), np.subtract(start, camera)
    moving = cone.path([0.0, 1.0], [start, end], exposure=ends, length=0.02)
    axis = moving.axis[0]
    root = -(start @ axis) / ((end - start) @ axis) if any(camera) else 2.0
    for t in (0.7, 1.0):
        state = moving.at(t)
        assert cycles_apart(state.phase, integral(start, end, ends, 0.02, t, root)) < 1e-9
        pace = np.linalg.norm(start + (end - start) * t)
        blur = (ends[0] + (ends[1] - ends[0]) * t) / 0.02
        assert state.stretch == pytest.approx(1.0 + pace * blur, rel=1e-13)
    # Outside it holds.
    for t, stretch in ((3.0, moving.stretch[1]), (-1.0, moving.stretch[0])):
        assert moving.at(t).stretch == stretch


def test_nothing_moves():
    for drop in ((0.0, 0.0, 0.0), DROP):
        # A camera that falls with the drops.
        still = cone.path([0.0, 1.0], drop, drop)
        np.testing.assert_array_equal(still.axis, [[0, 1, 0]] * 2)
        assert not still.phase.any() and (still.stretch == 1.0).all()
        assert still.at(17.0) == cone.State((0.0, 1.0, 0.0), 0.0, 1.0, 0.0)


def test_straight_up():
    # A camera that falls faster than the drops: they go up. The axis still points down.
    moving = cone.path([0.0, 1.0], (0.0, 5.0, 0.0), (0.0, 30.0, 0.0))
    assert moving.axis.tolist() == [[0, 1, 0]] * 2 and (moving.speed == -25.0).all()
    # An axis given straight up, and close to it: finite, and the frame stays square.
    tile = cone.snow_tile(64, seed=1)
    for tilt in (0.0, 1e-13, 1e-9, 1e-3):
        alpha = cone.layers((48, 64), Camera(60.0), tile, axis=(tilt, -1.0, 0.0), phase=0.3)
        assert np.isfinite(alpha).all() and alpha.max() > 0.2


def test_past_zero_at_a_small_distance():
    # Not quite through zero, between two frames: the axis turns the shorter way, never by more than
    # a right angle, and the drops go backwards along it.
    t = (np.arange(121) + 0.5) / 60
    drop = np.stack([np.full(121, 0.01), 5.0 - 5.0 * t, np.zeros(121)], axis=1)
    # At 1/24 m/s before and after, .01 aside: 27 degrees, of which the sign takes none. Where
    # `still` is above what is left of the speed, nothing turns at all.
    for calm, most in (({}, 0.5), ({"still": 0.2}, 0.11)):
        moving = cone.path(t, drop, **calm)
        turns = np.arccos(np.clip((moving.axis[1:] * moving.axis[:-1]).sum(axis=1), -1, 1))
        assert turns.max() < most and moving.speed[0] > 0 > moving.speed[-1]


def test_a_stuttering_clock():
    # Frames that come late, or at once: what is seen at a time does not depend on those before.
    rng = np.random.default_rng(7)
    steps = rng.choice([1 / 60, 1 / 30, 1 / 5, 0.0, 1.5], 400)
    times = np.concatenate([[0.0], np.cumsum(steps)])
    moving = cone.path(times, DROP, (0.0, 0.0, 3.0))
    steady = cone.path([0.0], DROP, (0.0, 0.0, 3.0))
    assert cycles_apart(moving.phase, [steady.at(t).phase for t in times]) < 1e-11
    assert (moving.stretch == steady.stretch[0]).all() and np.isfinite(moving.axis).all()

"""Axis and phase over a whole way: the hard cases of the clock and of the velocity, by name."""

import math

import mpmath
import numpy as np
import pytest

from flurries import cone
from flurries.camera import Camera, image_velocity

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


WAYS = [
    # A velocity that passes near zero inside a piece, at several distances from it.
    *[((miss, 3.0, 0.0), (0, 5, 0), (0.01, 0.01)) for miss in (1.0, 1e-2, 1e-4, 1e-8, 0.0)],
    # Up to 500 drops long in a second: the integrand has a pole close to where the exposure is 0.
    *[(DROP, camera, ends) for camera in ((0, 0, 0), (0, 7.3, 0))
      for ends in ((0.0, 0.5), (0.4, 0.1), (2.0, 0.0), (0.02, 0.03))],
]  # fmt: skip


@pytest.mark.parametrize(("start", "camera", "ends"), WAYS)
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
    moving = cone.path(t, drop)
    turns = np.arccos(np.clip((moving.axis[1:] * moving.axis[:-1]).sum(axis=1), -1, 1))
    # At 1/24 m/s before and after, .01 aside: 27 degrees, of which the sign takes none.
    assert turns.max() < 0.5
    assert moving.speed[0] > 0 > moving.speed[-1]
    # Where `still` is above what is left of the speed, nothing turns at all.
    calm = cone.path(t, drop, still=0.2)
    turns = np.arccos(np.clip((calm.axis[1:] * calm.axis[:-1]).sum(axis=1), -1, 1))
    assert turns.max() < 0.11 and calm.speed[0] > 0 > calm.speed[-1]


def test_dt_zero_and_a_paused_clock():
    paused = cone.path([0.0, 0.5, 0.5, 0.5, 1.0], DROP)
    plain = cone.path([0.0, 0.5, 1.0], DROP)
    assert np.isfinite(paused.axis).all()
    assert paused.phase[1] == paused.phase[2] == paused.phase[3]
    np.testing.assert_allclose(paused.phase[[0, 1, 4]], plain.phase, atol=1e-14)
    assert (paused.stretch == plain.stretch[0]).all()


def test_a_stuttering_clock():
    # Frames that come late: what is seen at a time does not depend on the frames before it.
    rng = np.random.default_rng(7)
    steps = rng.choice([1 / 60, 1 / 30, 1 / 5, 0.0, 1.5], 400)
    times = np.concatenate([[0.0], np.cumsum(steps)])
    moving = cone.path(times, DROP, (0.0, 0.0, 3.0))
    steady = cone.path([0.0], DROP, (0.0, 0.0, 3.0))
    assert cycles_apart(moving.phase, [steady.at(t).phase for t in times]) < 1e-11

"""Flakes as points: where they are, and their image against the slow twin."""

import math
from fractions import Fraction
from itertools import product

import mpmath
import numpy as np
import pytest

import twin_particles as twin
from every import every
from flurries import particles
from flurries.camera import Camera


@every("time", [0.0, 1.0, -3.25, 1e3, 123456.789, 1e9, -1e9])
@every("center", [(0.0, 0.0, 0.0), (1.5, -20.25, 3.0), (1e3, 1e6, -7e4)])
def test_a_position_is_the_formula_in_exact_arithmetic(time, center):
    box, seed = (10.0, 7.3, 0.5), 42
    velocity = np.random.default_rng(0).normal(size=(20, 3))
    got = particles.positions(20, box, seed=seed, velocity=velocity, time=time, center=center)
    for index, axis in np.ndindex(20, 3):
        speed = velocity[index, axis]
        want = twin.position(index, box[axis], seed, speed, time, center[axis], axis)
        off = Fraction(float(got[index, axis])) - want
        # A flake within rounding of a wall may stand at the other one.
        off -= round(off / Fraction(box[axis])) * Fraction(box[axis])
        limit = 1e-15 * box[axis] + np.spacing(abs(center[axis]) + box[axis])
        assert abs(off) <= limit, (index, axis, float(off))
    # One velocity for all, and fewer flakes, are the same.
    alone = particles.positions(8, box, seed=seed, velocity=velocity[7], time=time, center=center)
    np.testing.assert_array_equal(alone[7], got[7])


@every("box", [0.1, 3.0, 7.3])
def test_a_flake_that_is_sent_to_the_wall_is_folded(box):
    # An ulp before it, on it, and an ulp behind, from as far as 10^6 boxes.
    start = particles.positions(20, box, seed=1, velocity=(0.0, 0.0, 0.0), time=0.0)
    for index, place in enumerate(start):
        for boxes in (0.0, 1.0, 1e6):
            way = boxes * box + 0.5 * box - place
            for move in (np.nextafter(way, -np.inf), way, np.nextafter(way, np.inf)):
                got = particles.positions(index + 1, box, seed=1, velocity=move, time=1.0)[index]
                assert (got >= -0.5 * box).all() and (got < 0.5 * box).all()


@pytest.mark.parametrize("time", [0.0, 7.5, 1e9])
def test_the_sway_is_two_sines_added_after_the_wrap(time):
    amplitude, omega, seed = 0.3, 0.7, 9
    offsets = particles.sway_offsets(40, seed=seed, time=time, sway=(amplitude, omega))
    with mpmath.workdps(40):
        for index in (0, 13, 39):
            for axis, word in ((0, 3), (2, 4)):
                phase = 2 * mpmath.pi * mpmath.mpf(twin.unit(seed, index, word))
                want = amplitude * mpmath.sin(mpmath.mpf(omega) * mpmath.mpf(time) + phase)
                assert abs(offsets[index, axis] - want) < 1e-15
    assert (offsets[:, 1] == 0).all()
    arguments = {"seed": seed, "velocity": (0, 1, 0), "time": time}
    plain = particles.positions(40, 3.0, **arguments)
    swaying = particles.positions(40, 3.0, **arguments, sway=(amplitude, omega))
    np.testing.assert_array_equal(swaying, plain + offsets)


def test_the_fade_is_the_formula():
    rng = np.random.default_rng(4)
    box, center = np.array([4.0, 6.0, 8.0]), np.array([1.0, -2.0, 100.0])
    points = center + rng.uniform(-0.55, 0.55, (5000, 3)) * box
    got = particles.edge_fade(points, box, center=center)
    reach = 2 * np.abs(points - center) / box
    t = np.clip((reach - 0.85) / 0.15, 0, 1)
    want = np.prod(1 - t * t * (3 - 2 * t), axis=1)
    np.testing.assert_allclose(got, want, atol=2e-14)
    assert set(got[(reach >= 1).any(axis=1)]) == {0.0}
    assert set(got[(reach <= 0.85 * (1 - 1e-12)).all(axis=1)]) == {1.0}
    np.testing.assert_array_equal(
        particles.edge_fade(points, 4.0), particles.edge_fade(points, (4.0, 4.0, 4.0))
    )


FOCAL = 300.0


def one(shape, x, y, *, sigma, opacity=1e-3, depth=2.0, dtype=np.float64, **more):
    height, width = shape
    point = ((x - width / 2) * depth / FOCAL, (y - height / 2) * depth / FOCAL, depth)
    radius = 3 * sigma * depth / FOCAL
    return particles.splat(
        shape, [point], radius, Camera(FOCAL), opacity=opacity, dtype=dtype, **more
    )


def cloud(count, seed, *, speed, shutter):
    """Return flakes as arguments and as the twin wants them; some huge, behind, far outside."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1, -0.8, -0.3), (1, 0.8, 4), (count, 3))
    radius = 0.05 * rng.uniform(0, 1, count) ** 3 + 0.002
    opacity = rng.uniform(0, 0.9, count)
    velocity = rng.normal(0, speed, (count, 3))
    flakes = [
        {"point": p, "radius": r, "opacity": o, "velocity": v, "shutter": shutter}
        for p, r, o, v in zip(points, radius, opacity, velocity, strict=True)
    ]
    arguments = {"opacity": opacity, "velocity": velocity, "shutter": shutter}
    return points, radius, arguments, flakes


@every(
    ("speed", "shutter"), [(0.0, 0.0), (1e-5, 0.5), (0.003, 0.5), (0.05, 0.5), (0.6, 1.0), (5, 2)]
)
@every("shape", [(1, 1), (64, 64), (75, 130)])
def test_the_image_is_the_twins(speed, shutter, shape):
    points, radius, arguments, flakes = cloud(150, 7, speed=speed, shutter=shutter)
    camera = Camera(FOCAL, center=(33.25, 40.5), offset=(0.03, -0.02, 0.1), center_shift=(1.5, -2))
    want = twin.splat(shape, flakes, FOCAL, center=(34.75, 38.5), offset=camera.offset)
    wide = particles.splat(shape, points, radius, camera, dtype=np.float64, **arguments)
    narrow = particles.splat(shape, points, radius, camera, **arguments)
    assert (wide.dtype, narrow.dtype) == (np.float64, np.float32)
    # erf near 1 loses an ulp of 1, times sqrt(pi/2) / L with L >= 0.45 or scipy's own 1e-3.
    np.testing.assert_allclose(wide, want, rtol=0, atol=2e-12)
    np.testing.assert_allclose(narrow, want, rtol=0, atol=4e-6)
    assert wide.min() >= 0 and wide.max() <= 1


@every("sigma", [0.02, 0.1, 0.2, 0.54, 0.57, 0.61, 0.65, 0.7, 0.8, 1.0, 1.3, 2.5])
@every("length", [0.0, 1e-7, 1e-3, 0.2, 0.4, 0.6, 0.65, 1.0, 1.5, 4.0, 11.0, 40.0])
def test_energy_of_streaks_of_every_length_and_angle(sigma, length):
    for angle, x in product(np.linspace(0, math.pi, 9), (0.0, 0.1, 0.3, 0.5)):
        travel = np.array([math.cos(angle), math.sin(angle), 0]) * length * 2.0 / FOCAL
        alpha = one((90, 90), 45 + x, 45.1, sigma=sigma, velocity=travel / 0.5, shutter=0.5)
        energy = alpha.sum() / (2 * math.pi * 1e-3 * sigma**2)
        assert abs(energy - 1) < 0.002, (angle, x, energy)


def test_an_aspect_stretches_places_and_no_flakes():
    eye = Camera(200.0, offset=(0.1, -0.2, 0.3), aspect=1.5)
    alpha = particles.splat((120, 160), [(0.3, 0.1, 4.3)], 0.2, eye, opacity=0.5, dtype="float64")
    places = np.indices(alpha.shape) + 0.5
    middle = (places * alpha).sum(axis=(1, 2)) / alpha.sum()
    assert middle == pytest.approx([60.0 + 300.0 * 0.3 / 4.0, 80.0 + 200.0 * 0.2 / 4.0], abs=1e-3)
    spread = ((places - middle[:, None, None]) ** 2 * alpha).sum(axis=(1, 2)) / alpha.sum()
    assert spread[0] == pytest.approx(spread[1], rel=1e-3)


def test_the_rim_has_no_step():
    # A flake moves by 1e-4 px; nowhere does alpha change by more than its slope allows.
    for sigma in (0.3, 1.0, 4.0):
        effective = math.sqrt(max(sigma**2 + 1 / 12, 0.38))
        for speed in (None, (1.0, 0.7, 0.0)):
            flake = {"sigma": sigma, "opacity": 1, "velocity": speed, "shutter": 0.04}
            alphas = [one((40, 50), x, 20.2, **flake) for x in 20 + np.arange(0, 0.01, 1e-4)]
            assert np.abs(np.diff(alphas, axis=0)).max() < 0.7 * 1e-4 / effective


def test_a_hundred_thousand_faint_flakes_hide_what_they_should():
    alone = one((64, 64), 32, 32, sigma=9.0, opacity=1e-5)
    points, eye = np.tile((0.0, 0.0, 2.0), (100_000, 1)), Camera(FOCAL)
    got = particles.splat((64, 64), points, 27.0 * 2.0 / FOCAL, eye, opacity=1e-5)
    np.testing.assert_allclose(got, -np.expm1(1e5 * np.log1p(-alone)), rtol=0, atol=1e-6)


@every("dtype", [np.float32, np.float64])
@every("near", [0.1, 1e-12, 1e-300])
def test_huge_flakes_and_endless_streaks_are_finite(dtype, near):
    points = [(0, 0, near * 1.5), (1e-3, 0, 0.11), (1e12, 1e12, 1), (0, 0, 1e300), (1e300, 0, 0.2)]
    velocity = [(0, 0, 0), (0, 0, -100), (-3e12, 1e11, 0), (0, 0, 0), (1e300, 1e300, 1e300)]
    alpha = particles.splat(
        (70, 90), points, 5.0, Camera(FOCAL), opacity=0.5, velocity=velocity, shutter=1.0,
        near=near, dtype=dtype,
    )  # fmt: skip
    assert alpha.min() >= 0 and alpha.max() <= 1


@pytest.mark.parametrize("map_dtype", [np.float32, np.float64])
def test_what_stands_in_front_hides(map_dtype):
    shape = (70, 140)
    points, radius, arguments, flakes = cloud(200, 11, speed=0.05, shutter=1.0)
    depth = np.full(shape, np.inf, map_dtype)
    depth[10:60, 20:130] = np.linspace(0.2, 4, 110, dtype=map_dtype)
    want = twin.splat(shape, flakes, FOCAL, depth_map=depth.astype(float))
    for dtype, limit in ((np.float64, 2e-12), (np.float32, 4e-6)):
        got = particles.splat(
            shape, points, radius, Camera(FOCAL), depth=depth, dtype=dtype, **arguments
        )
        np.testing.assert_allclose(got, want, rtol=0, atol=limit)
    # A wall at its own depth does not hide a flake.
    given = {"opacity": 0.5, "dtype": np.float64}
    plain = particles.splat((20, 20), [(0, 0, 2.0)], 0.04, Camera(FOCAL), **given)
    for wall, visible in ((2.0, True), (1.999, False), (np.nan, True), (np.inf, True)):
        walls = np.full((20, 20), wall)
        alpha = particles.splat((20, 20), [(0, 0, 2.0)], 0.04, Camera(FOCAL), depth=walls, **given)
        np.testing.assert_array_equal(alpha, plain if visible else 0)

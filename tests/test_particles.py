"""Where the flakes are: fl.particles.positions, sway_offsets, edge_fade."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

import flurries as fl
import twin_particles as twin
from every import every
from flurries import particles

STILL = {"velocity": (0.0, 0.0, 0.0), "time": 0.0}


@every("time", [0.0, 1.0, -3.25, 1e3, 123456.789, 1e9, -1e9])
@every("center", [(0.0, 0.0, 0.0), (1.5, -20.25, 3.0), (1e3, 1e6, -7e4)])
def test_a_position_is_the_formula_in_exact_arithmetic(time, center):
    box, velocity, seed = (10.0, 7.3, 0.5), (0.1, 1.7, -0.013), 42
    got = particles.positions(20, box, seed=seed, velocity=velocity, time=time, center=center)
    for index in range(20):
        for axis in range(3):
            want = twin.position(index, box[axis], seed, velocity[axis], time, center[axis], axis)
            off = Fraction(float(got[index, axis])) - want
            # A flake within rounding of a wall may stand at the other one.
            off -= round(off / Fraction(box[axis])) * Fraction(box[axis])
            limit = 1e-15 * box[axis] + np.spacing(abs(center[axis]) + box[axis])
            assert abs(off) <= limit, (index, axis, float(off))


def test_a_velocity_per_flake_is_each_flakes_own():
    velocity = np.random.default_rng(0).normal(size=(50, 3))
    together = particles.positions(50, 4.0, seed=1, velocity=velocity, time=1e5)
    for index in (0, 7, 49):
        alone = particles.positions(50, 4.0, seed=1, velocity=velocity[index], time=1e5)
        np.testing.assert_array_equal(together[index], alone[index])


def test_any_time_alone_is_the_same_as_in_a_sequence():
    arguments = {"seed": 3, "velocity": (0.3, 1.0, -0.2), "sway": (0.5, 0.1)}
    times = np.arange(0, 40, 0.5)
    forward = [particles.positions(300, 9.0, time=t, **arguments) for t in times]
    for k in np.random.default_rng(1).permutation(len(times)):
        again = particles.positions(300, 9.0, time=times[k], **arguments)
        np.testing.assert_array_equal(again, forward[k])
        few = particles.positions(10, 9.0, time=times[k], **arguments)
        np.testing.assert_array_equal(few, forward[k][:10])


def test_no_flakes():
    assert particles.positions(0, 9.0, seed=3, velocity=(0, 0, 0), time=1.0).shape == (0, 3)
    assert particles.sway_offsets(0, seed=3, time=1.0, sway=(1, 1)).shape == (0, 3)
    assert particles.edge_fade(np.empty((0, 3)), 1.0).shape == (0,)


@pytest.mark.parametrize("time", [0.0, 17.0, 1e6])
def test_positions_are_uniform(time):
    n, cells = 64_000, 8
    points = particles.positions(n, 5.0, seed=11, velocity=(0.4, 0.9, 0.1), time=time)
    index = np.floor((points + 2.5) / 5.0 * cells).astype(int)
    counts = np.zeros((cells,) * 3)
    np.add.at(counts, tuple(index.T), 1)
    statistic = ((counts - n / cells**3) ** 2 / (n / cells**3)).sum()
    low, high = chi2.ppf([1e-4, 1 - 1e-4], cells**3 - 1)
    assert low < statistic < high


def test_the_density_stays_where_the_camera_flies():
    # At 20 units per frame; a window of 3.6 % of the box, fixed to the camera.
    n, box = 20_000, 30.0
    share = 0.33**3
    counts = []
    for frame in range(50):
        center = np.array([20.0 * frame, 0.3 * frame, 5.0 * math.sin(frame)])
        points = particles.positions(
            n, box, seed=2, velocity=(0.2, 1.1, 0.0), time=frame, center=center
        )
        inside = np.abs(points - center) < 0.165 * box
        counts.append(inside.all(axis=1).sum())
    variance = n * share * (1 - share)
    z = (np.array(counts) - n * share) / math.sqrt(variance)
    assert np.abs(z).max() < 4.5
    # Frames share flakes, so the bound on the spread is wide; a density that breathes is wider.
    assert 0.4 < z.std() < 1.8
    assert abs(z.mean()) < 1.0


@given(
    seed=st.integers(-(2**63), 2**63 - 1),
    box=st.floats(1e-6, 1e6),
    rate=st.floats(-1e6, 1e6),
    time=st.floats(-1e9, 1e9),
)
def test_the_offset_stays_in_the_half_open_box(seed, box, rate, time):
    points = particles.positions(8, box, seed=seed, velocity=(rate, 0.0, -rate), time=time)
    assert (points >= -box / 2).all()
    assert (points < box / 2).all()


def test_seeds_and_axes_differ():
    a = particles.positions(100, 2.0, seed=0, **STILL)
    b = particles.positions(100, 2.0, seed=-1, **STILL)
    assert np.abs(a - b).max() > 0.5
    correlation = np.corrcoef(np.hstack([a, b]).T) - np.eye(6)
    assert np.abs(correlation).max() < 0.45


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
    np.testing.assert_allclose(got, twin.edge_fade(points, box, center), atol=2e-14)
    outside = (2 * np.abs(points - center) >= box).any(axis=1)
    inside = (2 * np.abs(points - center) <= 0.85 * box * (1 - 1e-12)).all(axis=1)
    assert outside.any()
    assert inside.any()
    assert (got[outside] == 0).all()
    assert (got[inside] == 1).all()
    np.testing.assert_array_equal(
        particles.edge_fade(points, 4.0), particles.edge_fade(points, (4.0, 4.0, 4.0))
    )


def test_nothing_pops_at_the_wrap():
    # Across many frames no flake that jumps by a box is visible before or after.
    box, center = 6.0, np.zeros(3)
    last = None
    jumps = 0
    for frame in range(60):
        points = particles.positions(500, box, seed=8, velocity=(0.05, 0.11, 0.02), time=frame)
        fade = particles.edge_fade(points, box, center=center)
        if last is not None:
            jumped = (np.abs(points - last[0]) > box / 2).any(axis=1)
            jumps += jumped.sum()
            # A step of 0.11 is 3.7 % of the half box: 1 - smoothstep there is below 0.16.
            assert fade[jumped].max(initial=0) < 0.16
            assert last[1][jumped].max(initial=0) < 0.16
        last = points, fade
    assert jumps > 100


def test_the_image_of_a_flake_is_the_twins():
    # A flake of sigma 1 px, centred on a pixel.
    drawn = particles.splat((1, 1), [[0.0, 0.0, 1.0]], 0.03, fl.Camera(100.0), opacity=0.5,
                            dtype=np.float64)  # fmt: skip
    np.testing.assert_allclose(drawn[0, 0], 0.5 * twin.share(1.0, 1.0 + 1 / 12), rtol=1e-12)

"""Where the flakes are: fl.particles.positions, sway_offsets, edge_fade."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twin_particles as twin
from every import every
from flurries import particles


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

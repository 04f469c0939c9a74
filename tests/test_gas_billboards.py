"""The errors of billboards: direct projection in 700 digits, domain, hard spots."""

import math
from itertools import product

import mpmath
import numpy as np
import pytest

import flurries as fl

DIGITS = 700
EPS = np.finfo(float).eps
R, Y = 0.45, 0.8


def direct(x, depth, near):
    """Projection error by direct projection; None where there is none."""
    with mpmath.workdps(DIGITS):
        x, depth, near = mpmath.mpf(x), mpmath.mpf(depth), mpmath.mpf(near)
        c, r = mpmath.matrix([x, Y, depth]), mpmath.mpf(R)
        flat = c + mpmath.matrix([r, 0, 0])
        # Square to (0, 1, 0) and to the way to the eye.
        facing = c + r * mpmath.matrix([depth, 0, -x]) / mpmath.hypot(x, depth)
        if depth <= 0 or facing[2] <= 0:
            return None
        return [near * flat[k] / flat[2] - near * facing[k] / facing[2] for k in (0, 1)]


def off(got, want, allowed=0.0):
    """Relative errors of both components; 0 where the first is within what is allowed."""
    with mpmath.workdps(DIGITS):
        errors = [abs(mpmath.mpf(float(a)) - b) for a, b in zip(got, want, strict=True)]
        errors[0] = errors[0] if errors[0] > allowed else 0
        return [float(e / abs(b)) if e else 0.0 for e, b in zip(errors, want, strict=True)]


def signed(sizes):
    return [x for size in sizes for x in (size, -size)]


def test_exact_forms_against_direct_projection():
    near = 1.3
    places = signed([1e-160, 1e-100, 1e-30, 1e-9, 1e-3, 0.05, R, 1.0, 7.0, 300.0, 1e5])
    for x, depth in product(places, [0.1, 0.3, 1.0, 5.0, 100.0, 1e4, 1e6]):
        got = fl.gas.projection_error([(x, Y, depth)], R, near=near)[0]
        want = direct(x, depth, near)
        if want is None:
            assert np.isnan(got).all()
            continue
        allowed = 0.0
        if -3.5 * R < x < -0.5 * R:
            # Near the second zero two terms cancel.
            s = math.hypot(x, depth)
            term = near * R * -x * (-x * s / (s + depth) + R)
            allowed = 4 * EPS * term / (depth * (depth * s - R * x))
        assert max(off(got, want, allowed)) <= 1e-13, (x, depth)


def test_nan_exactly_where_the_domain_ends():
    # Behind, at the eye's plane, and where the facing billboard's edge lies behind it.
    for depth in (0.0, -0.0, -1.0):
        assert np.isnan(fl.gas.projection_error([(0.3, 0.1, depth)], R)).all()
    # D S = r C_x: with r > D. On both sides of the end of the domain, bit by bit.
    depth, x = 0.5, 2.0
    edge = depth * math.hypot(x, depth) / x
    for factor, seen in ((1 - 4 * EPS, True), (1 + 4 * EPS, False)):
        values = fl.gas.projection_error([(x, 0.3, depth)], edge * factor)
        parallax = fl.gas.parallax_error([(x - 0.05, 0.3, depth)], edge * factor, eye_distance=0.1)
        assert (np.isfinite(values) == seen).all() and (np.isfinite(parallax) == seen).all()
    # r > D is no end in itself.
    assert np.isfinite(fl.gas.projection_error([(0.1, 0.0, 0.4)], R)).all()


@pytest.mark.parametrize("apart", [1e-10, 1e-3, 0.065, 2.0])
def test_parallax_error_against_direct_projection(apart):
    places = signed([0.0, 1e-160, 1e-9, 0.01, R, 1.3, 40.0, 1e5])
    for x, depth in product(places, [0.1, 0.6, 1.0, 5.0, 1e3, 1e6]):
        got = fl.gas.parallax_error([(x, Y, depth)], R, eye_distance=apart)[0]
        with mpmath.workdps(DIGITS):
            half = mpmath.mpf(apart) / 2
            right, left = (direct(mpmath.mpf(x) + side, depth, 1) for side in (-half, half))
            if right is None or left is None:
                assert np.isnan(got).all()
                continue
            want = [a - b for a, b in zip(right, left, strict=True)]
        across, down = off(got, want)
        # p_x goes through zero near C_x = -r; elsewhere all digits are there.
        assert down <= 1e-13 and (across <= 1e-13 or -2.5 < x / R < -0.3), (x, depth)


def test_printed_forms_are_the_papers():
    centers = np.random.default_rng(6).uniform((-2, -2, 1), (2, 2, 9), (50, 3))
    got = fl.gas.projection_error(centers, R, near=1.5, form="printed")
    x, y, z = centers.T * [[1], [1], [-1]]
    s = np.sqrt(z * z + x * x)
    e_x = 1.5 * R * (x * x - z * s + R * x - z * z) / (-z * (-z * s + R * x))
    e_y = 1.5 * R * x * y * s / (z * (z * s - R * x))
    np.testing.assert_allclose(got, np.stack([e_x, e_y], axis=1), rtol=1e-12)
    # Opposite sign, and a third of it for r << C_x << D.
    a, b = (
        fl.gas.projection_error([(0.5, 1, 50)], 1e-3, form=f)[0, 0] for f in ("exact", "printed")
    )
    np.testing.assert_allclose(a / b, -1 / 3, rtol=2e-2)
    parallax = fl.gas.parallax_error(centers, R, eye_distance=0.1, form="printed")
    sides = [centers + np.array((s, 0, 0)) for s in (-0.05, 0.05)]
    right, left = (fl.gas.projection_error(c, R, form="printed") for c in sides)
    np.testing.assert_array_equal(parallax, right - left)

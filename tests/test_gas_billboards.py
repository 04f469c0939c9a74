"""The errors of billboards: derivation, direct projection in 700 digits, domain, hard spots."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import flurries as fl

DIGITS = 700
EPS = np.finfo(float).eps


def edges(x, y, depth, r):
    """Middle of the right edge of both billboards, from the geometry alone, in mpmath."""
    # Facing the eye: perpendicular to (0, 1, 0) and to the way to the eye.
    c = mpmath.matrix([x, y, depth])
    up, way = mpmath.matrix([0, 1, 0]), -c
    across = mpmath.matrix(
        [up[1] * way[2] - up[2] * way[1], up[2] * way[0] - up[0] * way[2],
         up[0] * way[1] - up[1] * way[0]]
    )  # fmt: skip
    length = mpmath.sqrt(sum(v * v for v in across))
    across = across / length
    if across[0] < 0:
        across = -across  # the right one
    return mpmath.matrix([x + r, y, depth]), c + r * across


def direct(center, r, near):
    """Projection error by direct projection; NaN where there is none."""
    with mpmath.workdps(DIGITS):
        x, y, depth = map(mpmath.mpf, center)
        r, near = mpmath.mpf(r), mpmath.mpf(near)
        if depth <= 0:
            return None
        flat, facing = edges(x, y, depth, r)
        if facing[2] <= 0:
            return None
        return [near * flat[k] / flat[2] - near * facing[k] / facing[2] for k in (0, 1)]


def relative(got, want):
    with mpmath.workdps(DIGITS):
        if want == 0:
            return 0.0 if got == 0 else math.inf
        return float(abs((mpmath.mpf(float(got)) - want) / want))


SIZES = [1e-160, 1e-100, 1e-30, 1e-9, 1e-3, 0.05, 0.45, 1.0, 7.0, 300.0, 1e5]
DEPTHS = [0.1, 0.3, 1.0, 5.0, 100.0, 1e4, 1e6]


def test_exact_forms_against_direct_projection():
    near, r, y = 1.3, 0.45, -0.7
    worst = 0.0
    for size in SIZES:
        for x in (size, -size):
            for depth in DEPTHS:
                got = fl.gas.projection_error([(x, y, depth)], r, near=near)[0]
                want = direct((x, y, depth), r, near)
                if want is None:
                    assert np.isnan(got).all()
                    continue
                for k in (0, 1):
                    error = relative(got[k], want[k])
                    if error > 1e-13 and k == 0:
                        # Near the second zero only, where two terms cancel.
                        s = math.hypot(x, depth)
                        term = near * r * -x * (-x * s / (s + depth) + r)
                        off = 4 * EPS * term / (depth * abs(depth * s - r * x))
                        assert abs(float(want[0] - mpmath.mpf(got[0]))) <= off
                        assert -3.5 * r < x < -0.5 * r
                        continue
                    worst = max(worst, error)
    assert worst <= 1e-13


def test_nan_exactly_where_the_domain_ends():
    # Behind, at the eye's plane, and where the facing billboard's edge lies behind it.
    for depth in (0.0, -0.0, -1.0):
        assert np.isnan(fl.gas.projection_error([(0.3, 0.1, depth)], 0.45)).all()
    # D S = r C_x: with r > D. On both sides of the end of the domain, bit by bit.
    depth, x = 0.5, 2.0
    edge = depth * math.hypot(x, depth) / x
    for factor, seen in ((1 - 4 * EPS, True), (1 + 4 * EPS, False)):
        values = fl.gas.projection_error([(x, 0.3, depth)], edge * factor)
        assert bool(np.isfinite(values).all()) == seen
        assert bool(np.isnan(values).all()) != seen
        parallax = fl.gas.parallax_error([(x - 0.05, 0.3, depth)], edge * factor, eye_distance=0.1)
        assert bool(np.isnan(parallax).all()) != seen
    # r > D is no end in itself.
    assert np.isfinite(fl.gas.projection_error([(0.1, 0.0, 0.4)], 0.45)).all()


@pytest.mark.parametrize("apart", [1e-10, 1e-3, 0.065, 2.0])
def test_parallax_error_against_direct_projection(apart):
    near, r = 1.0, 0.45
    for size in (0.0, 1e-160, 1e-9, 0.01, 0.45, 1.3, 40.0, 1e5):
        for x in (size, -size):
            for depth in (0.1, 0.6, 1.0, 5.0, 1e3, 1e6):
                center = (x, 0.8, depth)
                got = fl.gas.parallax_error([center], r, near=near, eye_distance=apart)[0]
                with mpmath.workdps(DIGITS):
                    half = mpmath.mpf(apart) / 2
                    right = direct((mpmath.mpf(x) - half, 0.8, depth), r, near)
                    left = direct((mpmath.mpf(x) + half, 0.8, depth), r, near)
                if right is None or left is None:
                    assert np.isnan(got).all()
                    continue
                for k in (0, 1):
                    with mpmath.workdps(DIGITS):
                        want = right[k] - left[k]
                    error = relative(got[k], want)
                    if k == 0 and error > 1e-13:
                        # p_x goes through zero near C_x = -r; elsewhere all digits are there.
                        assert -2.5 < x / r < -0.3, (center, apart, error)
                        continue
                    assert error <= 1e-13, (center, k, error)


def test_printed_forms_are_the_papers():
    rng = np.random.default_rng(6)
    centers = rng.uniform((-2, -2, 1), (2, 2, 9), (50, 3))
    got = fl.gas.projection_error(centers, 0.45, near=1.5, form="printed")
    for (x, y, depth), values in zip(centers, got, strict=True):
        z = -depth
        s = math.sqrt(z * z + x * x)
        n, r = 1.5, 0.45
        e_x = n * r * (x * x - z * s + r * x - z * z) / (-z * (-z * s + r * x))
        e_y = n * r * x * y * s / (z * (z * s - r * x))
        np.testing.assert_allclose(values, [e_x, e_y], rtol=1e-12)
    # Opposite sign, and a third of it for r << C_x << D.
    a, b = (
        fl.gas.projection_error([(0.5, 1, 50)], 1e-3, form=f)[0, 0] for f in ("exact", "printed")
    )
    np.testing.assert_allclose(a / b, -1 / 3, rtol=2e-2)
    parallax = fl.gas.parallax_error(centers, 0.45, eye_distance=0.1, form="printed")
    sides = [centers + np.array((s, 0, 0)) for s in (-0.05, 0.05)]
    right, left = (fl.gas.projection_error(c, 0.45, form="printed") for c in sides)
    np.testing.assert_array_equal(parallax, right - left)

"""Keyframes: values, slopes, and integrals that a million frames do not spoil."""

import itertools
from fractions import Fraction

import numpy as np
import pytest

import flurries as fl
from every import every
from flurries.motion.keys import as_number, as_vector, integral_to, value_at

Keys = fl.Keys
RAMP = Keys([(-3, 2.0), (4, -1.0), (4.5, 5.0), (90, 5.0), (100, 0.25)])
VECTOR = Keys([(2, (1.0, 0.0, -1.0)), (10, (3.0, -8.0, 1.0)), (11, (0.0, 0.0, 0.5))])
TIMES = [-1e6, -5.5, -3.0, 0.0, 1.0, 3.999, 4.0, 4.25, 4.5, 17.3, 90.0, 99.9, 100.0, 101.0, 1e6]


def exact(keys: Keys, t: float) -> Fraction:
    """The integral from 0 to `t` in exact rational arithmetic, values held outside."""
    pairs = [(Fraction(f), Fraction(v)) for f, v in keys.keys]

    def area(end: Fraction) -> Fraction:
        first, last = pairs[0], pairs[-1]
        if end <= first[0]:
            return first[1] * (end - first[0])
        total = Fraction(0)
        for (f0, v0), (f1, v1) in itertools.pairwise(pairs):
            stop = min(end, f1)
            if stop > f0:
                at_stop = v0 + (v1 - v0) * (stop - f0) / (f1 - f0)
                total += (v0 + at_stop) / 2 * (stop - f0)
        return total + last[1] * max(end - last[0], Fraction(0))

    return area(Fraction(t)) - area(Fraction(0))


def test_values_at_and_between_the_keys():
    for keys in (RAMP, VECTOR):
        assert all(keys.at(frame) == value for frame, value in keys.keys)
    assert (RAMP.at(0.5), RAMP.at(4.25), RAMP.at(95.0)) == (0.5, 2.0, 2.625)
    assert VECTOR.at(6) == (2.0, -4.0, 0.0)
    assert isinstance(RAMP.at(1), float) and isinstance(VECTOR.at(1), tuple)
    assert (RAMP.width, VECTOR.width) == (None, 3)


def test_outside_the_keys_values_hold_or_go_on():
    assert RAMP.at(-1e9) == 2.0 and RAMP.at(1e9) == 0.25
    assert RAMP.slope(-4) == 0.0 and RAMP.slope(101) == 0.0 and RAMP.slope(100) == 0.0
    assert RAMP.at(-10, extend=True) == 2.0 + 7 * 3 / 7
    assert RAMP.at(104, extend=True) == pytest.approx(0.25 - 4 * 4.75 / 10, rel=1e-15)
    assert RAMP.slope(-10, extend=True) == -3 / 7
    assert RAMP.slope(100, extend=True) == -4.75 / 10
    assert VECTOR.at(0) == (1.0, 0.0, -1.0)
    assert VECTOR.at(0, extend=True) == (0.5, 2.0, -1.5)


@pytest.mark.parametrize("extend", [False, True])
def test_slope_is_the_change_of_the_value(extend: bool):
    step = 2.0**-12  # smaller than any distance from a key below
    for t in (-9.3, -1.7, 3.3, 4.2, 50.1, 95.5, 120.2):
        for keys in (RAMP, VECTOR):
            ahead, behind = (np.array(keys.at(t + s, extend=extend)) for s in (step, -step))
            wanted = (ahead - behind) / (2 * step)
            assert np.abs(np.array(keys.slope(t, extend=extend)) - wanted).max() < 1e-10
    assert RAMP.slope(4) == 12.0, "at a key the slope is that of what comes"


@every("t", TIMES)
def test_integral_is_exact(t: float):
    want = exact(RAMP, t)
    assert abs(RAMP.integral(t) - want) <= 1e-15 * max(1.0, float(abs(want)), abs(t))
    parts = [Keys([(f, v[i]) for f, v in VECTOR.keys]) for i in range(3)]
    for got, part in zip(VECTOR.integral(t), parts, strict=True):
        assert abs(got - exact(part, t)) <= 1e-15 * max(1.0, abs(t) * 3)
    assert integral_to(RAMP, t) == RAMP.integral(t)


def test_plain_numbers_and_keys_are_asked_alike():
    assert value_at(0.25, 9.0) == 0.25
    assert integral_to((1.0, 2.0, 3.0), 4.0).tolist() == [4.0, 8.0, 12.0]
    assert as_number("x", RAMP) is RAMP
    assert as_vector("x", [1, 2, 3], 3) == (1.0, 2.0, 3.0)
    with pytest.raises(ValueError, match="amount"):
        as_number("amount", RAMP, low=0.0)
    for call in (lambda: as_number("amount", VECTOR), lambda: as_vector("amount", RAMP, 3)):
        with pytest.raises(ValueError, match="amount"):
            call()

"""The map from a Gaussian field to opacity: its moments, and the map that has given ones."""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np
from numpy.polynomial.hermite_e import hermeval

from flurries._contract import Float64

# The map has corners, so a fine even grid does better than Gauss's few nodes.
REACH, STEPS = 8.0, 4001

# Products of up to so many waves; the rest of the variance is below 1e-3 for any map here.
ORDERS = 16

# How steep a map may become: beyond, hardly a pixel is not clear.
POWERS = (0.5, 6.0)


@lru_cache(maxsize=1)
def _nodes() -> tuple[Float64, Float64]:
    z = np.linspace(-REACH, REACH, STEPS)
    weight = np.exp(-0.5 * z**2)
    return z, weight / weight.sum()


def moments(mean: float, deviation: float, power: float) -> tuple[float, float, float]:
    """Return mean, variance and skewness of clip(mean + deviation z, 0, 1)^power."""
    z, weight = _nodes()
    alpha = np.clip(mean + deviation * z, 0.0, 1.0) ** power
    first = float(weight @ alpha)
    away = alpha - first
    second = float(weight @ away**2)
    third = float(weight @ away**3)
    return first, second, third / second**1.5 if second > 0.0 else 0.0


def solved(mean: float, variance: float, power: float) -> tuple[float, float]:
    """Return (mean, deviation) of the field whose clipped power has this mean and variance.

    Without the clip at 1 the quotient of deviation and mean fixes mean / deviation alone, by
    bisection; the clip is then made up for by asking for a little more, a few times.
    """
    z, weight = _nodes()
    wanted_mean, wanted_variance = mean, variance
    middle = deviation = 0.0
    for _ in range(50):
        quotient = np.sqrt(wanted_variance) / wanted_mean
        low, high = -REACH, 1e6
        for _ in range(100):
            at = 0.5 * (low + high)
            alpha = np.maximum(at + z, 0.0) ** power
            first = float(weight @ alpha)
            spread = float(np.sqrt(weight @ (alpha - first) ** 2))
            low, high = (at, high) if spread > quotient * first else (low, at)
        deviation = float((wanted_mean / first) ** (1.0 / power))
        middle = at * deviation
        got_mean, got_variance, _ = moments(middle, deviation, power)
        if abs(got_mean / mean - 1.0) < 1e-9 and abs(got_variance / variance - 1.0) < 1e-9:
            return middle, deviation
        wanted_mean *= mean / got_mean
        wanted_variance *= variance / got_variance
    raise ValueError(
        f"population: no texture has the mean opacity {mean:.3g} and deviation "
        f"{np.sqrt(variance):.3g}: too many flakes, or too large ones, are left to it"
    )


def power_for(mean: float, variance: float, skewness: float) -> float:
    """Return the power, within `POWERS`, whose map has this skewness, too."""

    def found(power: float) -> float:
        return moments(*solved(mean, variance, power), power)[2]

    low, high = POWERS
    if found(low) >= skewness:
        return low
    if found(high) <= skewness:
        return high
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if found(middle) < skewness else (low, middle)
    return 0.5 * (low + high)


def orders(mean: float, deviation: float, power: float) -> Float64:
    """Return the variance that products of 0, 1, 2, ... waves have in the opacity.

    Squares of the map's Hermite coefficients over n!: where the field's correlation is rho, that of
    the opacity is sum_n orders[n] rho^n.
    """
    z, weight = _nodes()
    alpha = weight * np.clip(mean + deviation * z, 0.0, 1.0) ** power
    parts = [alpha @ hermeval(z, [0.0] * n + [1.0]) for n in range(ORDERS + 1)]
    return np.array([part**2 / factorial(n) for n, part in enumerate(parts)])

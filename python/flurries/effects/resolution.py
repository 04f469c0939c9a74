"""The texture at every size of the picture: as if a larger picture had been made smaller.

A look's band is given in pixels of a picture 1024 px wide and scales with the width. Waves shorter
than 2 px have no pixels to be seen in, and pixels average over their own area what is longer: both
take power from the field, and the opacity, which is no linear function of it, keeps its mean. Maps
are tuned at 1024 px; at another width the map is the one whose opacity has the mean and the
variance of the tuned one's averages.
"""

from __future__ import annotations

import math

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept

# The width that looks are tuned for.
TUNED = 1024

# Hermite polynomials in which maps are expanded, and steps of Newton's.
_TERMS = 24
_STEPS = 40


@kept(64)
def power_share(wavelengths: tuple[float, float], exponent: float, width: int) -> float:
    """Return the power that a picture shows of a band, against that of one 1024 px wide."""
    if width == TUNED:
        return 1.0
    return _shown(wavelengths, exponent, width / TUNED) / _shown(wavelengths, exponent, 1.0)


def _shown(wavelengths: tuple[float, float], exponent: float, scale: float) -> float:
    # Up to the band's end: what a pixel leaves of waves shorter than two of them is seen as longer
    # ones.
    first, last = 1.0 / wavelengths[1], 1.0 / wavelengths[0]
    # Even in the logarithm, at the middles.
    steps = 256
    octaves = math.log(last / first)
    k = first * np.exp(octaves * (np.arange(steps) + 0.5) / steps)
    angle = 0.5 * np.pi * (np.arange(32) + 0.5) / 32
    left = np.sinc(np.outer(k, np.cos(angle)) / scale) * np.sinc(np.outer(k, np.sin(angle)) / scale)
    power = k ** (2.0 - 2.0 * exponent) * (left**2).mean(axis=1)
    return float(power.mean() * octaves)


@kept(256)
def map_at(mean: float, spread: float, power: float, share: float) -> tuple[float, float]:
    """Return mean and spread of a map for a picture that shows a share of the tuned one's power."""
    if share == 1.0:
        return mean, spread
    deviation = 0.5 / spread
    smaller = min(share, 1.0)
    target = _moments(mean, deviation, power, smaller)
    of = 1.0 if share < 1.0 else 1.0 / share
    if share <= 1e-6 or target[1] <= 1e-12:
        # Nothing but the mean is seen.
        return target[0] ** (1.0 / power), 1e3
    guess = np.array([mean, math.log(deviation * math.sqrt(share))])
    for _ in range(_STEPS):
        now = _errors(guess, power, of, target)
        if np.abs(now).max() < 1e-10:
            break
        tiny = 1e-5
        slopes = np.stack(
            [(_errors(guess + step, power, of, target) - now) / tiny for step in tiny * np.eye(2)],
            axis=1,
        )
        try:
            step = np.linalg.solve(slopes, now)
        except np.linalg.LinAlgError:
            break
        guess = guess - step * min(1.0, 0.2 / float(np.abs(step).max()))
    if np.abs(_errors(guess, power, of, target)).max() > 1e-3:
        return mean, spread / math.sqrt(share)
    return float(guess[0]), 0.5 / math.exp(float(guess[1]))


def _errors(guess: Float64, power: float, of: float, target: tuple[float, float]) -> Float64:
    """Return the errors of a map, in logarithms: both moments may be small."""
    mean, variance = _moments(float(guess[0]), math.exp(min(float(guess[1]), 5.0)), power, of)
    wanted, spread = target
    return np.array(
        [
            math.log(max(mean, 1e-300) / max(wanted, 1e-300)),
            math.log(max(variance, 1e-300) / max(spread, 1e-300)),
        ]
    )


def _moments(mean: float, deviation: float, power: float, share: float) -> tuple[float, float]:
    """Return the mean of a map, and the variance of its mean given a share of the field's power."""
    z, weights = _hermite()
    coefficients = weights @ np.clip(mean + deviation * z, 0.0, 1.0) ** power
    if share == 1.0:
        # All there are, without cutting the series.
        square = float(weights[0] @ np.clip(mean + deviation * z, 0.0, 1.0) ** (2.0 * power))
        return float(coefficients[0]), max(square - float(coefficients[0]) ** 2, 0.0)
    powers = share ** np.arange(1, _TERMS)
    return float(coefficients[0]), float((coefficients[1:] ** 2) @ powers)


def variances(mean: float, deviation: float, power: float, shares: Float64) -> Float64:
    """Return the variances of a map's mean given shares (n,) of the field's power."""
    z, weights = _hermite()
    value = np.clip(mean + deviation * z, 0.0, 1.0) ** power
    squares = (weights[1:] @ value) ** 2
    whole = float(weights[0] @ (value - weights[0] @ value) ** 2)
    powers = np.power.outer(shares, np.arange(1, _TERMS))
    return np.asarray(powers @ squares + (whole - squares.sum()) * shares**_TERMS)


@kept(1)
def _hermite() -> tuple[Float64, Float64]:
    """Return nodes, and the normalised Hermite polynomials there times the normal's weights."""
    z = np.linspace(-8.0, 8.0, 1601)
    weight = np.exp(-0.5 * z * z)
    weight /= weight.sum()
    terms = [np.ones_like(z), z]
    for n in range(2, _TERMS):
        terms.append((z * terms[-1] - math.sqrt(n - 1.0) * terms[-2]) / math.sqrt(n))
    return z, np.stack(terms) * weight

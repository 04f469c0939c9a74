"""The gain by which a layer's optical depth covers as much as its flakes do.

Flakes at Poisson places cover 1 - exp(-n integral(a)) of a picture, a being one flake's opacity.
A texture adds optical depths, so that it covers 1 - exp(-n integral(1 - exp(-g a))): the gain g
makes both the same. It tends to 1 for faint flakes, and to 1.3 for a resting one of opacity 0.9.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss

from flurries._contract import Float64

# A pixel's square widens what it shows, and sigma is not under 0.3 px before that.
PIXEL_VARIANCE = 1.0 / 12.0
LEAST_SIGMA = 0.3

# Terms of the series of the integral across a streak: enough for g a up to 3.
_TERMS = np.arange(1, 31)
_SERIES = np.array([-((-1.0) ** k) / (math.factorial(k) * math.sqrt(k)) for k in range(1, 31)])
_NODES, _WEIGHTS = leggauss(24)
_ERF = np.vectorize(math.erf, otypes=[np.float64])


@lru_cache(maxsize=1024)
def gain_of(diameters: tuple[float, ...], opacity: float, streak: float) -> float:
    """Return the gain of a layer.

    Parameters
    ----------
    diameters : tuple of float
        Quantiles of the flakes' images at even shares, px.
    opacity : float
        Of a resting flake's middle.
    streak : float
        Length that flakes move by while the shutter is open, px.
    """
    raw = np.array(diameters) / math.sqrt(8.0)
    sigma = np.sqrt(np.maximum(raw, LEAST_SIGMA) ** 2 + PIXEL_VARIANCE)
    peak, profile, weight = _along(opacity * raw**2 / sigma**2, sigma, streak)
    share = np.full(len(raw), 1.0)
    share[[0, -1]] = 0.5
    wanted = float(share @ (sigma * (weight * peak * profile).sum(axis=0)))
    if wanted <= 0.0:
        return 1.0

    def covered(gain: float) -> float:
        middle = gain * peak * profile
        return float(share @ (sigma * (weight * _across(middle)).sum(axis=0)))

    low, high = 1.0, 3.0 / max(float((peak * profile).max()), 1e-3)
    for _ in range(60):
        gain = 0.5 * (low + high)
        low, high = (gain, high) if covered(gain) < wanted else (low, gain)
    return 0.5 * (low + high)


def _along(amplitude: Float64, sigma: Float64, streak: float) -> tuple[Float64, Float64, Float64]:
    """Return amplitudes of flakes, the profile along their middle and its steps, (k, n)."""
    reach = 0.5 * streak + 5.0 * sigma
    at = reach * _NODES[:, None]
    if streak < 1e-3:
        profile = np.exp(-0.5 * (at / sigma) ** 2)
    else:
        scale = 1.0 / (sigma * math.sqrt(2.0))
        ends = _ERF((at + 0.5 * streak) * scale) - _ERF((at - 0.5 * streak) * scale)
        profile = sigma * math.sqrt(0.5 * math.pi) / streak * ends
    return amplitude, profile, reach * _WEIGHTS[:, None]


def _across(middle: Float64) -> Float64:
    """Return the integral of 1 - exp(-m exp(-q^2 / 2)) over q, over sqrt(2 pi)."""
    return np.asarray((middle[..., None] ** _TERMS) @ _SERIES)

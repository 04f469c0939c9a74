"""Where flakes and drops send the light that falls on them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flurries import gas
from flurries._contract import Float64

# Asymmetry of snow's crystals and aggregates in visible light: Räisänen et al. 2015 (The Cryosphere
# 9, 1277) find 0.77 to 0.78 for a habit mix that matches measured blowing snow, Kokhanovsky and
# Zege 2004 (Applied Optics 43, 1589) 0.75 for fractal grains.
SNOW = 0.76

# Of water drops much larger than a wavelength, without the diffraction peak, which goes on straight
# ahead with what it was taken from: geometric optics at an index of 1.33 (van de Hulst 1957,
# section 12.34).
WATER = 0.87


class Optics(NamedTuple):
    """What particles do with light.

    Attributes
    ----------
    asymmetry : float
        Mean cosine of the angle between the light's ways before and after.
    albedo : float
        Share of the light that goes on.
    """

    asymmetry: float
    albedo: float


# What fresh snow sends back of the light that falls on it (Warren 1982, Reviews of Geophysics 20).
FLAKES = Optics(SNOW, 0.9)
DROPS = Optics(WATER, 1.0)


def phase(asymmetry: float, cosine: Float64) -> Float64:
    """Return the share of light that goes into a direction, per steradian.

    Henyey and Greenstein 1941; its integral over all directions is 1.

    Parameters
    ----------
    asymmetry : float
        Mean cosine of the angle between the ways before and after, -1 to 1.
    cosine : (...)
        Of that angle: 1 is straight on.
    """
    shape = np.shape(cosine)
    flat = np.ascontiguousarray(np.ravel(cosine), np.float64)
    found = gas.phase(flat, kind="henyey", asymmetry=asymmetry) / (4.0 * math.pi)
    return np.asarray(found, np.float64).reshape(shape)


def within(asymmetry: float, angle: float) -> float:
    """Return the share of light that leaves within an angle (radians) of straight on."""
    g = asymmetry
    if g == 0.0:
        return 0.5 * (1.0 - math.cos(angle))
    far = 1.0 / math.sqrt(1.0 + g * g - 2.0 * g * math.cos(angle))
    return (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 - g) - far)

"""How much snow and rain falls: laws between a rate, sizes, numbers and fall speeds.

Snow: melted diameters follow Gunn and Marshall 1958, N ~ exp(-2.55 R^-0.48 D) for a rate of R mm/h
of water. A flake has the density of Brandes et al. 2007, 0.178 D^-0.922 g/cm3 (D in mm), and falls
as aggregates do in Locatelli and Hobbs 1974, 0.8 D^0.16 m/s. The law of diameters is taken as
exponential in the flake itself, with the mean that puts the same melted size in the middle of the
mass; the number is what the rate asks for.

Rain: drops follow Marshall and Palmer 1948, N ~ exp(-4.1 R^-0.21 D), and fall as Atlas, Srivastava
and Sekhon 1973 say, 9.65 - 10.3 exp(-0.6 D) m/s. Their number, 8000 per m3 and mm in that paper, is
scaled so that the drops that are shown carry the rate that was asked for.
"""

from __future__ import annotations

import math

import numpy as np

from flurries._contract import Float64
from flurries.particles.sizes import Sizes

# Exponent of the fall speed of aggregates.
SNOW_SPEED_POWER = 0.16

# Diameters in metres that are shown: smaller flakes are specks, larger ones break.
SNOW_RANGE = (0.001, 0.04)
RAIN_RANGE = (0.0005, 0.006)

HIGHEST_RATE = {"snow": 50.0, "rain": 500.0}


def snow_mass(diameter: Float64) -> Float64:
    """Return the mass of flakes in kg, diameters in metres."""
    mm = 1e3 * np.asarray(diameter)
    # Grams per cm3 are mg per mm3.
    return np.asarray(1e-6 * 0.178 * math.pi / 6.0 * mm ** (3.0 - 0.922))


def drop_mass(diameter: Float64) -> Float64:
    """Return the mass of drops in kg, diameters in metres."""
    return np.asarray(1000.0 * math.pi / 6.0 * np.asarray(diameter) ** 3)


def snow_speed(diameter: Float64) -> Float64:
    """Return the fall speed of aggregates, m/s, diameters in metres."""
    return np.asarray(0.8 * (1e3 * np.asarray(diameter)) ** SNOW_SPEED_POWER)


def drop_speed(diameter: Float64) -> Float64:
    """Return the fall speed of drops, m/s, diameters in metres; none falls upwards."""
    return np.maximum(9.65 - 10.3 * np.exp(-600.0 * np.asarray(diameter)), 0.1)


def snow_sizes(rate: float) -> Sizes:
    """Return the sizes of the flakes of a liquid-equivalent rate, mm/h."""
    # The middle of the mass of melted drops is 4 / slope, in mm; a flake of 0.178 D^2.078 mm3 of
    # water, and one of exponential law with mean m has it at 3.078 m.
    melted = 4.0 / (2.55 * rate**-0.48)
    middle = (melted**3 / 0.178) ** (1.0 / 2.078)
    low, high = SNOW_RANGE
    return Sizes.with_slope(low, 3.078 / (1e-3 * middle), high)


def rain_sizes(rate: float) -> Sizes:
    """Return the sizes of the drops of a rate, mm/h."""
    return Sizes.with_slope(RAIN_RANGE[0], 4100.0 * rate**-0.21, RAIN_RANGE[1])


def rate_of(density: float, sizes: Sizes, mass: object, speed: object) -> float:
    """Return the rate in mm/h that flakes or drops carry: a kilogram on a square metre is a mm."""
    at, share = sizes.nodes(sizes.smallest, sizes.largest)
    return 3600.0 * density * float(share @ (mass(at) * speed(at)))  # type: ignore[operator]

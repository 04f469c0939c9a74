"""Looks by version, and what they make of a rate of precipitation.

A look is written out in full when an effect is made of it, so that nothing changes when a later
version has other numbers. What a version says once said stays.

Laws
----
Snow of a liquid-equivalent rate R, mm/h: R = number per m3 * mass * fall speed, with the mass of
Brandes et al. 2007, density 0.178 D^-0.922 g/cm3 for a diameter D in mm.

Rain of a rate R: the drops of Marshall and Palmer 1948, N(D) = 8000 exp(-4.1 R^-0.21 D) per m3 and
mm, which fall as Atlas, Srivastava and Sekhon 1973 say, 9.65 - 10.3 exp(-0.6 D) m/s. The largest
are drawn, and the veil has the extinction of all, 2 pi/4 D^2 each, over 60 m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from flurries._contract import real

LOOKS = ("v1",)

# Cubic metres that a lens of 1.2 widths sees of 12 m, the picture as high as wide: for which the
# presets' numbers of flakes in view were tuned.
_TUNED_VIEW = 12.0**3 / (3.0 * 1.2**2)

# How far away the background of rain without a depth stands, metres. The presets' veils are those
# of 55 to 80 m.
_VEILED = 60.0

# The presets light, moderate and heavy.
_SNOW_RATE: dict[str, tuple[float, ...]] = {
    "flakes": (2500.0, 8000.0, 20000.0),
    "largest": (0.024, 0.024, 0.028),
    "texture": (0.8, 0.8, 0.9),
    "mean": (-0.12, 0.05, 0.12),
    "spread": (2.0, 2.0, 2.2),
    "exponent": (0.75, 0.75, 0.95),
    "haze": (0.0, 0.04, 0.1),
    "fall": (1.2, 1.4, 1.6),
}
_SMALLEST_FLAKE = 0.008

# The presets drizzle, rain and downpour, whose drops are those of about these rates.
_RAIN_RATES = (3.0, 10.0, 25.0)
_RAIN_RATE: dict[str, tuple[float, ...]] = {"texture": (0.25, 0.35, 0.5), "mean": (0.1, 0.15, 0.3)}
_DRAWN_DROPS = (2.5, 4.0)

HIGHEST_RATE = {"snow": 50.0, "rain": 500.0}


def snow_of_rate(rate: float) -> dict[str, Any]:
    """Return the fields of snow of a liquid-equivalent rate, mm/h."""
    rates = []
    for number, largest, fall in zip(
        *(_SNOW_RATE[name] for name in ("flakes", "largest", "fall")), strict=True
    ):
        size = (_SMALLEST_FLAKE, largest)
        rates.append(snow_rate(number / _TUNED_VIEW, size, fall))
    look = _between(rate, rates, _SNOW_RATE)
    sizes = (_SMALLEST_FLAKE, look["largest"])
    return {
        "flake_density": rate / snow_rate(1.0, sizes, look["fall"]),
        "flake_size": sizes,
        # So little snow is few flakes.
        "texture": look["texture"] * min(rate / rates[0], 1.0),
        "mean": look["mean"],
        "spread": look["spread"],
        "exponent": look["exponent"],
        "fall": look["fall"],
        "haze": look["haze"],
    }


def snow_rate(density: float, sizes: tuple[float, float], fall: float) -> float:
    """Return the liquid-equivalent rate, mm/h, of flakes per m3 whose sizes, m, are even."""
    low, high = (1e3 * size for size in sizes)
    power = 3.0 - 0.922
    moment: float
    if high > low:
        moment = (high ** (power + 1.0) - low ** (power + 1.0)) / ((power + 1.0) * (high - low))
    else:
        moment = low**power
    # Grams per cm3 are thousandths per mm3, and kilograms thousandths again.
    kilograms = 1e-3 * 0.178e-3 * math.pi / 6.0 * moment
    return density * kilograms * fall * 3600.0


def rain_of_rate(rate: float) -> dict[str, Any]:
    """Return the fields of rain of a rate, mm/h."""
    slope = 4.1 * rate**-0.21
    # In light rain the drops are as much smaller as its whole distribution is.
    part = min((rate / 10.0) ** 0.21, 1.0)
    low, high = (part * size for size in _DRAWN_DROPS)
    number = 8000.0 / slope * (math.exp(-slope * low) - math.exp(-slope * high))
    extinction = 1e-6 * math.pi * 8000.0 / slope**3
    look = _between(rate, _RAIN_RATES, _RAIN_RATE)
    return {
        "drop_density": number,
        "drop_size": (1e-3 * low, 1e-3 * high),
        "fall": 9.65 - 10.3 * math.exp(-0.6 * 0.5 * (low + high)),
        "texture": look["texture"] * min(rate / _RAIN_RATES[0], 1.0),
        "mean": look["mean"],
        "haze": 1.0 - math.exp(-extinction * _VEILED),
    }


def _between(
    rate: float, rates: tuple[float, ...] | list[float], look: Mapping[str, tuple[float, ...]]
) -> dict[str, float]:
    """Return a look between those of some rates, by their logarithms."""
    at = math.log(rate)
    return {name: float(np.interp(at, np.log(rates), values)) for name, values in look.items()}


def rate_of(value: object, kind: str) -> float:
    """Return a rate in mm/h, or refuse it."""
    return real("rate", value, low=0.001, high=HIGHEST_RATE[kind])

"""Looks by version, and what they make of one knob: a severity, or a rate of precipitation.

A look is written out in full when an effect is made of it, so that nothing changes when a later
version has other numbers. What a version says once said stays.

Laws
----
Severity n takes a share of a picture's contrast: a layer of opacity a leaves 1 - a of each
difference, whatever the picture. What texture and particles do not take an even veil takes.

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

from flurries._contract import integer, real

LOOKS = ("v1",)

SEVERITIES = 5

# The share of contrast that severities 1 to 5 take.
LOSS = (0.06, 0.14, 0.25, 0.38, 0.55)

# Cubic metres that a lens of 1.2 widths sees of 12 m, the picture as high as wide: for which the
# presets' numbers of flakes in view were tuned.
_TUNED_VIEW = 12.0**3 / (3.0 * 1.2**2)

# How far away the background of rain without a depth stands, metres. The presets' veils are those
# of 55 to 80 m.
_VEILED = 60.0

# Flakes in view and the rest of the look, at severities 1 to 5.
SNOW_SEVERITY: dict[str, tuple[float, ...]] = {
    "flakes": (2500.0, 5000.0, 8000.0, 12000.0, 16000.0),
    "largest": (0.022, 0.024, 0.026, 0.027, 0.028),
    "mean": (-0.1, 0.05, 0.14, 0.2, 0.25),
    "spread": (2.0, 2.0, 2.1, 2.2, 2.2),
    "exponent": (0.75, 0.75, 0.85, 0.9, 0.9),
    "fall": (1.2, 1.4, 1.5, 1.6, 1.7),
}

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
_RAIN_RATE: dict[str, tuple[float, ...]] = {
    "texture": (0.25, 0.35, 0.5),
    "mean": (0.1, 0.15, 0.3),
}
_RAIN_SEVERITY = (1.0, 4.0, 10.0, 25.0, 60.0)
_DRAWN_DROPS = (2.5, 4.0)
_DROP_DEPTH = 14.0
_GAIN = 30.0

HIGHEST_RATE = {"snow": 50.0, "rain": 500.0}


def severity_of(value: object) -> int:
    """Return a severity, or refuse it."""
    return integer("severity", value, low=1, high=SEVERITIES)


def snow_of_severity(severity: int) -> dict[str, Any]:
    """Return the fields of snow of a severity, 1 to 5."""
    look = {name: values[severity - 1] for name, values in SNOW_SEVERITY.items()}
    density = look["flakes"] / _TUNED_VIEW
    sizes = (_SMALLEST_FLAKE, look["largest"])
    texture = 0.8
    left = 1.0 - texture * mean_square(look["mean"], 0.5 / look["spread"])
    left *= math.exp(-covered(density, sizes, 12.0, 0.9))
    return {
        "flake_density": density,
        "flake_size": sizes,
        "texture": texture,
        "mean": look["mean"],
        "spread": look["spread"],
        "exponent": look["exponent"],
        "fall": look["fall"],
        "haze": _veil(severity, left),
    }


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


def rain_of_severity(severity: int) -> dict[str, Any]:
    """Return the fields of rain of a severity, 1 to 5."""
    look = rain_of_rate(_RAIN_SEVERITY[severity - 1])
    left = 1.0 - look["texture"] * mean_square(look["mean"], 0.5 / 2.5)
    wider = math.sqrt(_GAIN)
    sizes = tuple(wider * size for size in look["drop_size"])
    left *= math.exp(-covered(look["drop_density"], sizes, _DROP_DEPTH, 1.0))
    return {**look, "haze": _veil(severity, left)}


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


def mist_density(severity: int, thickness: float) -> float:
    """Return the density of particles so that what they take is what a severity takes."""
    wanted = -math.log1p(-LOSS[severity - 1])
    if wanted > thickness:
        more = f"{math.ceil(wanted / thickness)} times as many" if thickness > 0.0 else "some"
        raise ValueError(f"severity {severity} needs {more} particles in the box")
    return wanted / thickness


def covered(density: float, sizes: tuple[float, ...], reach: float, opacity: float) -> float:
    """Return the share of a picture that particles cover up to a depth: less large ones that fade.

    A Gaussian disc of three sigma a radius covers 2 pi sigma^2, and as many of them are behind a
    pixel whatever the lens.
    """
    low, high = (0.5 * size for size in sizes)
    squares = (low * low + low * high + high * high) / 3.0
    return density * reach * 2.0 * math.pi * opacity * squares / 9.0


def mean_square(mean: float, deviation: float) -> float:
    """Return the mean of clip(mean + deviation z, 0, 1)^2 for a normal z, in closed form."""
    low, high = -mean / deviation, (1.0 - mean) / deviation

    def bell(x: float) -> float:
        return math.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)

    def below(x: float) -> float:
        return 0.5 * math.erfc(-x / math.sqrt(2.0))

    inside = below(high) - below(low)
    first = bell(low) - bell(high)
    second = inside + low * bell(low) - high * bell(high)
    moments = mean**2 * inside + 2.0 * mean * deviation * first + deviation**2 * second
    return moments + 1.0 - below(high)


def _veil(severity: int, left: float) -> float:
    """Return the haze that takes what is still wanted of the contrast."""
    return max(1.0 - (1.0 - LOSS[severity - 1]) / left, 0.0)


def _between(
    rate: float, rates: tuple[float, ...] | list[float], look: Mapping[str, tuple[float, ...]]
) -> dict[str, float]:
    """Return a look between those of some rates, by their logarithms."""
    at = math.log(rate)
    return {name: float(np.interp(at, np.log(rates), values)) for name, values in look.items()}


def rate_of(value: object, kind: str) -> float:
    """Return a rate in mm/h, or refuse it."""
    return real("rate_mm_h", value, low=0.001, high=HIGHEST_RATE[kind])

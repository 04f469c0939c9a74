"""The tents' looks of a rate of precipitation, between those of the presets.

All drops are those of Marshall and Palmer 1948, N(D) = 8000 exp(-4.1 R^-0.21 D) per m3 and mm. The
largest are drawn, and the veil has the extinction of all, 2 pi/4 D^2 each, over 60 m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from flurries._contract import real
from flurries.effects.checks import sizes
from flurries.effects.severity import rate_of
from flurries.particles.sizes import SNOW, Sizes

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


def snow_of_rate(turned: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of snow of a liquid-equivalent rate, mm/h, that are not given."""
    rate = real("rate", rate_of(turned, "snow"))
    rates = [
        number / _TUNED_VIEW * _flux((_SMALLEST_FLAKE, largest), fall)
        for number, largest, fall in zip(
            *(_SNOW_RATE[name] for name in ("flakes", "largest", "fall")), strict=True
        )
    ]
    look = _between(rate, rates, _SNOW_RATE)
    # So little snow is few flakes.
    look["texture"] *= min(rate / rates[0], 1.0)
    del look["flakes"]
    found = {"flake_size": (_SMALLEST_FLAKE, look.pop("largest")), **look, **given}
    each = _flux(sizes("flake_size", found["flake_size"]), real("fall", found["fall"], above=0.0))
    return {**found, "flake_density": rate / each}


def _flux(sizes: tuple[float, float], fall: float) -> float:
    """Return the mm/h of one flake per m3, of even sizes in metres that fall alike."""
    low, high = sizes
    law = Sizes(low, 0.5 * (low + high), high)
    return replace(SNOW, speed=np.ones_like).flux(law) * fall


def rain_of_rate(turned: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of rain of a rate, mm/h, that are not given."""
    rate = real("rate", rate_of(turned, "rain"))
    slope = 4.1 * rate**-0.21
    # In light rain the drops are as much smaller as its whole distribution is.
    part = min((rate / 10.0) ** 0.21, 1.0)
    own = given.get("drop_size", tuple(1e-3 * part * size for size in _DRAWN_DROPS))
    low, high = (1e3 * size for size in sizes("drop_size", own))
    number = 8000.0 / slope * (math.exp(-slope * low) - math.exp(-slope * high))
    extinction = 1e-6 * math.pi * 8000.0 / slope**3
    look = _between(rate, _RAIN_RATES, _RAIN_RATE)
    return {
        "drop_density": number,
        "drop_size": own,
        "fall": 9.65 - 10.3 * math.exp(-0.6 * 0.5 * (low + high)),
        "texture": look["texture"] * min(rate / _RAIN_RATES[0], 1.0),
        "mean": look["mean"],
        "haze": 1.0 - math.exp(-extinction * _VEILED),
        **given,
    }


def _between(
    rate: float, rates: tuple[float, ...] | list[float], look: Mapping[str, tuple[float, ...]]
) -> dict[str, float]:
    """Return a look between those of some rates, by their logarithms."""
    at = math.log(rate)
    return {name: float(np.interp(at, np.log(rates), values)) for name, values in look.items()}

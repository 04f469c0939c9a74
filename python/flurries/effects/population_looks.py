"""Looks, version 2: what presets and knobs of populations mean.

A rate is a law: see :mod:`flurries.particles.precipitation`. A severity is a rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

from flurries._contract import integer, real
from flurries.particles.precipitation import (
    HIGHEST_RATE,
    drop_mass,
    drop_speed,
    rain_sizes,
    snow_mass,
    snow_sizes,
    snow_speed,
)
from flurries.particles.precipitation import (
    rate_of as carried,
)

SEVERITIES = 5

# Looks by name, tuned by eye on dark, bright and busy photographs at 1:1 (docs/snow.md).
SnowLook: TypeAlias = Literal[
    "light", "moderate", "heavy", "blizzard", "sleet", "big flakes", "night flurry"
]
SNOW: dict[str, dict[str, Any]] = {
    "light": {"density": 12.0, "flake_size": (0.003, 0.006, 0.018)},
    "moderate": {},
    "heavy": {"density": 90.0, "flake_size": (0.003, 0.008, 0.025), "wind": (0.5, 0.0, 0.0)},
    "blizzard": {
        "density": 300.0,
        "flake_size": (0.002, 0.005, 0.016),
        "wind": (6.0, 0.0, 0.0),
        "shutter": 0.3,
    },
    # Half melted: small, fast and glassy.
    "sleet": {
        "density": 300.0,
        "flake_size": (0.001, 0.0035, 0.01),
        "opacity": 0.7,
        "fall": 4.0,
        "wind": (1.5, 0.0, 0.0),
        "sway": (0.0, 0.0),
    },
    "big flakes": {
        "density": 6.0,
        "flake_size": (0.008, 0.018, 0.045),
        "wind": (0.15, 0.0, 0.0),
        "sway": (0.05, 2.5),
    },
    "night flurry": {
        "density": 16.0,
        "flake_size": (0.002, 0.006, 0.016),
        "color": (1.0, 0.92, 0.8),
        "wind": (0.6, 0.0, 0.0),
    },
}

RainLook: TypeAlias = Literal["drizzle", "rain", "downpour"]
RAIN: dict[str, dict[str, Any]] = {
    "drizzle": {"density": 500.0, "drop_size": (0.0004, 0.0006, 0.003), "wind": (0.3, 0.0, 0.0)},
    "rain": {},
    "downpour": {"density": 1500.0, "drop_size": (0.0005, 0.0012, 0.006)},
}

SNOW_SEVERITY = (0.5, 1.2, 2.5, 5.0, 10.0)


def rate_of(value: object, kind: str) -> float:
    """Return a rate in mm/h, or refuse it."""
    return real("rate_mm_h", value, low=0.001, high=HIGHEST_RATE[kind])


def severity_of(value: object) -> int:
    """Return a severity, or refuse it."""
    return integer("severity", value, low=1, high=SEVERITIES)


def snow_of_rate(rate: float, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the flakes that carry a liquid-equivalent rate, mm/h."""
    sizes = snow_sizes(rate)
    return {
        "density": rate / carried(1.0, sizes, snow_mass, snow_speed),
        "flake_size": (sizes.smallest, sizes.mean, sizes.largest),
    }


def snow_of_severity(severity: int) -> dict[str, Any]:
    """Return the fields of snow of a severity, 1 to 5."""
    return snow_of_rate(SNOW_SEVERITY[severity - 1], {})


def rain_of_rate(rate: float) -> dict[str, Any]:
    """Return the drops that carry a rate, mm/h."""
    sizes = rain_sizes(rate)
    return {
        "density": rate / carried(1.0, sizes, drop_mass, drop_speed),
        "drop_size": (sizes.smallest, sizes.mean, sizes.largest),
    }


RAIN_SEVERITY = (2.0, 6.0, 15.0, 30.0, 60.0)


def rain_of_severity(severity: int) -> dict[str, Any]:
    """Return the fields of rain of a severity, 1 to 5."""
    return rain_of_rate(RAIN_SEVERITY[severity - 1])

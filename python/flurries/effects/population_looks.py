"""Looks, version 2: what presets and knobs of populations mean. A severity is a rate."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

from flurries._contract import real
from flurries.effects.severity import rate_of_severity
from flurries.particles.sizes import rain_of, snow_of

# Looks by name, tuned by eye on dark, bright and busy photographs at 1:1 (docs/snow.md).
SnowLook: TypeAlias = Literal[
    "light", "moderate", "heavy", "blizzard", "sleet", "big flakes", "night flurry"
]
SNOW: dict[str, dict[str, Any]] = {
    "light": {"density": 12.0, "flake_size": (0.003, 0.006, 0.018)},
    "moderate": {},
    "heavy": {"density": 90.0, "flake_size": (0.003, 0.008, 0.025), "wind": (0.5, 0.0, 0.0)},
    "blizzard": {
        "density": 300.0, "flake_size": (0.002, 0.005, 0.016), "wind": (6.0, 0.0, 0.0),
    },
    # Half melted: small, fast and glassy.
    "sleet": {
        "density": 300.0, "flake_size": (0.001, 0.0035, 0.01), "opacity": 0.7, "fall": 4.0,
        "wind": (1.5, 0.0, 0.0), "sway": (0.0, 0.0),
    },
    "big flakes": {
        "density": 6.0, "flake_size": (0.008, 0.018, 0.045), "wind": (0.15, 0.0, 0.0),
        "sway": (0.05, 2.5),
    },
    "night flurry": {
        "density": 16.0, "flake_size": (0.002, 0.006, 0.016), "wind": (0.6, 0.0, 0.0),
    },
}  # fmt: skip

RainLook: TypeAlias = Literal["drizzle", "rain", "downpour"]
RAIN: dict[str, dict[str, Any]] = {
    "drizzle": {"density": 500.0, "drop_size": (0.0004, 0.0006, 0.003), "wind": (0.3, 0.0, 0.0)},
    "rain": {},
    "downpour": {"density": 1500.0, "drop_size": (0.0005, 0.0012, 0.006)},
}

# The highest rates, mm/h.
_HIGHEST_SNOW, _HIGHEST_RAIN = 50.0, 500.0


def snow_of_rate(value: object) -> dict[str, Any]:
    """Return the fields of flakes that carry a liquid-equivalent rate, mm/h, or refuse it."""
    density, sizes = snow_of(real("rate", value, low=0.001, high=_HIGHEST_SNOW))
    return {"density": density, "flake_size": (sizes.smallest, sizes.mean, sizes.largest)}


def rain_of_rate(value: object) -> dict[str, Any]:
    """Return the fields of drops that carry a rate, mm/h, or refuse it."""
    density, sizes = rain_of(real("rate", value, low=0.001, high=_HIGHEST_RAIN))
    return {"density": density, "drop_size": (sizes.smallest, sizes.mean, sizes.largest)}


def snow_of_severity(value: object) -> dict[str, Any]:
    """Return the fields of snow of a severity, 1 to 5, or refuse it."""
    return snow_of_rate(rate_of_severity(value, "snow"))


def rain_of_severity(value: object) -> dict[str, Any]:
    """Return the fields of rain of a severity, 1 to 5, or refuse it."""
    return rain_of_rate(rate_of_severity(value, "rain"))

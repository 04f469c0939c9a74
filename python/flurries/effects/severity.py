"""Severities of weather: the one table for scenes and data sets."""

from __future__ import annotations

from typing import Literal

from flurries._contract import integer

# Of the severities 1 to 5: rates, mm/h, and visibilities, metres.
RATES = {"snow": (0.5, 1.0, 2.5, 5.0, 10.0), "rain": (2.5, 10.0, 25.0, 50.0, 100.0)}
VISIBILITIES = (1000.0, 500.0, 200.0, 100.0, 50.0)

SEVERITIES = len(VISIBILITIES)


def rate_of_severity(value: object, kind: Literal["snow", "rain"]) -> float:
    """Return the rate of a severity, mm/h, or refuse the severity."""
    return RATES[kind][integer("severity", value, low=1, high=SEVERITIES) - 1]


def visibility_of_severity(value: object) -> float:
    """Return the visibility in mist and fog of a severity, metres, or refuse the severity."""
    return VISIBILITIES[integer("severity", value, low=1, high=SEVERITIES) - 1]

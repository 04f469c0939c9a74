"""Severities of weather: the one table for scenes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flurries._contract import integer
from flurries.motion.keys import Keys, as_number

# Of the severities 1 to 5: rates, mm/h, and visibilities, metres.
RATES = {"snow": (0.5, 1.0, 2.5, 5.0, 10.0), "rain": (2.5, 10.0, 25.0, 50.0, 100.0)}
VISIBILITIES = (1000.0, 500.0, 200.0, 100.0, 50.0)

SEVERITIES = len(VISIBILITIES)

# Rates that are taken, mm/h.
LOWEST, HIGHEST = 0.001, {"snow": 50.0, "rain": 500.0}


def rate_of(given: Mapping[str, Any], kind: str) -> Any:
    """Return the `rate` that is given, or that of a `severity`, mm/h; None without both."""
    least = 0.0 if isinstance(given.get("rate"), Keys) else LOWEST
    limits = {"low": least, "high": HIGHEST[kind]}
    return _agreed("rate", given, RATES[kind], "mm/h", limits)


def visibility_of(given: Mapping[str, Any]) -> Any:
    """Return the `visibility` that is given, or that of a `severity`, m; None without both."""
    return _agreed("visibility", given, VISIBILITIES, "m", {"above": 0.0})


def _agreed(
    name: str, given: Mapping[str, Any], table: tuple[float, ...], unit: str,
    limits: Mapping[str, float],
) -> Any:  # fmt: skip
    value, severity = given.get(name), given.get("severity")
    value = None if value is None else as_number(name, value, **limits)
    if severity is None:
        return value
    said = table[integer("severity", severity, low=1, high=SEVERITIES) - 1]
    if value not in (None, said):
        raise ValueError(
            f"severity and {name} contradict: severity {severity} is {said:g} {unit}, "
            f"{name} is {value}"
        )
    return said

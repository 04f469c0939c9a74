"""What a hard case is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Measure = Callable[[Any], float]

EPS = {np.float32: float(np.finfo(np.float32).eps), np.float64: float(np.finfo(np.float64).eps)}


@dataclass(frozen=True)
class Case:
    """One question with a known answer."""

    name: str
    measure: Measure  # dtype -> the measured number.
    expected: float  # From a formula or a count, never from our own kernels.
    tolerance: float | tuple[float, float]  # Of both or of (float32, float64); 0 demands equality.
    because: str  # Where the tolerance comes from.
    guard: str = ""  # What breaks it when it is taken away.

    def allowed(self, dtype: Any) -> float:
        """Return the tolerance for a dtype."""
        if isinstance(self.tolerance, tuple):
            return self.tolerance[0 if dtype is np.float32 else 1]
        return self.tolerance


def worst(difference: Any) -> float:
    """Return the largest absolute value, as float64; infinity for what is not finite."""
    array = np.abs(np.asarray(difference, dtype=np.float64))
    return float(np.max(array)) if np.isfinite(array).all() else float("inf")

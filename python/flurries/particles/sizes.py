"""Sizes of flakes and drops: an exponential law between a smallest and a largest diameter.

N(D) ~ exp(-D / scale), as Gunn and Marshall 1958 measured it for snow and Marshall and Palmer 1948
for rain. A picture shows no flake of a tenth of a millimetre, so the law is cut on both sides; the
mean is that of what is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flurries._contract import Float64

# Nodes of Gauss and Legendre: moments of an exponential over any interval are exact to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


@dataclass(frozen=True)
class Sizes:
    """Diameters between `smallest` and `largest` that have a mean, metres."""

    smallest: float
    mean: float  # Above the middle it makes large ones more frequent.
    largest: float
    slope: float = 0.0  # Of the law exp(-slope D), 1/m; found from the mean.

    @classmethod
    def with_mean(cls, smallest: float, mean: float, largest: float) -> Sizes:
        """Return the law that has this mean, between the two or all three the same."""
        if smallest == mean == largest and smallest > 0.0:
            return cls(smallest, mean, largest)
        if not 0.0 < smallest < mean < largest:
            raise ValueError(
                "flake_size must be 0 < smallest < mean < largest, or three times the same, "
                f"got {(smallest, mean, largest)}"
            )
        return cls(smallest, mean, largest, _slope_of(smallest, mean, largest))

    @classmethod
    def with_slope(cls, smallest: float, slope: float, largest: float) -> Sizes:
        """Return the law exp(-slope D) between two diameters."""
        return cls(smallest, _mean_of(smallest, slope, largest), largest, slope)

    def below(self, diameter: Float64 | float) -> Float64:
        """Return the share of diameters that are smaller, 0 to 1."""
        if self.largest == self.smallest:
            return np.where(np.asarray(diameter) < self.smallest, 0.0, 1.0)
        part = (np.clip(diameter, self.smallest, self.largest) - self.smallest) * self.slope
        whole = (self.largest - self.smallest) * self.slope
        if abs(whole) < 1e-9:
            return np.asarray(part / self.slope / (self.largest - self.smallest))
        return np.asarray(np.expm1(-part) / math.expm1(-whole))

    def quantile(self, share: Float64 | float) -> Float64:
        """Return the diameter that a share of them is smaller than: the inverse of `below`."""
        at = np.asarray(share, np.float64)
        width = self.largest - self.smallest
        whole = width * self.slope
        if abs(whole) < 1e-9:
            return np.asarray(self.smallest + at * width)
        # Of a law that ends long before the largest diameter the last one is infinite, and clipped.
        with np.errstate(divide="ignore"):
            inside = -np.log1p(at * math.expm1(-whole)) / self.slope
        return np.asarray(np.clip(self.smallest + inside, self.smallest, self.largest))

    def nodes(self, low: float, high: float) -> tuple[Float64, Float64]:
        """Return diameters within an interval, and the share of all that each stands for, (64,)."""
        low, high = max(low, self.smallest), min(high, self.largest)
        if self.largest == self.smallest:
            return np.array([self.smallest]), np.array([1.0])
        half = 0.5 * (high - low)
        at = 0.5 * (low + high) + half * _NODES
        whole = (self.largest - self.smallest) * self.slope
        if abs(whole) < 1e-9:
            rate = np.full_like(at, 1.0 / (self.largest - self.smallest))
        else:
            rate = -self.slope * np.exp(-self.slope * (at - self.smallest)) / math.expm1(-whole)
        return at, half * _WEIGHTS * rate

    def moment(self, power: float) -> float:
        """Return the mean of diameter ** power, m ** power."""
        at, share = self.nodes(self.smallest, self.largest)
        return float(share @ at**power)


def _mean_of(smallest: float, slope: float, largest: float) -> float:
    """Return the mean of exp(-slope D) between two diameters."""
    width = largest - smallest
    x = slope * width
    if abs(x) < 1e-3:
        # 1/x - 1/(e^x - 1), whose two terms cancel here.
        return smallest + width * (0.5 - x / 12.0 + x**3 / 720.0)
    # exp(x) overflows for a law that ends long before the largest diameter.
    rest = 0.0 if x > 700.0 else 1.0 / math.expm1(x)
    return smallest + width * (1.0 / x - rest)


def _slope_of(smallest: float, mean: float, largest: float) -> float:
    """Return the slope that makes a mean, which falls as the slope rises: halve an interval."""
    width = largest - smallest
    low, high = -1e6 / width, 1e6 / width
    for _ in range(200):
        middle = 0.5 * (low + high)
        if _mean_of(smallest, middle, largest) > mean:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)

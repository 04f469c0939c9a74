"""Sizes of flakes and drops, how they fall, and how many carry a rate: measured laws."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept

Law = Callable[[Float64], Float64]

# Nodes of Gauss and Legendre: moments of an exponential over any interval are exact to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)

# Beyond so many scales of the law there is nothing, and the nodes would lie too far apart.
_SCALES = 500.0


@dataclass(frozen=True)
class Sizes:
    """Diameters between `smallest` and `largest` that have a mean, metres."""

    smallest: float
    mean: float  # Above the middle it makes large ones more frequent.
    largest: float
    slope: float = 0.0  # Of the law exp(-slope D), 1/m; found from the mean.

    @classmethod
    def with_mean(cls, smallest: float, mean: float, largest: float) -> "Sizes":
        """Return the law that has this mean, between the two or all three the same."""
        slope = 0.0 if smallest == largest else _slope_of(smallest, mean, largest)
        return cls(smallest, mean, largest, slope)

    @classmethod
    def with_slope(cls, smallest: float, slope: float, largest: float) -> "Sizes":
        """Return the law exp(-slope D) between two diameters."""
        return cls(smallest, _mean_of(smallest, slope, largest), largest, slope)

    def quantile(self, share: Float64 | float) -> Float64:
        """Return the diameter that a share of them is smaller than."""
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
        if self.largest == self.smallest:
            return np.array([self.smallest]), np.array([1.0])
        if self.slope > 0.0:
            high = min(high, max(low, self.smallest + _SCALES / self.slope))
        half = 0.5 * (high - low)
        at = 0.5 * (low + high) + half * _NODES
        whole = (self.largest - self.smallest) * self.slope
        if abs(whole) < 1e-9:
            rate = np.full_like(at, 1.0 / (self.largest - self.smallest))
        else:
            rate = -self.slope * np.exp(-self.slope * (at - self.smallest)) / math.expm1(-whole)
        return at, half * _WEIGHTS * rate

    def mean_of(self, law: Law) -> float:
        at, share = self.nodes(self.smallest, self.largest)
        return float(share @ law(at))

    @kept(64)
    def moment(self, power: float) -> float:
        """Return the mean of diameter ** power, m ** power."""
        return self.mean_of(lambda diameter: np.asarray(diameter**power))


def _mean_of(smallest: float, slope: float, largest: float) -> float:
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
    low, high = -1e6 / (largest - smallest), 1e6 / (largest - smallest)
    for _ in range(200):
        middle = 0.5 * (low + high)
        if _mean_of(smallest, middle, largest) > mean:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def snow_mass(diameter: Float64) -> Float64:
    # Grams per cm3 are mg per mm3.
    return np.asarray(1e-6 * 0.178 * math.pi / 6.0 * (1e3 * np.asarray(diameter)) ** (3.0 - 0.922))


def drop_mass(diameter: Float64) -> Float64:
    return np.asarray(1000.0 * math.pi / 6.0 * np.asarray(diameter) ** 3)


def snow_speed(diameter: Float64) -> Float64:
    """Return the fall speed of aggregates, m/s, diameters in metres."""
    return np.asarray(0.8 * (1e3 * np.asarray(diameter)) ** 0.16)


def drop_speed(diameter: Float64) -> Float64:
    """Return the fall speed of drops, m/s, diameters in metres; none falls upwards."""
    return np.maximum(9.65 - 10.3 * np.exp(-600.0 * np.asarray(diameter)), 0.1)


def _snow_slope(rate: float) -> float:
    """Return the slope of the law of flakes of a liquid-equivalent rate, mm/h."""
    # The middle of the mass of melted drops is 4 / slope, in mm; a flake of 0.178 D^2.078 mm3 of
    # water, and one of exponential law with mean m has it at 3.078 m.
    melted = 4.0 / (2.55 * rate**-0.48)
    middle = (melted**3 / 0.178) ** (1.0 / 2.078)
    return float(3.078 / (1e-3 * middle))


def _rain_slope(rate: float) -> float:
    """Return the slope of the law of drops of a rate, mm/h."""
    return float(4100.0 * rate**-0.21)


@dataclass(frozen=True)
class Matter:
    """What falls: its water, its fall, and the sizes that a rate has."""

    mass: Law  # kg, of diameters in metres.
    speed: Law  # m/s in still air, of diameters in metres.
    slope: Callable[[float], float]  # 1/m, of a rate in mm/h.
    # Diameters in metres that are shown: smaller flakes are specks, larger ones break.
    smallest: float
    largest: float
    weighed: float = 2.0  # Of `Population`.

    def sizes(self, rate: float) -> Sizes:
        return Sizes.with_slope(self.smallest, self.slope(rate), self.largest)

    def fall(self, sizes: Sizes) -> float:
        """Return the fall speed of one of the mean size, m/s."""
        return float(self.speed(np.array([sizes.mean]))[0])

    def flux(self, sizes: Sizes, fall: float | None = None) -> float:
        """Return the mm/h that one per m3 carries, all as much faster as the mean size's `fall`."""
        # A kilogram on a square metre is a mm.
        own = 3600.0 * sizes.mean_of(lambda diameter: self.mass(diameter) * self.speed(diameter))
        return own if fall is None else own * fall / self.fall(sizes)


SNOW = Matter(snow_mass, snow_speed, _snow_slope, 0.001, 0.04)
RAIN = Matter(drop_mass, drop_speed, _rain_slope, 0.0005, 0.006, 3.0)

"""How many flakes there are, how large and how fast: the laws of the literature, written once more.

Diameters follow an exponential law between a smallest and a largest one (Gunn and Marshall 1958;
Marshall and Palmer 1948). Every flake falls at its own speed, D in mm: aggregates at .8 D^.16 m/s
(Locatelli and Hobbs 1974), drops at 9.65 - 10.3 exp(-.6 D) (Atlas, Srivastava and Sekhon 1973).
"""

import math
from dataclasses import dataclass

import numpy as np

from twin_footprints import Floats


@dataclass(frozen=True, kw_only=True)
class Law:
    """A population: how many, how large and how fast."""

    density: float  # 1/m3.
    sizes: tuple[float, float, float]  # (smallest, mean, largest): diameters, metres.
    opacity: float = 0.9  # Mean over a flake's disc.
    kind: str = "snow"  # Or "rain": which speeds.
    fall: float | None = None  # Of a flake of the mean size, m/s; None is that of the kind.
    near: float = 0.4  # Depths that hold flakes, metres.
    far: float = 60.0
    # Flakes come in from near over the first to near, and go over the second on both sides of far.
    fades: tuple[float, float] = (1.25, 0.07)

    def nearest(self) -> float:
        """The depth from which on there are any, metres."""
        return self.near / self.fades[0]

    def slope(self) -> float:
        """Return s of exp(-s D): halve an interval until the mean is right."""
        small, mean, large = self.sizes
        low, high = -700.0 / (large - small), 1e5 / (large - small)
        for _ in range(200):
            s = 0.5 * (low + high)
            x = s * (large - small)
            got = 0.5 if abs(x) < 1e-6 else 1.0 / x - 1.0 / math.expm1(min(x, 700.0))
            low, high = (s, high) if small + got * (large - small) > mean else (low, s)
        return 0.5 * (low + high)

    def below(self, diameter: Floats) -> Floats:
        """Return the share of smaller flakes."""
        small, _, large = self.sizes
        s = self.slope()
        return np.asarray(np.expm1(-s * (diameter - small)) / np.expm1(-s * (large - small)))

    def diameters(self, share: Floats) -> Floats:
        """Return the diameters that shares of the flakes are below."""
        small, mean, large = self.sizes
        if small == large:
            return np.full_like(share, mean)
        s = self.slope()
        return small - np.log1p(share * math.expm1(-s * (large - small))) / s

    def speed(self, diameter: Floats) -> Floats:
        def own(d: Floats) -> Floats:
            mm = 1e3 * np.asarray(d)
            if self.kind == "rain":
                return np.maximum(9.65 - 10.3 * np.exp(-0.6 * mm), 0.1)
            return np.asarray(0.8 * mm**0.16)

        return own(diameter) * (1.0 if self.fall is None else self.fall / own(self.sizes[1]))

    def shown(self, depth: Floats) -> Floats:
        """Return the share of a flake that is shown at depths."""
        first = (depth - self.nearest()) / (self.near - self.nearest())
        last = 0.5 + (self.far - depth) / (2.0 * self.fades[1] * self.far)
        first, last = (np.clip(x, 0.0, 1.0) for x in (first, last))
        return first**2 * (3.0 - 2.0 * first) * last**2 * (3.0 - 2.0 * last)

    def extinction(self) -> float:
        """Return what a ray loses for each metre, 1/m: density times covered area."""
        d = self.diameters((np.arange(20000) + 0.5) / 20000)
        return self.density * self.opacity * 0.25 * math.pi * float((d**2).mean())

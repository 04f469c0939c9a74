"""What falls, as one population: how much of it there is, what is drawn and what is a texture.

A drawn flake costs time by itself and a texture by the pixel, whatever stands in it. So as few are
drawn as a texture allows: those that are too large for its tiles, too few in one, or too fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

from flurries.augment.flakes import NEAREST, Cloud
from flurries.particles.population import LEAST_IN_TILE, Population, SizeClass
from flurries.particles.precipitation import drop_speed, snow_speed
from flurries.particles.sizes import Sizes

# A disc of `particles` ends at three deviations, and a flake's deviation is d / sqrt(8).
_DISC = 3.0 / math.sqrt(2.0)

# Diameters at even shares that drawn flakes take theirs from.
_SHARES = 24

# A streak's middle over its resting flake's: sqrt(2 pi / 8) diameters over the way.
_SWEPT = math.sqrt(2.0 * math.pi / 8.0)

# The largest deviation of a flake's image in a texture, as a share of its tile.
_WIDEST = 0.08

# Pixels smooth the flakes of pictures smaller than this, and by what power of the size they are
# denser there, and fewer, so that a severity takes as much of the structure at every size.
_SMALL, _SHARPER = 512, 0.6

SPEEDS = {"snow": snow_speed, "rain": drop_speed}


class Streaks(NamedTuple):
    """The streaks of flakes that move while the shutter is open.

    Attributes
    ----------
    thick : float
        Optical depth of a resting one's middle.
    covered : float
        What one covers, over the product of that and its area.
    density : float
        How many there are per cubic metre.
    """

    thick: float
    covered: float
    density: float


@dataclass(frozen=True)
class Falling:
    """Flakes or drops between the camera and a depth.

    Attributes
    ----------
    kind : {"snow", "rain"}
    depth : float
        Optical depth of all of them: what they take of the light is ``1 - exp(-depth)``.
    sizes : (smallest, mean, largest)
        Diameters, metres.
    middle : float
        Optical depth of a resting one's middle.
    streak : float
        Optical depth of the middle of a streak that a mean one leaves, at least. A drop is a lens:
        it sends the light of half the sky, so that its streak is brighter than its width and way
        make it.
    near, far : float
        Metres.
    sway : (amplitude, rate)
        Metres, and radians per second, of those that are drawn.
    veil : float
        Share of the weather's opacity that an even veil holds.
    """

    kind: str
    depth: float
    sizes: tuple[float, float, float]
    middle: float
    far: float
    near: float = NEAREST
    streak: float = 0.0
    sway: tuple[float, float] = (0.0, 0.0)
    veil: float = 0.0

    def thick(self, way: float) -> float:
        """Return the optical depth of a resting one's middle, for streaks of a way in metres."""
        return max(self.middle, self.streak * way / (_SWEPT * self.sizes[1]))

    def streaks(self, way: float) -> Streaks:
        """Return the streaks of a way in metres."""
        thick = self.thick(way)
        covered = covered_by(thick, way, self.sizes[1])
        each = thick * covered * 0.25 * math.pi * _moment(self.sizes)
        return Streaks(thick, covered, self.depth / (each * (self.far - self.near)))

    def cloud(self, streaks: Streaks, reach: float) -> Cloud:
        """Return the flakes that are drawn."""
        thick, covered, density = streaks
        # A power of two, since opacities of copies are squared; so many that each is thin.
        times = 2 ** max(math.ceil(math.log2(2.0 * thick)), 1)
        return Cloud(
            density, self.near, reach, self.far, _quantiles(self.sizes), thick / times,
            times, covered, self.sway,
        )  # fmt: skip

    def reach(self, way: float, focal: float, tile: int, *, least: float) -> float:
        """Return the depth up to which they are drawn, metres.

        Parameters
        ----------
        way : float
            Metres that one falls while the shutter is open.
        focal : float
            Pixels.
        tile : int
            Of the texture, pixels.
        least : float
            Metres.
        """
        large = focal * self.sizes[2] / math.sqrt(8.0) / (_WIDEST * tile)
        # As many in a tile as a texture must have, in a slab whose far end is twice as far.
        sparse = 3.0 * LEAST_IN_TILE / (7.0 * self.streaks(way).density) * (focal / tile) ** 2
        wanted = max(sparse ** (1.0 / 3.0), large, least, 1.3 * self.near)
        return self.far if wanted > 0.7 * self.far else wanted


@lru_cache(maxsize=256)
def before(falling: Falling, longer: int, times: float) -> Falling:
    """Return the flakes before a picture of a longer side in px, some times as many of them."""
    dense = max(_SMALL / max(longer, _SMALL // 8), 1.0) ** _SHARPER
    if dense == times == 1.0:
        return falling
    return replace(
        falling, depth=times * falling.depth, middle=dense * falling.middle,
        streak=dense * falling.streak,
    )  # fmt: skip


def covered_by(thick: float, way: float, diameter: float) -> float:
    """Return the area that a flake covers over that of a thin one.

    A Gaussian of optical depth p in its middle covers Ein(p) / p of that.
    """
    p = thick / math.hypot(1.0, way / (_SWEPT * diameter))
    return ein(p) / p


def population_of(
    kind: str, sizes: tuple[float, float, float], density: float, opacity: float
) -> tuple[Population, SizeClass]:
    """Return the flakes as the population that a texture is made of, and its one class of size."""
    found = Population(density, _law(sizes), opacity, SPEEDS[kind])
    return found, found.classes(1)[0]


def ein(x: float) -> float:
    """Return the integral of (1 - exp(-t)) / t from 0 to x, by its series: x is at most some 10."""
    term, total = 1.0, 0.0
    for k in range(1, 60):
        term *= -x / k
        total -= term / k
        if abs(term) < 1e-17 * total:
            break
    return total


@lru_cache(maxsize=64)
def _moment(sizes: tuple[float, float, float]) -> float:
    return _law(sizes).moment(2.0)


@lru_cache(maxsize=64)
def _law(sizes: tuple[float, float, float]) -> Sizes:
    return Sizes.with_mean(*sizes)


@lru_cache(maxsize=64)
def _quantiles(sizes: tuple[float, float, float]) -> tuple[float, ...]:
    law = _law(sizes)
    return tuple(_DISC * float(law.quantile(k / (_SHARES - 1))) for k in range(_SHARES))

"""What falls, as one population of balls of one opacity: how many, and how dense each is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept
from flurries.particles.sizes import Sizes

# Optical depth of the middle of all balls, before it is multiplied; and the mean opacity over the
# disc of such a ball, 1 - 2 (1 - (1 + t) exp(-t)) / t^2.
MIDDLE = 1.5
OPACITY = 1.0 - 2.0 * (1.0 - (1.0 + MIDDLE) * math.exp(-MIDDLE)) / MIDDLE**2

# Pixels smooth the flakes of pictures smaller than this, and by what power of the size they are
# denser there, and fewer, so that a severity takes as much of the structure at every size.
SMALL, _SHARPER = 768, 1.15

# Cells of a ball's diameter across and along its way, and sizes, by which its cover is integrated.
_ACROSS, _ALONG, _SIZES = 24, 64, 8

# Steps of the factor and of the way, as ratios, between which the cover is interpolated.
_STEP = 1.25

# A shorter way over the diameter leaves no streak.
_REST = 1.0 / _ALONG


class Look(NamedTuple):
    """Flakes that move while the shutter is open."""

    # Factor of the optical depth of their balls; and how many there are per cubic metre.
    gain: float
    density: float


@dataclass(frozen=True)
class Falling:
    """Flakes or drops between the camera and a depth."""

    # Optical depth of all of them: what they take of the light is 1 - exp(-depth).
    depth: float
    # Smallest, mean and largest diameter, metres.
    sizes: tuple[float, float, float]
    # Optical depth of a resting one's middle.
    middle: float
    # Metres. Around the near depth they fade in.
    near: float
    far: float
    # Optical depth of the middle of a mean one's streak, at least. A drop is a lens: it sends the
    # light of half the sky, so that its streak is brighter than its width and way make it.
    streak: float = 0.0
    # Metres, and radians per second, of those that are drawn.
    sway: tuple[float, float] = (0.0, 0.0)
    # Share of the weather's opacity that an even veil holds.
    veil: float = 0.0

    @property
    def thickness(self) -> float:
        """Optical depth per metre."""
        return self.depth / (self.far - self.near)

    def look(self, way: float) -> Look:
        """Return the flakes of a way in metres."""
        gain, ratio = self.middle / MIDDLE, max(way / self.sizes[1], _REST)
        if self.streak > 0.0:
            wanted = self.streak * ratio / math.hypot(1.0, ratio)
            gain = max(gain, -wanted / math.log1p(-_brightest(ratio)))
        each = 0.25 * math.pi * square(self.sizes) * _covered(self.sizes, gain, ratio)
        return Look(gain, self.thickness / each)

    def before(self, depth: Float64) -> Float64:
        """Return the share of light from depths (n,) that passes."""
        way = np.clip(depth, self.near, self.far) - self.near
        return np.exp(-self.thickness * way)


@kept(256)
def seen_by(falling: Falling, longer: float, times: float) -> Falling:
    """Return the flakes before a picture of a longer side in px, some times as many of them."""
    dense = max(SMALL / max(longer, SMALL // 12), 1.0) ** _SHARPER
    if dense == times == 1.0:
        return falling
    return replace(
        falling, depth=times * falling.depth, middle=dense * falling.middle,
        streak=dense * falling.streak,
    )  # fmt: skip


@kept(64)
def law_of(sizes: tuple[float, float, float]) -> Sizes:
    """Return the law of diameters between a smallest and a largest that have a mean."""
    return Sizes.with_mean(*sizes)


@kept(64)
def square(sizes: tuple[float, float, float]) -> float:
    """Return the mean of the squares of diameters."""
    return law_of(sizes).moment(2.0)


def _brightest(ratio: float) -> float:
    """Return the opacity of the middle of a streak that is some diameters long."""
    chord = _balls()[-1]
    steps = max(round(0.5 * _ALONG * min(ratio, 1.0)), 1)
    half = chord[_ALONG // 2 + steps] - chord[_ALONG // 2]
    return float(2.0 * half / max(ratio, 2.0 * steps / _ALONG))


def _covered(sizes: tuple[float, float, float], gain: float, ratio: float) -> float:
    """Return the area that flakes cover over that of their discs, of a way over their mean size."""
    places = [math.log(value) / math.log(_STEP) for value in (gain, ratio)]
    (i, u), (j, v) = ((math.floor(place), place % 1.0) for place in places)
    rows = [
        (1.0 - u) * _covered_at(sizes, i, k) + u * _covered_at(sizes, i + 1, k) for k in (j, j + 1)
    ]
    return math.exp((1.0 - v) * rows[0] + v * rows[1])


@kept(4096)
def _covered_at(sizes: tuple[float, float, float], gain: int, ratio: int) -> float:
    """Return the logarithm of what is covered, at whole steps of the factor and of the way."""
    factor, way, total = _STEP**gain, sizes[1] * _STEP**ratio, 0.0
    shares = (np.arange(_SIZES) + 0.5) / _SIZES
    diameters: Sequence[float] = law_of(sizes).quantile(shares).tolist()
    sums = _balls()
    for diameter in diameters:
        length = way / diameter
        window = min(max(round(_ALONG * length), 1), _ALONG)
        # Opacity at places along the way: the ball's share of the time there.
        padded = np.pad(sums, ((0, 0), (window, window)), mode="edge")
        swept = padded[:, window:] - padded[:, :-window]
        swept /= length if length > 1.0 else window / _ALONG
        hidden = -np.expm1(factor * np.log1p(-swept))
        area = hidden.sum() / _ALONG + max(length - 1.0, 0.0) * hidden[:, window].sum()
        total += diameter**2 * 2.0 * float(area) * 0.5 / _ACROSS
    return math.log(total / (0.25 * math.pi * sum(d * d for d in diameters)))


@kept(1)
def _balls() -> Float64:
    """Return integrals of the opacity of a ball of diameter 1 along its chords, the middle last."""
    x = (np.arange(_ACROSS)[::-1] + 0.5) / (2.0 * _ACROSS)
    y = (np.arange(_ALONG) + 0.5) / _ALONG - 0.5
    inside = np.maximum(1.0 - 4.0 * (x[:, None] ** 2 + y**2), 0.0)
    opacity = -np.expm1(-MIDDLE * np.sqrt(inside))
    sums = np.zeros((_ACROSS, _ALONG + 1))
    np.cumsum(opacity / _ALONG, axis=1, out=sums[:, 1:])
    return sums

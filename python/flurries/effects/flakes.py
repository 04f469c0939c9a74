"""A few flakes or drops near the camera, in front of a texture that stands for the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.effects.maps import TUNED
from flurries.effects.motion import Motion
from flurries.effects.weather import Share
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at
from flurries.particles.population import FADE, SizeClass
from flurries.particles.sizes import Sizes

# The most opaque ball there is: its middle lets through a ten-millionth.
_MOST_OPAQUE = 0.99

# Sizes of these looks are six deviations of a Gaussian wide; a ball that covers as much is smaller.
_BALL = math.sqrt(8.0) / 6.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Flakes:
    motion: Motion  # What moves them.
    number: int  # How many are in view.
    density: float | None = None  # Per cubic metre, in place of the number in view.
    reach: float  # Depth up to which there are any, metres.
    # (smallest, largest): widths, metres, as many of each: six times the deviation of a Gaussian
    # that covers as much.
    sizes: tuple[float, float]
    opacity: Number  # Mean over the disc of a resting one.
    sway: tuple[float, float] = (0.0, 0.0)  # (amplitude, rate): metres, and radians per second.
    # (low, high): sigma of images on a picture 1024 px wide between which flakes fade: out-of-
    # focus puffs look like dirt.
    largest: tuple[float, float] = (3.5, 6.0)
    keyed: bool = False  # Whether the amount of flakes changes.

    shape: ClassVar[str] = "round"
    emission: ClassVar[float] = 1.0
    near: ClassVar[float] = 0.0

    @cached_property
    def law(self) -> Sizes:
        """The law of their diameters as balls."""
        small, large = (_BALL * size for size in self.sizes)
        return Sizes(small, 0.5 * (small + large), large)

    def opacity_at(self, t: float) -> float:
        return min(float(value_at(self.opacity, t)), _MOST_OPAQUE)

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        """Return them as one class of size."""
        return _shares(self, frame.shape, frame.path, frame.camera.focal)


@kept(64)
def _shares(
    flakes: Flakes, shape: tuple[int, int], path: CameraPath, focal: float
) -> tuple[Share, ...]:
    (height, width), (fx, fy) = shape, path.widest.focals
    # The view is a pyramid: a third of the prism around it.
    view = width * height * flakes.reach**3 / (3.0 * fx * fy)
    density = flakes.number / view if flakes.density is None else flakes.density
    small, large = flakes.law.smallest, flakes.law.largest
    fall = float(value_at(flakes.motion.fall, 0.0))
    one = SizeClass(density, small, large, fall, flakes.law.nodes(small, large))
    # The largest fade in, and all out again.
    widest = focal * flakes.sizes[1] / (6.0 * width / TUNED)
    low, high = (widest / limit for limit in flakes.largest)
    shown = (high, low, flakes.reach, flakes.reach * (1.0 + FADE))
    share = Share(one, flakes.motion, flakes.reach, shown)
    return (share,) if math.isfinite(density) else ()

"""A population in the air of a film: which flakes are drawn, and which the texture stands for.

What is near is drawn flake by flake up to the depth that `hand_over` says; beyond it each class of
size is synthesized in slabs of depth. Both take density, sizes, opacity, fall and
wind from here, so that nothing changes where one takes over from the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.camera.path import CameraPath
from flurries.effects.motion import Motion
from flurries.frame.needs import has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, Number, value_at
from flurries.particles.population import FADE, Population, SizeClass, Slab, slabs_of
from flurries.particles.sizes import Sizes

# Classes of size: each falls at a speed of its own. Where places move in their own ways the texture
# has fewer, each of some of the others.
CLASSES, BENT_CLASSES = 4, 2

# Drawn flakes for each pixel, before sheets take over; and flakes up to the far end for each pixel,
# of which all are drawn.
DRAWN, FEW = 0.002, 0.004

# Diameter in px of the largest flake of a sheet.
LARGEST = 14.0

# Layers of sheets of each class; large flakes make most of the contrast.
LAYERS, BENT_LAYERS = (3, 5, 8, 10), 6

# Depth in units of the near one over which flakes fade in before the lens.
NEAR_FADE = 1.25

# By so much of the far end, on either side, the last flakes fade, so that none pops.
FAR_FADE = 0.07

# Heights at which the amount of flakes is looked up while they begin or cease to fall.
HEIGHTS = 65


@dataclass(frozen=True, eq=False)
class Share:
    """A class of size, and how it is shared out."""

    size: SizeClass
    motion: Motion  # With the fall speed of the class.
    reach: float  # Depth up to which its flakes are drawn, metres.
    slabs: tuple[Slab, ...]  # What the texture stands for beyond; none where all are drawn.

    @property
    def end(self) -> float:
        """The depth at which the last of its drawn flakes are gone, metres."""
        return self.reach * (1.0 + FADE)


class Layer(NamedTuple):
    """A slab with the class that it belongs to."""

    share: Share
    slab: Slab


@dataclass(frozen=True, eq=False)
class Film:
    """The shares of all classes in one film."""

    shares: tuple[Share, ...]  # Of what the texture stands for.
    drawn: tuple[Share, ...]  # Of what is drawn: the same ones, or parts of them.
    comes: bool = False  # Whether the air ever comes nearer the camera or recedes, turns or grows.
    # Whether all places of a layer move alike and always so, and nothing of it changes.
    rigid: bool = False

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """The layers of the texture, near ones first."""
        found = [Layer(share, slab) for share in self.shares for slab in share.slabs]
        return tuple(sorted(found, key=lambda layer: layer.slab.depth))


@dataclass(frozen=True, eq=False, kw_only=True)
class Weather:
    """A population that falls."""

    population: Population
    motion: Motion  # Of a flake of the mean size.
    emission: Number  # Share of the flakes that begin to fall, 0 to 1.
    cloud: float  # Height above the camera at which they begin, metres.
    sway: tuple[float, float]  # (amplitude, rate): metres, and radians per second.
    near: float  # Depths between which there are flakes, metres.
    far: float  # Depths between which there are flakes, metres.
    simulated: bool  # Whether every flake is drawn.
    shape: str = "round"  # What flakes are near the camera.
    keyed: bool = False  # Whether the amount of flakes changes.
    # Depth up to which they are drawn where sheets lie beyond, metres.
    handover: float | None = None

    def film(self, frame: Frame) -> Film:
        """Return the shares of the film that a frame belongs to."""
        path = frame.path
        rotation = (0.0, 0.0, 0.0) if path.turns else frame.camera.rotation
        focal = frame.camera.focal if not path.zooms else path.longest_focal
        lens = frame.lens is not None and has_keys(frame.lens)
        return _film(self, path, rotation, focal, frame.fps, lens)

    def amounts(self, frame: Frame, share: Share, amount: float, heights: Float64) -> Float64:
        """Return the share of a class's flakes that is there at heights below the eye, metres.

        A flake at height h left the cloud (cloud + h) / fall seconds ago, and is there if it began
        to fall.
        """
        if not isinstance(self.emission, Keys):
            return np.full(len(heights), amount * self.emission)
        fall = max(float(value_at(share.motion.fall, frame.t)), 1e-3)
        left = frame.t - frame.fps * np.maximum(self.cloud + heights, 0.0) / fall
        return amount * np.array([self.emission.at(float(time)) for time in left])

    @property
    def law(self) -> Sizes:
        """The law of their diameters."""
        return self.population.sizes

    @cached_property
    def mean_speed(self) -> float:
        """The fall speed of a flake of the mean size, by the population's law, m/s."""
        return float(self.population.speed(np.array([self.population.sizes.mean]))[0])

    def opacity_at(self, t: float) -> float:
        """Return the mean opacity over the disc of a resting flake, at a frame."""
        return self.population.opacity

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        """Return the classes of size."""
        return self.film(frame).drawn

    def shown(self, share: Share, width: int, focal: float) -> tuple[float, float, float, float]:
        """Return the depths between which drawn flakes fade in, and out again, metres."""
        near = (self.near, self.near * NEAR_FADE)
        if share.reach >= self.far:
            return (*near, self.far * (1.0 - FAR_FADE), self.far * (1.0 + FAR_FADE))
        return (*near, share.reach, share.end)


def times(number: Number, factor: float) -> Number:
    """Return a number, plain or keyed, times a factor."""
    if isinstance(number, Keys):
        return Keys([(frame, factor * value) for frame, value in number.keys])
    return factor * number


@lru_cache(maxsize=64)
def _film(
    weather: Weather, path: CameraPath, rotation: tuple[float, float, float], focal: float,
    fps: float, blurred: bool,
) -> Film:  # fmt: skip
    population, motion = weather.population, weather.motion
    if population.density == 0.0:
        # Nothing to be shared out: one class, all of it drawn.
        (one,) = population.classes(1)
        none = (Share(one, motion, weather.far, ()),)
        return Film(none, none)
    mean = weather.mean_speed
    varied = population.sizes.largest > population.sizes.smallest

    def classes(count: int) -> list[tuple[SizeClass, Motion]]:
        return [
            (one, Motion(times(motion.fall, one.fall / mean), motion.wind, motion.shutter))
            for one in population.classes(count if varied else 1)
        ]

    fine = classes(CLASSES)
    if weather.simulated or _few(weather, path):
        drawn = tuple(Share(one, own, weather.far, ()) for one, own in fine)
        return Film(drawn, drawn)
    comes = motion.spreads(path, rotation)
    constant = (
        not (comes or weather.keyed or blurred or isinstance(motion.shutter, Keys))
        and not isinstance(weather.emission, Keys)
        and motion.varied is None
        and all(own.line(path, fps) is not None for _, own in fine)
    )
    reach = hand_over(weather, focal)

    slabs = partial(slabs_of, population, focal=focal, tile=1, reach=reach, far=weather.far)
    if constant:
        shares = tuple(
            Share(one, own, reach,
                  tuple(slabs(one, edges=layer_edges(reach, weather.far, count))))
            for (one, own), count in zip(fine, LAYERS[-len(fine) :], strict=True)
        )  # fmt: skip
        return Film(shares, shares, rigid=True)
    # Planes go through their slabs, and are as thick as these are far.
    edges = np.geomspace(reach, weather.far, BENT_LAYERS + 1)
    shares = tuple(
        Share(one, own, reach, tuple(slabs(one, edges=edges, flat=comes)))
        for one, own in classes(BENT_CLASSES)
    )
    return Film(shares, tuple(Share(one, own, reach, ()) for one, own in fine), comes)


def hand_over(weather: Weather, focal: float) -> float:
    """Return the depth up to which flakes are drawn where sheets are what lies beyond, metres.

    Slabs end at fixed depths, 2^(1/4) apart. Where the drawn flakes are a share of the pixels,
    their cost is that share at any size of the picture; a sheet's flakes have an end.
    """

    if weather.handover is not None:
        return min(max(weather.handover, NEAR_FADE * weather.near), weather.far)

    def edge(depth: float, towards: Callable[[float], float]) -> float:
        return float(2.0 ** (0.25 * towards(4.0 * math.log2(depth))))

    cost = (3.0 * DRAWN * focal**2 / weather.population.density) ** (1.0 / 3.0)
    large = weather.population.sizes.largest * focal / LARGEST
    near = max(edge(cost, math.floor), edge(max(large, NEAR_FADE * weather.near), math.ceil))
    return min(near, weather.far)


def layer_edges(near: float, far: float, count: int) -> Float64:
    """Return depths between layers: of even parts of speed, for the most part, and of coverage.

    Speed in the picture goes with one over the depth, and so does the variance up to a depth; what
    a layer covers goes with its thickness. A layer moves as a whole: one with much of the variance
    or with flakes of many speeds would be seen to.
    """
    if near >= far:
        return np.array([near, far])
    depths = np.geomspace(near, far, 1025)
    speed = (1.0 / near - 1.0 / depths) / (1.0 / near - 1.0 / far)
    share = 0.75 * speed + 0.25 * (depths - near) / (far - near)
    return np.interp(np.linspace(0.0, 1.0, count + 1), share, depths)


def _few(weather: Weather, path: CameraPath) -> bool:
    """Whether all flakes are so few for each pixel that they are drawn."""
    fx, fy = path.widest.focals
    return weather.population.density * weather.far**3 / (3.0 * fx * fy) < FEW

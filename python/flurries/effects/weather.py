"""A population in the air of a film: which flakes are drawn, and which the texture stands for."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar, NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath
from flurries.effects.air import NEAR_FADE, swing_of
from flurries.effects.drawn import Drawn, Share
from flurries.effects.motion import HALF_OPEN, Motion, times
from flurries.effects.notes import Notes
from flurries.frame.needs import has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Number, Vector
from flurries.particles import population as laws
from flurries.particles.sizes import Sizes

# Drawn flakes for each pixel, before sheets take over, and drops, before planes do: streaks of the
# nearest cost planes more. Of fewer flakes than the last up to the far end all are drawn.
DRAWN, FEW = (0.002, 0.005), 0.004

LARGEST = 14.0  # Diameter in px of the largest flake of a sheet.

# Flakes for each pixel of a sheet at most: of a plane, and where all places move alike.
_MOST_FLAKES = (6.0, 2.0)

# Classes of size, each with a fall speed of its own, and layers of sheets of each: large flakes
# make most of the contrast.
CLASSES, LAYERS = 4, (4, 7, 10, 15)

# The same where places move in their own ways, of fewer classes, each of some of the others. Of
# drops, whose speeds are so far apart that they streak in many ways, the logarithm of a depth.
BENT_CLASSES, BENT_LAYERS, _APART, _THICK = 2, 6, 1.3, 0.283

_ANYWHERE = (0.0, 0.0, 1e6, 1e6)  # Where a flake shows that somebody put there.

# By so much of the far end, on either side, the last flakes fade, so that none pops.
FAR_FADE = 0.07


class Layer(NamedTuple):
    """A slab of the texture with the class that it belongs to."""

    share: Share
    slab: laws.Slab


@dataclass(frozen=True, eq=False)
class Film:
    drawn: tuple[Share, ...]
    layers: list[Layer]  # Of the texture, near ones first; none where all flakes are drawn.
    comes: bool  # Whether the air ever comes nearer the camera or recedes, turns or grows.
    # Whether all places of a layer move alike and always so, and nothing of it changes.
    rigid: bool

    # Of each layer: its slab, the slab's depth and coverage, how fast its flakes fall, its part of
    # the variance, how many flakes each of its sheet stands for, and the width of one, px.
    slabs: list[laws.Slab]
    depths: Float64
    covers: Float64
    falls: Float64
    power: Float64
    many: list[float]
    wide: list[float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Weather(Drawn):
    population: laws.Population
    motion: Motion  # Of a flake of the mean size.
    emission: Number  # Share of the flakes that begin to fall, 0 to 1.
    cloud: float  # Height above the camera at which they begin, metres.
    sway: Vector  # (amplitude, rate): metres, and radians per second.
    clumps: float  # By what part of the mean density it differs from place to place, 0 to 1.
    near: float  # Depths between which there are flakes, metres.
    far: float
    simulated: bool  # Whether every flake is drawn.
    shape: str = "round"  # What flakes are near the camera.
    keyed: bool = False  # Whether the amount of flakes changes.
    # Depth up to which they are drawn where sheets lie beyond, metres.
    handover: float | None = None
    backdrop: float | None = None  # Where they end if the scene has no depth, metres.
    notes: Notes | None = None

    by_size: ClassVar[bool] = False

    def film(self, frame: Frame) -> Film:
        path = frame.path
        rotation = (0.0, 0.0, 0.0) if path.turns else frame.camera.rotation
        focal = frame.camera.focal if not path.zooms else path.longest_focal
        deep = frame.deep or frame.depth is not None
        return _film(self if deep else self._open, path, rotation, focal, frame.fps, frame.lens)

    @cached_property
    def _open(self) -> "Weather":
        """The weather before a background of which no depth is known."""
        end = self.far if self.backdrop is None else self.backdrop
        return replace(self, far=end) if end < self.far else self

    @property
    def law(self) -> Sizes:
        return self.population.sizes

    @cached_property
    def mean_speed(self) -> float:
        """The fall speed of a flake of the mean size, by the population's law, m/s."""
        return float(self.population.speed(np.array([self.law.mean]))[0])

    def opacity_at(self, t: float) -> float:
        return self.population.opacity

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        drawn = self.film(frame).drawn
        return drawn if self.notes is None else (*drawn, *self._placed(frame, self.notes))

    def _placed(self, frame: Frame, notes: Notes) -> Iterator[Share]:
        """Yield the flakes that somebody put there, each with the air that is its own."""
        path, fps = frame.path, frame.fps
        for t, *at, diameter in notes.place:
            speed = float(self.population.speed(np.array([diameter]))[0])
            motion = replace(self.motion, fall=times(self.motion.fall, speed / self.mean_speed))
            (eye,) = motion.places(path, fps, [t])
            swing, cycles = swing_of(self.sway, motion.now(t), fps)
            aside = swing * math.sin(math.tau * cycles) * np.array((1.0, 0.0, 1.0))
            place = at - path.place(t, fps=fps) + eye - aside
            size = laws.SizeClass(1.0, diameter, diameter, speed, (np.empty(0), np.empty(0)))
            yield Share(size, motion, self.far, _ANYWHERE, tuple(place.tolist()))


@kept(64)
def _film(
    weather: Weather, path: CameraPath, rotation: tuple[float, float, float], focal: float,
    fps: float, lens: Lens | None,
) -> Film:  # fmt: skip
    population, motion, far = weather.population, weather.motion, weather.far
    changes = weather.keyed or has_keys((lens, weather.emission, motion.shutter))
    fx, fy = path.widest.focals
    few = weather.simulated or population.density * far**3 / (3.0 * fx * fy) < FEW

    even, comes = motion.varied is None, motion.spreads(path, rotation)
    rigid = not (comes or changes) and even and motion.line(path, fps) is not None
    bent = [] if rigid else population.classes(BENT_CLASSES, 4)
    drops = bool(bent) and bent[-1].fall > _APART * bent[0].fall
    # Of drops each half of the drawn classes is what one of the planes' classes stands for.
    sizes = population.classes(CLASSES, 4 if drops else 2)
    apart = bent if drops else sizes if rigid else population.classes(1)
    ends = hand_overs(weather, focal, apart, DRAWN[drops])
    if weather.notes is not None:
        ends = [max(end, min(weather.notes.reach(path, fps), far)) for end in ends]

    def shares(sizes: list[laws.SizeClass]) -> list[Share]:
        found, near = list[Share](), (weather.near / NEAR_FADE, weather.near)
        for number, one in enumerate(sizes):
            reach = far if few else ends[number * len(ends) // len(sizes)]
            fall = times(motion.fall, one.fall / weather.mean_speed)
            fade = (1.0 - FAR_FADE, 1.0 + FAR_FADE) if reach >= far else (1.0, 1.0 + laws.FADE)
            shown = (*near, reach * fade[0], reach * fade[1])
            found.append(Share(one, replace(motion, fall=fall), reach, shown))
        return found

    drawn, parts = shares(sizes), list[tuple[Share, Float64]]()
    if rigid:
        rates = [(share.motion.line(path, fps) or ([], [0.0]))[1] for share in drawn]
        for share, count, rate in zip(drawn, LAYERS[-len(drawn) :], rates, strict=True):
            varies = partial(laws.variance_at, share.size, focal, HALF_OPEN * math.hypot(*rate))
            parts.append((share, laws.layer_edges(share.reach, far, count, varies)))
    else:
        # Planes go through slabs as thick as far, and both classes of them vary pixels as much.
        for one in shares(bent):
            deep = round(math.log(far / one.reach) / _THICK) if drops else BENT_LAYERS
            parts.append((one, np.geomspace(one.reach, far, max(deep, 1) + 1)))
    layers = [
        Layer(one, slab)
        for one, edges in parts
        for slab in laws.slabs_of(
            population, one.size, focal, edges, flat=comes, moment=2 if rigid or comes else 4
        )
    ]
    layers.sort(key=lambda layer: layer.slab.depth)
    slabs = [slab for _, slab in layers]
    counts, covers = np.reshape([(slab.count, slab.coverage) for slab in slabs], (-1, 2)).T
    power = counts * [float(np.mean(slab.diameters**4)) for slab in slabs]
    return Film(
        drawn=tuple(drawn), layers=layers, comes=comes, rigid=rigid, slabs=slabs, covers=covers,
        depths=np.array([slab.depth for slab in slabs]),
        falls=np.array([share.size.fall for share, _ in layers]),
        power=power, many=np.maximum(counts / _MOST_FLAKES[rigid], 1.0).tolist(),
        wide=[math.sqrt(float((d**4).mean() / (d**2).mean()) + 0.8)
              for d in (slab.diameters for slab in slabs)],
    )  # fmt: skip


def hand_overs(
    weather: Weather, focal: float, classes: list[laws.SizeClass], drawn: float
) -> list[float]:
    """Return the depths up to which flakes of each class are drawn if sheets lie beyond, metres."""
    if weather.handover is not None:
        return [min(max(weather.handover, weather.near), weather.far)] * len(classes)

    # Classes cover the same area: their diameters go with one over the root of their numbers. Those
    # of drops vary pixels as much: the larger are drawn farther still.
    sides = [max(one.density, 1e-30) ** -0.5 for one in classes]
    image, found = (3.0 * drawn * focal**2 / sum(sides)) ** (1.0 / 3.0), []
    for one, side in zip(classes, sides, strict=True):
        large = max(one.largest * focal / LARGEST, weather.near)
        step = max(math.floor(4.0 * math.log2(image * side)), math.ceil(4.0 * math.log2(large)))
        found.append(min(2.0 ** (0.25 * step), weather.far))
    return found

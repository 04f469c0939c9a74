"""A population in the air of a film: which flakes are drawn, and which the texture stands for.

What is near is drawn flake by flake up to the depth that `reach_of` says for each class of size;
beyond it the class is synthesized in slabs of depth. Both take density, sizes, opacity, fall and
wind from here, so that nothing changes where one takes over from the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix as matrix_of
from flurries.effects.motion import Motion, relative_course
from flurries.frame.needs import has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, Number, value_at
from flurries.particles.population import (
    FADE,
    HANDOVER_SIGMA,
    LEAST_IN_TILE,
    SIGMA_OF_DIAMETER,
    Population,
    SizeClass,
    Slab,
    reach_of,
    slabs_of,
)
from flurries.particles.sizes import Sizes

# Tiles of the texture, px: the least one whose layers move by less than half of it in a frame. The
# small one is odd, so that no waves of half a cycle are left out: without them small flakes ring.
TILES = (63, 128, 256)

# Classes of size: each falls at a speed of its own. Tiles have two, each of two of the others.
CLASSES, TILE_CLASSES = 4, 2

# Of a tile, the part that neighbours share. Power blending lifts the mean of sparse snow there, by
# 1.3 % of all at a ninth and by .7 % at a fifteenth.
OVERLAP = 14

# Flakes of all classes in a tile, below which neighbours share half as much: there blending lifts
# the mean, and seams of so few flakes cannot be seen.
SPARSE = 2000.0

# Drawn flakes for each pixel, before sheets take over; and flakes up to the far end for each pixel,
# of which all are drawn.
DRAWN, FEW = 0.002, 0.004

# Diameter in px of the largest flake of a sheet.
LARGEST = 14.0

# Layers of sheets of each class; large flakes make most of the contrast.
LAYERS = (3, 5, 8, 10)

# A layer changes its patterns after so many lengths of a torus.
WRAPS = 12

# Depth in units of the near one over which flakes fade in before the lens.
NEAR_FADE = 1.25

# By so much of the far end, on either side, the last flakes fade, so that none pops.
FAR_FADE = 0.07

# Heights at which the amount of flakes is looked up while they begin or cease to fall.
HEIGHTS = 65


@dataclass(frozen=True, eq=False)
class Share:
    """A class of size, and how it is shared out.

    Attributes
    ----------
    size : SizeClass
    motion : Motion
        With the fall speed of the class.
    reach : float
        Depth up to which its flakes are drawn, metres.
    slabs : list of Slab
        What the texture stands for beyond; none where all are drawn.
    flow : float
        How far a flake moves in a frame, as a rule over a film and its picture: pixels times metres
        of depth.
    """

    size: SizeClass
    motion: Motion
    reach: float
    slabs: tuple[Slab, ...]
    flow: float = 0.0

    @property
    def end(self) -> float:
        """The depth at which the last of its drawn flakes are gone, metres."""
        return self.reach * (1.0 + FADE)


class Layer(NamedTuple):
    """A slab with the class that it belongs to.

    Attributes
    ----------
    share : Share
    slab : Slab
    """

    share: Share
    slab: Slab


@dataclass(frozen=True, eq=False)
class Film:
    """The shares of all classes in one film.

    Attributes
    ----------
    shares : tuple of Share
        Of what the texture stands for.
    drawn : tuple of Share
        Of what is drawn: the same ones, or parts of them.
    tile, overlap : int
        Of the texture, px.
    across : bool
        Whether the film moves more along the rows than along the columns.
    comes : bool
        Whether the air ever comes nearer the camera or recedes.
    constant : bool
        Whether a layer passes all tiles alike, and at one speed always.
    rigid : bool
        Whether all places of a layer move alike and always so: then sheets are read.
    shear : int
        Pixels to the side at which a flake that leaves a tile's torus below comes in above.
    """

    shares: tuple[Share, ...]
    drawn: tuple[Share, ...]
    tile: int
    overlap: int
    across: bool
    comes: bool
    constant: bool
    shear: int
    rigid: bool = False

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """The layers of the texture, near ones first."""
        found = [Layer(share, slab) for share in self.shares for slab in share.slabs]
        return tuple(sorted(found, key=lambda layer: layer.slab.depth))

    @cached_property
    def classes(self) -> list[tuple[Share, npt.NDArray[np.int64], Float64, Float64]]:
        """Shares with the numbers, the depths (n, 1) and the half passages (n,) of their layers."""
        found = []
        for share in self.shares:
            own = np.array([n for n, layer in enumerate(self.layers) if layer.share is share], int)
            slabs = [self.layers[n].slab for n in own]
            depths = np.array([[slab.depth] for slab in slabs])
            found.append((share, own, depths, np.array([0.5 * (s.far - s.near) for s in slabs])))
        return [one for one in found if len(one[1])]


@dataclass(frozen=True, eq=False, kw_only=True)
class Weather:
    """A population that falls.

    Attributes
    ----------
    population : Population
    motion : Motion
        Of a flake of the mean size.
    emission : Number
        Share of the flakes that begin to fall, 0 to 1.
    cloud : float
        Height above the camera at which they begin, metres.
    sway : (amplitude, rate)
        Metres, and radians per second.
    near, far : float
        Depths between which there are flakes, metres.
    simulated : bool
        Whether every flake is drawn.
    shape : {"aggregate", "drop", "round"}
        What flakes are near the camera.
    keyed : bool
        Whether the amount of flakes changes.
    handover : float, optional
        Depth up to which they are drawn where sheets lie beyond, metres.
    """

    population: Population
    motion: Motion
    emission: Number
    cloud: float
    sway: tuple[float, float]
    near: float
    far: float
    simulated: bool
    shape: str = "round"
    keyed: bool = False
    handover: float | None = None

    def film(self, frame: Frame) -> Film:
        """Return the shares of the film that a frame belongs to."""
        path = frame.path
        rotation = (0.0, 0.0, 0.0) if path.turns else frame.camera.rotation
        focal = frame.camera.focal if not path.zooms else path.longest_focal
        lens = frame.lens is not None and has_keys(frame.lens)
        return _film(self, frame.shape, path, rotation, focal, frame.fps, lens)

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

    def opacity_at(self, t: float) -> float:
        """Return the mean opacity over the disc of a resting flake, at a frame."""
        return self.population.opacity

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        """Return the classes of size."""
        return self.film(frame).drawn

    def shown(self, share: Share, frame: Frame) -> tuple[float, float, float, float]:
        """Return the depths between which drawn flakes fade in, and out again, metres."""
        near = (self.near, self.near * NEAR_FADE)
        if share.reach >= self.far:
            return (*near, self.far * (1.0 - FAR_FADE), self.far * (1.0 + FAR_FADE))
        return (*near, share.reach, share.end)

    @property
    def steady(self) -> bool:
        """Whether as many flakes are there at all heights."""
        return not isinstance(self.emission, Keys)


def times(number: Number, factor: float) -> Number:
    """Return a number, plain or keyed, times a factor."""
    if isinstance(number, Keys):
        return Keys([(frame, factor * value) for frame, value in number.keys])
    return factor * number


@lru_cache(maxsize=64)
def _film(
    weather: Weather,
    shape: tuple[int, int],
    path: CameraPath,
    rotation: tuple[float, float, float],
    focal: float,
    fps: float,
    blurred: bool,
) -> Film:
    population, motion = weather.population, weather.motion
    if population.density == 0.0:
        # Nothing to be shared out: one class, all of it drawn.
        (one,) = population.classes(1)
        none = (Share(one, motion, weather.far, ()),)
        return Film(none, none, TILES[0], TILES[0] // OVERLAP, False, False, False, 0)
    mean = float(population.speed(np.array([population.sizes.mean]))[0])
    varied = population.sizes.largest > population.sizes.smallest
    fine, classes = (
        [
            (one, Motion(times(motion.fall, one.fall / mean), motion.wind, motion.shutter))
            for one in population.classes(count if varied else 1)
        ]
        for count in (CLASSES, TILE_CLASSES)
    )
    if weather.simulated or _few(weather, path):
        drawn = tuple(Share(one, own, weather.far, ()) for one, own in fine)
        return Film(drawn, drawn, TILES[0], TILES[0] // OVERLAP, False, False, False, 0)
    spreads = motion.spreads(path, rotation)
    constant = (
        not (spreads or path.zooms)
        and motion.varied is None
        and not isinstance(motion.shutter, Keys)
        and all(
            len(relative_course(path, fps, own.fall, own.mean_wind).knots) == 0
            for _, own in classes
        )
    )
    if constant and weather.steady and not weather.keyed and not blurred:
        reach = hand_over(weather, focal)
        shares = [
            Share(
                one, own, reach,
                tuple(
                    slabs_of(
                        population, one, focal, 1, reach=reach, far=weather.far,
                        edges=layer_edges(reach, weather.far, count),
                    )
                ),
                _flow(own, shape, path, rotation, focal, fps),
            )
            for (one, own), count in zip(fine, LAYERS[-len(fine) :], strict=True)
        ]  # fmt: skip
        return Film(tuple(shares), tuple(shares), 1, 0, False, False, True, 0, rigid=True)
    extra = 0.0 if motion.varied is None else motion.varied.fastest_extra() / fps
    fastest = [each.fastest(path, fps) + extra for _, each in classes]
    # As far as the largest flakes are drawn in any case, all may be.
    reach = focal * classes[-1][0].largest * SIGMA_OF_DIAMETER / HANDOVER_SIGMA
    for tile in TILES:
        drawn_to = max(reach, _sparse(classes, focal, tile))
        if max(fastest) * 2.0 * focal / tile <= drawn_to or tile >= min(shape):
            break
    # Nothing is nearer than the near depth: there the texture must not begin before it.
    least = min(NEAR_FADE * weather.near, weather.far)
    reaches = [
        max(reach_of(one, focal, tile, fastest=speed, far=weather.far), least)
        for (one, _), speed in zip(classes, fastest, strict=True)
    ]
    shares = []
    for (one, own), reach in zip(classes, reaches, strict=True):
        slabs = slabs_of(population, one, focal, tile, reach=reach, far=weather.far)
        flow = _flow(own, shape, path, rotation, focal, fps)
        shares.append(Share(one, own, reach, tuple(slabs), flow))
    in_tile = sum(slab.count for share in shares for slab in share.slabs)
    _, rate = path.relative(0.0, fps=fps, fall=motion.fall, wind=motion.mean_wind)
    rate = rate @ matrix_of(rotation)
    across = bool(abs(rate[0]) > abs(rate[1]))
    slopes = [0.0]
    if constant:
        for _, own in classes:
            course = relative_course(path, fps, own.fall, own.mean_wind)
            x, y, _ = course.values[0] @ matrix_of(rotation)
            slopes.append(float(y / x if across else x / y) if x or y else 0.0)
    shear = shear_for(tile, tuple(slopes[1:] if constant else slopes[:1]))
    overlap = tile // OVERLAP if in_tile >= SPARSE else tile // (2 * OVERLAP)
    each = len(fine) // len(classes)
    drawn = tuple(
        Share(one, own, shares[number // each].reach, ()) for number, (one, own) in enumerate(fine)
    )
    return Film(tuple(shares), drawn, tile, overlap, across, spreads, constant, shear)


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


def _flow(
    motion: Motion,
    shape: tuple[int, int],
    path: CameraPath,
    rotation: tuple[float, float, float],
    focal: float,
    fps: float,
) -> float:
    """Return the root of the mean square of the flow over a picture, at the film's speeds."""
    course = relative_course(path, fps, motion.fall, motion.mean_wind)
    x, y, z = (course.values @ matrix_of(rotation)).T
    # Of what comes nearer a point flows outwards, as far as it is from the middle.
    corner = (shape[0] ** 2 + shape[1] ** 2) / 12.0
    return float(np.sqrt(np.mean(focal**2 * (x**2 + y**2) + corner * z**2)))


def shear_for(tile: int, slopes: tuple[float, ...]) -> int:
    """Return the shear in pixels of a torus whose flakes meet themselves least.

    A flake that falls by n tiles is back where it was if it has moved aside by a whole number of
    tiles and n times the shear.

    Parameters
    ----------
    slopes : tuple of float
        How far flakes move aside for each pixel down.
    """
    turns = np.arange(1, WRAPS + 1)
    shears = np.arange(1, tile)
    off = np.concatenate([turns[:, None] * (slope * tile - shears) for slope in slopes])
    off = np.abs(off - tile * np.round(off / tile)).min(axis=0)
    return int(shears[np.argmax(off)])


def _sparse(classes: list[tuple[SizeClass, Motion]], focal: float, tile: int) -> float:
    """Return the least depth at which the largest class fills a tile, metres."""
    most = max(one.density for one, _ in classes)
    return float((LEAST_IN_TILE / (0.6 * most * (tile / focal) ** 2)) ** (1.0 / 3.0))

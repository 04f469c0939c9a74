"""A population of flakes or drops: how many, how large, how fast, and how they are shared out."""

import math
from dataclasses import dataclass, field

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries.particles.sizes import Law, Sizes

FADE = 0.08  # Over this part of its depth the hand-over goes from all drawn to all synthesized.

# Depths by which a slab's images are counted, and the even shares of images: many, since the few
# largest flakes make most of the contrast.
_DEPTHS, _SHARES = 12, 264
EVENLY = np.linspace(0.0, 1.0, _SHARES + 1)

# Weights by which layers have even parts of speed in the picture, depth and variance of pixels.
EVEN = [0.15, 0.2, 0.65]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_DEPTHS)


@dataclass(frozen=True)
class SizeClass:
    """Flakes of an interval of sizes, which fall alike."""

    density: float  # Per cubic metre.
    smallest: float  # Diameters, metres.
    largest: float
    fall: float  # Metres per second in still air: a mean that its flakes share.
    # Diameters in metres, and the share of all flakes that each stands for.
    nodes: tuple[Float64, Float64] = field(compare=False, repr=False)


@dataclass(frozen=True)
class Population:
    """Flakes or drops that fill the air."""

    density: float  # Per cubic metre.
    sizes: Sizes
    opacity: float  # Mean over a resting flake's disc.
    speed: Law  # Of the fall in m/s, of diameters in metres.
    # The power of diameters that falls as all of a class do: the area, or of drops the water.
    weighed: float = 2.0

    @property
    def extinction(self) -> float:
        """The loss of a ray for each metre: density times the mean area that a flake covers."""
        return self.density * self.opacity * 0.25 * math.pi * self.sizes.moment(2.0)

    def classes(self, count: int, moment: int = 2) -> list[SizeClass]:
        """Return classes of even parts of a moment, of 2 the area; each falls as its mean does."""
        weighed, sizes = self.weighed if moment == 2 else moment, self.sizes
        edges = np.array([sizes.smallest, sizes.largest])
        if sizes.largest > sizes.smallest:
            at = sizes.quantile(np.linspace(0.0, 1.0, 4097))
            below = np.append(0.0, np.cumsum(0.5 * (at[1:] ** moment + at[:-1] ** moment)))
            edges = np.interp(np.linspace(0.0, below[-1], count + 1), below, at)
        found = []
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            at, share = sizes.nodes(low, high)
            fall = float((share * at**weighed) @ self.speed(at)) / float(share @ at**weighed)
            density = self.density * float(share.sum())
            found.append(SizeClass(density, low, high, fall, (at, share)))
        return found


@dataclass(frozen=True, eq=False)
class Slab:
    """A layer of the texture: flakes of one class between two depths, metres."""

    near: float
    far: float
    depth: float  # That it moves as: the mean, by what it covers or, of 4, varies in pixels.
    count: float  # Mean number of flakes in a pixel.
    diameters: Float64  # (n,) px, of even shares of the flakes: each covers what its share does.
    coverage: float  # Mean of what they cover of a pixel.


def layer_edges(near: float, far: float, count: int, variance: Law) -> Float64:
    """Return depths between layers: of even parts of speed, of depth, and of variance."""
    if near >= far:
        return np.array([near, far])
    depths = np.geomspace(near, far, 1025)
    some = depths[::8]
    own = variance(some)
    areas = np.cumsum((own[1:] + own[:-1]) * np.diff(some))
    sums = [1.0 / near - 1.0 / depths, depths - near, np.interp(depths, some, [0.0, *areas])]
    share = sum(weight * each / each[-1] for weight, each in zip(EVEN, sums, strict=True))
    return np.interp(np.linspace(0.0, 1.0, count + 1), share, depths)


def slabs_of(
    population: Population, each: SizeClass, focal: float, edges: Float64, *, flat: bool = False,
    moment: int = 2,
) -> list[Slab]:  # fmt: skip
    """Return the layers of a class from where it is no longer drawn, near ones first."""
    # Flakes of a flat one are seen at its mean depth.
    if edges[0] >= edges[-1] or each.density == 0.0:
        return []
    diameters, share = each.nodes
    share = share / share.sum()
    found = []
    for near, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        depths = 0.5 * (near + end) + 0.5 * (end - near) * _NODES
        left = (depths / edges[0] - 1.0) / FADE
        _core.smooth(left)
        volume = 0.5 * (end - near) * _WEIGHTS * depths**2 * left * (1.0 / focal) ** 2
        count = each.density * float(volume.sum())
        seen = volume / depths**moment
        depth = float((depths * seen).sum() / seen.sum())
        images = (focal * diameters[None, :] / depths[:, None]).ravel()
        weight = (volume[:, None] * share[None, :]).ravel()
        area = float(weight @ images**2) / float(weight.sum())
        if flat:
            images, weight = focal * diameters / depth, share
            count *= area / (area := float(weight @ images**2))
        coverage = count * population.opacity * 0.25 * math.pi * area
        # Of each even share of images the diameter that covers what the share does.
        order = np.argsort(images, kind="stable")
        weight, images = (np.append(0.0, part[order]) for part in (weight, images))
        below, squares = np.cumsum([weight, weight * images**2], axis=1)
        upto = np.diff(np.interp(EVENLY, below / below[-1], squares))
        covered = np.asarray(np.sqrt(upto * _SHARES / below[-1]))
        found.append(Slab(near, end, depth, count, covered, coverage))
    return found


def variance_at(each: SizeClass, focal: float, way: float, depths: Float64) -> Float64:
    """Return how much flakes of a class vary the pixels, for each metre at depths, in some unit."""
    # `way` is how far they move while the shutter is open, metres. Images are Gaussians in the box
    # of a pixel: squares of deviations across the streak and along it.
    diameters, share = each.nodes
    square = (focal * diameters / depths[:, None]) ** 2
    across = square / 16.0 + 0.15
    along = across + (focal * way / depths[:, None]) ** 2 / 12.0
    return np.asarray(depths**2 * ((square**2 / np.sqrt(across * along)) @ share))

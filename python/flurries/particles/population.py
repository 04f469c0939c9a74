"""A population of flakes or drops: how many, how large, how fast, and how they are shared out.

One population fills the air. What is near is drawn flake by flake, what is far is synthesized, and
both take their numbers from here: classes of size, each with its fall speed and the depth from
which it is synthesized, and layers, each a slab of depth with the images of its flakes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64
from flurries.particles.sizes import Sizes

# Sigma of a flake's image from which it is drawn, px: a texture of waves resolves less.
HANDOVER_SIGMA = 1.2

# A flake's image of diameter d is a Gaussian of d / sqrt(8): its integral is opacity pi d^2 / 4.
SIGMA_OF_DIAMETER = 1.0 / math.sqrt(8.0)

# Fewer flakes of a layer than this in a tile are drawn: a texture of so few shows its tiles.
LEAST_IN_TILE = 8.0

# The far end of a slab of depth over its near end, at most.
SLAB_RATIO = 1.41

# Over this part of its depth the hand-over goes from all drawn to all synthesized.
FADE = 0.08


@dataclass(frozen=True)
class SizeClass:
    """Flakes of an interval of sizes, which fall alike."""

    density: float  # Per cubic metre.
    smallest: float  # Diameters, metres.
    largest: float
    square: float  # Mean of the squared diameter, m2.
    fall: float  # Metres per second in still air: the mean, each flake weighed by its area.


@dataclass(frozen=True)
class Population:
    """Flakes or drops that fill the air."""

    density: float  # Per cubic metre.
    sizes: Sizes
    opacity: float  # Mean over a resting flake's disc.
    speed: Callable[[Float64], Float64]  # Of the fall in m/s, of diameters in metres.

    @property
    def extinction(self) -> float:
        """The loss of a ray for each metre: density times the mean area that a flake covers."""
        return self.density * self.opacity * 0.25 * math.pi * self.sizes.moment(2.0)

    def classes(self, count: int) -> list[SizeClass]:
        """Return classes of size that cover the same area each, small ones first."""
        sizes = self.sizes
        if sizes.largest == sizes.smallest:
            edges = np.array([sizes.smallest, sizes.largest])
        else:
            at = sizes.quantile(np.linspace(0.0, 1.0, 4097))
            area = np.concatenate([[0.0], np.cumsum(0.5 * (at[1:] ** 2 + at[:-1] ** 2))])
            edges = np.interp(np.linspace(0.0, area[-1], count + 1), area, at)
        found = []
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            at, share = sizes.nodes(low, high)
            number = float(share.sum())
            square = float(share @ at**2)
            fall = float((share * at**2) @ self.speed(at)) / square
            found.append(SizeClass(self.density * number, low, high, square / number, fall))
        return found


def reach_of(each: SizeClass, focal: float, tile: int, *, fastest: float, far: float) -> float:
    """Return the depth up to which a class is drawn, metres, at most `far`."""
    # Three things ask for drawing: an image too large for the texture, too few flakes in a tile,
    # and a layer that moves by more than half a tile in a frame, which would seem to move
    # backwards. `fastest` is that of the flakes past the camera, metres per frame.
    large = focal * each.largest * SIGMA_OF_DIAMETER / HANDOVER_SIGMA
    cube = (SLAB_RATIO**3 - 1.0) / 3.0 * each.density * (tile / focal) ** 2
    sparse = (LEAST_IN_TILE / cube) ** (1.0 / 3.0)
    fast = 2.0 * focal * fastest / tile
    return float(min(max(large, sparse, fast), far))


def drawn_share(depth: Float64, reach: float, far: float) -> Float64:
    """Return the share of the flakes at depths that is drawn, 1 near to 0 far; all up to `far`."""
    if reach >= far:
        return np.where(np.asarray(depth) <= far, 1.0, 0.0)
    return 1.0 - smoothstep((np.asarray(depth, np.float64) / reach - 1.0) / FADE)


@dataclass(frozen=True, eq=False)
class Slab:
    """A layer of the texture: flakes of one class between two depths, metres."""

    near: float
    far: float
    depth: float  # That it moves as: the mean of the depths of what it covers.
    count: float  # Mean number of flakes in a tile.
    diameters: Float64  # (n,) quantiles of their images' diameters at even shares, px.
    coverage: float  # Mean of what they cover of a tile, px2.
    nearer: Float64  # (n,) parts of the coverage before depths at even steps from near to far.

    def before(self, depth: Float64) -> Float64:
        """Return the share of the coverage that lies before depths, 0 to 1."""
        at = np.linspace(self.near, self.far, len(self.nearer))
        return np.interp(depth, at, self.nearer)


# Depths by which a slab's images are counted, steps of depth, and the quantiles that are kept of
# images: many, since the few largest flakes make most of the contrast.
_DEPTHS, _STEPS, _QUANTILES = 32, 33, 257

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_DEPTHS)


def slabs_of(
    population: Population,
    each: SizeClass,
    focal: float,
    tile: int,
    *,
    reach: float,
    far: float,
    edges: Float64 | None = None,
) -> list[Slab]:
    """Return the layers of a class from where it is no longer drawn, near ones first."""
    # Depths `reach` and `far` are where the texture begins and ends, `edges` those at which slabs
    # end, where they do not follow from SLAB_RATIO.
    if reach >= far or each.density == 0.0:
        return []
    if edges is None:
        number = max(math.ceil(math.log(far / reach) / math.log(SLAB_RATIO)), 1)
        edges = reach * (far / reach) ** (np.arange(number + 1) / number)
    diameters, share = population.sizes.nodes(each.smallest, each.largest)
    share = share / share.sum()
    found = []
    for near, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        depths = 0.5 * (near + end) + 0.5 * (end - near) * _NODES
        left = 1.0 - drawn_share(depths, reach, far)
        volume = 0.5 * (end - near) * _WEIGHTS * depths**2 * left * (tile / focal) ** 2
        count = each.density * float(volume.sum())
        images = (focal * diameters[None, :] / depths[:, None]).ravel()
        weight = (volume[:, None] * share[None, :]).ravel()
        order = np.argsort(images, kind="stable")
        below = np.cumsum(weight[order])
        below = (below - 0.5 * weight[order]) / below[-1]
        table = np.interp(np.linspace(0.0, 1.0, _QUANTILES), below, images[order])
        area = float(weight @ images**2) / float(weight.sum())
        seen = volume / depths**2
        steps = np.linspace(near, end, _STEPS)
        # A flake covers the less the farther it is, and there are as many more: all depths cover
        # alike, but for what is drawn.
        middles = 1.0 - drawn_share(0.5 * (steps[1:] + steps[:-1]), reach, far)
        nearer = np.concatenate([[0.0], np.cumsum(middles)]) / max(float(middles.sum()), 1e-300)
        found.append(
            Slab(
                near,
                end,
                float((seen @ depths) / seen.sum()),
                count,
                table,
                count * population.opacity * 0.25 * math.pi * area,
                nearer,
            )
        )
    return found


def exact_variance(sigma: npt.ArrayLike) -> Float64:
    """Return the variances, px^2, of flakes drawn exactly: integrated over each pixel."""
    return _of_each(_core.particle_variance, sigma)


def smoothstep(t: npt.ArrayLike) -> Float64:
    """Return 0 below 0, 1 above 1, and the cubic that is level at both between; of any shape."""
    return _of_each(_core.smooth, t)


def _of_each(law: Callable[..., None], given: npt.ArrayLike, *more: object) -> Float64:
    values = np.ascontiguousarray(given, np.float64)
    out = np.empty(values.shape)
    law(out.reshape(-1), values.reshape(-1), *more)
    return out

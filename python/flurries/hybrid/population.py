"""Flakes that fill space evenly, and how large and dense a camera sees them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from flurries._contract import Float64, real, vector
from flurries.particles.looks import image_of, smoothstep

# Over these shares of the nearest and of the farthest depth flakes fade in, so that none pops.
FADE = 0.1

# Nodes of the integrals over depth and radius; twice as many change no figure by 1e-6.
DEPTHS, RADII = 96, 8


@dataclass(frozen=True, kw_only=True)
class Population:
    """Snow in space: number and size of the flakes, and the depths that they lie between.

    Parameters
    ----------
    density : float
        Flakes per cubic world unit (per cubic metre, as a rule).
    radius : (smallest, largest)
        Radii in world units, evenly spread; a third of the radius is the Gaussian's sigma, see
        :func:`flurries.particles.splat`.
    opacity : float
        Opacity in the centre of a large flake, above 0 and at most 1.
    depth : (near, far)
        Depths in world units. Flakes fade over a tenth of the range at either end, so that none
        pops.

    Raises
    ------
    TypeError, ValueError
        For an argument that is not as described; the message names it.
    """

    density: float
    radius: tuple[float, float]
    opacity: float = 0.9
    depth: tuple[float, float]

    def __post_init__(self) -> None:
        def settle(name: str, value: object) -> None:
            object.__setattr__(self, name, value)

        settle("density", real("density", self.density, above=0.0, high=1e30))
        settle("opacity", real("opacity", self.opacity, above=0.0, high=1.0))
        for name in ("radius", "depth"):
            low, high = vector(name, getattr(self, name), 2).tolist()
            if not 1e-30 <= low <= high <= 1e30 or (name == "depth" and low == high):
                raise ValueError(
                    f"{name} must be two positive lengths, the smaller first, got {(low, high)}"
                )
            settle(name, (low, high))

    def fade(self, depth: Float64) -> Float64:
        """Return the share of a flake at each depth that is shown, 0 to 1."""
        near, far = self.depth
        return np.asarray(
            smoothstep((depth - near) / (FADE * near)) * smoothstep((far - depth) / (FADE * far))
        )


class Seen(NamedTuple):
    """The flakes of a population in the picture, by classes of depth and radius; (n,) each."""

    depth: Float64
    sigma: Float64
    """Of the flake itself, px; what is drawn is wider, see `variance`."""
    number: Float64
    """Flakes of the class per square pixel."""
    variance: Float64
    """Of the Gaussian that is drawn, px^2."""
    amplitude: Float64
    """Its opacity in the middle."""


@lru_cache(maxsize=2)
def _nodes(count: int) -> tuple[Float64, Float64]:
    """Return Gauss and Legendre's nodes and weights; an eigenvalue problem, solved once."""
    nodes, weights = leggauss(count)
    return nodes, weights


def seen(population: Population, focal: float) -> Seen:
    """Return nodes and weights for integrals over a population as a camera sees it."""
    (near, far), (small, large) = population.depth, population.radius
    x, wx = _nodes(DEPTHS)
    z = np.sqrt(near * far) * (far / near) ** (0.5 * x)
    share = 0.5 * np.log(far / near) * wx * z
    y, wy = _nodes(RADII)
    radius = 0.5 * (small + large) + 0.5 * (large - small) * y
    depth, size = (grid.ravel() for grid in np.meshgrid(z, radius, indexing="ij"))
    weight = np.outer(share, 0.5 * wy).ravel()
    sigma = focal * size / (3.0 * depth)
    variance, share = image_of(sigma)
    amplitude = population.opacity * population.fade(depth) * share
    number = population.density * (depth / focal) ** 2 * weight
    return Seen(depth, sigma, number, variance, amplitude)

"""Particles from a gridded density volume (Johnson 2005, section 1.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import LARGEST, SMALLEST, Float64, real, table, vector
from flurries.gas.visibility import _RIM as RIM

__all__ = ["Particles", "particles_of"]

# Sigma of a voxel's Gaussian in voxels. Their sum over a uniform grid ripples by
# 2 exp(-2 pi^2 0.75^2) = 3e-5.
SIGMA = 0.75


class Particles(NamedTuple):
    """Arguments of :func:`flurries.gas.splat`: middles (n, 3), a radius, densities (n,)."""

    centers: Float64
    radius: float
    density: Float64


def particles_of(
    volume: npt.ArrayLike,
    spacing: float,
    *,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    threshold: float = 0.0,
) -> Particles:
    """Return one particle for each voxel of a gas, with its optical depth.

    Parameters
    ----------
    volume : (nz, ny, nx)
        Extinction per world unit at the voxels' middles, not negative: a light ray through a
        length L of the value k lets through exp(-k L). Axes from slow to fast: away, down, right.
    spacing : float
        Side of a voxel, world units.
    center : (3,)
        The middle of the grid in camera axes, world units.
    threshold : float
        Voxels of at most this much are left out.

    Returns
    -------
    Particles
        ``(centers, radius, density)``, to be put into ``splat(shape, *particles, color, camera)``.
        In a uniform volume the mean optical depth of a ray is k L, whatever k. A voxel holds at
        most an optical depth of 5.7 (then its particle is opaque); what is beyond is cut off.

    Notes
    -----
    A particle on a grid is not one of a random cloud: rays meet them one after the other in equal
    steps, and logarithms add up. So the density solves ``integral of -log(1 - density g) over the
    plane = k spacing^3``, not ``density * integral of g``.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> z, y, x = np.mgrid[-1:1:9j, -1:1:9j, -1:1:9j]
    >>> ball = fl.gas.particles_of(2.0 * (x * x + y * y + z * z < 0.8), 0.25, center=(0, 0, 4))
    >>> fl.gas.splat((60, 80), *ball, 0.9, fl.Camera(70.0)).shape
    (60, 80, 4)
    """
    values = table("volume", volume, ndim=3)
    if values.size == 0:
        raise ValueError(f"volume must not be empty, got shape {values.shape}")
    if values.min() < 0.0:
        raise ValueError(f"volume must not be negative, got {values.min()}")
    side = real("spacing", spacing, low=SMALLEST, high=LARGEST)
    middle = vector("center", center, 3)
    least = real("threshold", threshold, low=0.0)
    place = np.argwhere(values > least)
    offset = place[:, ::-1] - 0.5 * (np.array(values.shape[::-1]) - 1.0)
    sigma = SIGMA * side
    # Per voxel: extinction times its volume, in squares of sigma.
    wanted = values[tuple(place.T)] * side / SIGMA**2
    return Particles(middle + offset * side, 3.0 * sigma, _density(wanted))


def _density(wanted: Float64) -> Float64:
    """Return the density whose footprint's optical depth over the plane is `wanted` sigma^2."""
    nodes = _nodes()
    # Newton's method on a convex function: from a table's lower end it cannot leave [0, 1].
    grid = 1.0 - np.geomspace(1.0, 1e-9, 513)
    grid[-1] = 1.0
    density = np.interp(wanted, _optical_depth(grid, *nodes)[0], grid)
    for _ in range(4):
        for part in np.array_split(np.arange(len(density)), max(1, len(density) // 4096)):
            inside = part[density[part] < 1.0]
            value, slope = _optical_depth(density[inside], *nodes)
            density[inside] = np.clip(density[inside] - (value - wanted[inside]) / slope, 0.0, 1.0)
    return np.asarray(density)


def _nodes() -> tuple[Float64, Float64]:
    """Return 1 - g at the nodes of an integral over the plane, and their areas."""
    # With s = exp(-q^2/2) the area is 2 pi ds / s, and 1 - g is proportional to 1 - s. The
    # logarithm of it at s = 1 wants nodes that crowd there: s = 1 - w^3.
    nodes, weights = np.polynomial.legendre.leggauss(96)
    top = (1.0 - RIM) ** (1.0 / 3.0)
    w = 0.5 * top * (nodes + 1.0)
    s = 1.0 - w**3
    return w**3 / (1.0 - RIM), 2.0 * np.pi * (0.5 * top * weights) * 3.0 * w * w / s


def _optical_depth(density: Float64, through: Float64, area: Float64) -> tuple[Float64, Float64]:
    """Return the plane integral of -log(1 - density g), tapered, and its slope, in sigma^2."""
    rest = 1.0 - density[:, None]
    # 1 - density g = rest + density (1 - g)
    left = rest + density[:, None] * through
    with np.errstate(divide="ignore"):
        value = -(np.log(left) @ area)
        slope = ((1.0 - through) / left) @ area
    return np.asarray(value), np.asarray(slope)

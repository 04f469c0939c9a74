"""What a gas does to light: what it takes and lets through, and what reaches its particles."""

from __future__ import annotations

import math

import numpy as np

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, SMALLEST, Array, ArrayLike, Float64
from flurries.gas.splatting import gas_of

_RIM = math.exp(-4.5)

# The plane integral of a footprint in squares of sigma, by how it ends. "disc" is "square" as the
# models that know only a distance cut it.
AREAS = {
    "taper": 2.0 * math.pi - 9.0 * math.pi * _RIM / (1.0 - _RIM),
    "square": 2.0 * math.pi * math.erf(3.0 / math.sqrt(2.0)) ** 2,
    "disc": 2.0 * math.pi * (1.0 - _RIM),
}


def footprint_table(size: int, *, intervals: int = 100, out: Float64 | None = None) -> Float64:
    """Return the line integrals of the kernel over [-3, 3] sigma squared (Eq. 4).

    Parameters
    ----------
    size : int
        n, 1 to 8192. With an even n no entry lies at the origin.
    intervals : int
        Of the trapezoid rule along the line, 1 to 1,000,000: a common factor, which cancels.

    Returns
    -------
    (n, n) float64
        exp(-(x^2 + y^2)/2) at x = -3 + 6 i / (n - 1) of column i, y likewise; at most 1.
    """
    n = check.integer("size", size, low=1, high=8192)
    steps = check.integer("intervals", intervals, low=1, high=1_000_000)
    x = np.linspace(-3.0, 3.0, n) if n > 1 else np.zeros(1)
    # The two halves of the axis mirror each other exactly.
    x = 0.5 * (x - x[::-1])
    w = np.linspace(-3.0, 3.0, steps + 1)
    heights = np.exp(-0.5 * w * w)
    line = (heights.sum() - 0.5 * (heights[0] + heights[-1])) * (6.0 / steps)
    across = np.exp(-0.5 * x * x)
    result = check.output(out, (n, n), np.dtype(np.float64))
    np.multiply(np.outer(across, across), line, out=result)
    result /= line
    return result


def extinction(
    count: float, volume: float, radius: float, density: float, *, edge: str = "taper"
) -> float:
    """Return the extinction of a gas: beta of the mean transmittance exp(-beta L) of a length L.

    Parameters
    ----------
    count, volume : float
        Particles, and what they fill evenly, world units cubed.
    radius, density : float
        Of a particle.
    edge : {"taper", "square", "disc"}
        How footprints end: "disc" for `edge` "square" of the models "viewpoint" and "volume".

    Returns
    -------
    float
        Per world unit: ``count / volume * density * A * (radius / 3)^2``, A the plane integral of
        the footprint in squares of sigma. Exact for particles placed at random.
    """
    number = check.real("count", count, low=0.0, high=LARGEST)
    space = check.real("volume", volume, low=SMALLEST, high=LARGEST)
    size = check.real("radius", radius, low=SMALLEST, high=LARGEST)
    opacity = check.real("density", density, low=0.0, high=1.0)
    area = AREAS[check.choice("edge", edge, tuple(AREAS))] * (size / 3.0) ** 2
    return number / space * opacity * area


def visibility(beta: float, *, contrast: float = 0.05) -> float:
    """Return the distance at which a black object keeps a given contrast to fog.

    It is -log(contrast) / beta, world units, of an :func:`extinction` `beta`, more than 0; as well
    the extinction that gives a visibility `beta`. `contrast` is 0.05 as the weather services have
    it, or 0.02 (Koschmieder); above 0 and below 1.
    """
    share = check.real("contrast", contrast, above=0.0)
    if share >= 1.0:
        raise ValueError(f"contrast must be less than 1, got {share!r}")
    return float(-np.log(share)) / check.real("beta", beta, low=SMALLEST)


def light(
    centers: ArrayLike, radius: ArrayLike, density: ArrayLike, direction: ArrayLike,
    *, forward: float = 0.5, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the share of the light that reaches each particle through the others (Harris 2001).

    The time grows with n^2: 2 ms for 1500 particles, 10 s for 100,000.

    Parameters
    ----------
    centers, radius, density
        As in :func:`splat`.
    direction : (3,)
        Direction in which the light travels, in the axes of `centers`; any length.
    forward : float
        Share of the light taken that goes on forward, 0 (full shadow) to 1 (no shadow).

    Returns
    -------
    (n,) float64
        0 to 1. In a uniform gas the mean at a depth L along the light is
        exp(-(1 - forward) beta L), beta the :func:`extinction`.
    """
    gas = gas_of(centers, radius, density)
    way = check.vector("direction", direction, 3)
    length = math.sqrt(float(way @ way))
    if not length > 0.0:
        raise ValueError(f"direction must not be zero, got {way.tolist()}")
    share = check.real("forward", forward, low=0.0, high=1.0)
    result = check.output(out, (len(gas.centers),), np.dtype(np.float64), *vars(gas).values())
    x, y, z = (way / length).tolist()
    _core.gas_light(result, gas, (x, y, z), share)
    return result


def phase(cosine: ArrayLike, *, kind: str = "rayleigh", asymmetry: float = 0.6) -> Array:
    """Return the light that a gas scatters by an angle, over the mean of all directions.

    Parameters
    ----------
    cosine : array
        Of the angle between the light's way and the way to the eye: 1 looks into the sun.
    kind : {"rayleigh", "henyey"}
        ``3/4 (1 + c^2)``, or Henyey and Greenstein's function, which is the one for droplets.
    asymmetry : float
        Of the latter, -0.99 to 0.99; 0 scatters evenly, 0.85 is a cloud.
    """
    c = check.table("cosine", cosine, ndim=None)
    check.require("cosine", c, np.abs(c) <= 1.0 + 1e-9, "from -1 to 1")
    if check.choice("kind", kind, ("rayleigh", "henyey")) == "rayleigh":
        return np.asarray(0.75 * (1.0 + c * c))
    g = check.real("asymmetry", asymmetry, low=-0.99, high=0.99)
    return np.asarray((1.0 - g * g) / (1.0 + g * g - 2.0 * g * c) ** 1.5)

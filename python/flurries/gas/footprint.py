"""What a particle's footprint holds (Johnson 2005, Eqs 1-4), and how far one sees through many."""

from __future__ import annotations

import math

import numpy as np

from flurries._contract import LARGEST, SMALLEST, Float64, choice, integer, output, real

__all__ = ["extinction", "footprint_table", "visibility"]

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
        exp(-(x^2 + y^2)/2) at x = -3 + 6 i / (n - 1) of column i, y likewise: over the value at the
        origin, at most 1.
    """
    n = integer("size", size, low=1, high=8192)
    steps = integer("intervals", intervals, low=1, high=1_000_000)
    x = np.linspace(-3.0, 3.0, n) if n > 1 else np.zeros(1)
    # The two halves of the axis mirror each other exactly.
    x = 0.5 * (x - x[::-1])
    w = np.linspace(-3.0, 3.0, steps + 1)
    heights = np.exp(-0.5 * w * w)
    line = (heights.sum() - 0.5 * (heights[0] + heights[-1])) * (6.0 / steps)
    across = np.exp(-0.5 * x * x)
    result = output(out, (n, n), np.dtype(np.float64))
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
        Of a particle, as in :func:`splat`.
    edge : {"taper", "square", "disc"}
        How footprints end: "disc" for `edge` "square" of the models "viewpoint" and "volume".

    Returns
    -------
    float
        Per world unit: ``count / volume * density * A * (radius / 3)^2``, A the plane integral of
        the footprint in squares of sigma. Exact for particles placed at random.

    Examples
    --------
    >>> import flurries as fl
    >>> round(fl.gas.extinction(1200, 5**3, 0.45, 0.4), 4)  # the paper's fog
    0.5154
    """
    number = real("count", count, low=0.0, high=LARGEST)
    space = real("volume", volume, low=SMALLEST, high=LARGEST)
    size = real("radius", radius, low=SMALLEST, high=LARGEST)
    opacity = real("density", density, low=0.0, high=1.0)
    return (
        number / space * opacity * (AREAS[choice("edge", edge, tuple(AREAS))] * (size / 3.0) ** 2)
    )


def visibility(beta: float, *, contrast: float = 0.05) -> float:
    """Return the distance at which a black object keeps a given contrast to fog.

    Parameters
    ----------
    beta : float
        :func:`extinction`, per world unit, positive.
    contrast : float
        0.05 as the weather services have it, or 0.02 (Koschmieder); below 1.

    Returns
    -------
    float
        -log(contrast) / beta, world units. As well the extinction that gives a visibility `beta`.
    """
    share = real("contrast", contrast, above=0.0)
    if share >= 1.0:
        raise ValueError(f"contrast must be less than 1, got {share!r}")
    return float(-np.log(share)) / real("beta", beta, low=SMALLEST)

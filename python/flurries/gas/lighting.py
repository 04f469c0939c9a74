"""Light in a gas: what of a direction's light reaches each particle (after Harris 2001)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64, choice, output, real, require, table, vector
from flurries.gas.splatting import gas_of

__all__ = ["light", "phase"]


def light(
    centers: npt.ArrayLike,
    radius: npt.ArrayLike,
    density: npt.ArrayLike,
    direction: npt.ArrayLike,
    *,
    forward: float = 0.5,
    out: Float64 | None = None,
) -> Float64:
    """Return the share of the light that reaches each particle through the others.

    The time grows with n^2: 2 ms for 1500 particles, 10 s for 100,000.

    Parameters
    ----------
    centers, radius, density
        As in :func:`flurries.gas.splat`.
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
    way = vector("direction", direction, 3)
    length = math.sqrt(float(way @ way))
    if not length > 0.0:
        raise ValueError(f"direction must not be zero, got {way.tolist()}")
    share = real("forward", forward, low=0.0, high=1.0)
    result = output(out, (len(gas.centers),), np.dtype(np.float64), *vars(gas).values())
    x, y, z = (way / length).tolist()
    _core.gas_light(result, gas, (x, y, z), share)
    return result


def phase(cosine: npt.ArrayLike, *, kind: str = "rayleigh", asymmetry: float = 0.6) -> Array:
    """Return the light that a gas scatters by an angle, over the mean of all directions.

    Parameters
    ----------
    cosine : array
        Of the angle between the light's way and the way to the eye: 1 looks into the sun.
    kind : {"rayleigh", "henyey"}
        ``3/4 (1 + c^2)``, or Henyey and Greenstein's function, which is the one for droplets.
    asymmetry : float
        Of the latter, -0.99 to 0.99; 0 scatters evenly, 0.85 is a cloud.

    Returns
    -------
    array
        The mean over the sphere is 1.
    """
    c = table("cosine", cosine, ndim=None)
    require("cosine", c, np.abs(c) <= 1.0 + 1e-9, "from -1 to 1")
    if choice("kind", kind, ("rayleigh", "henyey")) == "rayleigh":
        return np.asarray(0.75 * (1.0 + c * c))
    g = real("asymmetry", asymmetry, low=-0.99, high=0.99)
    return np.asarray((1.0 - g * g) / (1.0 + g * g - 2.0 * g * c) ** 1.5)

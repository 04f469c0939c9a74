"""How far one sees in a gas: extinction, and meteorological visibility."""

from __future__ import annotations

import math

import numpy as np

from flurries._contract import LARGEST, SMALLEST, choice, real
from flurries.gas.splatting import Edge

__all__ = ["count_for_visibility", "density_for_visibility", "extinction", "visibility"]

_RIM = math.exp(-4.5)

# More particles than this are no answer.
_MOST = 2**53

# The plane integral of a footprint in squares of sigma, by how it ends. "disc" is "square" as the
# models that know only a distance cut it.
AREAS = {
    "taper": 2.0 * math.pi - 9.0 * math.pi * _RIM / (1.0 - _RIM),
    "square": 2.0 * math.pi * math.erf(3.0 / math.sqrt(2.0)) ** 2,
    "disc": 2.0 * math.pi * (1.0 - _RIM),
}


def extinction(
    count: float, volume: float, radius: float, density: float, *, edge: str = "taper"
) -> float:
    """Return the extinction of a gas, which is the light that it takes out per length.

    Parameters
    ----------
    count : float
        Particles.
    volume : float
        Volume that the particles fill evenly, world units cubed.
    radius : float
        Radius of a particle, three sigma, world units.
    density : float
        Opacity in the middle of a particle, 0 to 1.
    edge : {"taper", "square", "disc"}
        How footprints end: "disc" for `edge` "square" of the models "viewpoint" and "volume".

    Returns
    -------
    float
        beta, per world unit: the mean transmittance over a length L is exp(-beta L).

    Notes
    -----
    ``beta = count / volume * density * A * (radius / 3)^2``, A the plane integral of the footprint
    in squares of sigma: 5.9656, 6.2493, 6.2134. Exact for particles placed at random.

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
    return number / space * opacity * _area(edge, size)


def _area(edge: str, radius: float) -> float:
    return AREAS[choice("edge", edge, tuple(AREAS))] * (radius / 3.0) ** 2


def visibility(beta: float, *, contrast: float = 0.05) -> float:
    """Return the distance at which a black object keeps a given contrast to fog.

    Parameters
    ----------
    beta : float
        :func:`extinction`, per world unit, positive.
    contrast : float
        0.05 as the weather services have it, or 0.02 (Koschmieder).

    Returns
    -------
    float
        -log(contrast) / beta, world units: 2.996 / beta or 3.912 / beta.
    """
    return _depth(contrast) / real("beta", beta, low=SMALLEST)


def density_for_visibility(
    distance: float,
    count: float,
    volume: float,
    radius: float,
    *,
    contrast: float = 0.05,
    edge: Edge = "taper",
) -> float:
    """Return the particles' density that gives a visibility.

    Parameters
    ----------
    distance : float
        The visibility, world units.
    count, volume, radius, edge
        As in :func:`extinction`.
    contrast : float
        As in :func:`visibility`.

    Returns
    -------
    float
        0 to 1.

    Raises
    ------
    ValueError
        Also if that few particles cannot be as dense; the message says how many can.
    """
    length = real("distance", distance, low=SMALLEST, high=LARGEST)
    most = extinction(count, volume, radius, 1.0, edge=edge)
    wanted = _depth(contrast) / length
    if wanted > most:
        needed = wanted / _area(edge, radius) * volume
        raise ValueError(
            f"distance must be at least {_depth(contrast) / most if most else math.inf:.4g} for "
            f"{count:g} particles of radius {radius:g}, got {length:g}: that needs {needed:.0f}"
        )
    return wanted / most


def count_for_visibility(
    distance: float,
    volume: float,
    radius: float,
    density: float,
    *,
    contrast: float = 0.05,
    edge: Edge = "taper",
) -> int:
    """Return the number of particles that gives a visibility, rounded.

    Parameters
    ----------
    distance : float
        The visibility, world units.
    volume, radius, density, edge
        As in :func:`extinction`; the density above 0.
    contrast : float
        As in :func:`visibility`.

    Returns
    -------
    int
    """
    length = real("distance", distance, low=SMALLEST, high=LARGEST)
    opacity = real("density", density, above=0.0, high=1.0)
    each = extinction(1.0, volume, radius, opacity, edge=edge)
    number = _depth(contrast) / max(length * each, SMALLEST)
    if number > _MOST:
        raise ValueError(
            f"distance must be farther, or density larger: {length:g} with particles of density "
            f"{opacity:g} needs {number:.3g}"
        )
    return round(number)


def _depth(contrast: float) -> float:
    """Return the optical depth that leaves a contrast."""
    share = real("contrast", contrast, above=0.0)
    if share >= 1.0:
        raise ValueError(f"contrast must be less than 1, got {share!r}")
    return float(-np.log(share))

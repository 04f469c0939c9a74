"""What a gas does to light: what it takes and lets through, and what reaches its particles."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, SMALLEST, Array, ArrayLike, Float64, choice, output, real
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
    """Return the line integrals of the kernel over [-3, 3] sigma squared (Eq. 4), (n, n) float64.

    They are exp(-(x^2 + y^2)/2) at x = -3 + 6 i / (n - 1) of column i, y likewise; at most 1.

    Parameters
    ----------
    size : int
        n, 1 to 8192. With an even n no entry lies at the origin.
    intervals : int
        Of the trapezoid rule along the line, 1 to 1,000,000: a common factor, which cancels.
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

    It is ``count / volume * density * A * (radius / 3)^2`` per world unit, A the plane integral of
    the footprint in squares of sigma. Exact for particles placed at random.

    Parameters
    ----------
    count, volume : float
        Particles, and what they fill evenly, world units cubed.
    radius, density : float
        Of a particle.
    edge : {"taper", "square", "disc"}
        How footprints end: "disc" for `edge` "square" of the models "viewpoint" and "volume".
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

    They are (n,) float64, 0 to 1. In a uniform gas the mean at a depth L along the light is exp(-(1
    - forward) beta L), beta the :func:`extinction`. The time grows with n^2: 2 ms for 1500
    particles, 10 s for 100,000.

    Parameters
    ----------
    centers, radius, density
        As in :func:`splat`.
    direction : (3,)
        Direction in which the light travels, in the axes of `centers`; any length.
    forward : float
        Share of the light taken that goes on forward, 0 (full shadow) to 1 (no shadow).
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
    kind, asymmetry : {"rayleigh", "henyey"}, float
        ``3/4 (1 + c^2)``, or Henyey and Greenstein's function, which is the one for droplets, of an
        asymmetry of -0.99 to 0.99: 0 scatters evenly, 0.85 is a cloud.
    """
    c = check.table("cosine", cosine, ndim=None)
    check.require("cosine", c, np.abs(c) <= 1.0 + 1e-9, "from -1 to 1")
    if check.choice("kind", kind, ("rayleigh", "henyey")) == "rayleigh":
        return np.asarray(0.75 * (1.0 + c * c))
    g = check.real("asymmetry", asymmetry, low=-0.99, high=0.99)
    return np.asarray((1.0 - g * g) / (1.0 + g * g - 2.0 * g * c) ** 1.5)


Form: TypeAlias = Literal["exact", "printed"]


def projection_error(
    centers: ArrayLike, radius: ArrayLike, *, near: float = 1.0, form: Form = "exact",
    out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the error (e_x, e_y), (n, 2) float64, of a billboard's right edge on the viewplane.

    It is the billboard parallel to the viewplane minus the one that faces the eye, in the unit of
    `near`, to 1e-15 but near the second zero of e_x at C_x = -2 r or so. NaN where the edge of the
    latter does not lie in front of the eye: depth D <= 0, or D S <= r C_x.

    Parameters
    ----------
    centers, radius : (n, 3), and float or (n,)
        Middles in camera axes, and half the width of the billboards.
    near : float
        N, the distance of the viewplane. Give the focal length for pixels.
    form : {"exact", "printed"}
        "printed" evaluates the paper's Eqs 11 and 12 as they stand.
    """
    x, y, depth, r = _each(centers, radius)
    distance = real("near", near, above=0.0)
    printed = choice("form", form, Form) == "printed"
    result = output(out, (len(x), 2), np.dtype(np.float64))
    with np.errstate(all="ignore"):
        away = np.hypot(x, depth)
        seen = (depth > 0.0) & (depth * away > r * x)
        if printed:
            # -C_z is the depth; the paper's own order of operations, and so its cancellations.
            squared = x * x + depth * depth
            across = x * x + depth * np.sqrt(squared) + r * x - depth * depth
            result[:, 0] = distance * r * across / (depth * (depth * np.sqrt(squared) + r * x))
            below = -depth * (-depth * np.sqrt(squared) - r * x)
            result[:, 1] = distance * r * x * y * np.sqrt(squared) / below
        else:
            scale = r / depth
            below = away - scale * x
            across = x * (away / (away + depth)) + r
            result[:, 0] = -distance * scale * (x / depth) * across / below
            result[:, 1] = -distance * scale * (x / depth) * y / below
    result[~seen] = np.nan
    return result


def parallax_error(
    centers: ArrayLike, radius: ArrayLike, *, near: float = 1.0, eye_distance: float,
    form: Form = "exact", out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the error of the parallax of a billboard's right edge (section 3.3), (n, 2) float64.

    It is the right eye's :func:`projection_error` minus the left eye's, NaN where either is, of
    `centers` from the middle between eyes that are `eye_distance` apart, more than 0. The exact
    form has all its digits for eyes however close, which a subtraction has not.
    """
    x, y, depth, r = _each(centers, radius)
    distance = real("near", near, above=0.0)
    apart = real("eye_distance", eye_distance, above=0.0)
    half = 0.5 * apart
    result = output(out, (len(x), 2), np.dtype(np.float64))
    if choice("form", form, Form) == "printed":
        eyes = [np.stack([x + side, y, depth], axis=1) for side in (-half, half)]
        right, left = (projection_error(eye, r, near=near, form=form) for eye in eyes)
        return np.subtract(right, left, out=result)
    with np.errstate(all="ignore"):
        a, b = x - half, x + half
        sa, sb = np.hypot(a, depth), np.hypot(b, depth)
        # In units of the depth, so that nothing overflows or vanishes.
        a, b, sa, sb, size, y, gap = (v / depth for v in (a, b, sa, sb, r, y, apart))
        ba, bb = sa - size * a, sb - size * b
        seen = (depth > 0.0) & (ba > 0.0) & (bb > 0.0)
        both = sa + sb
        product = a * b
        same = (a * a + b * b + 1.0) / (sa * sb + product)
        k = 1.0 + np.where(product > 0.0, same, sa * sb - product)
        qa, qb = sa / (sa + 1.0), sb / (sb + 1.0)
        ds = (a + b) / both
        dq = ds / ((sa + 1.0) * (sb + 1.0))
        db = ds - size
        p_x = (a * a * dq + qb * (a + b)) * ba - a * a * qa * db + size * k / both
        result[:, 0] = distance * size * gap * p_x / (ba * bb)
        result[:, 1] = distance * size * y * gap * k / (both * ba * bb)
    result[~seen] = np.nan
    return result


def _each(centers: ArrayLike, radius: ArrayLike) -> tuple[Float64, ...]:
    gas = gas_of(centers, radius, 0.0)
    x, y, depth = gas.centers.T.copy()
    return x, y, depth, np.broadcast_to(gas.radius, x.shape)

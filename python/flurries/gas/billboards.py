"""What a billboard parallel to the viewplane gets wrong (Johnson 2005, section 3, corrected).

The point looked at is the middle of its right edge, C + r u: u is (1, 0, 0) parallel to the
viewplane and (D, 0, -C_x) / S, S = hypot(C_x, D), facing the eye.
"""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import ArrayLike, Float64, choice, output, real
from flurries.gas.splatting import gas_of

Form: TypeAlias = Literal["exact", "printed"]
FORMS = get_args(Form)


def projection_error(
    centers: ArrayLike, radius: ArrayLike, *, near: float = 1.0, form: Form = "exact",
    out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the error of a billboard's right edge on the viewplane.

    Parameters
    ----------
    centers, radius : (n, 3), and float or (n,)
        Middles in camera axes, and half the width of the billboards.
    near : float
        N, the distance of the viewplane. Give the focal length for pixels.
    form : {"exact", "printed"}
        "printed" evaluates the paper's Eqs 11 and 12 as they stand.

    Returns
    -------
    (n, 2) float64
        (e_x, e_y): billboard parallel to the viewplane minus billboard that faces the eye, in the
        unit of `near`, to 1e-15 but near the second zero of e_x at C_x = -2 r or so. NaN where the
        edge of the latter does not lie in front of the eye: depth D <= 0, or D S <= r C_x.
    """
    x, y, depth, r = _each(centers, radius)
    distance = real("near", near, above=0.0)
    printed = choice("form", form, FORMS) == "printed"
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
    if choice("form", form, FORMS) == "printed":
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

"""How flakes look: how wide and how faint they are, how many are there, which are too large."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64


def image_of(sigma: npt.ArrayLike) -> tuple[Float64, Float64]:
    """Return the images of flakes: variances, px^2, and the factors of their middles' opacities.

    Parameters
    ----------
    sigma : array
        ``f radius / (3 z)`` of flakes, px, of any shape.
    """
    given = np.ascontiguousarray(sigma, np.float64)
    variance, share = np.empty(given.shape), np.empty(given.shape)
    _core.particle_image(variance.reshape(-1), share.reshape(-1), given.reshape(-1))
    return variance, share


def exact_variance(sigma: npt.ArrayLike) -> Float64:
    """Return the variances, px^2, of flakes that are drawn exactly: integrated over each pixel.

    Parameters
    ----------
    sigma : array
        ``f radius / (3 z)`` of flakes, px, of any shape.
    """
    return _of_each(_core.particle_variance, sigma)


def smoothstep(t: npt.ArrayLike) -> Float64:
    """Return 0 below 0, 1 above 1, and the cubic that is level at both between; of any shape."""
    return _of_each(_core.smooth, t)


def presence(index: npt.ArrayLike, *, count: int, amount: float, fade_in: float) -> Float64:
    """Return the presence of flakes, 0 to 1: of `count`, the first `amount` of them.

    Parameters
    ----------
    index : array of int
        Of any shape.
    count : int
        Flakes in the box.
    amount, fade_in : float
        Share that is there, and the share of them over which the last ones fade.
    """
    given = np.ascontiguousarray(index, np.int64)
    there = np.empty(given.shape)
    _core.particle_presence(there.reshape(-1), given.reshape(-1), count, amount, fade_in)
    return there


def size_fade(sigma: npt.ArrayLike, limits: tuple[float, float]) -> Float64:
    """Return the shown share of flakes: all up to the first limit, nothing from the second on.

    Parameters
    ----------
    sigma : array
        ``f radius / (3 z)`` of flakes, px, of any shape.
    limits : (low, high)
        Sigmas, px.
    """
    return _of_each(_core.particle_size_fade, sigma, limits)


def _of_each(law: Callable[..., None], given: npt.ArrayLike, *more: object) -> Float64:
    values = np.ascontiguousarray(given, np.float64)
    out = np.empty(values.shape)
    law(out.reshape(-1), values.reshape(-1), *more)
    return out

"""How flakes look: how wide and how faint they are, how many are there, which are too large."""

from __future__ import annotations

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


def smoothstep(t: npt.ArrayLike) -> Float64:
    """Return 0 below 0, 1 above 1, and the cubic that is level at both between; of any shape."""
    values = np.ascontiguousarray(t, np.float64)
    out = np.empty(values.shape)
    _core.smooth(out.reshape(-1), values.reshape(-1))
    return out

"""How flakes look: how wide and how faint they are, how many are there, which are too large."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64


def exact_variance(sigma: npt.ArrayLike) -> Float64:
    """Return the variances, px^2, of flakes drawn exactly: integrated over each pixel."""
    return _of_each(_core.particle_variance, sigma)


def smoothstep(t: npt.ArrayLike) -> Float64:
    """Return 0 below 0, 1 above 1, and the cubic that is level at both between; of any shape."""
    return _of_each(_core.smooth, t)


def _of_each(law: Callable[..., None], given: npt.ArrayLike, *more: object) -> Float64:
    values = np.ascontiguousarray(given, np.float64)
    out = np.empty(values.shape)
    law(out.reshape(-1), values.reshape(-1), *more)
    return out

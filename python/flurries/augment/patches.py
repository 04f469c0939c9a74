"""Fog that is thicker here than there: a slow spectral field, the same at every size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.spectral.frame import request

if TYPE_CHECKING:
    from flurries.augment.air import View

# Points of the field along the longer side; its waves have 16 to 120 of them.
_POINTS = 120
_BAND = (16.0, 120.0)
_TILE = 240

# Half the normal law's quantiles, for means over all densities.
_QUANTILES = 33


@dataclass(frozen=True)
class Patches:
    """How uneven a fog is.

    Attributes
    ----------
    strength : float
        Standard deviation of the extinction against its mean, where none is below 0.
    wind : (x, y)
        How fast the largest patches drift, picture widths per second.
    """

    strength: float
    wind: tuple[float, float]

    def densities(self) -> Float64:
        """Return equally likely densities, (n,)."""
        if self.strength == 0.0:
            return np.ones(1)
        return np.asarray(np.maximum(1.0 + self.strength * _normal(), 0.0))

    def motion(self, shape: tuple[int, int], fps: float) -> Float64:
        """Return how the patches move, (2,) pixels per frame: the mean of their waves."""
        mean = math.sqrt(_BAND[0] / _BAND[1])
        return np.asarray(self.wind) * (mean * max(shape) / fps)

    def density(self, view: View, seed: int, time: float) -> Array:
        """Return the density at each pixel, (H, W) float32, or 1."""
        if self.strength == 0.0:
            return np.ones((1, 1), np.float32)
        height, width = view.shape
        cell = max(height, width) / _POINTS
        rows, cols = (math.ceil(n / cell) + 2 for n in (height, width))
        drift = (np.asarray(self.wind) * time) * _POINTS
        asked = request(
            (rows, cols), drift=drift, seed=seed, tile=_TILE, overlap=_TILE // 4,
            wavelengths=_BAND, exponent=1.5,
        )  # fmt: skip
        field = np.empty((rows, cols), np.float32)
        _core.field(field, asked)
        down, across = _between(height, rows, cell), _between(width, cols, cell)
        wide = down @ (field @ across.T)
        wide *= np.float32(self.strength)
        wide += np.float32(1.0)
        return np.asarray(np.maximum(wide, 0.0, out=wide))


@lru_cache(maxsize=32)
def _between(length: int, points: int, cell: float) -> Array:
    """Return the weights of points at pixels, (length, points): linear between."""
    place = (np.arange(length) + 0.5) / cell
    first = np.minimum(place.astype(np.int64), points - 2)
    part = place - first
    weights = np.zeros((length, points), np.float32)
    weights[np.arange(length), first] = 1.0 - part
    weights[np.arange(length), first + 1] = part
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=1)
def _normal() -> Float64:
    law = NormalDist()
    return np.array([law.inv_cdf((k + 0.5) / _QUANTILES) for k in range(_QUANTILES)])

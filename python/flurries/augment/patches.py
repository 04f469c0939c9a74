"""Fog that is thicker here than there: a slow spectral field, the same at every size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from flurries import spectral
from flurries._contract import Array, Float64

# Points of the field along the longer side; its waves have 16 to 120 of them.
_POINTS = 120
_BAND = (16.0, 120.0)
_TILE = 240

# Half the normal law's quantiles, for means over all densities.
_QUANTILES = 33


@dataclass(frozen=True)
class Patches:
    """The unevenness of a fog.

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
        """Return the patches' motion, (2,) pixels per frame: the mean of their waves."""
        mean = math.sqrt(_BAND[0] / _BAND[1])
        return np.asarray(self.wind) * (mean * max(shape) / fps)

    def field(self, shape: tuple[int, int], seed: int, time: float) -> tuple[Array, float, float]:
        """Return a field of variance 1, the pixels between its points, and its strength.

        Point (i, j) stands at (i, j) times these pixels.
        """
        cell = max(shape) / _POINTS
        size = (math.ceil(shape[0] / cell) + 2, math.ceil(shape[1] / cell) + 2)
        drift = (np.asarray(self.wind) * time) * _POINTS
        made = spectral.field(
            size, drift=drift, seed=seed, tile=_TILE, overlap=_TILE // 4, wavelengths=_BAND,
            exponent=1.5,
        )  # fmt: skip
        return made, cell, self.strength


@lru_cache(maxsize=1)
def _normal() -> Float64:
    law = NormalDist()
    return np.array([law.inv_cdf((k + 0.5) / _QUANTILES) for k in range(_QUANTILES)])

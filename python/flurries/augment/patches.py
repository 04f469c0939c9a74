"""Fog that is thicker here than there: a slow spectral field, the same at every size."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from flurries import spectral
from flurries._contract import Array, Float64

# Points of the field along the longer side; its waves have 16 to 120 of them.
_POINTS = 120
_BAND = (16.0, 120.0)
_UNEVEN = spectral.Texture(wavelengths=_BAND, exponent=1.5, tile=240, overlap=60)

# Quantiles of the normal law, for means over all densities.
_NORMAL = np.array([NormalDist().inv_cdf((k + 0.5) / 33) for k in range(33)])


@dataclass(frozen=True)
class Patches:
    """The unevenness of a fog."""

    # Standard deviation of the extinction against its mean, where none is below 0.
    strength: float
    # How fast the largest patches drift, picture widths per second.
    wind: tuple[float, float]

    def densities(self) -> Float64:
        """Return equally likely densities, (n,)."""
        if self.strength == 0.0:
            return np.ones(1)
        return np.asarray(np.maximum(1.0 + self.strength * _NORMAL, 0.0))

    def motion(self, shape: tuple[int, int], fps: float) -> Float64:
        """Return the patches' motion, (2,) pixels per frame: the mean of their waves."""
        mean = math.sqrt(_BAND[0] / _BAND[1])
        return np.asarray(self.wind) * (mean * max(shape) / fps)

    def field(self, shape: tuple[int, int], seed: int, time: float) -> tuple[Array, float, float]:
        """Return a field of variance 1, the pixels between its points, and its strength."""
        cell = max(shape) / _POINTS
        size = (math.ceil(shape[0] / cell) + 2, math.ceil(shape[1] / cell) + 2)
        drift = (np.asarray(self.wind) * time) * _POINTS
        made = spectral.field(size, drift=drift, seed=seed, texture=_UNEVEN)
        return made, cell, self.strength

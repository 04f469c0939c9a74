"""Fog for data sets, thicker here than there: a slow spectral field, the same at every size."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np

from flurries import spectral
from flurries._contract import Array, Float64, suggesting
from flurries._kept import kept
from flurries.augment.air import Air, uniforms
from flurries.augment.calibration import Kind
from flurries.augment.record import Limits, Range, between, range_of
from flurries.augment.weather import Weather
from flurries.effects.strength import BACKDROP, Strength

_STREAM = 7002

# Points of the field along the longer side; its waves have 16 to 120 of them.
_POINTS = 120
_BAND = (16.0, 120.0)
_UNEVEN = spectral.Texture(wavelengths=_BAND, exponent=1.5, tile=240, overlap=60)

# Half the normal law's quantiles, for means over all densities.
_QUANTILES = 33


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
        return np.asarray(np.maximum(1.0 + self.strength * _normal(), 0.0))

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


@kept(1)
def _normal() -> Float64:
    law = NormalDist()
    return np.array([law.inv_cdf((k + 0.5) / _QUANTILES) for k in range(_QUANTILES)])


@suggesting
@dataclass(frozen=True, kw_only=True, repr=False)
class Fog(Weather):
    """Fog, as a function of pictures, clips, batches and stereo pairs.

    Numbers and ranges (low, high) are drawn as for :class:`Snowfall`.

    Parameters
    ----------
    amount, severity, profile, ground, focal, white, seed, weather_seed
        See :class:`Snowfall`.
    visibility : number or range, optional
        Distance in metres at which 5 % of a contrast is left, in place of amount and severity.
        Depths must be in metres; the amount of each picture follows from its own depths.
    patches : number or range
        Standard deviation of the extinction divided by its mean, 0 to 1; 0 is even fog.
    wind : number or range
        Speed of the largest patches to the right, lengths of the picture's longer side per second.
    color : number, range or (r, g, b)
        The light that fog scatters towards the camera, display values, 0 to 1.

    Notes
    -----
    Natural severities are visibilities of 1000, 500, 200, 100 and 50 m; a sky without a depth is
    60 m away. Koschmieder: ``seen = clear exp(-b d) + color (1 - exp(-b d))`` at depth d, b the
    extinction, 3 / visibility, d up to two visibilities, or 60 m. `patches` multiplies b by
    1 + patches z, no less than 0, with z a spectral field of variance 1.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> picture = np.zeros((96, 128, 3), np.float32)
    >>> fog = fl.augment.Fog(visibility=60.0, patches=0.0, color=1.0)
    >>> seen = fog(picture, depth=60.0)
    >>> round(float(seen[0, 0, 0]), 3)
    0.95
    """

    color: Range | tuple[float, float, float] = (0.75, 0.92)
    visibility: Range | None = None
    patches: Range = (0.0, 0.3)
    wind: Range = (-0.1, 0.1)

    DRAWN: ClassVar[Mapping[str, Limits]] = {"patches": (0.0, 1.0), "wind": (-100.0, 100.0)}
    WEATHER: ClassVar[Kind] = "fog"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.visibility is not None:
            if self.amount is not None or self.severity is not None:
                raise ValueError("visibility must stand without amount and severity")
            vars(self)["visibility"] = range_of("visibility", self.visibility, (1e-3, 1e9))

    def strength(self) -> tuple[Strength, Strength]:
        """Return how strong the weakest and the strongest fog are that are drawn."""
        if self.visibility is None:
            return super().strength()
        near, far = self.visibility  # type: ignore[misc]
        thin, thick = (Strength(end, 1.0 - 20.0 ** (-BACKDROP / end)) for end in (far, near))
        return thin, thick

    def _drawn(self, image: Array | None, index: int | None) -> dict[str, Any]:
        record = super()._drawn(image, index)
        if self.visibility is not None:
            u = float(uniforms(record["weather_seed"], _STREAM, 1)[0])
            record["amount"], record["visibility"] = None, between(self.visibility, u)
        return record

    def _air(self, record: dict[str, Any]) -> Air:
        return Air(
            record["weather_seed"], "fog", record["amount"] or 0.0, record["profile"],
            patches=Patches(record["patches"], (record["wind"], 0.0)), visible=record["visibility"],
        )  # fmt: skip

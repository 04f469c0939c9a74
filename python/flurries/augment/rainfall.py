"""Rain for data sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flurries.augment.air import Air
from flurries.augment.draws import Range
from flurries.augment.precipitation import Precipitation, at
from flurries.augment.signature import suggests

# Diameters in metres: smallest, mean and largest. Several times those of drops, whose streaks no
# picture of a data set would show.
SIZES = (0.004, 0.007, 0.020)
NEAR, FAR = 0.7, 10.0

# Optical depth of a mean streak's middle at the severities 1 to 5.
STREAK = (0.18, 0.23, 0.28, 0.38, 0.6)


@suggests
@dataclass(frozen=True, kw_only=True)
class Rainfall(Precipitation):
    """Rain, as a function of pictures, clips, batches and stereo pairs.

    Numbers that are drawn take a number or a range (low, high), and are drawn evenly from it, anew
    for each index. The camera stands still; for one that moves see :class:`flurries.Scene`.

    Parameters
    ----------
    amount, severity, profile, veil, ground, focal, white, seed, weather_seed
        See :class:`Snowfall`.
    wind : number or range
        Wind across the view, metres per second; to the right if positive.
    fall : number or range
        Fall speed, metres per second: 4 for drizzle, 9 for the largest drops.
    exposure : number or range
        Seconds that the shutter is open; a longer exposure makes longer streaks.
    color : number, range or (r, g, b)
        Display values, 0 to 1.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    One population of drops as in :class:`flurries.Rain`: the near streaks are drawn, the others a
    texture. Drops are drawn several times as large as real ones, and as bright as the light that
    they gather: real drops are hardly visible.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> rain = fl.augment.Rainfall(severity=3, seed=7)
    >>> picture = np.full((96, 128), 60, np.uint16)
    >>> rain(picture, index=0).dtype.name
    'uint16'
    """

    color: Range | tuple[float, float, float] = (0.78, 0.95)
    wind: Range = (-2.0, 2.0)
    fall: Range = (6.0, 9.0)
    exposure: Range = (0.015, 0.03)

    def _air(self, record: dict[str, Any]) -> Air:
        return self._of(record, "rain", _look)


def _look(amount: float) -> dict[str, Any]:
    return {"sizes": SIZES, "near": NEAR, "far": FAR, "middle": 0.9, "streak": at(amount, STREAK)}

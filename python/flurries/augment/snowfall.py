"""Falling snow for data sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flurries.augment.air import Air
from flurries.augment.draws import Range
from flurries.augment.precipitation import Precipitation, at
from flurries.augment.signature import suggests

# Diameters in metres: smallest, mean and largest. Wet flakes of heavy snowfall, since smaller ones
# are less than a pixel in most pictures of data sets.
SIZES = (0.006, 0.014, 0.036)
NEAR, FAR = 1.0, 10.0

# Optical depth of a flake's middle at the severities 1 to 5: the more flakes overlap, the denser
# they are, so that they do not drown in each other.
MIDDLE = (0.4, 0.5, 0.65, 0.95, 1.5)


@suggests
@dataclass(frozen=True, kw_only=True)
class Snowfall(Precipitation):
    """Falling snow, as a function of pictures, clips, batches and stereo pairs.

    Numbers that are drawn take a number or a range (low, high), and are drawn evenly from it, anew
    for each index. The camera stands still; for one that moves see :class:`flurries.Scene`.

    Parameters
    ----------
    amount : number or range, optional
        Strength, 0 to 1: how much of the picture's contrast is lost at any size of the picture, see
        :func:`flurries.augment.contrast_loss`. (0.2, 0.8) if neither it nor `severity` is given.
    severity : int or (low, high), optional
        Strength in five steps, 1 to 5, in place of `amount`.
    profile : {"natural", "hard"}
        "natural" is weather as it is, "hard" takes as much as the corruptions of published
        benchmarks.
    veil : float
        Share of the opacity that an even veil has, 0 to 1; flakes or drops have the rest. 0 is no
        veil.
    wind : number or range
        Wind across the view, metres per second; to the right if positive.
    fall : number or range
        Fall speed, metres per second.
    exposure : number or range
        Seconds that the shutter is open.
    color : number, range or (r, g, b)
        Display values, 0 to 1: a grey or a color.
    ground : Ground or None
        Depth of pictures for which none is given. With None everything is as far away as the sky. A
        :class:`Ground` is a plane with a horizon, for pictures that show one.
    focal : float
        Focal length, in lengths of the picture's longer side.
    white : float
        Value of white in float pictures; in integers it is their full scale.
    seed : int, optional
        Seed of all draws. Without it each call draws anew, in every process.
    weather_seed : int, optional
        Seed of the weather itself; drawn for each index if not given.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    One population of flakes as in :class:`flurries.Snow`: the near ones are drawn, the others a
    texture of flakes. Their number follows from the amount; a veil takes the rest of the loss of
    contrast, ``docs/augment.md``.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> snow = fl.augment.Snowfall(severity=(2, 4), seed=7)
    >>> picture = np.full((96, 128, 3), 60, np.uint8)
    >>> snowy = snow(picture, index=12)
    >>> snowy.shape, snowy.dtype.name, snow.clip(np.stack([picture] * 3), index=12).shape
    ((96, 128, 3), 'uint8', (3, 96, 128, 3))
    """

    wind: Range = (-1.5, 1.5)
    fall: Range = (1.0, 1.8)
    exposure: Range = (0.005, 0.02)

    def _air(self, record: dict[str, Any]) -> Air:
        return self._of(record, "snow", _look)


def _look(amount: float) -> dict[str, Any]:
    return {
        "sizes": SIZES, "near": NEAR, "far": FAR, "middle": at(amount, MIDDLE),
        "sway": (0.02, 4.0),
    }  # fmt: skip

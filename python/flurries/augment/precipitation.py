"""Snow and rain for data sets: what a record of them says falls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from flurries._contract import real
from flurries._kept import kept
from flurries.augment.air import Air
from flurries.augment.calibration import Profile, contrast_loss
from flurries.augment.draws import Range, range_of
from flurries.augment.falling import Falling
from flurries.augment.signature import suggests
from flurries.augment.weather import Weather

# Rungs of the amount from 0 to 1, which sheets are kept for.
_RUNGS = 10

# Optical depth of a flake's middle at the severities 1 to 5: the more flakes overlap, the denser
# they are, so that they do not drown in each other; and of the middle of a mean streak of rain.
_MIDDLE, _STREAK = (0.4, 0.5, 0.65, 0.95, 1.5), (0.18, 0.23, 0.28, 0.38, 0.6)


@dataclass(frozen=True, kw_only=True)
class Precipitation(Weather):
    """Weather that falls."""

    veil: float = 0.25
    wind: Range = 0.0
    fall: Range = 0.0
    exposure: Range = 0.0

    DRAWN: ClassVar[tuple[str, ...]] = ("wind", "fall", "exposure")

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        settle(self, "veil", real("veil", self.veil, low=0.0, high=1.0))
        for name in ("wind", "fall"):
            settle(self, name, range_of(name, getattr(self, name), low=-100.0, high=100.0))
        settle(self, "exposure", range_of("exposure", self.exposure, low=0.0, high=10.0))

    def _drawn(self, image: Any, index: int | None) -> dict[str, Any]:
        return {**super()._drawn(image, index), "veil": self.veil}

    def _air(self, record: dict[str, Any]) -> Air:
        kind: Literal["snow", "rain"] = "rain" if isinstance(self, Rainfall) else "snow"
        amount, own = record["amount"], (record["profile"], record["veil"], kind)
        loss, falling = _falling_of(amount, *own)
        # Sheets are kept for some amounts, the severities among them.
        _, rung = _falling_of(max(round(_RUNGS * amount), 1) / _RUNGS, *own)
        return Air(
            seed=record["weather_seed"], loss=loss, velocity=(record["wind"], record["fall"]),
            exposure=record["exposure"], falling=falling, rung=rung,
        )  # fmt: skip


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
        Share of the opacity that an even veil has, 0 to 1; flakes or drops have the rest.
    wind : number or range
        Wind across the view, metres per second; to the right if positive.
    fall : number or range
        Fall speed, metres per second.
    exposure : number or range
        Seconds that the shutter is open.
    color : number, range or (r, g, b)
        Display values, 0 to 1: a grey or a color.
    ground : Ground or None
        Depth of pictures that are given none: a plane with a horizon, or all as far as the sky.
    focal : float
        Focal length, in lengths of the picture's longer side.
    white : float
        Value of white in float pictures; in integers it is their full scale.
    seed : int, optional
        Seed of all draws. Without it each call draws anew, in every process.
    weather_seed : int, optional
        Seed of the weather itself; drawn for each index if not given.

    Notes
    -----
    One population of flakes as in :class:`flurries.Snow`: near ones are drawn, others a texture.
    Their number follows from the amount; a veil takes the contrast's rest: ``docs/augment.md``.

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


@suggests
@dataclass(frozen=True, kw_only=True)
class Rainfall(Precipitation):
    """Rain, as a function of pictures, clips, batches and stereo pairs; see :class:`Snowfall`.

    Parameters
    ----------
    amount, severity, profile, veil, wind, color, ground, focal, white, seed, weather_seed
        See :class:`Snowfall`.
    fall : number or range
        Fall speed, metres per second: 4 for drizzle, 9 for the largest drops.
    exposure : number or range
        Seconds that the shutter is open; a longer exposure makes longer streaks.

    Notes
    -----
    One population of drops as in :class:`flurries.Rain`. They are several times as large as real
    ones, which are hardly visible, and as bright as the light that they gather.

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


def _look(kind: str, amount: float) -> dict[str, Any]:
    """Return what falls at an amount, as arguments of `Falling`."""

    def at(levels: Sequence[float]) -> float:
        return float(np.interp(5.0 * amount, range(1, 6), levels))

    if kind == "snow":
        # Wet flakes of heavy snowfall: smaller ones are less than a pixel in most data sets.
        return {
            "sizes": (0.006, 0.014, 0.036), "near": 1.0, "far": 10.0, "middle": at(_MIDDLE),
            "sway": (0.02, 4.0),
        }  # fmt: skip
    # Several times the sizes of drops, whose streaks no picture of a data set would show.
    return {
        "sizes": (0.004, 0.007, 0.020), "near": 0.7, "far": 10.0, "middle": 0.9,
        "streak": at(_STREAK),
    }  # fmt: skip


@kept(256)
def _falling_of(
    amount: float, profile: Profile, veil: float, kind: Literal["snow", "rain"]
) -> tuple[float, Falling | None]:
    """Return the loss of contrast of an amount, and what falls."""
    loss = contrast_loss(amount, profile=profile, weather=kind)
    depth = math.log1p(-veil * loss) - math.log1p(-loss) if loss > 0.0 else 0.0
    return loss, Falling(depth=depth, veil=veil, **_look(kind, amount)) if depth > 1e-9 else None

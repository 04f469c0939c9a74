"""What snow and rain for data sets share: their fields, and how a record becomes air."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from flurries._contract import real
from flurries.augment.air import Air
from flurries.augment.calibration import Profile, contrast_loss
from flurries.augment.draws import Range, range_of
from flurries.augment.falling import Falling
from flurries.augment.weather import Weather

_SPEED = (-100.0, 100.0)

# Rungs of the amount from 0 to 1, which sheets are kept for.
_RUNGS = 10

# What makes the look of flakes of an amount: arguments of `Falling`.
Looks: TypeAlias = Callable[[float], dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Precipitation(Weather):
    """Weather that falls. The fields are described in the weathers themselves."""

    veil: float = 0.25
    wind: Range = 0.0
    fall: Range = 0.0
    exposure: Range = 0.0

    DRAWN: ClassVar[tuple[str, ...]] = ("wind", "fall", "exposure")

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        settle(self, "veil", real("veil", self.veil, low=0.0, high=1.0))
        settle(self, "wind", range_of("wind", self.wind, low=_SPEED[0], high=_SPEED[1]))
        settle(self, "fall", range_of("fall", self.fall, low=_SPEED[0], high=_SPEED[1]))
        settle(self, "exposure", range_of("exposure", self.exposure, low=0.0, high=10.0))

    def _drawn(self, image: Any, index: int | None) -> dict[str, Any]:
        return {**super()._drawn(image, index), "veil": self.veil}

    def _of(self, record: dict[str, Any], kind: Literal["snow", "rain"], look: Looks) -> Air:
        """Return the air of a record, whose flakes look as their amount says."""
        amount, own = record["amount"], (record["profile"], record["veil"], kind, look)
        loss, falling = _falling_of(amount, *own)
        # Sheets are kept for some amounts, the severities among them.
        _, rung = _falling_of(max(round(_RUNGS * amount), 1) / _RUNGS, *own)
        return Air(
            seed=record["weather_seed"],
            loss=loss,
            velocity=(record["wind"], record["fall"]),
            exposure=record["exposure"],
            falling=falling,
            rung=rung,
        )


@lru_cache(maxsize=256)
def _falling_of(
    amount: float, profile: Profile, veil: float, kind: Literal["snow", "rain"], look: Looks
) -> tuple[float, Falling | None]:
    """Return the loss of contrast of an amount, and what falls."""
    loss = contrast_loss(amount, profile=profile, weather=kind)
    depth = math.log1p(-veil * loss) - math.log1p(-loss) if loss > 0.0 else 0.0
    return loss, Falling(depth=depth, veil=veil, **look(amount)) if depth > 1e-9 else None


@lru_cache(maxsize=256)
def at(amount: float, levels: tuple[float, ...]) -> float:
    """Return a number of a look that is given at the amounts 0.2, 0.4, ..., 1."""
    return float(np.interp(5.0 * amount, range(1, 6), levels))

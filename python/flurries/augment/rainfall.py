"""Rain for data sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from flurries.augment.air import Air
from flurries.augment.calibration import at_amount, contrast_loss
from flurries.augment.draws import Range, range_of
from flurries.augment.flakes import Cloud
from flurries.augment.weather import Weather

_DROPS = (50.0, 250.0, 420.0, 600.0, 800.0, 1000.0)
_GAIN = (60.0, 75.0, 90.0, 105.0, 120.0, 130.0)
_REACH = 12.0


@dataclass(frozen=True, kw_only=True)
class Rainfall(Weather):
    """Rain, as a function of pictures, clips, batches and stereo pairs.

    Numbers that are drawn take a number or a range (low, high), and are drawn evenly from it, anew
    for each index. The camera stands still; for one that moves see :class:`flurries.Scene`.

    Parameters
    ----------
    amount, severity, ground, focal, white, seed, weather_seed
        See :class:`Snowfall`.
    wind : number or range
        Sideways, metres per second; to the right if positive.
    fall : number or range
        Fall speed, metres per second: 4 for drizzle, 9 for the largest drops.
    exposure : number or range
        Seconds that the shutter is open: how long the streaks are.
    color : number, range or (r, g, b)
        Display values, 0 to 1.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    Drops as streaks to 12 m, and beyond them the veil that rain is from afar: at 30 frames per
    second a texture of rain is too fast to be anything else. Drops are drawn as if several times as
    large as they are: real ones are smeared to near invisibility.

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
    exposure: Range = (0.008, 0.02)

    DRAWN: ClassVar[tuple[str, ...]] = ("wind", "fall", "exposure")

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        settle(self, "wind", range_of("wind", self.wind, low=-100.0, high=100.0))
        settle(self, "fall", range_of("fall", self.fall, low=-100.0, high=100.0))
        settle(self, "exposure", range_of("exposure", self.exposure, low=0.0, high=10.0))

    def _air(self, record: dict[str, Any]) -> Air:
        amount = record["amount"]
        # Light goes with the area: a gain is a larger drop, whose streak is as long as ever.
        wider = at_amount(amount, _GAIN) ** 0.5
        return Air(
            seed=record["weather_seed"],
            loss=contrast_loss(amount),
            velocity=(record["wind"], record["fall"]),
            exposure=record["exposure"],
            cloud=Cloud(
                min(amount / 0.1, 1.0) * at_amount(amount, _DROPS),
                _REACH,
                (0.0025 * wider, 0.004 * wider),
                1.0,
            ),
        )

"""Falling snow for data sets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from flurries.augment.air import Air
from flurries.augment.calibration import at_amount, contrast_loss
from flurries.augment.draws import Range, range_of
from flurries.augment.flakes import Cloud
from flurries.augment.texture import Texture
from flurries.augment.weather import Weather
from flurries.effects.looks import SNOW_SEVERITY

# At the amounts 0, 0.2, ..., 1.
_FLAKES = (300.0, *SNOW_SEVERITY["flakes"])
_LARGEST = (0.02, *SNOW_SEVERITY["largest"])
_MEAN = (-0.3, *SNOW_SEVERITY["mean"])
_SPREAD = (2.0, *SNOW_SEVERITY["spread"])
_EXPONENT = (0.75, *SNOW_SEVERITY["exponent"])
_NEAR = 12.0


@dataclass(frozen=True, kw_only=True)
class Snowfall(Weather):
    """Falling snow, as a function of pictures, clips, batches and stereo pairs.

    Numbers that are drawn take a number or a range (low, high), and are drawn evenly from it, anew
    for each index. The camera stands still; for one that moves see :class:`flurries.Scene`.

    Parameters
    ----------
    amount : number or range, optional
        How much, 0 to 1, the same at every size of the picture: it says how much of the picture's
        contrast is lost, see :func:`flurries.augment.contrast_loss`. (0.2, 0.8) if neither it nor
        `severity` is given.
    severity : int or (low, high), optional
        In place of `amount`, in five steps: 1 to 5.
    wind : number or range
        Sideways, metres per second; to the right if positive.
    fall : number or range
        Fall speed, metres per second.
    exposure : number or range
        Seconds that the shutter is open.
    color : number, range or (r, g, b)
        Display values, 0 to 1: a grey, or a color as it is.
    ground : Ground or None
        The depth of pictures of which none is given: a plane with a horizon. None: as far as the
        sky everywhere.
    focal : float
        Focal length, in lengths of the picture's longer side.
    white : float
        What float pictures call white; integers have their full scale.
    seed : int, optional
        Of all draws. Without it each call draws anew, whatever process it is in.
    weather_seed : int, optional
        Of the weather itself; drawn for each index if not given.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    Langer 2004, sections 5 and 6: a spectral texture for all that is beyond 12 m, flakes before it.
    What they leave of the wanted loss an even veil takes, ``docs/augment.md``.

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

    DRAWN: ClassVar[tuple[str, ...]] = ("wind", "fall", "exposure")

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        settle(self, "wind", range_of("wind", self.wind, low=-100.0, high=100.0))
        settle(self, "fall", range_of("fall", self.fall, low=-100.0, high=100.0))
        settle(self, "exposure", range_of("exposure", self.exposure, low=0.0, high=10.0))

    def _air(self, record: dict[str, Any]) -> Air:
        amount = record["amount"]
        # So little snow is few flakes, and no texture.
        fading = min(amount / 0.1, 1.0)
        return Air(
            seed=record["weather_seed"],
            loss=contrast_loss(amount),
            velocity=(record["wind"], record["fall"]),
            exposure=record["exposure"],
            cloud=Cloud(
                fading * at_amount(amount, _FLAKES),
                _NEAR,
                (0.008, at_amount(amount, _LARGEST)),
                0.9,
                (0.02, 4.0),
            ),
            texture=Texture(
                0.8 * fading,
                at_amount(amount, _MEAN),
                at_amount(amount, _SPREAD),
                at_amount(amount, _EXPONENT),
                _NEAR,
            ),
        )

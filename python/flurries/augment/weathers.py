"""Snow, rain and fog for data sets: what users tell of them, and what a record says is there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from flurries._contract import Array, suggesting, uniforms
from flurries.augment.calibration import Kind
from flurries.augment.record import Range, between, range_of
from flurries.augment.weather import Weather
from flurries.effects.strength import BACKDROP, Strength

# Of the visibility.
_STREAM = 7002


@suggesting
@dataclass(frozen=True, kw_only=True, repr=False)
class Snowfall(Weather):
    """Falling snow, as a function of pictures, clips, batches and stereo pairs.

    Numbers take a number or a range (low, high), and are drawn evenly from it, anew for each index.
    The camera stands still; for one that moves see :class:`flurries.Scene`.

    Parameters
    ----------
    amount : number or range, optional
        Strength, 0 to 1, in fifths of a severity. (0.2, 0.8) if neither it nor `severity` is given.
    severity : int or (low, high), optional
        Strength in five steps, 1 to 5, in place of `amount`.
    profile : {"natural", "hard"}
        "natural" is the weather of scenes, of rates of .5, 1, 2.5, 5 and 10 mm/h, of rain 2.5, 10,
        25, 50 and 100; "hard" takes a share of the contrast, more than that at every step, see
        :func:`flurries.augment.contrast_loss`.
    veil : float
        Share of the weather, 0 to 1, in whose place there is an even veil.
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
    shade : number or range
        Metres of this weather overhead, which take the sun's light and half of its shadows.
    drops : number or range
        Drops on the lens: discs that show what is around them upside down. No label knows them.
    seed : int, optional
        Seed of all draws. Without it each call draws anew, in every process.
    weather_seed : int, optional
        Seed of the weather itself; drawn for each index if not given.

    Notes
    -----
    One population of flakes as in :class:`flurries.Snow`, from 1.5 to 60 m; of the hard profile as
    near as makes them as large in pixels at every size of the picture: ``docs/augment.md``.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> snow = fl.augment.Snowfall(severity=(2, 4), seed=7)
    >>> picture = np.full((96, 128, 3), 60, np.uint8)
    >>> snowy = snow(picture, index=12)
    >>> snowy.shape, snowy.dtype.name, snow.clip(np.stack([picture] * 3), index=12).shape
    ((96, 128, 3), 'uint8', (3, 96, 128, 3))
    """

    veil: float = 0.0
    wind: Range = (-1.5, 1.5)
    fall: Range = (0.8, 1.4)
    exposure: Range = (0.002, 0.01)

    WEATHER: ClassVar[Kind] = "snow"


@suggesting
@dataclass(frozen=True, kw_only=True, repr=False)
class Rainfall(Weather):
    """Rain, as a function of pictures, clips, batches and stereo pairs; see :class:`Snowfall`.

    Parameters
    ----------
    amount, severity, profile, veil, wind, color, ground, focal, white, shade, drops, seed, \
    weather_seed
        See :class:`Snowfall`.
    fall : number or range
        Fall speed, metres per second: 4 for drizzle, 9 for the largest drops.
    exposure : number or range
        Seconds that the shutter is open; a longer exposure makes longer streaks.

    Notes
    -----
    One population of drops as in :class:`flurries.Rain`. Natural ones are hardly visible one by
    one; those of the hard profile are large, near, and as bright as the light that they gather.
    """

    color: Range | tuple[float, float, float] = (0.78, 0.95)
    veil: float = 0.0
    wind: Range = (-2.0, 2.0)
    fall: Range = (4.0, 7.0)
    exposure: Range = (0.003, 0.01)

    WEATHER: ClassVar[Kind] = "rain"


@suggesting
@dataclass(frozen=True, kw_only=True, repr=False)
class Fog(Weather):
    """Fog, as a function of pictures, clips, batches and stereo pairs.

    Numbers and ranges (low, high) are drawn as for :class:`Snowfall`.

    Parameters
    ----------
    amount, severity, profile, ground, focal, white, shade, drops, seed, weather_seed
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

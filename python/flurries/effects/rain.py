"""Rain: streaks near the camera, and a texture whose waves across the fall are all that is left.

What falls as fast as rain is too fast for the frame rate: of the texture's waves only those that
run nearly along the fall stay, and make streaks. They are few, so that a small tile would hold
none that moves: the tile grows with the speed.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any, ClassVar

from flurries._contract import flag, real
from flurries.effects.falling import Falling
from flurries.effects.looks import rain_of_rate, rain_of_severity, rate_of, severity_of
from flurries.effects.peopled import Population
from flurries.effects.presets import RAIN
from flurries.frame.layer import Frame
from flurries.motion.keys import Number, Vector
from flurries.motion.wind import Wind
from flurries.spectral.contrast import kept_power

# The share of what is left of the texture that stands still is 13.5 c / M for wavelengths of 4 to
# 32 px, c the cycles of the longest wave in a frame: M = 144 c is a tenth, with a little to spare.
PIXELS_PER_CYCLE = 144.0 / (28.0 / math.log(8.0))

# A larger tile costs memory that a picture does not; from here on `jitter` would do.
LARGEST_TILE = 2048


@dataclass(frozen=True, kw_only=True)
class Rain(Falling):
    """Rain.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    amount : float
        How much of it all, 0 to 1; scales drops, texture and haze. Keyed.
    fall : float
        Fall speed, metres per second: 3 for drizzle, 9 for the largest drops. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed; or
        :class:`flurries.Wind`.
    color : float, (r, g, b) or "ambient"
        Display values, 0 to 1. Keyed. "ambient" as in :class:`Snow`.
    haze : float
        Opacity of an even veil, 0 to 1; before a scene with a depth, of the veil before the
        farthest rain. Keyed. Most of what tells rain on a bright picture.
    shutter : float
        Exposure in frames, centred on the frame: how long the streaks are. Keyed.
    texture : float
        Largest opacity of the texture, 0 to 1; 0 leaves it out. Keyed.
    mean, spread, power : float
        The texture's map to opacity, see :func:`flurries.spectral.opacity`. Keyed.
    exponent : float
        Slope of the texture's spectrum.
    wavelengths : (shortest, longest), optional
        The texture's band in pixels. If not given, (2, 12) on a picture 1024 px wide, in proportion
        on others, not under 2 px.
    near_depth : float
        Depth in metres that the longest wave stands for.
    tile, overlap : int, optional
        The texture's tiles in pixels. If not given, as large as streaks need to move. One that is
        too small for it is used with a warning.
    blend : {"power", "linear"}
        See :func:`flurries.spectral.blend_tiles`.
    alias : {"cut", "soft", "keep"}
        What becomes of waves too fast for the frame rate, see
        :func:`flurries.spectral.temporal_filter`.
    renormalise : bool
        Give the waves that are left the contrast that all had.
    jitter : bool
        Spread the directions of the texture's waves, so that none stands still.
    depth_mode : {"tile", "pixel"}
        As in :class:`Snow`.
    drops : int
        Drops in view between the camera and `drop_depth`; 0 draws none.
    drop_density : float, optional
        Drops per cubic metre, in place of `drops`.
    drop_size : (smallest, largest)
        Diameters in metres.
    drop_depth : float
        Depth in metres up to which drops are drawn.
    gain : float
        How many times as much light a drop scatters as an opaque disc of its size hides. Real drops
        are smeared to near invisibility.
    look : {"v1"}
        As in :class:`Snow`.
    seed : int, optional
        Of this effect; the scene's if not given.
    severity : int, optional
        One knob: 1 to 5 take 6, 14, 25, 38 and 55 % of a picture's contrast. Sets `drop_density`,
        `drop_size`, `fall`, `texture`, `mean` and `haze`, those that are not given. No field: what
        it makes is written out.
    rate_mm_h : float, optional
        One knob: the rate of rain in mm/h; drizzle 3, rain 10, a downpour 25. Sets the same fields:
        the drops of Marshall and Palmer's law, and a veil with the extinction of all of them over
        60 m.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Warns
    -----
    UserWarning
        When a frame is rendered whose `tile` is so small that a tenth or more of the streaks stands
        still.

    Notes
    -----
    Langer 2004, sections 5 and 8. ``docs/deviations.md`` says how the size of the tile follows from
    the speed.

    Examples
    --------
    >>> import flurries as fl
    >>> rain = fl.Rain.preset("downpour", wind=(2.0, 0.0, 0.0))
    >>> rain.drops > fl.Rain.preset("drizzle").drops
    True
    """

    fall: Number = 8.0
    wind: Vector | Wind = (0.56, 0.0, 0.0)
    color: Any = (0.86, 0.88, 0.92)
    haze: Number = 0.08
    texture: Number = 0.35
    mean: Number = 0.15
    spread: Number = 2.5
    exponent: float = 1.0
    near_depth: float = 3.5
    alias: str = "cut"
    renormalise: bool = True
    drops: int = 4000
    drop_density: float | None = None
    drop_size: tuple[float, float] = (0.0025, 0.004)
    drop_depth: float = 14.0
    gain: float = 30.0

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = RAIN
    _BAND = (2.0, 12.0)
    # Wider streaks look like smears on the lens.
    _LARGEST_SIGMA = (1.8, 3.0)

    def __post_init__(self, severity: int | None, rate_mm_h: float | None) -> None:
        super().__post_init__(severity, rate_mm_h)
        self._settle_particles("drops", "drop_size", "drop_density")
        flag("renormalise", self.renormalise)
        object.__setattr__(self, "drop_depth", real("drop_depth", self.drop_depth, above=0.0))
        object.__setattr__(self, "gain", real("gain", self.gain, low=0.0, high=1e4))

    def _look(self, severity: int | None, rate_mm_h: float | None) -> dict[str, Any]:
        """Return the fields that a knob sets."""
        if severity is not None:
            return rain_of_severity(severity_of(severity))
        return {} if rate_mm_h is None else rain_of_rate(rate_of(rate_mm_h, self.NAME))

    def _instead(self) -> tuple[str, ...]:
        """Return fields that say the same as one that a knob sets."""
        return ("drops",)

    def population(self, t: float) -> Population:
        """Return the drops at `t`."""
        # Light goes with the area: a gain is a larger drop, whose streak is as long as ever.
        wider = math.sqrt(self.gain)
        sizes = (wider * self.drop_size[0], wider * self.drop_size[1])
        return Population(
            "drops", self.drops, self.drop_depth, sizes, 1.0, (0.0, 0.0), self.drop_density
        )

    def needed_tile(self, frame: Frame) -> float:
        """Return the tile in pixels from which on less than a tenth of the streaks stands still.

        In proportion to the fastest motion of the film; 0 where no wave is too fast.
        """
        shortest, longest = self.band(frame.shape)
        cycles = frame.camera.focal * self.fastest(frame) / self.near_depth / longest
        if cycles <= 0.5 or self.alias == "keep" or self.jitter:
            return 0.0
        return PIXELS_PER_CYCLE * cycles * (longest - shortest) / math.log(longest / shortest)

    def least_tile(self, frame: Frame) -> float:
        """Return the tile in pixels that the motion of the film needs."""
        return self.needed_tile(frame)

    def tiles(self, frame: Frame) -> tuple[int, int]:
        """Return tile and overlap in pixels for the film that a frame belongs to."""
        tile, overlap = super().tiles(frame)
        needed = self.needed_tile(frame)
        if self.tile is None:
            tile = max(tile, 8 * math.ceil(min(needed, LARGEST_TILE) / 8.0))
            overlap = tile // 6 if self.overlap is None else min(self.overlap, tile - 1)
        elif tile < needed:
            warnings.warn(
                f"rain: with tiles of {tile} px a tenth of the streaks or more stands still; "
                f"take tile={math.ceil(needed)}, or leave it out, or jitter=True",
                UserWarning,
                stacklevel=7,
            )
        return tile, overlap

    @property
    def preserves_mean(self) -> bool:
        """Whether what blur takes of the mean is added again; renormalised, it has lost nothing."""
        return not self.renormalise

    def mapped(self, frame: Frame, amount: float) -> tuple[float, float, float, float]:
        """Return mean, spread, power and amount of the texture's map to opacity."""
        mean, spread, power, most = super().mapped(frame, amount)
        if self.renormalise:
            kept = kept_power(self.cycles(frame), self.alias)
            spread = max(spread * math.sqrt(kept), 1e-3)
        return mean, spread, power, most

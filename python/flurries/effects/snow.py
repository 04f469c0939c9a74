"""Falling snow: flakes near the camera, a spectral texture for all that lies behind them.

One set of physical parameters moves both. The texture's longest wave stands for the depth
`near_depth`; a wave of wavelength L stands for ``near_depth * longest / L`` and moves as a flake at
that depth does. The flakes fill the air up to `near_depth`, where the texture takes over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from flurries._contract import vector
from flurries.effects.falling import Falling
from flurries.effects.looks import rate_of, severity_of, snow_of_rate, snow_of_severity
from flurries.effects.peopled import Population
from flurries.effects.presets import SNOW
from flurries.motion.keys import Number, as_number, value_at


@dataclass(frozen=True, kw_only=True)
class Snow(Falling):
    """Falling snow.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are; the looks were tuned for metres.

    Parameters
    ----------
    amount : float
        How much of it all, 0 to 1; scales flakes, texture and haze. Keyed.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed; or
        :class:`flurries.Wind`, with gusts, swirls and differences over depth. Waves exactly across
        the motion stand still, which shows when the wind is 0 or in a simple ratio to the fall
        (1:3, 1:4): take a ratio beside it, or `jitter`.
    color : float, (r, g, b) or "ambient"
        Display values, 0 to 1. Keyed. "ambient": as bright as white is in the light of the
        background, see :func:`flurries.light.ambient.ambient_light`.
    haze : float
        Opacity of an even veil, 0 to 1; before a scene with a depth, of the veil before the
        farthest snow. Keyed.
    shutter : float
        Exposure in frames, 0 to 1 for a usual camera, centred on the frame. Keyed.
    texture : float
        Largest opacity of the texture, 0 to 1; 0 leaves it out. Keyed.
    mean, spread, power : float
        The texture's map to opacity, see :func:`flurries.spectral.opacity`. Keyed.
    exponent : float
        Slope of the texture's spectrum: less makes dots, more makes cotton.
    wavelengths : (shortest, longest), optional
        The texture's band in pixels. If not given, (3, 24) on a picture 1024 px wide, in proportion
        on others, not under 2 px.
    near_depth : float
        Depth in metres that the longest wave stands for, and up to which flakes are drawn.
    tile, overlap : int, optional
        The texture's tiles in pixels. If not given, 8/3 of the longest wave, and an overlap of a
        sixth, or of a half when the camera moves forward.
    blend : {"power", "linear"}
        See :func:`flurries.spectral.blend_tiles`.
    alias : {"soft", "cut", "keep"}
        What becomes of waves too fast for the frame rate, see
        :func:`flurries.spectral.temporal_filter`.
    jitter : bool
        Spread the directions of the texture's waves, so that none stands still.
    depth_mode : {"tile", "pixel"}
        How exactly the texture follows the scene's depth: by its tiles, or octaves of it by every
        pixel, which takes as many times as long as there are octaves.
    flakes : int
        Flakes in view between the camera and `near_depth`; 0 draws none.
    flake_density : float, optional
        Flakes per cubic metre, in place of `flakes`.
    flake_size : (smallest, largest)
        Diameters in metres.
    flake_opacity : float
        Of a flake's middle, 0 to 1. Keyed.
    sway : (amplitude, rate)
        Metres, and radians per second: each flake swings on its own.
    look : {"v1"}
        Version of the looks: what presets and knobs mean, and how a picture of another size shows
        them.
    seed : int, optional
        Of this effect; the scene's if not given.
    severity : int, optional
        One knob: 1 to 5 take 6, 14, 25, 38 and 55 % of a picture's contrast. Sets `flake_density`,
        `flake_size`, `texture`, `mean`, `spread`, `exponent`, `fall` and `haze`, those that are not
        given. No field: what it makes is written out.
    rate_mm_h : float, optional
        One knob: the liquid-equivalent rate of snowfall in mm/h; light snow is less than 1, heavy
        more than 5. Sets the same fields.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Notes
    -----
    Langer 2004, sections 5 to 7. The paper's own look is the preset "paper".

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.Snow.preset("heavy", wind=(1.0, 0.0, 0.0))
    >>> snow.flakes > fl.Snow.preset("light").flakes
    True
    """

    flakes: int = 8000
    flake_density: float | None = None
    flake_size: tuple[float, float] = (0.008, 0.024)
    flake_opacity: Number = 0.9
    sway: tuple[float, float] = (0.02, 4.0)

    NAME: ClassVar[str] = "snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = SNOW

    def __post_init__(self, severity: int | None, rate_mm_h: float | None) -> None:
        super().__post_init__(severity, rate_mm_h)
        self._settle_particles("flakes", "flake_size", "flake_density")
        opacity = as_number("flake_opacity", self.flake_opacity, low=0.0, high=1.0)
        object.__setattr__(self, "flake_opacity", opacity)
        object.__setattr__(self, "sway", tuple(vector("sway", self.sway, 2).tolist()))

    def _look(self, severity: int | None, rate_mm_h: float | None) -> dict[str, Any]:
        """Return the fields that a knob sets."""
        if severity is not None:
            return snow_of_severity(severity_of(severity))
        return {} if rate_mm_h is None else snow_of_rate(rate_of(rate_mm_h, self.NAME))

    def _instead(self) -> tuple[str, ...]:
        """Return fields that say the same as one that a knob sets."""
        return ("flakes",)

    def population(self, t: float) -> Population:
        """Return the flakes at `t`."""
        return Population(
            "flakes",
            self.flakes,
            self.near_depth,
            self.flake_size,
            value_at(self.flake_opacity, t),
            self.sway,
            self.flake_density,
        )

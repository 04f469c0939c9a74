"""Falling snow: flakes near the camera, a spectral texture for all that lies behind them.

One set of physical parameters moves both. The texture's longest wave stands for the depth
`near_depth`, up to which flakes fill the air; shorter waves stand for greater depths and move as
flakes there do.
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from flurries._contract import real
from flurries.effects.checks import (
    TENT,
    DepthMode,
    optional,
    pair,
    part_of,
    population,
    settle,
    share,
    sizes,
)
from flurries.effects.color import Color
from flurries.effects.described import Described
from flurries.effects.field import Field
from flurries.effects.flakes import Flakes
from flurries.effects.knobs import knobs, looks
from flurries.effects.looks import rate_of, snow_of_rate
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation
from flurries.effects.presets import SNOW, TentSnowLook
from flurries.effects.severity import rate_of_severity
from flurries.effects.texture import Texture
from flurries.effects.veil import Veil
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind
from flurries.spectral.tables import Aliasing
from flurries.spectral.tiles import Blend

_CHECKS = {
    **TENT,
    "flakes": population,
    "flake_density": optional(lambda name, value: real(name, value, low=0.0, high=1e6)),
    "flake_size": sizes,
    "flake_opacity": share,
    "sway": pair,
}


@looks
@knobs(
    severity=lambda value, _: snow_of_rate(rate_of_severity(value, "snow")) | {"flakes": None},
    rate=lambda value, _: snow_of_rate(rate_of(value, "snow")) | {"flakes": None},
)
@dataclass(frozen=True, kw_only=True)
class TentSnow(metaclass=Described):
    """Falling snow.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are; the looks were tuned for metres.

    Parameters
    ----------
    preset : str, optional
        A look by name, of ``PRESETS``; given fields replace its own.
    amount : float
        Strength of the whole effect, 0 to 1; scales flakes, texture and haze. Keyed.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed; or
        :class:`flurries.Wind`, with gusts, swirls and differences over depth. Waves exactly across
        the motion stand still, which shows when the wind is 0 or in a simple ratio to the fall
        (1:3, 1:4): choose another ratio, or `jitter`.
    color : float, (r, g, b), "#rrggbb" or "ambient"
        Display values, 0 to 1. Keyed. "ambient" as in :class:`flurries.Snow`.
    haze : float
        Opacity of an even veil, 0 to 1; in a scene with a depth, of the veil in front of the
        farthest snow. Keyed.
    shutter : float
        Exposure in frames, 0 to 1 for a usual camera, centred on the frame. Keyed.
    texture : float
        Largest opacity of the texture, 0 to 1; 0 leaves it out. Keyed.
    mean, spread, power : float
        Parameters of the map from the texture to opacity, see :func:`flurries.spectral.opacity`.
        Keyed.
    exponent : float
        Slope of the texture's spectrum: small values make dots, large values make soft clumps.
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
        What happens to waves that are too fast for the frame rate, see
        :func:`flurries.spectral.temporal_filter`.
    jitter : bool
        Spread the directions of the texture's waves, so that none stands still.
    depth_mode : {"tile", "pixel"}
        Whether the texture follows the scene's depth by tiles or, octave by octave, at every pixel.
        "pixel" takes as many times as long as there are octaves.
    flakes : int
        Flakes in view between the camera and `near_depth`; 0 draws none.
    flake_density : float, optional
        Flakes per cubic metre, in place of `flakes`.
    flake_size : (smallest, largest)
        Diameters in metres.
    flake_opacity : float
        Mean opacity over the disc of a flake at rest, 0 to 1; .99 at most is drawn. Keyed.
    sway : (amplitude, rate)
        Amplitude in metres and rate in radians per second. Each flake swings with a phase of its
        own.
    look : {"v1"}
        Version of the presets and of `severity` and `rate`, and of how pictures of other sizes
        show them.
    seed : int, optional
        Seed of this effect; the scene's seed if not given.
    severity : int, optional
        1 to 5 are rates, as of :class:`Snow` and :class:`Rain`.
    rate : float, optional
        Liquid-equivalent rate of snowfall in mm/h; light snow is less than 1, heavy more than 5.
        Sets `flake_density`, `flake_size`, `texture`, `mean`, `spread`, `exponent`, `fall` and
        `haze`, those that are not given; scene files hold these and not the rate.

    Notes
    -----
    Langer 2004, sections 5 to 7. The paper's own look is the preset "paper".

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.effects.TentSnow("heavy", wind=(1.0, 0.0, 0.0))
    >>> snow.flakes > fl.effects.TentSnow("light").flakes
    True
    """

    preset: InitVar[TentSnowLook | None] = field(default=None, kw_only=False)
    amount: Number = 1.0
    fall: Number = 1.4
    wind: Vector | Wind = (0.36, 0.0, 0.0)
    color: Color = 0.98
    haze: Number = 0.04
    shutter: Number = 0.5
    texture: Number = 0.8
    mean: Number = 0.05
    spread: Number = 2.0
    power: Number = 2.0
    exponent: float = 0.75
    wavelengths: tuple[float, float] | None = None
    near_depth: float = 12.0
    tile: int | None = None
    overlap: int | None = None
    blend: Blend = "power"
    alias: Aliasing = "soft"
    jitter: bool = False
    depth_mode: DepthMode = "tile"
    flakes: int = 8000
    flake_density: float | None = None
    flake_size: tuple[float, float] = (0.008, 0.024)
    flake_opacity: Number = 0.9
    sway: tuple[float, float] = (0.02, 4.0)
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate: InitVar[float | None] = None

    NAME: ClassVar[str] = "snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = SNOW

    def __post_init__(self, *_: Any) -> None:
        settle(self, _CHECKS)

    @cached_property
    def parts(self) -> Precipitation[Texture]:
        """The parts of the effect."""
        motion = Motion(self.fall, self.wind, self.shutter)
        field = part_of(Field, self, motion=motion, tuned=(3.0, 24.0))
        texture = part_of(Texture, self, field=field, opacity=self.texture)
        flakes = Flakes(
            motion=motion, keyed=isinstance(self.amount, Keys), number=self.flakes,
            density=self.flake_density, reach=self.near_depth, sizes=self.flake_size,
            opacity=self.flake_opacity, sway=self.sway,
        )  # fmt: skip
        return part_of(
            Precipitation, self, name=self.NAME, motion=motion, texture=texture, flakes=flakes,
            veil=Veil(self.haze, field.far_depth),
        )  # fmt: skip

"""Langer's snow and rain: near flakes and drops, before a texture of all that lies behind."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from flurries.effects import checks
from flurries.effects.color import Color
from flurries.effects.drawn import Flakes
from flurries.effects.field import Field
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation, Veil
from flurries.effects.presets import TENT_RAIN, TENT_SNOW, RainLook, TentSnowLook
from flurries.effects.texture import Texture
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind
from flurries.spectral.tables import Aliasing
from flurries.spectral.tiles import Blend


@dataclass(frozen=True, kw_only=True)
class _Tent(metaclass=checks.Described):
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
    depth_mode: checks.DepthMode = "tile"
    look: str = "v1"
    seed: int | None = None

    NAME: ClassVar[str]

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self)

    def _parts(self, tuned: tuple[float, float], streaks: bool, **near: Any) -> Precipitation:
        motion = Motion(self.fall, self.wind, self.shutter)
        field = checks.part_of(Field, self, motion=motion, tuned=tuned, streaks=streaks)
        flakes = Flakes(motion=motion, keyed=isinstance(self.amount, Keys), **near)
        return checks.part_of(
            Precipitation, self, name=self.NAME, motion=motion, flakes=flakes,
            texture=checks.part_of(Texture, self, field=field, opacity=self.texture),
            veil=Veil(self.haze, field.far_depth, flakes),
        )  # fmt: skip


@checks.effect()
@dataclass(frozen=True, kw_only=True)
class TentSnow(_Tent):
    """Falling snow as Langer's texture.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    amount : float
        Strength of the whole effect, 0 to 1; scales flakes, texture and haze. Keyed.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    preset, color, sway, seed
        As in :class:`Snow`.
    wind : (x, y, z) or Wind
        As in :class:`Snow`. Waves exactly across the motion stand still, which shows when the wind
        is 0 or in a simple ratio to the fall (1:3, 1:4): choose another ratio, or `jitter`.
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
        Flakes in view between the camera and `near_depth`; 0 draws none. Of more than 600 those too
        far off to be half a pixel wide are an even veil that hides as much.
    flake_density : float, optional
        Flakes per cubic metre, in place of `flakes`.
    flake_size : (smallest, largest)
        Diameters in metres.
    flake_opacity : float
        Mean opacity over the disc of a flake at rest, 0 to 1; .99 at most is drawn. Keyed.
    look : {"v1"}
        Version of the presets, and of how pictures of other sizes look.

    Notes
    -----
    Langer 2004, sections 5 to 7. The paper's own look is the preset "paper".
    """

    preset: InitVar[TentSnowLook | None] = field(default=None, kw_only=False)
    flakes: int = 8000
    flake_density: float | None = None
    flake_size: tuple[float, float] = (0.008, 0.024)
    flake_opacity: Number = 0.9
    sway: tuple[float, float] = (0.02, 4.0)

    NAME: ClassVar[str] = "snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = TENT_SNOW

    @cached_property
    def parts(self) -> Precipitation:
        return self._parts(
            (3.0, 24.0), False, number=self.flakes, density=self.flake_density,
            reach=self.near_depth, sizes=self.flake_size, opacity=self.flake_opacity,
            sway=self.sway,
        )  # fmt: skip


@checks.effect()
@dataclass(frozen=True, kw_only=True)
class TentRain(_Tent):
    """Rain as Langer's texture (2004, sections 5 and 8), whose tiles are as large as streaks need.

    ``docs/internals/deviations.md`` says how that follows from the speed. A frame whose `tile` is
    so small that a tenth or more of the streaks stands still is warned of.

    Parameters
    ----------
    preset, amount, fall, wind, color, shutter, texture, mean, spread, power, exponent, \
near_depth, overlap, blend, alias, jitter, depth_mode, look, seed
        As in :class:`TentSnow`.
    haze : float
        As in :class:`TentSnow`. On a bright picture it is most of what shows that it rains.
    wavelengths : (shortest, longest), optional
        If not given, (2, 12) on a picture 1024 px wide, as there.
    tile : int, optional
        If not given, tiles are large enough for the streaks to move. A smaller one is used with a
        warning.
    renormalise : bool
        Give the remaining waves the contrast that all waves had together.
    drops : int
        Drops in view up to `drop_depth`, as `flakes` of :class:`TentSnow`; 0 draws none.
    drop_density : float, optional
        Drops per cubic metre, in place of `drops`.
    drop_size : (smallest, largest)
        Diameters in metres.
    drop_depth : float
        Depth in metres up to which drops are drawn.
    gain : float
        Light that a drop scatters, divided by the light that an opaque disc of its size hides. With
        1 the streaks are hardly visible, as those of real drops.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    fall: Number = 8.0
    wind: Vector | Wind = (0.56, 0.0, 0.0)
    color: Color = (0.86, 0.88, 0.92)
    haze: Number = 0.08
    texture: Number = 0.35
    mean: Number = 0.15
    spread: Number = 2.5
    exponent: float = 1.0
    near_depth: float = 3.5
    alias: Aliasing = "cut"
    renormalise: bool = True
    drops: int = 4000
    drop_density: float | None = None
    drop_size: tuple[float, float] = (0.0025, 0.004)
    drop_depth: float = 14.0
    gain: float = 30.0

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = TENT_RAIN

    @cached_property
    def parts(self) -> Precipitation:
        # Light goes with the area: a gain is a larger drop, whose streak is as long as ever. Wider
        # ones look like smears on the lens.
        small, large = (math.sqrt(self.gain or 1.0) * size for size in self.drop_size)
        number, density = (self.drops, self.drop_density) if self.gain else (0, None)
        return self._parts(
            (2.0, 12.0), True, number=number, density=density, reach=self.drop_depth,
            sizes=(small, large), opacity=1.0, largest=(1.8, 3.0),
        )  # fmt: skip

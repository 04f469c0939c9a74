"""Langer's rain: streaks near the camera, before a texture of the waves that run along the fall.

Others are too fast for the frame rate. A small tile has none that moves: tiles grow with the speed.
"""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from flurries._contract import flag, real
from flurries.effects import checks
from flurries.effects.color import Color
from flurries.effects.field import Field
from flurries.effects.flakes import Flakes
from flurries.effects.knobs import Described, knobs, looks
from flurries.effects.looks import rain_of_rate
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation
from flurries.effects.presets import TENT_RAIN, RainLook
from flurries.effects.texture import Texture
from flurries.effects.veil import Veil
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind
from flurries.spectral.tables import Aliasing
from flurries.spectral.tiles import Blend

_CHECKS = {
    **checks.TENT, "drops": checks.population, "drop_size": checks.sizes,
    "drop_density": checks.optional(lambda name, value: real(name, value, low=0.0, high=1e6)),
    "drop_depth": checks.length, "gain": checks.gain, "renormalise": flag,
}  # fmt: skip


@looks
@knobs("rate", "severity", law=rain_of_rate, apart=("drops", "drop_density"))
@dataclass(frozen=True, kw_only=True)
class TentRain(metaclass=Described):
    """Rain as Langer's texture.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    preset, amount, fall, wind, color, shutter, texture, mean, spread, power, exponent, \
near_depth, overlap, blend, alias, jitter, depth_mode, look, seed, severity
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
        Drops in view between the camera and `drop_depth`; 0 draws none.
    drop_density : float, optional
        Drops per cubic metre, in place of `drops`.
    drop_size : (smallest, largest)
        Diameters in metres.
    drop_depth : float
        Depth in metres up to which drops are drawn.
    gain : float
        Light that a drop scatters, divided by the light that an opaque disc of its size hides. With
        1 the streaks are hardly visible, as those of real drops.
    rate : float, optional
        Rate of rain in mm/h: drizzle 3, rain 10, a downpour 25. Sets `drop_density`, that of the
        drops of `drop_size` in Marshall and Palmer's law, and those of `drop_size`, `fall`,
        `texture`, `mean` and `haze`, the extinction of all drops over 60 m, that are not given.

    Warns
    -----
    UserWarning
        When a frame is rendered whose `tile` is so small that a tenth or more of the streaks stands
        still.

    Notes
    -----
    Langer 2004, sections 5 and 8. ``docs/internals/deviations.md`` says how the size of the
    tile follows from the speed.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    amount: Number = 1.0
    fall: Number = 8.0
    wind: Vector | Wind = (0.56, 0.0, 0.0)
    color: Color = (0.86, 0.88, 0.92)
    haze: Number = 0.08
    shutter: Number = 0.5
    texture: Number = 0.35
    mean: Number = 0.15
    spread: Number = 2.5
    power: Number = 2.0
    exponent: float = 1.0
    wavelengths: tuple[float, float] | None = None
    near_depth: float = 3.5
    tile: int | None = None
    overlap: int | None = None
    blend: Blend = "power"
    alias: Aliasing = "cut"
    renormalise: bool = True
    jitter: bool = False
    depth_mode: checks.DepthMode = "tile"
    drops: int = 4000
    drop_density: float | None = None
    drop_size: tuple[float, float] = (0.0025, 0.004)
    drop_depth: float = 14.0
    gain: float = 30.0
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate: InitVar[float | None] = None

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = TENT_RAIN

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self, _CHECKS)

    @cached_property
    def parts(self) -> Precipitation[Texture]:
        motion = Motion(self.fall, self.wind, self.shutter)
        field = checks.part_of(Field, self, motion=motion, tuned=(2.0, 12.0), streaks=True)
        texture = checks.part_of(Texture, self, field=field, opacity=self.texture)
        # Light goes with the area: a gain is a larger drop, whose streak is as long as ever.
        wider = math.sqrt(self.gain)
        drops = Flakes(
            motion=motion,
            keyed=isinstance(self.amount, Keys),
            number=self.drops,
            density=self.drop_density,
            reach=self.drop_depth,
            sizes=(wider * self.drop_size[0], wider * self.drop_size[1]),
            opacity=1.0,
            # Wider streaks look like smears on the lens.
            largest=(1.8, 3.0),
        )
        return checks.part_of(
            Precipitation, self, name=self.NAME, motion=motion, texture=texture, flakes=drops,
            veil=Veil(self.haze, field.far_depth),
        )  # fmt: skip

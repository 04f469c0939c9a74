"""Langer's snow and rain: near flakes and drops, before a spectral texture of all that lies behind.

Of rain's waves only those that run along the fall are slow enough for the frame rate. A small tile
has none that moves: tiles grow with the speed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from flurries._contract import flag, real
from flurries.effects import checks
from flurries.effects.air import Flakes
from flurries.effects.color import Color
from flurries.effects.field import Field
from flurries.effects.knobs import Described, knobs, looks
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation
from flurries.effects.presets import TENT_RAIN, TENT_SNOW, RainLook, TentSnowLook
from flurries.effects.severity import rate_of
from flurries.effects.texture import Texture
from flurries.effects.veil import Veil
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind
from flurries.particles.sizes import SNOW, Sizes
from flurries.spectral.tables import Aliasing
from flurries.spectral.tiles import Blend

_density: checks.Check = checks.optional(lambda name, value: real(name, value, low=0.0, high=1e6))

# Cubic metres that a lens of 1.2 widths sees of 12 m, the picture as high as wide: for which the
# presets' numbers of flakes in view were tuned.
_TUNED_VIEW = 12.0**3 / (3.0 * 1.2**2)

# How far away the background of rain without a depth stands, metres. The presets' veils are those
# of 55 to 80 m.
_VEILED = 60.0

# The rates, mm/h, of which the presets' drops are about those; and diameters that are drawn, mm.
_RAIN_RATES, _DRAWN_DROPS = (3.0, 10.0, 25.0), (2.5, 4.0)


def _snow_of_rate(turned: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of snow of a liquid-equivalent rate, mm/h, that are not given."""
    rate, known = real("rate", rate_of(turned, "snow")), ("light", "moderate", "heavy")
    sizes, falls = (_tuned(TentSnow, known, name) for name in ("flake_size", "fall"))
    rates = [
        number / _TUNED_VIEW * _flux(size, fall)
        for number, size, fall in zip(_tuned(TentSnow, known, "flakes"), sizes, falls, strict=True)
    ]
    look = {
        name: _between(rate, rates, _tuned(TentSnow, known, name))
        for name in ("texture", "mean", "spread", "exponent", "haze", "fall")
    }
    # So little snow is few flakes.
    look["texture"] *= min(rate / rates[0], 1.0)
    largest = _between(rate, rates, [large for _, large in sizes])
    found = {"flake_size": (sizes[0][0], largest), **look, **given}
    fall = real("fall", found["fall"], above=0.0)
    each = _flux(checks.sizes("flake_size", found["flake_size"]), fall)
    return {**found, "flake_density": rate / each}


def _rain_of_rate(turned: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of rain of a rate, mm/h, that are not given."""
    # All drops are those of Marshall and Palmer 1948, N(D) = 8000 exp(-4.1 R^-0.21 D) per m3 and
    # mm. The largest are drawn, and the veil has the extinction of all, 2 pi/4 D^2 each.
    rate, known = real("rate", rate_of(turned, "rain")), ("drizzle", "rain", "downpour")
    slope = 4.1 * rate**-0.21
    # In light rain the drops are as much smaller as its whole distribution is.
    part = min((rate / 10.0) ** 0.21, 1.0)
    own = given.get("drop_size", tuple(1e-3 * part * size for size in _DRAWN_DROPS))
    low, high = (1e3 * size for size in checks.sizes("drop_size", own))
    number = 8000.0 / slope * (math.exp(-slope * low) - math.exp(-slope * high))
    extinction = 1e-6 * math.pi * 8000.0 / slope**3
    texture, mean = (
        _between(rate, _RAIN_RATES, _tuned(TentRain, known, name)) for name in ("texture", "mean")
    )
    return {
        "drop_density": number,
        "drop_size": own,
        "fall": 9.65 - 10.3 * math.exp(-0.6 * 0.5 * (low + high)),
        "texture": texture * min(rate / _RAIN_RATES[0], 1.0),
        "mean": mean,
        "haze": 1.0 - math.exp(-extinction * _VEILED),
        **given,
    }


def _tuned(kind: Any, presets: Sequence[str], name: str) -> list[Any]:
    """Return a field of some presets."""
    (usual,) = (f.default for f in fields(kind) if f.name == name)
    return [kind.PRESETS[preset].get(name, usual) for preset in presets]


def _between(rate: float, rates: Sequence[float], values: Sequence[float]) -> float:
    """Return a number between those of some rates, by their logarithms."""
    return float(np.interp(math.log(rate), np.log(rates), values))


def _flux(sizes: tuple[float, float], fall: float) -> float:
    """Return the mm/h of one flake per m3, of even sizes in metres that fall alike."""
    low, high = sizes
    law = Sizes(low, 0.5 * (low + high), high)
    return replace(SNOW, speed=np.ones_like).flux(law) * fall


_CHECKS = {
    **checks.TENT, "flakes": checks.population, "flake_density": _density,
    "flake_size": checks.sizes, "flake_opacity": checks.share, "sway": checks.pair,
    "drops": checks.population, "drop_density": _density, "drop_size": checks.sizes,
    "drop_depth": checks.length, "gain": checks.gain, "renormalise": flag,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Tent(metaclass=Described):
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
    severity: InitVar[int | None] = None
    rate: InitVar[float | None] = None

    NAME: ClassVar[str]

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self, _CHECKS)

    def _parts(self, tuned: tuple[float, float], streaks: bool, **near: Any) -> Precipitation:
        motion = Motion(self.fall, self.wind, self.shutter)
        field = checks.part_of(Field, self, motion=motion, tuned=tuned, streaks=streaks)
        flakes = Flakes(motion=motion, keyed=isinstance(self.amount, Keys), **near)
        return checks.part_of(
            Precipitation, self, name=self.NAME, motion=motion, flakes=flakes,
            texture=checks.part_of(Texture, self, field=field, opacity=self.texture),
            veil=Veil(self.haze, field.far_depth),
        )  # fmt: skip


@looks
@knobs("rate", "severity", law=_snow_of_rate, apart=("flakes", "flake_density"))
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
    preset, color, sway, seed, severity
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
        Flakes in view between the camera and `near_depth`; 0 draws none.
    flake_density : float, optional
        Flakes per cubic metre, in place of `flakes`.
    flake_size : (smallest, largest)
        Diameters in metres.
    flake_opacity : float
        Mean opacity over the disc of a flake at rest, 0 to 1; .99 at most is drawn. Keyed.
    look : {"v1"}
        Version of the presets, of `severity` and `rate`, and of how pictures of other sizes look.
    rate : float, optional
        Liquid-equivalent rate of snowfall in mm/h; light snow is less than 1, heavy more than 5.
        Sets `flake_density` to what carries it, and those of `flake_size`, `texture`, `mean`,
        `spread`, `exponent`, `fall` and `haze` that are not given; scene files hold these.

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


@looks
@knobs("rate", "severity", law=_rain_of_rate, apart=("drops", "drop_density"))
@dataclass(frozen=True, kw_only=True)
class TentRain(_Tent):
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
        small, large = (math.sqrt(self.gain) * size for size in self.drop_size)
        return self._parts(
            (2.0, 12.0), True, number=self.drops, density=self.drop_density,
            reach=self.drop_depth, sizes=(small, large), opacity=1.0, largest=(1.8, 3.0),
        )  # fmt: skip

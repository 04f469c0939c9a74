"""Snow made of flakes: one population, drawn near and synthesized far."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import partial
from typing import Any, ClassVar

from flurries.effects.knobs import knobs, looks
from flurries.effects.population import Falling, size_law
from flurries.effects.presets import SNOW_LOOKS, SnowLook
from flurries.effects.strength import solved
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind
from flurries.particles.sizes import SNOW, Matter


@looks
@knobs("rate", "visibility", "severity", law=partial(solved, "snow", SNOW, "flake_size", size_law))
@dataclass(frozen=True, kw_only=True)
class Snow(Falling):
    """Falling snow, made of flakes.

    One population fills the air: near flakes are drawn, far ones are a texture with the phases of
    flakes, and both have the same number, sizes, opacity and motion. Numbers marked "keyed" may
    vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    preset : str, optional
        A look by name, of ``PRESETS``; given fields replace its own.
    density : float
        Flakes per cubic metre. Keyed: as it changes, flakes come and go one by one.
    flake_size : (smallest, mean, largest)
        Diameters in metres, exponentially distributed: many small ones, few large ones.
        Keyed: between two keys the flakes of one size go, one by one, as those of the other come.
    opacity : float
        Mean opacity over the disc of a flake at rest, 0 to 0.99: one of diameter D covers
        ``opacity * pi / 4 * D**2``.
    amount : float
        Share of the flakes that are shown, 0 to 1. Flakes become fewer, not fainter. Keyed.
    emission : float
        Share of the flakes that begin to fall, 0 to 1. Keyed: with keys that end at 0 snow stops
        falling, and flakes that are in the air fall on.
    fall : float, optional
        Fall speed of a flake of the mean size in still air, metres per second; larger ones fall
        faster. If not given, the measured speed of aggregates of this size. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed; or
        :class:`flurries.Wind`, with gusts, swirls and differences over depth.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        Display values, 0 to 1. Keyed. "ambient": 0.9 of the light of the shot's sky, nearly grey,
        the same in all frames. "local": 0.9 of the light from behind and around each flake and
        from outside the picture, mixed in linear light: flakes glow before a lamp.
    haze : float
        Opacity of an even veil beside the flakes, 0 to 1. Keyed.
    shutter : float, optional
        Exposure in frames, 0 to 1 for a usual camera, centred on the frame. Keyed. If not
        given, 0.5, and 1/250 s in a still; see `fps` of :class:`flurries.Scene`.
    sway : (amplitude, rate)
        Amplitude in metres and rate in radians per second. Each near flake swings with a phase of
        its own.
    clumps : float
        Differences of the density over its mean, 0 to 1: in clumps of 3 to 14 m that fall with the
        flakes, and in fronts of 20 to 70 m that the wind drives.
    near, far : float
        Depths in metres between which there are flakes. All that is farther away is seen through
        all of them, whatever its depth.
    backdrop : float, optional
        In a scene without a depth the background is a wall this far away, metres; if not given, it
        lies beyond `far`.
    cloud : float
        Height above the camera in metres at which flakes begin to fall, for `emission`.
    handover : float, optional
        Depth in metres up to which flakes are drawn one by one. If not given, it follows from the
        density and the focal length.
    method : {"flakes", "simulated", "tent", "cone"}
        "simulated" draws every flake one by one, which is slow. "tent" makes a
        :class:`flurries.effects.TentSnow`, "cone" a `ConeSnow`, by looks and fields of these.
    shape : {"natural", "round"}
        Shape of a flake whose image has a sigma above some 4 pixels: "natural" is an aggregate of
        crystals that tumbles as it falls, "round" a round dot like farther flakes.
    look : {"v2"}
        Version of the presets.
    seed : int, optional
        Seed of this effect; the scene's seed if not given.
    severity : int, optional
        1 to 5: rates of .5, 1, 2.5, 5 and 10 mm/h, of rain 2.5, 10, 25, 50 and 100.
    rate : float, optional
        Water that falls, mm/h; of snow when melted. Keyed, and then `density` is.
    visibility : float, optional
        Metres at which a black object keeps 5 % of its contrast. Keyed, and then `density` is. Also
        sets `far` to twice as much, 60 at least, and `backdrop` to 60, unless `far` is given.

    Raises
    ------
    ValueError
        When `rate`, `visibility` and `severity` contradict the density, sizes, opacity and fall
        beside them. All that are given hold, the others follow: ``docs/snow.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.Snow("heavy", wind=(1.0, 0.0, 0.0))
    >>> snow.density > fl.Snow("light").density
    True
    """

    preset: InitVar[SnowLook | None] = field(default=None, kw_only=False)
    density: Number = 30.0
    flake_size: tuple[float, float, float] | Keys = (0.003, 0.007, 0.022)
    wind: Vector | Wind = (0.3, 0.0, 0.0)
    sway: tuple[float, float] = (0.02, 4.0)

    NAME: ClassVar[str] = "snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = SNOW_LOOKS
    MATTER: ClassVar[Matter] = SNOW
    SIZES: ClassVar[str] = "flake_size"
    NATURAL: ClassVar[str] = "aggregate"

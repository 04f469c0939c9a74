"""Snow and rain made of particles: one population each, drawn near and synthesized far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from flurries._contract import Array, real, vector
from flurries._warnings import warn
from flurries.effects import checks
from flurries.effects.bent import moved_by_wind, read_bent
from flurries.effects.color import AMBIENT, LOCAL, PlacedColor, as_color, lamp_shade
from flurries.effects.motion import Motion, plane_motions, product, times
from flurries.effects.notes import Body, Notes, as_bodies, as_ids, as_placed, as_where, depths_of
from flurries.effects.precipitation import Mixture, Precipitation, Veil
from flurries.effects.presets import RAIN_LOOKS, SNOW_LOOKS, RainLook, SnowLook
from flurries.effects.sheets import read_sheets
from flurries.effects.strength import OPACITY, OPAQUE, solved, strength_of
from flurries.effects.weather import Weather
from flurries.frame.layer import Shade
from flurries.frame.needs import Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.lamp import DROPS, FLAKES, Optics
from flurries.motion.keys import Keys, Number, Vector, as_number, as_vector, largest
from flurries.motion.wind import Wind
from flurries.particles.population import Population
from flurries.particles.sizes import RAIN, SNOW, Matter, Sizes

Method: TypeAlias = Literal["flakes", "simulated", "tent", "cone"]
Shape: TypeAlias = Literal["natural", "round"]

_LARGEST_MEAN = 0.2  # Metres: flakes and drops of a larger mean are sizes in another unit.

# Sparse rain shines so much more than the shot, and less by an optical depth over metres: by eye.
THIN, DIMS = 3.0, 390.0


def size_law(name: str, value: object) -> Any:
    """Return (smallest, mean, largest) diameters in metres, plain or keyed, or refuse them."""
    if isinstance(value, Keys):
        if value.width != 3:
            raise ValueError(f"{name} must be keyed with (smallest, mean, largest)")
        for _, part in value.keys:
            size_law(name, part)
        return value
    low, mean, high = vector(name, value, 3).tolist()
    if not (0.0 < low < mean < high or 0.0 < low == mean == high):
        raise ValueError(
            f"{name} must be 0 < smallest < mean < largest in metres, or three times the same, "
            f"got {(low, mean, high)}"
        )
    if mean > _LARGEST_MEAN:
        warn(f"{name} is taken as metres: {low:g}, {mean:g} and {high:g} m are no flakes or drops")
    return low, mean, high


@dataclass(frozen=True, eq=False)
class FlakeTexture:
    """The far flakes of a population, as a part behind its near ones."""

    weather: Weather

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        weather = self.weather
        if not self._covers(frame).any():
            return Needs.none("texture", "all flakes are drawn one by one")
        still = frame.settled and weather.motion.still and not has_keys(weather.emission)
        still = still and weather.notes is None and weather.hangs
        return Needs((Step("texture", once=still),), most=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float) -> Array:
        film, notes = self.weather.film(frame), self.weather.notes
        read = partial(read_sheets if film.rigid else read_bent, self.weather, frame, film, amount)
        return read() if notes is None else notes.thinned(frame, film, read)

    def _covers(self, frame: Frame) -> Any:
        """Return what each layer covers, (L,)."""
        film, notes = self.weather.film(frame), self.weather.notes
        return film.covers if notes is None else film.covers * notes.parts(film)

    def lamp_shade(self, frame: Frame, optics: Optics) -> Shade:
        film = self.weather.film(frame)
        return lamp_shade(frame, film.depths, self._covers(frame), optics)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        film, motion = self.weather.film(frame), self.weather.motion
        weights = self._covers(frame)
        if not weights.any():
            far = np.full(frame.size, np.inf, np.float32)
            return [np.zeros((*frame.size, 2), np.float32) for _ in others], far
        nearness = weights / film.depths
        speed = float(nearness @ film.falls / nearness.sum() / self.weather.mean_speed)
        depth = np.full((1, 1), weights.sum() / nearness.sum(), np.float32)
        mean = replace(motion, fall=times(motion.fall, speed))
        here, *places = mean.places(frame.path, frame.fps, [at.t for at in (frame, *others)])
        moves = plane_motions(depth, frame, others, [np.subtract(at, here) for at in places])
        if motion.varied is not None:
            for move, other in zip(moves, others, strict=True):
                move += moved_by_wind(self.weather, weights, frame, other)
        return moves, np.full(frame.size, weights @ film.depths / weights.sum(), np.float32)


@dataclass(frozen=True, kw_only=True)
class Falling(metaclass=checks.Described):
    """The fields of snow and of rain."""

    density: Number
    opacity: float = OPACITY
    amount: Number = 1.0
    emission: Number = 1.0
    fall: Number | None = None
    wind: Vector | Wind
    color: PlacedColor = "ambient"
    haze: Number = 0.0
    shutter: Number | None = None
    time: Number = 1.0
    turbulence: Number = 1.0
    clumps: float = 0.0
    near: float = 0.4
    far: float = 60.0
    backdrop: float | None = None
    cloud: float = 10.0
    handover: float | None = None
    where: Any = None
    holdout: Any = None
    split: tuple[float, ...] | None = None
    hide: tuple[int, ...] = ()
    place: tuple[tuple[float, ...], ...] = ()
    wakes: tuple[Body, ...] = ()
    method: Method = "flakes"
    shape: Shape = "natural"
    look: str = "v2"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate: InitVar[Number | None] = None
    visibility: InitVar[Number | None] = None

    CHECKS: ClassVar[dict[str, checks.Check]] = {
        "density": partial(as_number, low=0.0, high=1e6), "emission": checks.share,
        "time": partial(as_number, low=-100.0, high=100.0),
        "turbulence": partial(as_number, low=0.0, high=100.0),
        "sway": partial(as_vector, length=2),
        "opacity": lambda name, value: real(name, value, low=0.0, high=OPAQUE),
        "color": lambda _, value: as_color(value, (AMBIENT, LOCAL)), "clumps": checks.part,
        "flake_size": size_law, "drop_size": size_law, "far": checks.length,
        "backdrop": checks.length, "cloud": checks.length, "handover": checks.length,
        "method": checks.one_of(Method), "shape": checks.one_of(Shape),
        "where": as_where, "holdout": as_where, "split": depths_of, "hide": as_ids,
        "place": as_placed, "wakes": as_bodies, "look": checks.one_of(("v2",)),
        "gain": partial(as_number, low=0.0, high=100.0),
    }  # fmt: skip
    NAME: ClassVar[str]
    MATTER: ClassVar[Matter]
    SIZES: ClassVar[str]  # The field of sizes.
    NATURAL: ClassVar[str]  # What large ones are near the camera.
    OPTICS: ClassVar[Optics] = FLAKES

    strength = strength_of

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self)

    @cached_property
    def parts(self) -> Precipitation | Mixture:
        """The parts; of keyed sizes a population for each."""
        wind, sizes = self.wind, getattr(self, self.SIZES)
        if isinstance(wind, Wind) and wind.profile is not None and isinstance(self.emission, Keys):
            # Flakes are there or not by the heights that they fell through.
            raise ValueError("emission: cannot be keyed in a wind with a profile over depth")
        keys = sizes.keys if isinstance(sizes, Keys) else [(0.0, sizes)]
        frames, parts = [frame for frame, _ in keys], []
        ends = [0.0, *(self.split or ()), math.inf]
        places = ("near", *["mid"] * (len(ends) - 3), "far") if self.split else ("",)
        for place, between in reversed([*zip(places, pairwise(ends), strict=True)]):
            for frame, size in keys:
                # 1 at its own key, 0 at the others.
                share = Keys([(other, float(other == frame)) for other in frames])
                amount = product(self.amount, share) if len(frames) > 1 else self.amount
                parts.append(self._made(size, amount, place, between))
        return Mixture(parts) if self.split or isinstance(sizes, Keys) else parts[0]

    def _made(self, size: Any, amount: Number, place: str, between: Any) -> Precipitation:
        said, edges = (self.where, self.hide, self.place, self.wakes), (0.0, *(self.split or ()))
        law, density, most = Sizes.with_mean(*size), self.density, largest(self.density)
        # The air holds as many as there ever are; fewer are shown where the density is less.
        if isinstance(density, Keys):
            amount = product(amount, times(density, 1.0 / most)) if most > 0.0 else 0.0
        speed = self.MATTER.speed
        fall = float(speed(np.array([law.mean]))[0]) if self.fall is None else self.fall
        motion = Motion(fall, self.wind, self.shutter, self.time, self.turbulence)
        air = Population(most, law, self.opacity, speed, self.MATTER.weighed)
        gain = getattr(self, "gain", 1.0)
        weather = checks.part_of(
            Weather, self, population=air, motion=motion,
            sway=getattr(self, "sway", (0.0, 0.0)), simulated=self.method == "simulated",
            shape=self.NATURAL if self.shape == "natural" else "round",
            keyed=isinstance(amount, Keys),
            notes=Notes(*said, between, edges) if any(said) or place else None,
        )  # fmt: skip
        return Precipitation(
            name=f"{self.NAME}.{place}" if place else self.NAME, amount=amount, color=self.color,
            brightness=1.0 + THIN * math.exp(-air.extinction * DIMS) if gain is None else gain,
            optics=self.OPTICS, motion=motion, texture=FlakeTexture(weather), flakes=weather,
            veil=Veil(self.haze if between[1] == math.inf else 0.0, self.far), holdout=self.holdout,
        )  # fmt: skip


@checks.effect("rate", "visibility", "severity", law=solved)
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
        from outside the picture: flakes glow before a lamp.
    haze : float
        Opacity of an even veil beside the flakes, 0 to 1. Keyed.
    shutter : float, optional
        Exposure in frames, 0 to 1 for a usual camera, centred on the frame. Keyed. If not
        given, 0.5, and 1/250 s in a still; see `fps` of :class:`flurries.Scene`.
    time : float
        How fast the time of the weather alone goes: 0.5 is slow motion, 0 stands still, below 0 it
        goes back. Keyed. What is keyed of `fall`, `wind` and `emission` goes by this time.
    turbulence : float
        How fast gusts, swirls and a `field` of :class:`flurries.Wind` change, over their own pace;
        at 0 they stay as they are, and only travel with the wind. Keyed, by the weather's time.
    sway : (amplitude, rate)
        Amplitude in metres and rate in radians per second. Each near flake swings with a phase of
        its own. Keyed.
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
    where : path, array, function, float or effects.Where, optional
        Where there are flakes: shares of 0 to 1 over the picture, see
        :class:`flurries.effects.Where`. Drawn flakes are there or not, by their middles; the
        texture beyond them is thinner.
    holdout : path, array, function, float or effects.Where, optional
        A mask, 1 where this effect alone is hidden: flakes are cut by it, as by a foreground.
    split : sequence of float, optional
        Depths in metres that part the weather into layers, "snow.near", "snow.mid" and "snow.far"
        with ``(3, 12)``: over each other they are the whole.
    hide : sequence of int
        Flakes that are not shown, by their `id` in :func:`flurries.flakes`.
    place : (n, 5) table
        Flakes of your own, drawn at any depth and amount: a row (frame, x, y, z, diameter) says
        where one is in a frame, in metres as `place` of :func:`flurries.flakes` but for gusts. It
        falls, blows and sways as others do.
    wakes : sequence of effects.Body
        Balls and boxes that flakes go around. Up to them flakes are drawn one by one.
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
    sway: Vector = (0.02, 4.0)

    NAME: ClassVar[str] = "snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = SNOW_LOOKS
    MATTER: ClassVar[Matter] = SNOW
    SIZES: ClassVar[str] = "flake_size"
    NATURAL: ClassVar[str] = "aggregate"


@checks.effect("rate", "visibility", "severity", law=solved)
@dataclass(frozen=True, kw_only=True)
class Rain(Falling):
    """Rain, made of drops.

    One population fills the air: near drops are drawn as streaks, far ones are a texture of drops.

    Parameters
    ----------
    preset, density, opacity, amount, emission, fall, wind, haze, shutter, time, turbulence, \
clumps, near, far, backdrop, cloud, handover, where, holdout, split, hide, place, wakes, method, \
look, seed, severity, rate, visibility
        As in :class:`Snow`.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        As in :class:`Snow`. "local" is the light that a drop bends towards the camera, and `gain`
        does not count.
    drop_size : (smallest, mean, largest)
        As `flake_size` of :class:`Snow`.
    gain : float, optional
        Light that a drop sends, divided by `color`. A drop shows the sky ahead, most of it higher
        than what the picture has: under clouds twice as bright as at the horizon. If not given, 2
        where it pours, 4 in thin rain. Keyed.
    shape : {"natural", "round"}
        Shape of a drop near the camera: "natural" is flattened by its fall, with a rim through
        which little light comes; "round" is a round dot.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    density: Number = 700.0
    drop_size: tuple[float, float, float] | Keys = (0.0005, 0.0009, 0.006)
    wind: Vector | Wind = (0.6, 0.0, 0.0)
    gain: Number | None = None

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = RAIN_LOOKS
    MATTER: ClassVar[Matter] = RAIN
    SIZES: ClassVar[str] = "drop_size"
    NATURAL: ClassVar[str] = "drop"
    OPTICS: ClassVar[Optics] = DROPS

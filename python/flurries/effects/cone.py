"""Rain and snow as textures on a double cone around the camera (Wang 2004).

They cost the same however heavy they are, tilt with the camera's motion and stretch with its speed.
Fall, wind, shutter and the size of drops mean what they mean in `Rain` and `Snow`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, ClassVar, TypeVar

import numpy as np

from flurries import cone
from flurries._contract import Array, choice, flag, integer, real, seed_of, vector
from flurries.composite import join
from flurries.effects.coned import Drops, Pose, drawn, way
from flurries.effects.falling import AMBIENT, settled_color
from flurries.effects.limited import veil
from flurries.effects.looks import look_of
from flurries.effects.moving import Moving
from flurries.effects.presets import CONE_RAIN, CONE_SNOW
from flurries.effects.snow import Snow
from flurries.frame.layer import Frame, Layer
from flurries.frame.needs import PARTS, Cost, LeftOut, Needs, Step
from flurries.motion.keys import Number, Vector, as_number, as_vector, value_at
from flurries.motion.wind import Wind
from flurries.trace import stage

_Kind = TypeVar("_Kind", bound="Coned")

# The cones of the four layers, against the first one's.
FARTHEST = 8


@dataclass(frozen=True, kw_only=True)
class Coned(Moving, ABC):
    """What `ConeRain` and `ConeSnow` have in common; the fields are described there."""

    amount: Number = 1.0
    color: Any = 0.98
    haze: Number = 0.04
    shutter: Number = 0.5
    gain: float = 1.0
    conserve: bool = True
    damping: float = 1.0
    radius: float = 3.0
    repeats: int = 5
    slope: float = 0.0
    tile: int = 512
    look: str = "v1"
    seed: int | None = None

    NAME: ClassVar[str] = ""
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {}
    # Of the layers, nearest first: what is large and near must not outshine the rest.
    _GAINS: ClassVar[tuple[float, ...]] = (0.8, 1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        look_of(self.look)
        for name in ("amount", "haze"):
            settle(name, as_number(name, getattr(self, name), low=0.0, high=1.0))
        settle("fall", as_number("fall", self.fall))
        if not isinstance(self.wind, Wind):
            settle("wind", as_vector("wind", self.wind, 3))
        settle("color", settled_color(self.color))
        settle("shutter", as_number("shutter", self.shutter, low=0.0))
        settle("gain", real("gain", self.gain, low=0.0, high=1e4))
        flag("conserve", self.conserve)
        settle("damping", real("damping", self.damping, low=0.0, high=1.0))
        settle("radius", real("radius", self.radius, above=0.0))
        settle("repeats", integer("repeats", self.repeats, low=1, high=64))
        settle("slope", real("slope", self.slope, low=0.0, high=10.0))
        settle("tile", integer("tile", self.tile, low=16, high=2048))
        if self.seed is not None:
            settle("seed", seed_of(self.seed))

    @classmethod
    def preset(cls: type[_Kind], name: str, **changes: Any) -> _Kind:
        """Return a look by name; further arguments replace single values of it."""
        values: dict[str, Any] = dict(cls.PRESETS[choice("preset", name, tuple(cls.PRESETS))])
        unknown = set(changes) - {f.name for f in fields(cls)}
        if unknown:
            raise TypeError(f"{cls.__name__} has no field {sorted(unknown)[0]!r}")
        return cls(**{**values, **changes})

    @property
    @abstractmethod
    def length(self) -> float:
        """Of a drop in still air, metres."""

    @abstractmethod
    def texture(self, seed: int) -> cone.Texture:
        """Return the layers' texture."""

    def state(self, frame: Frame) -> cone.State:
        """Return axis, phase and stretch of a frame."""
        drops = Drops(
            self.fall, self.mean_wind, self.damping, self.shutter, self.length, self.radius,
            self.repeats,
        )  # fmt: skip
        return way(frame.path, frame.fps, drops).at(frame.t / frame.fps)

    def needs(self, frame: Frame) -> Needs:
        """Return what a frame takes: the cone, and what `_near_steps` adds."""
        amount = value_at(self.amount, frame.t)
        haze = amount * value_at(self.haze, frame.t)
        if amount == 0.0:
            return Needs((), (LeftOut(self.NAME, "its amount is 0"),), most=0.0)
        pixels = frame.shape[0] * frame.shape[1]
        part = (frame.window[1] - frame.window[0]) * (frame.window[3] - frame.window[2])
        steps, left_out = [], []
        if self.gain > 0.0:
            cost = Cost({"cone pixel": pixels}, "4 layers", 4 * part, 4 * (pixels - part))
            steps.append(Step("cone", lambda: cost))
        else:
            left_out.append(LeftOut(f"{self.NAME}: cone", "its gain is 0"))
        steps += self._near_steps(frame, amount)
        if not steps and haze == 0.0:
            return Needs((), (LeftOut(self.NAME, "nothing of it has any opacity"),), most=0.0)
        planes = max(len(steps), 1)
        steps.append(Step("join", lambda: Cost({"joined pixel": planes * part}, "", 4 * part)))
        reads = PARTS if self.color == AMBIENT else PARTS - {"ambient"}
        most = 1.0 if len(steps) > 1 else haze
        return Needs(tuple(steps), tuple(left_out), reads, most=most, by_rows=True)

    def _near_steps(self, frame: Frame, amount: float) -> list[Step]:
        """Return the steps of what is drawn one by one in front."""
        return []

    def render(self, frame: Frame) -> Layer:
        """Return this effect's layer of a frame."""
        amount, run = value_at(self.amount, frame.t), frame.running(self)
        near = [
            run("cone", lambda: self._cone(frame, amount)),
            run("flakes", lambda: self._near(frame, amount)),
        ]
        planes = [plane for plane in near if plane is not None]
        haze = amount * value_at(self.haze, frame.t)
        if haze > 0.0 and frame.depth is not None:
            planes.append(veil(haze, frame.crop(frame.depth), FARTHEST * self.radius))
            haze = 0.0
        if not planes:
            top, bottom, left, right = frame.window
            planes.append(np.zeros((bottom - top, right - left), np.float32))
        planes = [np.ascontiguousarray(plane) for plane in planes]
        with stage("join"):
            alpha = join(planes, haze=haze)
        return Layer(self.NAME, alpha, self._color_at(frame))

    def _cone(self, frame: Frame, amount: float) -> Array:
        state = self.state(frame)
        pose = Pose(
            frame.shape, frame.camera, state.axis, state.stretch, self.slope, self.repeats,
            self.radius,
        )  # fmt: skip
        texture = self.texture(frame.seed)
        gains = [amount * self.gain * layer for layer in self._GAINS]
        look = {"gains": gains, "conserve": self.conserve}
        return drawn(self, frame, pose, texture, state.phase, **look)

    def _near(self, frame: Frame, amount: float) -> Array:
        """Return what is drawn one by one in front: nothing, as `_near_steps` says."""
        top, bottom, left, right = frame.window
        return np.zeros((bottom - top, right - left), np.float32)

    def _color_at(self, frame: Frame) -> tuple[float, float, float]:
        if self.color == AMBIENT:
            return frame.ambient or (1.0, 1.0, 1.0)
        color = value_at(self.color, frame.t)
        return (color,) * 3 if isinstance(color, float) else color

    @property
    def _tile_metres(self) -> float:
        """Metres that a tile of the first layer stands for."""
        return 2.0 * math.pi * self.radius / self.repeats


@dataclass(frozen=True, kw_only=True)
class ConeRain(Coned):
    """Rain on a double cone: the cost of a frame does not depend on how heavy it is.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    amount : float
        How much of it all, 0 to 1. Keyed.
    fall : float
        Fall speed, metres per second. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed. Of a
        :class:`flurries.Wind` its mean: a cone has one axis.
    color : float, (r, g, b) or "ambient"
        Display values, 0 to 1. Keyed. "ambient" as in :class:`Snow`.
    haze : float
        Opacity of an even veil, 0 to 1; before a scene with a depth, of the veil before the
        farthest rain. Keyed.
    shutter : float
        Exposure in frames, centred on the frame: how long the streaks are. Keyed: streaks grow and
        shrink about the cone's equator, and drops keep their speed there.
    gain : float
        How many times as much light a drop scatters as an opaque one of its size hides.
    conserve : bool
        Longer streaks are fainter. False keeps them bright.
    drops : int
        In a tile; the farther layers show more of them, as many times as they are smaller.
    drop_size : float
        Width in metres.
    drop_length : float
        Length in metres without any exposure. A streak is
        ``drop_length + speed * shutter / fps`` long.
    spread : float
        How much drops differ in size and opacity, 0 to 1.
    damping : float
        How much of the camera's motion tilts the cone, 0 to 1; 1 is what is seen.
    radius : float
        Of the nearest cone, metres; the others are 2, 4 and 8 times as large.
    repeats : int
        Tiles of the nearest layer around.
    slope : float
        Radius over height of the cone; 0 is a cylinder, in exact perspective.
    tile : int
        Texels of the texture to a side, 16 to 2048.
    seed : int, optional
        Of this effect; the scene's if not given.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Notes
    -----
    Wang 2004, corrected: ``docs/deviations.md``. Two eyes see each layer at its distance.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene((160, 120), "#203040", effects=[fl.ConeRain.preset("downpour")])
    >>> scene.render(17).shape
    (120, 160, 3)
    """

    fall: Number = 8.0
    wind: Vector | Wind = (0.56, 0.0, 0.0)
    color: Any = (0.86, 0.88, 0.92)
    haze: Number = 0.08
    gain: float = 3.0
    drops: int = 700
    drop_size: float = 0.004
    drop_length: float = 0.05
    spread: float = 0.7

    NAME: ClassVar[str] = "cone_rain"
    _GAINS = (0.3, 0.55, 0.8, 1.0)
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = CONE_RAIN

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        settle(self, "drops", integer("drops", self.drops, low=0, high=100_000))
        settle(self, "drop_size", real("drop_size", self.drop_size, above=0.0))
        settle(self, "drop_length", real("drop_length", self.drop_length, above=0.0))
        settle(self, "spread", real("spread", self.spread, low=0.0, high=1.0))
        if self.drop_length > 0.5 * self._tile_metres:
            raise ValueError(
                f"drop_length must be at most half a tile ({0.5 * self._tile_metres:g} m), "
                f"got {self.drop_length!r}"
            )

    @property
    def length(self) -> float:
        """Of a drop in still air, metres."""
        return self.drop_length

    def texture(self, seed: int) -> cone.Texture:
        """Return the layers' texture."""
        metres = self._tile_metres
        return _rain(
            self.tile, seed, self.drops, self.drop_size / metres, self.drop_length / metres,
            self.spread,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ConeSnow(Coned):
    """Snow on a double cone, with flakes that sway in front.

    A texture falls in step; light snow jitters, and the paper leaves it to particles. So do we:
    `flakes` of them fall before the cone, by the same fall and wind.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    amount, wind, color, haze, gain, conserve, damping, radius, repeats, slope, tile, seed
        As in :class:`ConeRain`.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    shutter : float
        Exposure in frames. Keyed.
    texture_flakes : int
        Flakes in a tile of the cone's texture; 0 leaves the cone out.
    flakes : int
        Flakes drawn one by one up to `radius`; 0 draws none.
    flake_size : (smallest, largest)
        Diameters in metres, of both.
    flake_opacity : float
        Of a flake's middle, 0 to 1.
    sway : (amplitude, rate)
        Metres, and radians per second: each flake in front swings on its own.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Notes
    -----
    Wang 2004, corrected: ``docs/deviations.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.ConeSnow.preset("heavy", wind=(1.0, 0.0, 0.0))
    >>> snow.texture_flakes > fl.ConeSnow.preset("light").texture_flakes
    True
    """

    shutter: Number = 0.35
    gain: float = 5.0
    texture_flakes: int = 1500
    flakes: int = 300
    flake_size: tuple[float, float] = (0.008, 0.018)
    flake_opacity: float = 0.9
    sway: tuple[float, float] = (0.06, 2.0)

    NAME: ClassVar[str] = "cone_snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = CONE_SNOW

    def __post_init__(self) -> None:
        super().__post_init__()
        settle = object.__setattr__
        for name in ("texture_flakes", "flakes"):
            settle(self, name, integer(name, getattr(self, name), low=0, high=100_000_000))
        integer("texture_flakes", self.texture_flakes, low=0, high=100_000)
        sizes = vector("flake_size", self.flake_size, 2).tolist()
        if not 0.0 < sizes[0] <= sizes[1]:
            raise ValueError(f"flake_size must be 0 < smallest <= largest, got {tuple(sizes)}")
        settle(self, "flake_size", tuple(sizes))
        opacity = real("flake_opacity", self.flake_opacity, low=0.0, high=1.0)
        settle(self, "flake_opacity", opacity)
        settle(self, "sway", tuple(vector("sway", self.sway, 2).tolist()))

    @property
    def length(self) -> float:
        """Of a flake, metres: its mean diameter."""
        return 0.5 * (self.flake_size[0] + self.flake_size[1])

    def texture(self, seed: int) -> cone.Texture:
        """Return the layers' texture."""
        small, large = self.flake_size
        # A flake's radius is three sigma; the width of a tile's flake is two.
        width = self.length / 3.0 / self._tile_metres
        spread = min(2.0 * (large - small) / (large + small), 1.0)
        return _snow(self.tile, seed, self.texture_flakes, width, spread, self.flake_opacity)

    def _cone(self, frame: Frame, amount: float) -> Array:
        if not self.texture_flakes:
            top, bottom, left, right = frame.window
            return np.zeros((bottom - top, right - left), np.float32)
        return super()._cone(frame, amount)

    def near_snow(self) -> Snow:
        """Return the flakes in front as an effect of their own."""
        return Snow(
            amount=self.amount, fall=self.fall, wind=self.wind, haze=0.0, shutter=self.shutter,
            texture=0.0, near_depth=self.radius, flakes=self.flakes, flake_size=self.flake_size,
            flake_opacity=self.flake_opacity, sway=self.sway,
        )  # fmt: skip

    def _near_steps(self, frame: Frame, amount: float) -> list[Step]:
        if not self.flakes:
            return []
        return [step for step in self.near_snow().needs(frame).steps if step.name == "flakes"]

    def _near(self, frame: Frame, amount: float) -> Array:
        # One that both eyes and all bands ask, since what they share goes by its owner.
        snow = frame.once(self, "snow", self.near_snow)
        return snow.particles(frame, amount)


@lru_cache(maxsize=8)
def _rain(
    size: int, seed: int, drops: int, width: float, length: float, spread: float
) -> cone.Texture:
    return cone.Texture(
        cone.rain_tile(size, seed=seed, drops=drops, width=width, length=length, spread=spread)
    )


@lru_cache(maxsize=8)
def _snow(
    size: int, seed: int, flakes: int, width: float, spread: float, opacity: float
) -> cone.Texture:
    return cone.Texture(
        cone.snow_tile(size, seed=seed, flakes=flakes, width=width, spread=spread, opacity=opacity)
    )

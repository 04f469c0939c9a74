"""Rain and snow as textures on a double cone around the camera (Wang 2004), moved by its way."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from flurries import cone
from flurries._contract import Array, Float64, flag, integer, real
from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.cone.sheet import wrapped
from flurries.effects import checks
from flurries.effects.color import Color
from flurries.effects.drawn import Flakes
from flurries.effects.motion import Motion, air_course, air_motions, rays
from flurries.effects.precipitation import Precipitation, Veil
from flurries.effects.presets import CONE_RAIN, CONE_SNOW, ConeSnowLook, RainLook
from flurries.frame.needs import Needs, Step
from flurries.frame.view import Frame, Lap
from flurries.motion.keys import Keys, Number, Vector
from flurries.motion.wind import Wind

# Below this speed, m/s, the air hardly moves relative to the camera; a cone that turned over there
# would be seen to.
STILL = 0.1

FARTHEST = 8  # The cones of the four layers, against the first one's.


@dataclass(frozen=True, eq=False, kw_only=True)
class DoubleCone:
    """Four layers of one texture."""

    motion: Motion
    make: Callable[..., cone.Texture] | None  # Gives the texture of a seed; None without drops.
    length: float  # Of a drop in still air, metres.
    # Of the layers, nearest first: what is large and near must not outshine the rest.
    gains: tuple[float, ...]
    look: _Cone  # The effect.

    name = "cone"

    def needs(self, frame: Frame, amount: float) -> Needs:
        if self.look.gain == 0.0:
            return Needs.none("cone", "its gain is 0")
        if self.make is None:
            return Needs.none("cone", "it has no flakes")
        return Needs((Step("cone"),), most=1.0)

    def state(self, frame: Frame) -> cone.State:
        path = _path(self, frame.path, frame.fps)
        state, lap = path.at(frame.t / frame.fps), frame.lap
        if lap is None:
            return state
        rest = lap.part(frame.t) * beyond(self, frame.path, frame.fps, lap)[0]
        return replace(state, phase=wrapped(state.phase - rest))

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        way_of, shape = rays(frame), frame.size
        along = way_of @ frame.camera.matrix().T @ np.array(self.state(frame).axis)
        aside = np.sqrt(np.maximum((way_of**2).sum(axis=-1) - along**2, 1e-12))
        nearest = self.look.radius / np.maximum(aside + self.look.slope * np.abs(along), 1e-3)
        depth, through, shown = np.zeros(shape), np.ones(shape), np.zeros(shape)
        for number, gains in enumerate(np.diag(self.gains)):
            alpha = self._drawn(frame, self.look.gain * gains)
            share = through * alpha
            depth += share * nearest * 2.0**number
            shown += share
            through *= 1.0 - alpha
        far = np.where(shown > 1e-6, depth / np.maximum(shown, 1e-6), np.inf)
        motions = air_motions(far, frame, others, fall=self.motion.fall, wind=self.motion.mean_wind)
        return motions, far.astype(np.float32)

    def alpha(self, frame: Frame, amount: float) -> Array:
        return self._drawn(frame, np.array([amount * self.look.gain * gain for gain in self.gains]))

    def _drawn(self, frame: Frame, gains: Float64) -> Array:
        assert self.make is not None
        top, bottom, left, right = frame.window
        state, look = self.state(frame), self.look
        alpha = cone.layers(
            frame.shape, frame.camera, self.make(seed=frame.seed), axis=state.axis,
            phase=state.phase, stretch=state.stretch, slope=look.slope, repeats=look.repeats,
            radius=look.radius, depth=frame.depth, rows=(top, bottom), gains=gains,
            conserve=look.conserve,
        )  # fmt: skip
        return alpha[:, left:right]


@kept(32)
def _path(part: DoubleCone, path: CameraPath, fps: float) -> cone.Path:
    """Return the cone over a whole film; times are seconds."""
    motion, look = part.motion, part.look
    courses = air_course(fps, motion.fall, motion.mean_wind), path.course(fps)
    shutter: Any = motion.shutter
    at, exposures = shutter.columns if isinstance(shutter, Keys) else ([0.0], [shutter])
    # Frames between the first and the last knot, at which the axis is looked at; what lies outside
    # does not change.
    knots = np.concatenate([*(one.knots for one in courses), at, [0.0]])
    frames = np.union1d(np.arange(np.floor(knots.min()), np.ceil(knots.max()) + 1.0), knots)
    # Both sides of every time, since a velocity may jump.
    twice = np.repeat(frames, 2)
    inside = twice + np.tile([-1e-6, 1e-6], len(frames))
    velocity = [course.line(twice, inside)[0] * fps for course in courses]
    return cone.path(
        twice / fps, *velocity, damping=look.damping,
        exposure=np.interp(twice, at, exposures) / fps, length=part.length, radius=look.radius,
        repeats=look.repeats, still=STILL,
    )  # fmt: skip


@kept(32)
def beyond(part: DoubleCone, path: CameraPath, fps: float, lap: Lap) -> tuple[float, float]:
    """Return by how many tiles a round misses a whole number, and how many it passes."""
    states = _path(part, path, fps)
    phases = [states.at(t / fps).phase for t in range(lap.first, lap.end + 1)]
    steps = np.diff(phases)
    passed = float((steps - np.round(steps)).sum())
    # Where anything moves one at least, or rain would stand still.
    least = math.copysign(1.0, passed) if abs(passed) > 1e-6 else 0.0
    return passed - (float(round(passed)) or least), passed


@dataclass(frozen=True, kw_only=True)
class _Cone(metaclass=checks.Described):
    amount: Number = 1.0
    fall: Number = 8.0
    wind: Vector | Wind = (0.56, 0.0, 0.0)
    color: Color = (0.86, 0.88, 0.92)
    haze: Number = 0.08
    shutter: Number = 0.5
    gain: float = 3.0
    conserve: bool = True
    damping: float = 1.0
    radius: float = 3.0
    repeats: int = 5
    slope: float = 0.0
    tile: int = 512
    look: str = "v1"
    seed: int | None = None

    CHECKS: ClassVar[dict[str, checks.Check]] = {
        "conserve": flag, "damping": checks.part, "repeats": partial(integer, low=1, high=64),
        "slope": partial(real, low=0.0, high=10.0), "tile": partial(integer, low=16, high=2048),
        "drops": checks.count, "drop_size": checks.length, "drop_length": checks.length,
        "spread": checks.part, "texture_flakes": checks.count, "flake_opacity": checks.part,
    }  # fmt: skip
    NAME: ClassVar[str]

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self)

    @property
    def _tile_metres(self) -> float:
        """The metres that a tile of the first layer stands for."""
        return 2.0 * math.pi * self.radius / self.repeats

    def _parts(
        self, make: Callable[..., cone.Texture] | None, length: float, gains: tuple[float, ...],
        flakes: Flakes | None = None,
    ) -> Precipitation:  # fmt: skip
        motion = Motion(self.fall, self.wind, self.shutter)
        sheet = DoubleCone(motion=motion, make=make, length=length, gains=gains, look=self)
        return checks.part_of(
            Precipitation, self, name=self.NAME, motion=motion, texture=sheet, flakes=flakes,
            veil=Veil(self.haze, FARTHEST * self.radius, flakes),
        )  # fmt: skip


@checks.effect()
@dataclass(frozen=True, kw_only=True)
class ConeRain(_Cone):
    """Rain on a double cone: the cost of a frame does not depend on how heavy it is.

    Parameters
    ----------
    preset, amount, fall, color, haze, look, seed
        As in :class:`TentSnow`.
    wind : (x, y, z) or Wind
        As there; a :class:`flurries.Wind` counts with its mean velocity, as a cone has one axis.
    shutter : float
        Exposure in frames, centred on the frame: how long the streaks are. Keyed: streaks grow and
        shrink about the cone's equator, and drops keep their speed there.
    gain : float
        Light that a drop scatters, divided by the light that an opaque drop of its size hides.
    conserve : bool
        Longer streaks are fainter. False keeps them bright.
    drops : int
        Drops in a tile of the texture. A farther layer shows the tile smaller and more often.
    drop_size, drop_length : float
        Width and length of a resting drop in metres. A streak is ``drop_length + speed * shutter /
        fps`` long.
    spread : float
        How much drops differ in size and opacity, 0 to 1.
    damping : float
        How much of the camera's motion tilts the cone, 0 to 1; 1 is what is seen.
    radius, repeats : float, int
        Radius of the nearest cone, metres, and the tiles around it; the other cones are 2, 4 and 8
        times as large.
    slope : float
        Radius over height of the cone; 0 is a cylinder, in exact perspective.
    tile : int
        Side of the texture's tile in texels, 16 to 2048.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    drops: int = 700
    drop_size: float = 0.004
    drop_length: float = 0.05
    spread: float = 0.7

    NAME: ClassVar[str] = "cone_rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = CONE_RAIN

    def __post_init__(self, *_: Any) -> None:
        super().__post_init__()
        most = 0.5 * self._tile_metres
        if self.drop_length > most:
            got = f"({most:g} m), got {self.drop_length!r}"
            raise ValueError(f"drop_length must be at most half a tile {got}")

    @cached_property
    def parts(self) -> Precipitation:
        metres = self._tile_metres
        make = partial(
            _texture, cone.rain_tile, self.tile, drops=self.drops, width=self.drop_size / metres,
            length=self.drop_length / metres, spread=self.spread,
        )  # fmt: skip
        return self._parts(make, self.drop_length, (0.3, 0.55, 0.8, 1.0))


@checks.effect()
@dataclass(frozen=True, kw_only=True)
class ConeSnow(_Cone):
    """Snow on a double cone, with flakes that sway in front, since those of a texture move alike.

    Parameters
    ----------
    preset, amount, fall, wind, color, haze, shutter, gain, conserve, damping, radius, repeats, \
slope, tile, look, seed
        As in :class:`ConeRain`.
    texture_flakes : int
        Flakes in a tile of the cone's texture; 0 leaves the cone out.
    flakes : int
        Flakes in view up to the depth `radius`, as `flakes` of :class:`TentSnow`; 0 draws none.
    flake_size : (smallest, largest)
        Diameters in metres, of the flakes in the texture and of those in front.
    flake_opacity : float
        Opacity of a flake, 0 to 1: the mean over the disc of those in front, .99 at most, and that
        of the middle of those in the texture.
    sway : (amplitude, rate)
        As in :class:`Snow`, of the flakes in front.
    """

    preset: InitVar[ConeSnowLook | None] = field(default=None, kw_only=False)
    fall: Number = 1.4
    wind: Vector | Wind = (0.36, 0.0, 0.0)
    color: Color = 0.98
    haze: Number = 0.04
    shutter: Number = 0.35
    gain: float = 5.0
    texture_flakes: int = 1500
    flakes: int = 300
    flake_size: tuple[float, float] = (0.008, 0.018)
    flake_opacity: float = 0.9
    sway: tuple[float, float] = (0.06, 2.0)

    NAME: ClassVar[str] = "cone_snow"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = CONE_SNOW

    @cached_property
    def parts(self) -> Precipitation:
        small, large = self.flake_size
        mean = 0.5 * (small + large)
        # A flake's radius is three sigma; the width of a tile's flake is two.
        make = partial(
            _texture, cone.snow_tile, self.tile, flakes=self.texture_flakes,
            width=mean / 3.0 / self._tile_metres, opacity=self.flake_opacity,
            spread=min(2.0 * (large - small) / (large + small), 1.0),
        )  # fmt: skip
        flakes = Flakes(
            motion=Motion(self.fall, self.wind, self.shutter), keyed=isinstance(self.amount, Keys),
            number=self.flakes, reach=self.radius, sizes=self.flake_size,
            opacity=self.flake_opacity, sway=self.sway,
        )  # fmt: skip
        gains = (0.8, 1.0, 1.0, 1.0)
        return self._parts(make if self.texture_flakes else None, mean, gains, flakes)


@kept(16)
def _texture(make: Callable[..., Array], size: int, *, seed: int, **about: Any) -> cone.Texture:
    return cone.Texture(make(size, seed=seed, **about))

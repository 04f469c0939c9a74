"""A texture on a double cone around the camera (Wang 2004), moved by the camera's way."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries import cone
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.cone.sheet import wrapped
from flurries.effects.motion import Motion, air_course
from flurries.effects.passes import plane_motion, rays
from flurries.frame.needs import Needs, Step
from flurries.frame.view import Frame, Lap
from flurries.motion.keys import Keys

# Below this speed, m/s, the air hardly moves relative to the camera; a cone that turned over there
# would be seen to.
STILL = 0.1

# The cones of the four layers, against the first one's.
FARTHEST = 8


@dataclass(frozen=True, eq=False, kw_only=True)
class DoubleCone:
    """Four layers of one texture; the last six fields are those of `ConeRain` and `ConeSnow`."""

    motion: Motion
    make: Callable[..., cone.Texture] | None  # Gives the texture of a seed; None without drops.
    length: float  # Of a drop in still air, metres.
    # Of the layers, nearest first: what is large and near must not outshine the rest.
    gains: tuple[float, ...]
    gain: float
    conserve: bool
    damping: float
    radius: float
    repeats: int
    slope: float

    name = "cone"

    def needs(self, frame: Frame, amount: float) -> Needs:
        if self.gain == 0.0 or self.make is None:
            why = "its gain is 0" if self.gain == 0.0 else "it has no flakes"
            return Needs.none("cone", why)
        return Needs((Step("cone"),), most=1.0)

    def state(self, frame: Frame) -> cone.State:
        path = _path(self, frame.path, frame.fps)
        state, lap = path.at(frame.t / frame.fps), frame.lap
        if lap is None:
            return state
        rest = lap.part(frame.t) * self.beyond(frame.path, frame.fps, lap)[0]
        return replace(state, phase=wrapped(state.phase - rest))

    def beyond(self, path: CameraPath, fps: float, lap: Lap) -> tuple[float, float]:
        """Return by how many tiles a round misses a whole number, and how many it passes."""
        return _beyond(_path(self, path, fps), fps, lap)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        shape = frame.size
        way_of = rays(frame)
        along = way_of @ frame.camera.matrix().T @ np.array(self.state(frame).axis)
        aside = np.sqrt(np.maximum((way_of**2).sum(axis=-1) - along**2, 1e-12))
        nearest = self.radius / np.maximum(aside + self.slope * np.abs(along), 1e-3)
        depth, through, shown = np.zeros(shape), np.ones(shape), np.zeros(shape)
        for number, gain in enumerate(self.gains):
            gains = np.zeros(len(self.gains))
            gains[number] = self.gain * gain
            alpha = self._drawn(frame, gains)
            share = through * alpha
            depth += share * nearest * 2.0**number
            shown += share
            through *= 1.0 - alpha
        far = np.where(shown > 1e-6, depth / np.maximum(shown, 1e-6), np.inf)
        air: Any = {"fall": self.motion.fall, "wind": self.motion.mean_wind}
        motions = [
            plane_motion(far, frame, other, other.displacement(**air) - frame.displacement(**air))
            for other in others
        ]
        return motions, far.astype(np.float32)

    def alpha(self, frame: Frame, amount: float) -> Array:
        return self._drawn(frame, np.array([amount * self.gain * gain for gain in self.gains]))

    def _drawn(self, frame: Frame, gains: Float64) -> Array:
        assert self.make is not None
        top, bottom, left, right = frame.window
        state = self.state(frame)
        alpha = cone.layers(
            frame.shape, frame.camera, self.make(seed=frame.seed), axis=state.axis,
            phase=state.phase, stretch=state.stretch, slope=self.slope, repeats=self.repeats,
            radius=self.radius, depth=frame.depth, rows=(top, bottom), gains=gains,
            conserve=self.conserve,
        )  # fmt: skip
        return alpha[:, left:right]


@kept(32)
def _path(part: DoubleCone, path: CameraPath, fps: float) -> cone.Path:
    """Return the cone over a whole film; times are seconds."""
    motion = part.motion
    air, camera = air_course(fps, motion.fall, motion.mean_wind), path.course(fps)
    shutter = motion.shutter
    knots = np.union1d(air.knots, camera.knots)
    at: Any = [0.0]
    exposures: Any = [shutter]
    if isinstance(shutter, Keys):
        at, exposures = zip(*shutter.keys, strict=True)
        knots = np.union1d(knots, at)
    # Frames between the first and the last knot, at which the axis is looked at; what lies outside
    # does not change.
    ends = np.array([*knots, 0.0])
    frames = np.union1d(np.arange(np.floor(ends.min()), np.ceil(ends.max()) + 1.0), knots)
    # Both sides of every time, since a velocity may jump.
    twice = np.repeat(frames, 2)
    inside = twice + np.tile([-1e-6, 1e-6], len(frames))
    velocity = [course.line(twice, inside)[0] * fps for course in (air, camera)]
    return cone.path(
        twice / fps, *velocity, damping=part.damping,
        exposure=np.interp(twice, at, exposures) / fps, length=part.length, radius=part.radius,
        repeats=part.repeats, still=STILL,
    )  # fmt: skip


@kept(32)
def _beyond(path: cone.Path, fps: float, lap: Lap) -> tuple[float, float]:
    phases = [path.at(t / fps).phase for t in range(lap.first, lap.end + 1)]
    steps = np.diff(phases)
    passed = float((steps - np.round(steps)).sum())
    whole = float(round(passed))
    # Where anything moves one at least, or rain would stand still.
    if whole == 0.0 and abs(passed) > 1e-6:
        whole = math.copysign(1.0, passed)
    return passed - whole, passed

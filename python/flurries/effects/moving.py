"""What moves the snow and the rain: a fall, a wind, and a camera; the same for waves and flakes.

A wind that differs from place to place moves the rings of waves of each tile by what it does at the
place that they stand for, and flakes by what it does where they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.camera.path import CameraPath, fall_course
from flurries.frame.layer import Frame
from flurries.motion.keys import (
    Course,
    Keys,
    Number,
    Running,
    Vector,
    course_of,
    integral_to,
    summed,
    value_at,
)
from flurries.motion.waves import Waves, carried
from flurries.motion.wind import Wind

# Frames whose sum is kept where nothing closed is known: a film asks for the same ones again.
BLOCK = 64

# Depths at which a profile is integrated for a camera that comes nearer; linear between.
_DEPTHS = 65


@dataclass(frozen=True, kw_only=True)
class Moving:
    """What falls in a wind. The fields are described where they are used, in `Snow` and `Rain`."""

    fall: Number = 1.4
    wind: Vector | Wind = (0.36, 0.0, 0.0)

    @property
    def mean_wind(self) -> Vector:
        """The part of the wind that is the same everywhere."""
        return self.wind.steady if isinstance(self.wind, Wind) else self.wind

    def displacement(self, frame: Frame) -> Float64:
        """Return camera minus air since frame 0 in house axes, (3,) metres, for the mean wind."""
        return frame.displacement(fall=self.fall, wind=self.mean_wind)

    def velocity(self, frame: Frame) -> Float64:
        """Return camera minus flake per frame in house axes, (3,) metres, for the mean wind."""
        return frame.velocity(fall=self.fall, wind=self.mean_wind)

    def spreads(self, frame: Frame) -> bool:
        """Whether the air ever comes nearer or recedes: its flow then differs between tiles."""
        return (
            frame.path.turns
            or frame.path.zooms
            or comes_nearer(frame.path, frame.camera.matrix()[:, 2], self.fall, self.mean_wind)
        )

    def fastest(self, frame: Frame) -> float:
        """Return the largest speed of the camera through the air, metres per frame.

        In the mean wind, at the keys of a film; a bound where keys of several things interleave.
        """
        course = _relative(frame.path, frame.fps, self.fall, self.mean_wind)
        times = np.concatenate([course.knots, [0.0]])
        before = course.line(times, times - 1e-6)[0]
        speeds = np.concatenate([before, course.line(times, times + 1e-6)[0], course.values])
        return float(np.linalg.norm(speeds, axis=1).max())


def comes_nearer(path: CameraPath, axis: Float64, fall: Number, wind: Vector) -> bool:
    winds = wind.keys if isinstance(wind, Keys) else [(0.0, wind)]
    falls = fall.keys if isinstance(fall, Keys) else [(0.0, fall)]
    return (
        path.goes_along(axis)
        or any(np.dot(axis, wind) != 0.0 for _, wind in winds)
        or any(axis[1] * fall != 0.0 for _, fall in falls)
    )


@lru_cache(maxsize=32)
def _relative(path: CameraPath, fps: float, fall: Number, wind: Vector) -> Course:
    """Return camera minus air, house axes, metres per frame."""
    return summed([path.course(fps), course_of(wind, -1.0 / fps), fall_course(fall, -1.0 / fps)])


@lru_cache(maxsize=32)
def _air(fps: float, fall: Number, wind: Vector) -> Course:
    return summed([course_of(wind, 1.0 / fps), fall_course(fall, 1.0 / fps)])


@lru_cache(maxsize=32)
def _camera(path: CameraPath, fps: float) -> Course:
    return path.course(fps)


# What a wind that differs does to a tile's rings, beyond its mean --------------------------------


def of_rings(effect: Moving, frame: Frame, ahead: Float64) -> tuple[Float64, Float64]:
    """Return how the air at places of the view has moved and moves beyond the mean wind.

    Parameters
    ----------
    ahead : (..., 3)
        Places in the eye's axes, metres.

    Returns
    -------
    displacement, velocity : (..., 3)
        Metres since frame 0 and metres per frame, in the eye's axes.
    """
    wind = effect.wind
    assert isinstance(wind, Wind)
    points = np.ascontiguousarray(ahead.reshape(-1, 3))
    moved, rate = _profiled(wind, frame, points[:, 2])
    if wind.waves is not None:
        world = frame.path.place(frame.t, fps=frame.fps) + points @ frame.camera.matrix().T
        now = _phasor(wind, frame, frame.t)
        if frame.path.turns:
            rate = rate + frame.to_camera(wind.waves.at(world, now))
            depths, which = np.unique(points[:, 2], return_inverse=True)
            moved = moved + _seen_turning(wind, frame, depths)[which]
        else:
            parts = carried(wind.waves, _camera(frame.path, frame.fps), frame.fps)
            both = wind.waves.at(world, _summed(wind, frame, *parts), now)
            moved = moved + frame.to_camera(both[:, :3])
            rate = rate + frame.to_camera(both[:, 3:])
    return moved.reshape(ahead.shape), rate.reshape(ahead.shape)


def _phasor(wind: Wind, frame: Frame, time: float) -> npt.NDArray[np.complex128]:
    """Return what the waves' amplitudes are multiplied by at a time, for metres per frame."""
    assert wind.waves is not None
    turned = np.exp(-1j * wind.waves.omega * time / frame.fps) / frame.fps
    return np.asarray(turned, np.complex128)


def _summed(wind: Wind, frame: Frame, way: Running, waves: Running) -> npt.NDArray[np.complex128]:
    """Return what the amplitudes are multiplied by for the way of what is at a place now."""
    assert wind.waves is not None
    parts = waves.to(frame.t)
    half = len(parts) // 2
    back = np.exp(-1j * (wind.waves.k @ way.to(frame.t)))
    factor = (parts[:half] + 1j * parts[half:]) * back / frame.fps
    return np.asarray(factor, np.complex128)


def _seen_turning(wind: Wind, frame: Frame, depths: Float64) -> Float64:
    """Return the displacement of the air straight ahead of a camera that turns, (n, 3).

    In the eye's turning axes, summed over the frames: what tiles aside see differs from it by what
    the wind differs between there and the middle.
    """
    assert wind.waves is not None
    mount = frame.path.rig(frame.t).T @ frame.camera.matrix()
    # Turned back by a frame's own orientation it has lost some bits: the mount is one for a film.
    view = _View(wind.waves, frame.path, frame.fps, np.round(mount, 12).tobytes(), depths.tobytes())
    whole = math.trunc(frame.t)
    sign = -1 if frame.t < 0.0 else 1
    blocks, rest = divmod(abs(whole), BLOCK)
    total = np.zeros((len(depths), 3))
    for number in range(blocks):
        total += _block(view, sign, number)
    for number in range(blocks * BLOCK, blocks * BLOCK + rest):
        total += sign * view.seen(sign * (number + 0.5))
    part = frame.t - whole
    return np.asarray(total + part * view.seen(whole + 0.5 * part) if part else total)


class _View(NamedTuple):
    """What a camera that turns sees of waves, straight ahead at some depths."""

    waves: Waves
    path: CameraPath
    fps: float
    mount: bytes
    depths: bytes

    def seen(self, time: float) -> Float64:
        """Return the velocity of the air there, (n, 3) metres per frame in the eye's axes."""
        depths = np.frombuffer(self.depths)
        turn = self.path.rig(time) @ np.frombuffer(self.mount).reshape(3, 3)
        world = self.path.place(time, fps=self.fps) + depths[:, None] * turn[:, 2]
        now = np.exp(-1j * self.waves.omega * time / self.fps) / self.fps
        return np.asarray(self.waves.at(world, np.asarray(now, np.complex128)) @ turn)


@lru_cache(maxsize=4096)
def _block(view: _View, sign: int, number: int) -> Float64:
    """Return the sum over a block of whole frames, by their middles."""
    first = number * BLOCK
    return np.asarray(sum(sign * view.seen(sign * (first + step + 0.5)) for step in range(BLOCK)))


def _profiled(wind: Wind, frame: Frame, depth: Float64) -> tuple[Float64, Float64]:
    """Return what the profile does at fixed depths (n,): displacement and velocity, (n, 3)."""
    if wind.profile is None:
        return np.zeros((len(depth), 3)), np.zeros((len(depth), 3))
    require_still_axes(frame)
    factor, own = wind.extra(depth)
    steady = wind.steady
    mean = integral_to(steady, frame.t) / frame.fps
    now = np.array(value_at(steady, frame.t)) / frame.fps
    moved = factor[:, None] * mean + own * (frame.t / frame.fps)
    return _across(frame, moved), _across(frame, factor[:, None] * now + own / frame.fps)


def _across(frame: Frame, vectors: Float64) -> Float64:
    """Return house axes turned into the eye's, without the part along the view."""
    turned = frame.to_camera(vectors)
    turned[:, 2] = 0.0
    return turned


def require_still_axes(frame: Frame) -> None:
    """Refuse a profile for a camera that turns: what is behind what would change."""
    if frame.path.turns:
        raise ValueError("wind: a profile over depth needs a camera that does not turn")


# What it does to flakes --------------------------------------------------------------------------


def profile_of_flakes(effect: Moving, frame: Frame, depth: Float64) -> tuple[Float64, Float64]:
    """Return displacement and velocity of flakes at depths (n,) by the profile, (n, 3) eye's axes.

    A flake that comes nearer has felt the wind of every depth that it came through.
    """
    wind = effect.wind
    assert isinstance(wind, Wind)
    moved, rate = _profiled(wind, frame, depth)
    axis = frame.camera.matrix()[:, 2]
    if wind.profile is None or not comes_nearer(frame.path, axis, effect.fall, effect.mean_wind):
        return moved, rate
    course = _relative(frame.path, frame.fps, effect.fall, effect.mean_wind)
    way = _way(course)
    nearer = float(way.to(frame.t) @ axis)
    # Where the air at these depths was before: depth plus the camera's way through it is kept.
    nodes = np.linspace(min(float(depth.min()), 0.0), float(depth.max()), _DEPTHS)
    times, steps = _middles(frame.t)
    was = nodes + nearer - (np.stack([way.to(time) for time in times]) @ axis)[:, None]
    factor, own = wind.extra(was.ravel())
    mean = np.stack([value_at(effect.mean_wind, time) for time in times])
    felt = factor.reshape(was.shape)[..., None] * mean[:, None] + own.reshape(*was.shape, 3)
    total = np.einsum("t,tni->ni", steps, felt) / frame.fps
    total = _across(frame, total)
    return np.stack([np.interp(depth, nodes, total[:, a]) for a in range(3)], axis=1), rate


def _middles(t: float) -> tuple[Float64, Float64]:
    """Return the middles of the frames from 0 to `t`, the last a part of one, and their lengths."""
    whole = math.trunc(t)
    sign = -1.0 if t < 0.0 else 1.0
    times = sign * (np.arange(abs(whole)) + 0.5)
    return np.append(times, 0.5 * (whole + t)), np.append(np.full(abs(whole), sign), t - whole)


@lru_cache(maxsize=32)
def _way(course: Course) -> Running:
    def ways(start: Float64, end: Float64, inside: Float64) -> Float64:
        values, _ = course.line(0.5 * (start + end), inside)
        return np.asarray(values * (end - start)[:, None])

    return Running.of(ways, course.knots)


def waves_of_flakes(effect: Moving, frame: Frame, points: Float64) -> tuple[Float64, Float64]:
    """Return displacement and velocity of flakes at places (n, 3) by gusts and swirls.

    Everything in the eye's axes; the places are those without them.
    """
    wind = effect.wind
    assert isinstance(wind, Wind) and wind.waves is not None
    world = frame.path.place(frame.t, fps=frame.fps) + points @ frame.camera.matrix().T
    parts = carried(wind.waves, _air(frame.fps, effect.fall, effect.mean_wind), frame.fps)
    both = wind.waves.at(world, _summed(wind, frame, *parts), _phasor(wind, frame, frame.t))
    return frame.to_camera(both[:, :3]), frame.to_camera(both[:, 3:])

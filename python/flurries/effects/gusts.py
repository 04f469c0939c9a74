"""What a wind that differs from place to place does beyond its mean: to waves, and to flakes.

It moves the rings of waves of each tile by what it does at the place that they stand for, and
flakes by what it does where they are. All displacements are metres since frame 0 and all velocities
metres per frame, in the eye's axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.camera.path import CameraPath
from flurries.effects.motion import (
    Motion,
    air_course,
    camera_course,
)
from flurries.frame.view import Frame
from flurries.motion.keys import Course, Integral, course_of, integral_to, value_at
from flurries.motion.waves import Waves, carry
from flurries.motion.wind import Wind

_Complex = npt.NDArray[np.complex128]

# Frames whose sum is kept where nothing closed is known: a film asks for the same ones again.
BLOCK = 64

# Frames that the integral of a profile takes together.
_TOGETHER = 4096


def wind_at(motion: Motion, frame: Frame, ahead: Float64) -> tuple[Float64, Float64]:
    """Return the air's way and velocity at places of the view beyond the mean wind.

    Parameters
    ----------
    ahead : (..., 3)
        Places in the eye's axes, metres.

    Returns
    -------
    displacement, velocity : (..., 3)
    """
    wind = _varied(motion)
    points = np.ascontiguousarray(ahead.reshape(-1, 3))
    moved, rate = _profile_at(wind, frame, points[:, 2])
    if wind.waves is not None:
        world = frame.path.place(frame.t, fps=frame.fps) + points @ frame.camera.matrix().T
        now = _phasor(wind.waves, frame, frame.t)
        if frame.path.turns:
            rate = rate + frame.to_camera(wind.waves.at(world, now))
            depths, which = np.unique(points[:, 2], return_inverse=True)
            moved = moved + _ahead_while_turning(wind.waves, frame, depths)[which]
        else:
            parts = carry(wind.waves, camera_course(frame.path, frame.fps), frame.fps)
            both = wind.waves.at(world, _way_phasor(wind.waves, frame, *parts), now)
            moved = moved + frame.to_camera(both[:, :3])
            rate = rate + frame.to_camera(both[:, 3:])
    return moved.reshape(ahead.shape), rate.reshape(ahead.shape)


def wave_weights(motion: Motion, fps: float, times: Sequence[float], start: Float64) -> Float64:
    """Return what gusts and swirls have done to flakes at some frames, as sums of waves, metres.

    Parameters
    ----------
    times : sequence of float
        Frame numbers.
    start : (3,)
        The place in the flakes' air that places are counted from.

    Returns
    -------
    (m, 6 n) float64
        The displacement at x from there is the sum over waves of ``re cos(k . x) - im sin(k . x)``,
        three numbers for each frame: the real parts, then the imaginary ones.
    """
    waves = _varied(motion).waves
    assert waves is not None
    _, sums = carry(waves, air_course(fps, motion.fall, motion.mean_wind), fps)
    there = np.exp(1j * (waves.k @ start)) / fps
    parts = []
    for t in times:
        found = sums.to(t)
        half = len(found) // 2
        parts.append(waves.a * ((found[:half] + 1j * found[half:]) * there)[:, None])
    weights = np.concatenate(parts, axis=1)
    return np.ascontiguousarray(np.concatenate([weights.real, weights.imag], axis=1))


def carried_by_profile(
    motion: Motion, path: CameraPath, fps: float, t: float, ahead: Float64
) -> Float64:
    """Return how far a wind of depth has carried flakes since frame 0, (n, 2) metres, x and y.

    Parameters
    ----------
    ahead : (n,)
        Where they are at the frame: along the house's z from the camera's place, metres. The depth
        of the wind is counted from the camera's place at frame 0.
    """
    wind, steady = _varied(motion), motion.mean_wind
    depth = ahead + (path.place(t, fps=fps)[2] - path.place(0.0, fps=fps)[2])
    blowing, course = course_of(steady), air_course(fps, motion.fall, steady)
    if not (course.values[:, 2].any() or _slopes(course).any()):
        factor, own = wind.extra(depth)
        moved = factor[:, None] * (integral_to(steady, t) / fps) + own * (t / fps)
        return np.asarray(moved[:, :2])
    # One that comes nearer has felt the wind of every depth that it came through.
    way = _way_of(course)
    nearer = float(way.to(t)[2])
    felt = np.zeros((len(depth), 3))
    for times, lengths in _middles(t):
        was = depth + (way.at(times)[:, 2] - nearer)[:, None]
        factor, own = wind.extra(was.ravel())
        mean, _ = blowing.line(times, times)
        felt += np.einsum("t,tn,ta->na", lengths, factor.reshape(was.shape), mean)
        felt += np.einsum("t,tna->na", lengths, own.reshape(*was.shape, 3))
    return np.asarray(felt[:, :2] / fps)


def _slopes(course: Course) -> Float64:
    return np.zeros(1) if course.slopes is None else course.slopes[:, 2]


def _varied(motion: Motion) -> Wind:
    assert isinstance(motion.wind, Wind)
    return motion.wind


def _phasor(waves: Waves, frame: Frame, time: float) -> _Complex:
    """Return the factors of the waves' amplitudes at a time, for metres per frame."""
    turned = np.exp(-1j * waves.omega * time / frame.fps) / frame.fps
    return np.asarray(turned, np.complex128)


def _way_phasor(waves: Waves, frame: Frame, way: Integral, sums: Integral) -> _Complex:
    """Return the factors of the amplitudes for the way of a flake that is at a place now."""
    parts = sums.to(frame.t)
    half = len(parts) // 2
    back = np.exp(-1j * (waves.k @ way.to(frame.t)))
    return np.asarray((parts[:half] + 1j * parts[half:]) * back / frame.fps, np.complex128)


def _ahead_while_turning(waves: Waves, frame: Frame, depths: Float64) -> Float64:
    """Return the displacement of the air straight ahead of a camera that turns, (n, 3).

    In the eye's turning axes, summed over the frames: what tiles aside see differs from it by what
    the wind differs between there and the middle.
    """
    mount = frame.path.rig(frame.t).T @ frame.camera.matrix()
    # Turned back by a frame's own orientation it has lost some bits: the mount is one for a film.
    view = _View(waves, frame.path, frame.fps, np.round(mount, 12).tobytes(), depths.tobytes())
    whole = math.trunc(frame.t)
    sign = -1 if frame.t < 0.0 else 1
    blocks, rest = divmod(abs(whole), BLOCK)
    total = np.zeros((len(depths), 3))
    for number in range(blocks):
        total += _block(view, sign, number)
    for number in range(blocks * BLOCK, blocks * BLOCK + rest):
        total += sign * view.velocity(sign * (number + 0.5))
    part = frame.t - whole
    return np.asarray(total + part * view.velocity(whole + 0.5 * part) if part else total)


class _View(NamedTuple):
    """The waves before a camera that turns, straight ahead at some depths."""

    waves: Waves
    path: CameraPath
    fps: float
    mount: bytes
    depths: bytes

    def velocity(self, time: float) -> Float64:
        """Return the velocity of the air there, (n, 3)."""
        depths = np.frombuffer(self.depths)
        turn = self.path.rig(time) @ np.frombuffer(self.mount).reshape(3, 3)
        world = self.path.place(time, fps=self.fps) + depths[:, None] * turn[:, 2]
        now = np.exp(-1j * self.waves.omega * time / self.fps) / self.fps
        return np.asarray(self.waves.at(world, np.asarray(now, np.complex128)) @ turn)


@lru_cache(maxsize=4096)
def _block(view: _View, sign: int, number: int) -> Float64:
    """Return the sum over a block of whole frames, by their middles."""
    middles = (sign * (number * BLOCK + step + 0.5) for step in range(BLOCK))
    return np.asarray(sum(sign * view.velocity(middle) for middle in middles))


def _profile_at(wind: Wind, frame: Frame, depth: Float64) -> tuple[Float64, Float64]:
    """Return the profile's displacement and velocity at fixed depths (n,), each (n, 3)."""
    if wind.profile is None:
        return np.zeros((len(depth), 3)), np.zeros((len(depth), 3))
    if frame.path.turns:
        # What is behind what would change.
        raise ValueError("wind: a profile over depth needs a camera that does not turn")
    factor, own = wind.extra(depth)
    mean = integral_to(wind.steady, frame.t) / frame.fps
    now = np.array(value_at(wind.steady, frame.t)) / frame.fps
    moved = factor[:, None] * mean + own * (frame.t / frame.fps)
    return _across(frame, moved), _across(frame, factor[:, None] * now + own / frame.fps)


def _across(frame: Frame, vectors: Float64) -> Float64:
    """Return house axes turned into the eye's, without the part along the view."""
    turned = frame.to_camera(vectors)
    turned[:, 2] = 0.0
    return turned


def _middles(t: float) -> Iterator[tuple[Float64, Float64]]:
    """Yield the middles of the frames from 0 to `t`, the last a part of one, and their lengths.

    So many at a time as take little memory, however long the film is.
    """
    whole = math.trunc(t)
    sign = -1.0 if t < 0.0 else 1.0
    for first in range(0, abs(whole), _TOGETHER):
        numbers = np.arange(first, min(first + _TOGETHER, abs(whole)), dtype=np.float64)
        yield (numbers + 0.5) * sign, np.full(len(numbers), sign)
    yield np.array([0.5 * (whole + t)]), np.array([t - whole])


@lru_cache(maxsize=32)
def _way_of(course: Course) -> Integral:
    def ways(start: Float64, end: Float64, inside: Float64) -> Float64:
        values, _ = course.line(0.5 * (start + end), inside)
        return np.asarray(values * (end - start)[:, None])

    return Integral.of(ways, course.knots)

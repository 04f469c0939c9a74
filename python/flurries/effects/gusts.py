"""What a wind that differs from place to place does beyond its mean: to waves, and to flakes.

It moves the rings of waves of each tile by what it does at the place that they stand for, and
flakes by what it does where they are. All displacements are metres since frame 0 and all velocities
metres per frame, in the eye's axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.effects.motion import Motion, air_course
from flurries.frame.view import Frame
from flurries.motion.keys import course_of, integral_of, integral_to, value_at
from flurries.motion.waves import Waves, carry
from flurries.motion.wind import Wind

# Frames that the integral of a profile takes together.
_TOGETHER = 4096

_way_of = kept(32)(integral_of)


def wind_at(motion: Motion, frame: Frame, ahead: Float64) -> tuple[Float64, Float64]:
    """Return the air's way and velocity beyond the mean wind at places (..., 3), eye's axes."""
    wind = _varied(motion)
    if wind.profile is not None and frame.path.turns:
        # What is behind what would change.
        raise ValueError("wind: a profile over depth needs a camera that does not turn")
    points = np.ascontiguousarray(ahead.reshape(-1, 3))
    moved, rate = _profile_at(wind, frame, points[:, 2])
    if wind.waves is not None:
        waves, path, fps = wind.waves, frame.path, frame.fps
        world = path.place(frame.t, fps=fps) + points @ frame.camera.matrix().T
        now = np.exp(-1j * waves.omega * frame.t / fps) / fps
        # Of the flake that is at the place now.
        way, sums = carry(waves, path.course(fps), fps)
        back = np.exp(-1j * (waves.k @ way.to(frame.t)))
        both = waves.at(world, np.asarray(_complex(sums.to(frame.t)) * back / fps), now)
        moved = moved + frame.to_camera(both[:, :3])
        rate = rate + frame.to_camera(both[:, 3:])
    return moved.reshape(ahead.shape), rate.reshape(ahead.shape)


def wave_weights(motion: Motion, fps: float, times: Sequence[float], start: Float64) -> Float64:
    """Return what gusts and swirls have done to flakes at n frames, as sums of waves, (m, 6 n)."""
    waves = _varied(motion).waves
    assert waves is not None
    _, sums = carry(waves, air_course(fps, motion.fall, motion.mean_wind), fps)
    there = np.exp(1j * (waves.k @ start)) / fps
    parts = [waves.a * (_complex(sums.to(motion.now(t))) * there)[:, None] for t in times]
    weights = np.concatenate(parts, axis=1)
    return np.ascontiguousarray(np.concatenate([weights.real, weights.imag], axis=1))


@kept(32)
def cycles_of(waves: Waves) -> Float64:
    """Return the waves' vectors in cycles per metre, (m, 3)."""
    return np.ascontiguousarray(waves.k / (2.0 * np.pi))


def carried_by_profile(
    motion: Motion, path: CameraPath, fps: float, t: float, ahead: Float64
) -> Float64:
    """Return how far a wind of depth has carried flakes since frame 0, (n, 2) metres, x and y."""
    wind, steady = _varied(motion), motion.mean_wind
    depth = ahead + (path.place(t, fps=fps)[2] - path.place(0.0, fps=fps)[2])
    course, t = air_course(fps, motion.fall, steady), motion.now(t)
    bends = course.slopes is not None and course.slopes[:, 2].any()
    if not (course.values[:, 2].any() or bends):
        factor, own = wind.extra(depth)
        moved = factor[:, None] * (integral_to(steady, t) / fps) + own * (t / fps)
        return np.asarray(moved[:, :2])
    # One that comes nearer has felt the wind of every depth that it came through.
    way, blowing = _way_of(course), course_of(steady)
    nearer = float(way.to(t)[2])
    felt = np.zeros((len(depth), 3))
    for times, lengths in _middles(t):
        was = depth + (way.at(times)[:, 2] - nearer)[:, None]
        factor, own = wind.extra(was.ravel())
        mean, _ = blowing.line(times, times)
        felt += np.einsum("t,tn,ta->na", lengths, factor.reshape(was.shape), mean)
        felt += np.einsum("t,tna->na", lengths, own.reshape(*was.shape, 3))
    return np.asarray(felt[:, :2] / fps)


def _varied(motion: Motion) -> Wind:
    assert isinstance(motion.wind, Wind)
    return motion.wind


def _complex(parts: Float64) -> Any:
    """Return numbers whose real parts come first, then their imaginary ones."""
    half = len(parts) // 2
    return parts[:half] + 1j * parts[half:]


def _profile_at(wind: Wind, frame: Frame, depth: Float64) -> tuple[Float64, Float64]:
    """Return the profile's displacement and velocity at fixed depths (n,), each (n, 3)."""
    if wind.profile is None:
        return np.zeros((len(depth), 3)), np.zeros((len(depth), 3))
    factor, own = wind.extra(depth)
    mean = integral_to(wind.steady, frame.t) / frame.fps
    now = np.array(value_at(wind.steady, frame.t)) / frame.fps
    moved = frame.to_camera(factor[:, None] * mean + own * (frame.t / frame.fps))
    rate = frame.to_camera(factor[:, None] * now + own / frame.fps)
    # Without the part along the view.
    moved[:, 2] = rate[:, 2] = 0.0
    return moved, rate


def _middles(t: float) -> Iterator[tuple[Float64, Float64]]:
    """Yield the middles of the frames from 0 to `t`, the last a part of one, and their lengths."""
    whole = math.trunc(t)
    sign = -1.0 if t < 0.0 else 1.0
    for first in range(0, abs(whole), _TOGETHER):
        numbers = np.arange(first, min(first + _TOGETHER, abs(whole)), dtype=np.float64)
        yield (numbers + 0.5) * sign, np.full(len(numbers), sign)
    yield np.array([0.5 * (whole + t)]), np.array([t - whole])

"""Plane waves of velocity, and how far they carry what goes a known way through them.

u(x, t) = Re sum a exp(i (k . x - w t)), each a across its k, so that no air is made or lost. What
is carried along a way q(t) is displaced by Re sum a exp(i k . (x - q(t))) I(t), I(t) the integral
of exp(i (k . q - w t)): one complex number for each wave and time, for all flakes alike.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64, uniforms
from flurries._kept import kept
from flurries.motion.keys import Course, Integral, Keys, Number, course_of, integral_of, sum_of

WAVES = 24  # Waves of the gusts and of the swirls, each.

# Points of Gauss and Legendre in a frame, where the speed of the wind changes.
_NODES, _WEIGHTS = (0.5 * part for part in np.polynomial.legendre.leggauss(8))


@dataclass(frozen=True, eq=False)
class Waves:
    """Plane waves of velocity: Re sum a exp(i (k . x - omega t))."""

    k: Float64  # (m, 3) radians per metre.
    omega: Float64  # (m,) radians per second.
    a: npt.NDArray[np.complex128]  # (m, 3) metres per second.
    own: Float64  # (m,) rad/s: the part of omega by which each changes, and does not travel.

    def at(self, points: Float64, *factors: npt.NDArray[np.complex128]) -> Float64:
        """Return Re sum a factor exp(i k . x) at points (n, 3), one after the other: (n, 3 f)."""
        weights = np.concatenate([self.a * factor[:, None] for factor in factors], axis=1)
        result = np.empty((len(points), weights.shape[1]))
        parts = np.concatenate([weights.real, weights.imag], axis=1)
        cycles = self.k / (2.0 * np.pi)
        _core.wind_waves(result, np.ascontiguousarray(points), cycles, parts)
        return result


def eddies(
    speed: float, sizes: tuple[float, float], turnover: float, mean: Any, seed: int, stream: int
) -> Waves:
    """Return solenoidal waves of random directions whose speed squared has the mean speed^2."""
    draws = np.stack([uniforms(seed, stream + row, WAVES) for row in range(5)])
    # Lengths evenly spread over the octaves, so that every seed has its share of each.
    share = (np.arange(WAVES) + draws[0]) / WAVES
    length = sizes[0] * (sizes[1] / sizes[0]) ** share
    # Directions of half the sphere, upwards: a wave and its opposite are the same.
    up, around = draws[1], 2.0 * np.pi * draws[2]
    flat = np.sqrt(1.0 - up**2)
    unit = np.stack([flat * np.cos(around), -up, flat * np.sin(around)], axis=1)
    k = 2.0 * np.pi / length[:, None] * unit
    # Two directions across k, and one between them.
    side = np.stack([-np.sin(around), np.zeros(WAVES), np.cos(around)], axis=1)
    other = np.cross(unit, side)
    angle = 2.0 * np.pi * draws[3][:, None]
    across = np.cos(angle) * side + np.sin(angle) * other
    own = turnover * speed * 2.0 * np.pi / length
    amplitude = speed * math.sqrt(2.0 / WAVES) * np.exp(2j * np.pi * draws[4])
    return Waves(k, k @ np.array(mean) + own, across * amplitude[:, None], own)


def strongest(field: Float64, spacing: float, duration: float, modes: int) -> Waves:
    """Return the strongest waves of a periodic field, without its mean."""
    given = field if field.ndim == 5 else field[None]
    count = given.shape[:4]
    spectrum = np.fft.fftn(given, axes=(0, 1, 2, 3)) / np.prod(count)
    turns = [2.0 * np.pi * np.fft.fftfreq(n, step) for n, step in
             zip(count, (duration / count[0], *3 * (spacing,)), strict=True)]  # fmt: skip
    omega, kz, ky, kx = np.meshgrid(*turns, indexing="ij")
    k = np.stack([kx, ky, kz], axis=-1).reshape(-1, 3)
    # exp(i (k x + w t)) of the transform is exp(i (k x - omega t)) here.
    omega = -omega.ravel()
    a = spectrum.reshape(-1, 3)
    # What is the same everywhere and always belongs to the mean.
    a[0] = 0.0
    power = np.sum(np.abs(a) ** 2, axis=1)
    # Of a wave and its mirror, the bin -k, one is kept, twice as strong.
    grids = np.meshgrid(*[(-np.arange(n)) % n for n in count], indexing="ij")
    mirror = np.ravel_multi_index([g.ravel() for g in grids], count)
    a = np.where((mirror == np.arange(len(power)))[:, None], a, 2.0 * a)
    order = [i for i in np.argsort(-power, kind="stable") if i <= mirror[i] and power[i] > 0.0]
    chosen = np.array(order[:modes], dtype=np.intp)
    return Waves(k[chosen], omega[chosen], a[chosen], omega[chosen])


@kept(32)
def paced(waves: Waves, course: Course, fps: float, pace: Number) -> tuple[Waves, Course]:
    """Return waves that change at a pace, and a course, with what has changed as a fourth axis."""
    keys = pace.keys if isinstance(pace, Keys) else [(0.0, pace)]
    fourth = course_of(Keys([(frame, (0.0, 0.0, 0.0, value)) for frame, value in keys]), 1.0 / fps)
    assert course.slopes is not None
    values, slopes = (np.pad(part, ((0, 0), (0, 1))) for part in (course.values, course.slopes))
    wide = replace(waves, k=np.column_stack([waves.k, -waves.own]), omega=waves.omega - waves.own)
    return wide, sum_of([replace(course, values=values, slopes=slopes), fourth])


@kept(32)
def carry(waves: Waves, course: Course, fps: float) -> tuple[Integral, Integral]:
    """Return the way q of a course (m per frame), and the integral of exp(i (k . q - w t))."""
    way = integral_of(course)
    rate = waves.omega / fps

    def turns(start: Float64, end: Float64, inside: Float64) -> Float64:
        result = np.empty((len(start), 2 * len(rate)))
        values, slopes = course.line(start, inside)
        for row, (a, b, v, s) in enumerate(zip(start, end, values, slopes, strict=True)):
            first = waves.k @ way.to(a) - rate * a
            found = _turning_sum(first, waves.k @ v - rate, waves.k @ s, b - a)
            result[row, : len(rate)], result[row, len(rate) :] = found.real, found.imag
        return result

    sums = Integral.of(turns, course.knots)
    return way, replace(sums, sums=sums.sums + _start(waves, course, rate))


def _start(waves: Waves, course: Course, rate: Float64) -> Float64:
    """Return the value at frame 0 that makes the integral swing about 0 and not beside it."""
    now = course.line(np.zeros(1), np.zeros(1))[0][0]
    turning = waves.k @ now - rate
    slow = np.abs(turning) < 1e-3
    first = np.where(slow, 0.0, 1.0 / (1j * np.where(slow, 1.0, turning)))
    return np.concatenate([first.real, first.imag])


def _turning_sum(first: Float64, speed: Float64, slope: Float64, length: float) -> Any:
    """Return the integral over h from 0 to length of exp(i (first + speed h + slope h^2 / 2))."""
    if not slope.any():
        half = 0.5 * speed * length
        return np.exp(1j * (first + half)) * length * np.sinc(half / np.pi)
    steps = max(math.ceil(abs(length)), 1)
    h = length * (np.arange(steps)[:, None] + 0.5 + _NODES).ravel() / steps
    phase = first + speed * h[:, None] + 0.5 * slope * h[:, None] ** 2
    weights = np.tile(_WEIGHTS, steps) * (length / steps)
    return weights @ np.exp(1j * phase)

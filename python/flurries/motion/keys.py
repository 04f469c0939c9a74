"""Numbers that vary over time: keyframes, their values, and their integrals in closed form."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from flurries._contract import Float64, real, suggesting, table, vector


@suggesting
@dataclass(frozen=True)
class Keys:
    """A number or a vector that changes over time: given at some frames, linear between them.

    `keys` are pairs (frame, value): frames increase; values are numbers, or vectors of one length.

    Examples
    --------
    >>> import flurries as fl
    >>> amount = fl.Keys([(0, 0.0), (48, 1.0)])
    >>> amount.at(12)
    0.25
    >>> amount.integral(48)
    24.0
    """

    keys: Sequence[tuple[float, Any]]
    _frames: Float64 = field(init=False, repr=False, compare=False)
    _values: Float64 = field(init=False, repr=False, compare=False)
    _sums: Float64 = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.keys, (list, tuple)) and np.ndim(self.keys) == 0:
            raise TypeError(f"keys must be pairs (frame, value), got {self.keys!r}")
        pairs = list(self.keys)
        if not pairs or any(not isinstance(p, (tuple, list)) or len(p) != 2 for p in pairs):
            raise ValueError(f"keys must be pairs (frame, value), at least one, got {self.keys!r}")
        frames = np.array([real("keys: frame", frame) for frame, _ in pairs])
        if not (np.diff(frames) > 0).all():
            raise ValueError(f"keys: frames must increase, got {frames.tolist()}")
        values = table("keys: value", [value for _, value in pairs], ndim=None)
        if values.ndim not in (1, 2) or values.size == 0:
            raise ValueError(f"keys: values must be numbers or vectors, got shape {values.shape}")
        plain = tuple((float(f), _plain(v)) for f, v in zip(frames, values, strict=True))
        steps = np.diff(frames).reshape(-1, *[1] * (values.ndim - 1))
        sums = prefix_sums(0.5 * (values[1:] + values[:-1]) * steps, values.shape)
        vars(self).update(keys=plain, _frames=frames, _values=values, _sums=sums)

    @property
    def columns(self) -> tuple[Float64, Float64]:
        """The frames, (n,), and the values, (n,) or (n, width)."""
        return self._frames, self._values

    @property
    def width(self) -> int | None:
        """Length of the vectors, None for numbers."""
        return None if self._values.ndim == 1 else int(self._values.shape[1])

    def at(self, t: float, *, extend: bool = False) -> Any:
        """Return the value at frame `t`; outside the keys it holds, or goes on with `extend`."""
        return self.value(real("t", t), extend=extend)

    def value(self, t: float, *, extend: bool = False) -> Any:
        """Return the value at a time that is checked."""
        frames, values = self._frames, self._values
        if len(frames) == 1 or (not extend and not frames[0] <= t <= frames[-1]):
            return _plain(values[0] if t < frames[0] else values[-1])
        i = self._piece(t)
        part = (t - frames[i]) / (frames[i + 1] - frames[i])
        return _plain(values[i] + part * (values[i + 1] - values[i]))

    def slope(self, t: float, *, extend: bool = False) -> Any:
        """Return the change per frame at `t`; at a key, the change after it."""
        t = real("t", t)
        frames, values = self._frames, self._values
        if len(frames) == 1 or (not extend and not frames[0] <= t < frames[-1]):
            return _plain(0.0 * values[0])
        i = self._piece(t)
        return _plain((values[i + 1] - values[i]) / (frames[i + 1] - frames[i]))

    def integral(self, t: float) -> Any:
        """Return the integral from frame 0 to `t`, values held outside the keys."""
        return _plain(self._area(real("t", t)) - self._area(0.0))

    def _piece(self, t: float) -> int:
        return min(max(bisect.bisect_right(self._frames, t) - 1, 0), len(self._frames) - 2)

    def _area(self, t: float) -> Any:
        """Return the integral from the first key to `t`."""
        frames, values = self._frames, self._values
        if t <= frames[0]:
            return values[0] * (t - frames[0])
        if t >= frames[-1]:
            return self._sums[-1] + values[-1] * (t - frames[-1])
        i = self._piece(t)
        width = t - frames[i]
        slope = (values[i + 1] - values[i]) / (frames[i + 1] - frames[i])
        return self._sums[i] + width * (values[i] + 0.5 * width * slope)


def prefix_sums(areas: Float64, shape: tuple[int, ...]) -> Float64:
    """Return running sums that carry their rounding error (Neumaier), the first of them 0."""
    total, lost = np.zeros(shape[1:]), np.zeros(shape[1:])
    sums = np.zeros(shape)
    for i, area in enumerate(areas, 1):
        larger = total + area
        rest = (total - larger) + area, (area - larger) + total
        lost = lost + np.where(np.abs(total) >= np.abs(area), *rest)
        total = larger
        sums[i] = total + lost
    return sums


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else tuple(float(v) for v in value)


Number: TypeAlias = float | Keys
Vector: TypeAlias = tuple[float, ...] | Keys


def as_number(
    name: str, value: object, *, low: float = -math.inf, high: float = math.inf,
    above: float = -math.inf,
) -> Number:  # fmt: skip
    """Return a number or keyed numbers, each within the range."""
    if not isinstance(value, Keys):
        return real(name, value, low=low, high=high, above=above)
    if value.width is not None:
        raise ValueError(f"{name} must be keyed with numbers, got vectors of {value.width}")
    for _, v in value.keys:
        real(name, v, low=low, high=high, above=above)
    return value


def as_vector(name: str, value: object, length: int) -> Vector:
    """Return a vector or keyed vectors of the given length."""
    if not isinstance(value, Keys):
        return tuple(vector(name, value, length).tolist())
    if value.width != length:
        raise ValueError(f"{name} must be keyed with vectors of {length}, got {value.keys[0][1]!r}")
    return value


def value_at(value: Any, t: float) -> Any:
    """Return a plain value, or a keyed one at frame `t`."""
    return value.value(t) if isinstance(value, Keys) else value


def largest(value: Any) -> float:
    return float(max(v for _, v in value.keys) if isinstance(value, Keys) else value)


def integral_to(value: Any, t: float) -> Any:
    """Return the integral from frame 0 to `t` of a plain or keyed value, as an array."""
    if isinstance(value, Keys):
        return np.asarray(value._area(t) - value._area(0.0))
    return np.asarray(np.multiply(value, t))


@dataclass(frozen=True, eq=False)
class Course:
    """A vector that is linear in time between knots, and goes on as its end pieces do."""

    knots: Float64  # (n,) increasing times at which pieces meet.
    values: Float64  # (n + 1, width), of the pieces at their `times`.
    slopes: Float64 | None = None  # (n + 1, width) per frame; none if left out.
    times: Float64 | None = None  # (n + 1,) where the values hold; needed with slopes.

    def line(self, at: Float64, inside: Float64) -> tuple[Float64, Float64]:
        """Return values at times (m,) and slopes, of the pieces that other times lie in."""
        which = np.searchsorted(self.knots, inside, side="right")
        values = self.values[which]
        if self.slopes is None or self.times is None:
            return values, np.zeros_like(values)
        slopes = self.slopes[which]
        return values + slopes * (at - self.times[which])[:, None], slopes


def course_of(value: Any, scale: float = 1.0) -> Course:
    """Return a plain or keyed vector, held outside its keys, as a course."""
    if not isinstance(value, Keys):
        return Course(np.empty(0), scale * np.array(value, dtype=np.float64)[None])
    frames, values = value._frames, scale * value._values
    between = np.diff(values, axis=0) / np.diff(frames)[:, None]
    flat = np.zeros((1, values.shape[1]))
    return Course(
        frames, np.concatenate([values[:1], values]), np.concatenate([flat, between, flat]),
        np.concatenate([frames[:1], frames]),
    )  # fmt: skip


def air_courses(wind: Vector, fall: Number, scale: float) -> list[Course]:
    """Return the courses of a wind and of a fall speed, down; either may be keyed."""
    down: Vector = (0.0, 0.0 if isinstance(fall, Keys) else fall, 0.0)
    if isinstance(fall, Keys):
        down = Keys([(frame, (0.0, value, 0.0)) for frame, value in fall.keys])
    return [course_of(wind, scale), course_of(down, scale)]


def sum_of(courses: Sequence[Course]) -> Course:
    knots = np.unique(np.concatenate([course.knots for course in courses]))
    # One time in each piece, beyond the ends too.
    each = knots[:1] - 1.0, 0.5 * (knots[1:] + knots[:-1]), knots[-1:] + 1.0
    inside = np.concatenate(each) if len(knots) else np.zeros(1)
    lines = [course.line(inside, inside) for course in courses]
    values = np.sum([value for value, _ in lines], axis=0)
    return Course(knots, values, np.sum([slope for _, slope in lines], axis=0), inside)


@dataclass(frozen=True, eq=False)
class Integral:
    """The integral from frame 0 of a vector that is elementary between knots."""

    # pieces(start, end, inside): the integrals (m, width) over intervals (m,) that hold no knot;
    # `inside` is a time that lies in the piece meant.
    pieces: Callable[[Float64, Float64, Float64], Float64]
    knots: Float64  # (n,) increasing; 0 is one of them.
    sums: Float64  # (n, width), from 0 to them.

    @staticmethod
    def of(pieces: Callable[[Float64, Float64, Float64], Float64], knots: Float64) -> Integral:
        """Return the integral with its sums at all knots."""
        knots = np.unique(np.concatenate([knots, [0.0]]))
        areas = pieces(knots[:-1], knots[1:], 0.5 * (knots[:-1] + knots[1:]))
        sums = prefix_sums(areas, (len(knots), areas.shape[1]))
        return Integral(pieces, knots, sums - sums[np.searchsorted(knots, 0.0)])

    def to(self, t: float) -> Float64:
        """Return the integral from frame 0 to `t`, (width,)."""
        return np.asarray(self.at(np.array([t]))[0])

    def at(self, times: Float64) -> Float64:
        """Return the integrals from frame 0 to times (m,), (m, width)."""
        last = np.maximum(np.searchsorted(self.knots, times, side="right") - 1, 0)
        start = self.knots[last]
        inside = np.where(times < start, times, 0.5 * (start + times))
        return np.asarray(self.sums[last] + self.pieces(start, times, inside))


def integral_of(course: Course) -> Integral:
    """Return the integral of a course from frame 0."""

    def areas(start: Float64, end: Float64, inside: Float64) -> Float64:
        # The middle's value is the mean of a straight piece.
        middle, _ = course.line(0.5 * (start + end), inside)
        return np.asarray(middle * (end - start)[:, None])

    return Integral.of(areas, course.knots)

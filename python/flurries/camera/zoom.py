"""Focal length over time, and integrals that it weighs.

What moves across the view by a way dP moves by f dP / Z in the picture, with the focal length of
that moment: a zoom weighs the way instead of changing what has long passed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from flurries._contract import LARGEST, SMALLEST, Float64, real, table
from flurries.motion.keys import Course, Integral, Keys, course_of

# Pieces of a product of two that both slope are cut at whole frames, at most so many.
_MOST_CUTS = 1_000_000


@dataclass(frozen=True, eq=False)
class Zoom:
    """A focal length for every time: linear between keys, held outside."""

    keys: Keys  # Pixels.

    @property
    def moves(self) -> bool:
        """Whether it ever changes."""
        values = [value for _, value in self.keys.keys]
        return any(value != values[0] for value in values)

    @property
    def widest(self) -> float:
        """The shortest focal length of all."""
        return min(float(value) for _, value in self.keys.keys)

    @property
    def longest(self) -> float:
        """The longest focal length of all."""
        return max(float(value) for _, value in self.keys.keys)

    def at(self, t: float) -> float:
        """Return the focal length at `t`, pixels."""
        return float(self.keys.value(t))

    def rate(self, t: float) -> float:
        """Return the relative change per frame at `t`."""
        return float(self.keys.slope(t)) / self.at(t)

    def grown(self, t: float) -> float:
        """Return the logarithm of the focal length against that of frame 0."""
        return math.log(self.at(t) / self.at(0.0))

    def weigh(self, course: Course) -> Course:
        """Return a velocity times the focal length."""
        focal = course_of(Keys([(frame, (value,)) for frame, value in self.keys.keys]))
        knots = np.union1d(focal.knots, course.knots)
        sloped = course.slopes is not None and bool(course.slopes.any())
        if sloped and len(knots) > 1:
            # Two that slope make a parabola: near enough on whole frames.
            cuts = np.arange(math.ceil(knots[0]), math.floor(knots[-1]) + 1)
            if len(cuts) > _MOST_CUTS:
                raise ValueError(f"focal: at most {_MOST_CUTS} frames of keys, got {len(cuts)}")
            knots = np.union1d(knots, cuts)
        if len(knots) == 0:
            knots = np.zeros(1)
        # Each piece from its start, the first from its end; the last two times lie in the last one.
        ends = np.concatenate([knots[:1] - 1.0, knots, knots[-1:] + 1.0])
        start, end = ends[:-1], ends[1:]
        inside = 0.5 * (start + end)
        values = [focal.line(at, inside)[0] * course.line(at, inside)[0] for at in (start, end)]
        slopes = (values[1] - values[0]) / (end - start)[:, None]
        return Course(knots, values[0], slopes, start)


def zoom_of(focal: Any) -> Zoom:
    """Return a zoom from keyed focal lengths or one for each frame."""
    if isinstance(focal, Keys):
        keys = focal
        if keys.width is not None:
            raise ValueError(f"focal must be keyed with numbers, got vectors of {keys.width}")
    else:
        values = table("focal", focal, ndim=1)
        if len(values) == 0:
            raise ValueError("focal must hold at least one length, got none")
        keys = Keys(list(enumerate(values.tolist())))
    for _, value in keys.keys:
        real("focal", value, low=SMALLEST, high=LARGEST)
    return Zoom(keys)


def integral_of(course: Course) -> Integral:
    """Return the integral of a course from frame 0."""
    return Integral.of(partial(_areas, course), course.knots)


def _areas(course: Course, start: Float64, end: Float64, inside: Float64) -> Float64:
    # The middle's value is the mean of a straight piece.
    middle, _ = course.line(0.5 * (start + end), inside)
    return np.asarray(middle * (end - start)[:, None])

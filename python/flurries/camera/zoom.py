"""Focal length over time, and integrals that it weighs.

What moves across the view by a way dP moves by f dP / Z in the picture, with the focal length of
that moment: a zoom weighs the way instead of changing what has long passed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flurries._contract import LARGEST, SMALLEST, real, table
from flurries.motion.keys import Course, Keys, course_of

# Pieces of a product of two that both slope are cut at whole frames, at most so many.
_MOST_CUTS = 1_000_000


def weigh(lengths: Keys, course: Course) -> Course:
    """Return a velocity times a keyed focal length."""
    focal = course_of(Keys([(frame, (value,)) for frame, value in lengths.keys]))
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


def lengths_of(focal: Any) -> Keys:
    """Return keys of a `focal` argument: keyed lengths in pixels, or one for each frame."""
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
    return keys

"""A camera that turns and zooms: integrals in its axes, weighed by its focal length."""

import bisect
import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from flurries._contract import LARGEST, SMALLEST, Float64, moderate, table
from flurries.camera.lens import matrices_of, quaternions_of, rotation_matrix, rotation_vector
from flurries.motion.keys import Course, Integral, Keys, as_number, course_of

# Below this angle the terms are summed as series: there the closed forms cancel.
_SMALL = 0.5
_TERMS = 9

# Pieces of a product of two that both slope are cut at whole frames, at most so many.
_MOST_CUTS = 1_000_000


@dataclass(frozen=True, eq=False)
class Turning:
    """An orientation for every time: R_i exp([w] (t - t_i)) between keys, w in its own axes."""

    frames: Float64  # (n,) increasing times of the keys.
    matrices: Float64  # (n, 3, 3) rig to house axes at the keys.
    # (max(n - 1, 1), 3) radians per frame between them, in the rig's axes; the ends go on.
    rates: Float64
    _angle: Integral = field(init=False, repr=False)

    def __post_init__(self) -> None:
        def angles(start: Float64, end: Float64, inside: Float64) -> Float64:
            return np.asarray(self.rates[self.pieces(inside)] * (end - start)[:, None])

        object.__setattr__(self, "_angle", Integral.of(angles, self.frames[1:-1]))

    def at(self, t: float) -> Float64:
        """Return the matrix (3, 3) at `t`, rig to house axes."""
        i = self._piece(t)
        matrix: Float64 = self.matrices[i] @ rotation_matrix(self.rates[i] * (t - self.frames[i]))
        return matrix

    def rate(self, t: float) -> Float64:
        """Return radians per frame at `t`, (3,), in the rig's own axes."""
        rate: Float64 = self.rates[self._piece(t)]
        return rate

    def angle(self, t: float) -> Float64:
        """Return the integral of the rate from frame 0 to `t`, (3,), in the rig's own axes."""
        return self._angle.to(t)

    def integral(self, course: Course) -> Integral:
        """Return the integral of R^T u: the way of a velocity u in the rig's own axes."""
        knots = np.concatenate([self.frames[1:-1], course.knots])
        return Integral.of(partial(_areas, self, course), knots)

    def pieces(self, inside: Float64) -> Any:
        """Return the indices of the pieces that times (m,) lie in."""
        found = np.searchsorted(self.frames, inside, side="right") - 1
        return np.clip(found, 0, len(self.rates) - 1)

    def _piece(self, t: float) -> int:
        return min(max(bisect.bisect_right(self.frames, t) - 1, 0), len(self.rates) - 1)


def _areas(
    turning: Turning, course: Course, start: Float64, end: Float64, inside: Float64
) -> Float64:
    """Return the integrals of R^T u over intervals (n,) without a knot, (n, 3)."""
    which = turning.pieces(inside)
    rate = turning.rates[which]
    first = np.empty((len(which), 3, 3))
    for row, (i, a) in enumerate(zip(which, start, strict=True)):
        step = rotation_matrix(turning.rates[i] * (a - turning.frames[i]))
        first[row] = turning.matrices[i] @ step
    length = (end - start)[:, None]
    u, slope = course.line(start, inside)
    # Velocity and its slope in the axes at the start of the interval.
    w0 = np.einsum("nji,nj->ni", first, u)
    w1 = np.einsum("nji,nj->ni", first, slope)
    angle = rate * length
    c1, c2, c3, c4 = _terms(np.linalg.norm(angle, axis=1))[..., None]

    def cross(v: Float64) -> Float64:
        return np.cross(angle, v)

    plain = w0 - c1 * cross(w0) + c2 * cross(cross(w0))
    sloped = 0.5 * w1 - c3 * cross(w1) + c4 * cross(cross(w1))
    areas: Float64 = length * (plain + length * sloped)
    return areas


def _terms(x: Float64) -> Float64:
    """Return the four coefficients of [w] and [w]^2 in the integrals of exp and h exp, (4, n)."""
    # (1 - cos x)/x^2, (x - sin x)/x^3, (sin x - x cos x)/x^3, (x^2/2 - x sin x - cos x + 1)/x^4.
    result = np.empty((4, len(x)))
    small = np.abs(x) < _SMALL
    y = x[~small]
    s, c = np.sin(y), np.cos(y)
    result[:, ~small] = (
        (1.0 - c) / y**2,
        (y - s) / y**3,
        (s - y * c) / y**3,
        (0.5 * y**2 - y * s - c + 1.0) / y**4,
    )
    # Term n of each over (-x^2)^n.
    f = math.factorial
    terms = [
        (1 / f(2 * n + 2), 1 / f(2 * n + 3), (2 * n + 2) / f(2 * n + 3), (2 * n + 3) / f(2 * n + 4))
        for n in range(_TERMS)
    ]
    powers = (-(x[small] ** 2)) ** np.arange(_TERMS)[:, None]
    result[:, small] = np.einsum("nk,nm->km", terms, powers)
    return result


def turning_of(orientation: Any) -> Turning:
    """Return the turning of an `orientation` argument: keys or arrays of any form."""
    if isinstance(orientation, Keys):
        frames, values = orientation.columns
        if orientation.width not in (3, 4):
            raise ValueError(
                "orientation must be keyed with rotation vectors (3 numbers) or quaternions (4), "
                f"got {orientation.keys[0][1]!r}"
            )
    else:
        values = moderate("orientation", table("orientation", orientation, ndim=None))
        frames = np.arange(len(values), dtype=np.float64) if values.ndim else np.empty(0)
    vectors = values if values.shape[1:] == (3,) else None
    if len(values) == 0 or values.shape[1:] not in ((3,), (4,), (3, 3)):
        wanted = "(n, 3), (n, 4) or (n, 3, 3)"
        raise ValueError(f"orientation must have shape {wanted}, got {values.shape}")
    matrices = _matrices(values)
    return Turning(frames, matrices, _rates(frames, matrices, vectors))


def _matrices(values: Float64) -> Float64:
    if values.shape[1:] == (3,):
        return np.stack([rotation_matrix(value) for value in values])
    if values.shape[1:] == (4,):
        lengths = np.linalg.norm(values, axis=1, keepdims=True)
        if not (np.abs(lengths - 1.0) < 1e-3).all():
            raise ValueError(
                "orientation: quaternions (w, x, y, z) must have length 1, "
                f"got {lengths.flat[np.abs(lengths - 1.0).argmax()]:g}"
            )
        return matrices_of(values / lengths)
    off = np.abs(np.einsum("nij,nik->njk", values, values) - np.eye(3)).max()
    if not (off < 1e-3 and (np.linalg.det(values) > 0.0).all()):
        raise ValueError(
            "orientation: matrices must be rotations (orthonormal, determinant 1), "
            f"got one that is off by {off:.3g} or mirrored"
        )
    return matrices_of(quaternions_of(values))


def _rates(frames: Float64, matrices: Float64, vectors: Float64 | None) -> Float64:
    """Return radians per frame between keys, the shortest way or the one that vectors mean."""
    rates = np.zeros((max(len(frames) - 1, 1), 3))
    for i in range(len(frames) - 1):
        turn = rotation_vector(matrices[i].T @ matrices[i + 1])
        angle = float(np.linalg.norm(turn))
        if vectors is not None and angle > 0.0:
            # (0, 0, 0) to (0, 7, 0) is more than a whole turn: whole turns are added while the way
            # comes nearer to the difference of the vectors.
            axis = turn / angle
            meant = float(axis @ (vectors[i + 1] - vectors[i]))
            turn = axis * (angle + 2.0 * np.pi * round((meant - angle) / (2.0 * np.pi)))
        rates[i] = turn / (frames[i + 1] - frames[i])
    return rates


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
    keys = focal
    if not isinstance(keys, Keys):
        values = table("focal", focal, ndim=1)
        if len(values) == 0:
            raise ValueError("focal must hold at least one length, got none")
        keys = Keys(list(enumerate(values.tolist())))
    as_number("focal", keys, low=SMALLEST, high=LARGEST)
    return keys

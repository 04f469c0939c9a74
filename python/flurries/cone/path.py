"""Axis, phase and stretch of the cone for a whole way at once: any frame can be asked for."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flurries import _contract as check
from flurries._contract import LARGEST, SMALLEST, ArrayLike, Float64
from flurries.cone.sheet import MOST_REPEATS, wrapped

STILL = 1e-3  # Below this speed, m/s, there is no direction: the axis stays as it was.
DOWN = np.array([0.0, 1.0, 0.0])  # Before anything has moved the cone points down.

# Gauss-Legendre nodes and weights on [-1, 1]: right to 1e-16 where the speed's branch points are
# farther from the middle than twice the half width.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class State:
    """The arguments of :func:`flurries.cone.layer` at one moment.

    `axis` (x, y, z) has length 1, house axes; `phase` is in tiles, in [0, 1); `stretch` is the
    length of a streak over the length of its drop; and `speed` is metres per second along the axis,
    negative where the drops go against it.
    """

    axis: tuple[float, float, float]
    phase: float
    stretch: float
    speed: float


@dataclass(frozen=True, eq=False)
class Path:
    """The cone over `times` (n,), seconds that do not decrease; made by :func:`path`.

    `axis`, `phase`, `stretch` and `speed`, (n, 3) or (n,), are those of :class:`State`.
    """

    times: Float64
    axis: Float64
    phase: Float64
    stretch: Float64
    speed: Float64
    _velocity: Float64
    _blur: Float64
    _tile: float
    _still: float

    def at(self, time: float) -> State:
        """Return the state at a time in seconds.

        Before the first and after the last time velocity and exposure stay what they are there;
        between two times they are linear, and the phase an integral.
        """
        t = check.real("time", time)
        times = self.times
        i = max(bisect.bisect_right(times, t) - 1, 0)
        part = 0.0
        if i + 1 < len(times) and t > times[0]:
            part = float((t - times[i]) / (times[i + 1] - times[i]))
        j = i + 1 if part > 0.0 else i
        velocity, blur = (
            np.stack([row[i], row[i] + part * (row[j] - row[i])])
            for row in (self._velocity, self._blur)
        )
        axis, speed = self.axis[i], float(self.speed[i])
        phase, stretch = float(self.phase[i]), float(self.stretch[i])
        if t != times[i]:
            step = np.array([t - times[i]])
            phase = wrapped(phase + float(_gone(velocity, blur, axis[None], step)[0]) / self._tile)
            axis, speed = _tilt(velocity[1], axis, self._still)
            stretch = 1.0 + float(blur[1]) * abs(speed)
        x, y, z = axis.tolist()
        return State((x, y, z), phase, stretch, speed)


def path(
    times: ArrayLike, drop: ArrayLike, camera: ArrayLike = (0.0, 0.0, 0.0), *,
    damping: float = 1.0, exposure: ArrayLike = 1.0 / 60.0, length: float = 0.02,
    radius: float = 2.0, repeats: int = 4, still: float = STILL,
) -> Path:  # fmt: skip
    """Return axis, phase and stretch of the cone for a whole way of the camera.

    With v = drop - damping camera the axis is v / |v|, at first (0, 1, 0). Below `still` it stays
    what it was; where it would turn by more than a right angle, the drops go backwards along the
    old one instead, so that nothing flips. The phase is the integral of ``speed / (tile stretch)``
    with ``tile = 2 pi radius / repeats`` metres: at the equator of the cone the image moves as a
    drop's at that radius, whatever the frame rate (Wang 2004, Eqs. 1-3, corrected).

    Parameters
    ----------
    times : (n,)
        Seconds, not decreasing; a paused clock repeats a time.
    drop, camera : (3,) or (n, 3)
        Velocities at those times, metres per second, house axes, linear between them.
    damping : float
        How much of the camera's motion counts, 0 to 1; with 1 the apex is the focus of expansion.
    exposure : float or (n,)
        Seconds, 0 or more, at each time, linear between them.
    length, radius, repeats : float, float, int
        Of a drop, and of the first layer's cone, metres, more than 0; and tiles around that layer.
    still : float
        Metres per second, more than 0: what is slower has no direction.

    Examples
    --------
    >>> import flurries as fl
    >>> film = fl.cone.path([0.0, 10.0], drop=(0.5, 5.0, 0.0), camera=(0.0, 0.0, 8.0))
    >>> state = film.at(3.0)
    >>> alpha = fl.cone.layer((90, 120), fl.Camera(150.0), fl.cone.rain_tile(64, seed=1),
    ...                       axis=state.axis, phase=state.phase, stretch=state.stretch)
    """
    moments = check.moderate("times", check.table("times", times, ndim=1))
    count = len(moments)
    if count == 0:
        raise ValueError("times must hold at least one time, got none")
    steps = np.diff(moments)
    rising = np.append(True, steps >= 0.0)
    check.require("times", moments, rising, "no less than the time before")
    fallen, moved = (
        check.moderate(name, check.each_of(name, value, count, (3,)))
        for name, value in (("drop", drop), ("camera", camera))
    )
    velocity = fallen - check.real("damping", damping, low=0.0, high=1.0) * moved
    around = check.integer("repeats", repeats, low=1, high=MOST_REPEATS)
    tile = 2.0 * math.pi * check.real("radius", radius, low=SMALLEST, high=LARGEST) / around
    slow = check.real("still", still, above=0.0)
    seconds = check.moderate("exposure", check.each_of("exposure", exposure, count))
    check.require("exposure", seconds, seconds >= 0.0, "at least 0")
    blur = seconds / check.real("length", length, above=0.0, high=LARGEST)
    velocity, blur = np.broadcast_to(velocity, (count, 3)), np.broadcast_to(blur, count)
    axis, speed = np.empty((count, 3)), np.empty(count)
    last = DOWN
    for i, rate in enumerate(velocity):
        axis[i], speed[i] = _tilt(rate, last, slow)
        last = axis[i]
    phase = np.zeros(count)
    for i, step in enumerate((_gone(velocity, blur, axis[:-1], steps) / tile).tolist()):
        phase[i + 1] = wrapped(phase[i] + math.fmod(step, 1.0))
    stretch = 1.0 + blur * np.abs(speed)
    return Path(moments, axis, phase, stretch, speed, velocity, blur, tile, slow)


def _tilt(velocity: Float64, last: Float64, still: float) -> tuple[Float64, float]:
    """Return the axis and the speed along it of a velocity, where the axis was `last`."""
    pace = float(np.linalg.norm(velocity))
    if pace < still:
        return last, float(velocity @ last)
    axis: Float64 = velocity / pace
    return (axis, pace) if axis @ last >= 0.0 else (-axis, -pace)


def _gone(velocity: Float64, blur: Float64, axis: Float64, steps: Float64) -> Float64:
    """Return metres of scroll of each step; velocity (n + 1, 3) and blur (n + 1,) are linear."""
    # The integral of s |v| / (1 + blur |v|), s the sign along `axis`. |v| has a kink, or nearly
    # one, where v is least, and the whole a pole beyond the time at which the blur would be 0:
    # near either, pieces double in length from there on.
    start, change = velocity[:-1], np.diff(velocity, axis=0)
    first, longer = blur[:-1], np.diff(blur)
    size = np.linalg.norm(change, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        least = -np.einsum("nc,nc->n", start, change) / size**2
        slowest = np.linalg.norm(start + least[:, None] * change, axis=1) / size
        turn = -np.einsum("nc,nc->n", start, axis) / np.einsum("nc,nc->n", change, axis)
        pole = -first / longer
        fastest = np.linalg.norm(start, axis=1) + 4.0 * size
        beyond = 1.0 / np.maximum(np.abs(longer) * fastest, 1.0)
    kinks = np.stack([turn, least, slowest, pole, beyond], axis=1).tolist()
    pieces: list[tuple[int, float, float]] = []
    for i in np.flatnonzero(steps):
        edges = {0.0, 1.0, kinks[i][0]}
        for place, distance in (kinks[i][1:3], kinks[i][3:]):
            if math.hypot(place - 0.5, distance) <= 1.25:
                edges |= _around(place, distance)
        inside = sorted(edge for edge in edges if 0.0 <= edge <= 1.0)
        pieces += [(int(i), low, high) for low, high in pairwise(inside)]
    row = np.array([piece[0] for piece in pieces], int)
    low, high = np.array([piece[1:] for piece in pieces]).reshape(-1, 2).T
    half = 0.5 * (high - low)
    at = 0.5 * (low + high)[:, None] + half[:, None] * _NODES
    rate = start[row, None, :] + at[..., None] * change[row, None, :]
    pace = np.sqrt(np.einsum("nkc,nkc->nk", rate, rate))
    sign = np.where(np.einsum("nkc,nc->nk", rate, axis[row]) >= 0.0, 1.0, -1.0)
    blurred = 1.0 + (first[row, None] + at * longer[row, None]) * pace
    sums = half * np.einsum("nk,k->n", sign * pace / blurred, _WEIGHTS)
    return np.bincount(row, sums, minlength=len(steps)) * steps


def _around(place: float, distance: float) -> set[float]:
    """Return the ends of pieces that double in length from a place on, to both sides."""
    # `distance` is how far from there the function is not analytic: no need for shorter pieces.
    edges = {place}
    for side in (-1.0, 1.0):
        width = 1.0
        while width > max(0.25 * distance, 1e-12):
            edges.add(place + side * width)
            width *= 0.5
        edges.add(place + side * width)
    return edges

"""Axis, phase and stretch of the cone for a whole way at once: any frame can be asked for."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from flurries._contract import (
    LARGEST,
    SMALLEST,
    Float64,
    flag,
    integer,
    moderate,
    real,
    rectangular,
    require,
    table,
)
from flurries.cone.motion import FRAME, travel
from flurries.cone.sheet import MOST_REPEATS, wrapped

__all__ = ["Path", "State", "path"]

# Below this speed, m/s, there is no direction: the axis stays as it was.
STILL = 1e-3

# Before anything has moved the cone points down.
DOWN = np.array([0.0, 1.0, 0.0])

# Gauss-Legendre nodes and weights on [-1, 1]: right to 1e-16 where the speed's branch points are
# farther from the middle than twice the half width.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class State:
    """The arguments of :func:`flurries.cone.layer` at one moment.

    Attributes
    ----------
    axis : (x, y, z)
        Axis of length 1, house axes.
    phase : float
        Phase in tiles, in [0, 1).
    stretch : float
        Length of a streak over the length of its drop.
    speed : float
        Speed along the axis, metres per second; negative where the drops go against it.
    """

    axis: tuple[float, float, float]
    phase: float
    stretch: float
    speed: float


@dataclass(frozen=True, eq=False)
class Path:
    """The cone over time; made by :func:`path`.

    Attributes
    ----------
    times : (n,) float64
        Seconds, not decreasing.
    axis, phase, stretch, speed : (n, 3) or (n,) float64
        As in :class:`State`.
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
    _published: bool

    def at(self, time: float) -> State:
        """Return the state at a time in seconds.

        Before the first and after the last time velocity and exposure stay what they are there;
        between two times they are linear, and the phase an integral. A path as printed has only the
        moments that it was made of, and gives the last one before `time`.
        """
        t = real("time", time)
        times = self.times
        i = max(bisect.bisect_right(times, t) - 1, 0)
        if self._published or t == times[i]:
            return self._state(i)
        velocity, blur = self._velocity, self._blur.tolist()
        start = end = velocity[i]
        first = last = blur[i]
        if i + 1 < len(times) and t > times[0]:
            part = (t - times[i]) / (times[i + 1] - times[i])
            end = start + part * (velocity[i + 1] - start)
            last = first + part * (blur[i + 1] - first)
        axis, speed = _tilt(end, self.axis[i], self._still)
        gone = _gone(start, end, t - times[i], self.axis[i], (first, last)) / self._tile
        stretch = 1.0 + last * abs(speed)
        x, y, z = axis.tolist()
        return State((x, y, z), wrapped(self.phase[i] + gone), float(stretch), float(speed))

    def _state(self, i: int) -> State:
        x, y, z = self.axis[i].tolist()
        return State((x, y, z), float(self.phase[i]), float(self.stretch[i]), float(self.speed[i]))


def path(
    times: npt.ArrayLike,
    drop: npt.ArrayLike,
    camera: npt.ArrayLike = (0.0, 0.0, 0.0),
    *,
    damping: float = 1.0,
    exposure: npt.ArrayLike = 1.0 / 60.0,
    length: float = 0.02,
    radius: float = 2.0,
    repeats: int = 4,
    still: float = STILL,
    published: bool = False,
    pixel: float = 50.0,
) -> Path:
    """Return axis, phase and stretch of the cone for a whole way of the camera.

    With v = drop - damping camera the axis is v / |v|. Below `still` it stays what it was, and
    where it would turn by more than a right angle from one time to the next, the drops go backwards
    along the old one instead, so that nothing flips as v goes through zero; before the first time
    it is (0, 1, 0). The phase is the integral of ``speed / (tile stretch)``, from 0 at the first
    time, with ``tile = 2 pi radius / repeats`` metres: at the equator of the cone the image moves
    as a drop's at that radius, whatever the frame rate.

    Parameters
    ----------
    times : (n,)
        Seconds, not decreasing; a paused clock repeats a time.
    drop, camera : (3,) or (n, 3)
        Velocities at those times, metres per second, house axes, linear between them.
    damping : float
        C_f, how much of the camera's motion counts, 0 to 1; with 1 the apex of the cone is the
        focus of expansion.
    exposure : float or (n,)
        Seconds, 0 or more; one at each time is linear between them. As one that grows makes streaks
        longer, the phase goes slower by as much, so that drops at the equator keep their speed.
    length : float
        Length of a drop, metres, more than 0.
    radius : float
        R0, radius of the first layer's cone, metres.
    repeats : int
        Number of tiles around the first layer.
    still : float
        Metres per second, more than 0: what is slower has no direction.
    published : bool
        Everything as printed: a sum in Eq. 1, frame times where an exposure and a speed are meant.
        `length` is S_streak in tiles' pixels, of which there are `pixel` to a metre. Rows of `axis`
        where the clock stands still are NaN. See ``docs/internals/deviations.md``.
    pixel : float
        C_pixel of the printed form.

    Returns
    -------
    Path

    Notes
    -----
    Wang 2004, Eqs. 1-3, corrected. Phases are computed in float64 and reduced at every time.

    Examples
    --------
    >>> import flurries as fl
    >>> film = fl.cone.path([0.0, 10.0], drop=(0.5, 5.0, 0.0), camera=(0.0, 0.0, 8.0))
    >>> state = film.at(3.0)
    >>> alpha = fl.cone.layer((90, 120), fl.Camera(150.0), fl.cone.rain_tile(64, seed=1),
    ...                       axis=state.axis, phase=state.phase, stretch=state.stretch)
    """
    moments = moderate("times", table("times", times, ndim=1))
    if len(moments) == 0:
        raise ValueError("times must hold at least one time, got none")
    rising = np.diff(moments, prepend=moments[0]) >= 0.0
    require("times", moments, rising, "no less than the time before")
    count = len(moments)
    rows = [_rows(name, value, count) for name, value in (("drop", drop), ("camera", camera))]
    around = integer("repeats", repeats, low=1, high=MOST_REPEATS)
    tile = 2.0 * math.pi * real("radius", radius, low=SMALLEST, high=LARGEST) / around
    streak = real("length", length, above=0.0, high=LARGEST)
    if flag("published", published):
        scale = real("pixel", pixel, low=SMALLEST, high=LARGEST)
        return _printed(moments, rows, damping, streak, scale, tile)
    velocity = travel(*rows, damping=damping)
    slow = real("still", still, above=0.0)
    blur = _exposures(exposure, count) / streak
    axis, speed = np.empty((count, 3)), np.empty(count)
    last = DOWN
    for i, rate in enumerate(velocity):
        axis[i], speed[i] = _tilt(rate, last, slow)
        last = axis[i]
    steps = _all_gone(velocity, np.diff(moments), axis, blur) / tile
    phase = np.zeros(count)
    for i, step in enumerate(steps.tolist()):
        phase[i + 1] = wrapped(phase[i] + math.fmod(step, 1.0))
    stretch = 1.0 + blur * np.abs(speed)
    return Path(moments, axis, phase, stretch, speed, velocity, blur, tile, slow, False)


def _rows(name: str, value: npt.ArrayLike, count: int) -> Float64:
    given = table(name, value, ndim=None)
    if given.shape not in ((3,), (count, 3)):
        raise ValueError(f"{name} must be (3,) or ({count}, 3), got shape {given.shape}")
    return moderate(name, np.array(np.broadcast_to(given, (count, 3))))


def _exposures(value: npt.ArrayLike, count: int) -> Float64:
    if rectangular("exposure", value).ndim == 0:
        return np.full(count, real("exposure", value, low=0.0))
    given = moderate("exposure", table("exposure", value, ndim=1))
    if given.shape != (count,):
        raise ValueError(f"exposure must be a number or ({count},), got shape {given.shape}")
    if not (given >= 0.0).all():
        raise ValueError(f"exposure must be at least 0, got {given.min()}")
    return given


def _tilt(velocity: Float64, last: Float64, still: float) -> tuple[Float64, float]:
    """Return the axis and the speed along it of a velocity, where the axis was `last`."""
    pace = float(np.linalg.norm(velocity))
    if pace < still:
        return last, float(velocity @ last)
    axis: Float64 = velocity / pace
    return (axis, pace) if axis @ last >= 0.0 else (-axis, -pace)


def _gone(
    start: Float64, end: Float64, dt: float, axis: Float64, blur: tuple[float, float]
) -> float:
    """Return metres of the texture's scroll over a time in which velocity and blur are linear."""
    # The integral of s |v| / (1 + blur |v|), s the sign along `axis`. |v| has a kink, or nearly
    # one, where v is least, and the whole a pole beyond the time at which the blur would be 0:
    # pieces double in length from there on.
    change, longer = end - start, blur[1] - blur[0]
    square = float(change @ change)
    edges = {0.0, 1.0}
    if square > 0.0:
        least = -float(start @ change) / square
        slowest = float(np.linalg.norm(start + least * change)) / math.sqrt(square)
        edges |= _around(least, slowest)
        along, turning = float(start @ axis), float(change @ axis)
        if turning != 0.0:
            edges.add(-along / turning)
    if longer != 0.0:
        fastest = float(np.linalg.norm(start)) + 4.0 * math.sqrt(square)
        edges |= _around(-blur[0] / longer, 1.0 / max(abs(longer) * fastest, 1.0))
    inside = sorted(edge for edge in edges if 0.0 <= edge <= 1.0)
    total = 0.0
    rows = start[None], change[None], axis[None], np.array(blur[:1]), np.array([longer])
    for low, high in pairwise(inside):
        total += float(_pieces(*rows, low, high)[0])
    return total * dt


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


def _pieces(
    start: Float64, change: Float64, axis: Float64, blur: Float64, longer: Float64,
    low: float, high: float,
) -> Float64:  # fmt: skip
    """Return the integrals over [low, high] of rows of velocities, by one Gauss rule each."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    at = middle + half * _NODES
    velocity = start[:, None, :] + at[:, None] * change[:, None, :]
    pace = np.sqrt(np.einsum("nkc,nkc->nk", velocity, velocity))
    sign = np.where(np.einsum("nkc,nc->nk", velocity, axis) >= 0.0, 1.0, -1.0)
    blurred = 1.0 + (blur[:, None] + at * longer[:, None]) * pace
    return np.asarray(half * (sign * pace / blurred) @ _WEIGHTS)


def _all_gone(velocity: Float64, steps: Float64, axis: Float64, blur: Float64) -> Float64:
    """Return `_gone` of every step; those without a kink or a pole nearby in one go."""
    start, change, axis = velocity[:-1], np.diff(velocity, axis=0), axis[:-1]
    first, longer = blur[:-1], np.diff(blur)
    square = np.einsum("nc,nc->n", change, change)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(square > 0.0, -np.einsum("nc,nc->n", start, change) / square, np.inf)
        closest = start + np.where(np.isfinite(least), least, 0.0)[:, None] * change
        slowest = np.linalg.norm(closest, axis=1) / np.sqrt(square)
        fastest = np.linalg.norm(start, axis=1) + 4.0 * np.sqrt(square)
        pole = np.where(longer != 0.0, -first / longer, np.inf)
        beyond = np.where(longer != 0.0, 1.0 / (np.abs(longer) * fastest), np.inf)
    far = np.minimum(np.hypot(least - 0.5, slowest), np.hypot(pole - 0.5, beyond)) > 1.25
    along = np.einsum("nc,nc->n", start, axis)
    turned = np.einsum("nc,nc->n", start + change, axis)
    plain = far & ((along >= 0.0) == (turned >= 0.0))
    gone = np.zeros(len(steps))
    of = [part[plain] for part in (start, change, axis, first, longer)]
    gone[plain] = _pieces(of[0], of[1], of[2], of[3], of[4], 0.0, 1.0) * steps[plain]
    for i in np.flatnonzero(~plain):
        ends = float(blur[i]), float(blur[i + 1])
        gone[i] = _gone(velocity[i], velocity[i + 1], float(steps[i]), axis[i], ends)
    return gone


def _printed(
    moments: Float64,
    rows: list[Float64],
    damping: float,
    streak: float,
    pixel: float,
    tile: float,
) -> Path:
    """Return the path by the equations as printed, frame after frame."""
    dt = np.diff(moments, prepend=moments[0])
    vectors = travel(*rows, damping=damping, published=True, dt=dt)
    length = np.linalg.norm(vectors, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        axis = vectors / length[:, None]
        speed = length / dt
    stretch = 1.0 + pixel * length / streak
    moved = streak * dt / (FRAME * pixel * tile)
    phase = np.array([wrapped(value) for value in np.cumsum(moved).tolist()])
    return Path(moments, axis, phase, stretch, speed, vectors, np.zeros(len(dt)), tile, STILL, True)

"""Wind that differs from place to place: with the depth, in gusts and swirls, or as it is given.

A velocity field of plane waves, u(x, t) = Re sum a exp(i (k . x - w t)), each with a across k, so
that no air is made or lost. What is carried along a known way q(t) is displaced by
Re sum a exp(i k . (x - q(t))) I(t), I(t) the integral of exp(i (k . q - w t)): one complex number
for each wave and time, for all flakes alike. Nothing is stepped from frame to frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64, integer, real, seed_of, table
from flurries.motion.keys import Course, Keys, Running, Vector, as_vector

__all__ = ["Wind"]

# Waves of the gusts and of the swirls, each.
WAVES = 24

# Lengths of the waves, in units of `scale`.
GUST_LENGTHS = (2.0, 8.0)
SWIRL_LENGTHS = (0.25, 1.0)

# Eddies change at this many times their speed over their size: below 1 flakes would be folded
# over each other, far above the air would shake instead of turning. Gusts carry less far than the
# swirls are wide.
GUST_TURNOVER, SWIRL_TURNOVER = 6.0, 3.0

_STREAM = 201

# Points of Gauss and Legendre in a frame, where the speed of the wind changes.
_NODES, _WEIGHTS = (0.5 * part for part in np.polynomial.legendre.leggauss(8))


@dataclass(frozen=True, eq=False, init=False)
class Wind:
    """Wind that differs from place to place.

    Parameters
    ----------
    mean : (x, y, z) or Keys
        Velocity everywhere, metres per second, house axes: x right, y down, z away.
    gusts : float
        Speed (root mean square) of large waves that travel with the mean wind, metres per second.
    swirl : float
        The same of small eddies, metres per second.
    scale : float
        Size of the largest eddies, metres; gusts are 2 to 8 of it long, swirls down to a quarter.
    profile : sequence of (depth, value) or Keys, optional
        How the mean changes with the depth in front of the camera, metres: numbers are factors of
        the mean, vectors (x, y, z) are added to it. Linear between, held outside. Counts across the
        view only, and for a camera that does not turn.
    field : (nz, ny, nx, 3) or (nt, nz, ny, nx, 3) array, optional
        A velocity field of your own, metres per second, house axes, added to the rest: samples of
        one period in space (and time), of which the strongest `modes` waves are kept.
    spacing : float
        Metres between samples of `field`.
    duration : float
        Seconds of its period in time.
    modes : int
        How many waves of `field` are kept.
    seed : int, optional
        Of gusts and swirls; the same seed is the same air for every effect.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    Langer 2004, section 8, asks for such winds. A `field` that never changes carries what falls
    straight through its columns ever further; give it a period in time, or a mean. Gusts and swirls
    have no divergence; they displace a flake by a bounded way in a mean wind that does not change,
    since they ride on it and drift upwards in it while what falls does not. A flake feels the wind
    of the place where it would be without them: see ``docs/deviations.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> wind = fl.Wind((1.0, 0.0, 0.0), gusts=0.8, swirl=0.4)
    >>> snow = fl.Snow(wind=wind)
    >>> wind.velocity([(0.0, 0.0, 8.0)], 2.5).shape
    (1, 3)
    """

    mean: Vector = (0.0, 0.0, 0.0)
    gusts: float = 0.0
    swirl: float = 0.0
    scale: float = 8.0
    profile: Any = None
    field: Any = None
    spacing: float = 1.0
    duration: float = 1.0
    modes: int = 64
    seed: int = 0
    _waves: Any = None

    def __init__(
        self,
        mean: Any = (0.0, 0.0, 0.0),
        *,
        gusts: float = 0.0,
        swirl: float = 0.0,
        scale: float = 8.0,
        profile: Any = None,
        field: Any = None,
        spacing: float = 1.0,
        duration: float = 1.0,
        modes: int = 64,
        seed: int = 0,
    ) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        settle("mean", as_vector("mean", mean, 3))
        settle("gusts", real("gusts", gusts, low=0.0))
        settle("swirl", real("swirl", swirl, low=0.0))
        settle("scale", real("scale", scale, above=0.0))
        settle("profile", None if profile is None else _profile(profile))
        settle("spacing", real("spacing", spacing, above=0.0))
        settle("duration", real("duration", duration, above=0.0))
        settle("modes", integer("modes", modes, low=1, high=4096))
        settle("seed", seed_of(seed))
        given = None
        if field is not None:
            given = table("field", field, ndim=None).copy()
            if given.ndim not in (4, 5) or given.shape[-1] != 3 or 0 in given.shape:
                raise ValueError(
                    "field must have shape (nz, ny, nx, 3) or (nt, nz, ny, nx, 3), "
                    f"got {given.shape}"
                )
            given.flags.writeable = False
        settle("field", given)
        settle("_waves", _waves_of(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, tuple(getattr(self, name) for name in FIELDS)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Wind):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[Any, ...]:
        values = tuple(getattr(self, name) for name in FIELDS if name != "field")
        return (*values, None if self.field is None else (self.field.shape, self.field.tobytes()))

    @property
    def waves(self) -> Waves | None:
        """The waves of gusts, swirls and the field; None where the wind is the same all over."""
        waves: Waves | None = self._waves
        return waves

    @property
    def uniform(self) -> bool:
        """Whether it blows alike everywhere."""
        return self.profile is None and self._waves is None

    @property
    def steady(self) -> Vector:
        """The mean with that of `field`."""
        if self.field is None:
            return self.mean
        own = self.field.reshape(-1, 3).mean(axis=0)
        if isinstance(self.mean, Keys):
            return Keys([(frame, tuple(np.add(value, own))) for frame, value in self.mean.keys])
        return tuple(np.add(self.mean, own).tolist())

    def velocity(self, points: npt.ArrayLike, seconds: float) -> Float64:
        """Return the air's velocity at places of the house axes, without the profile.

        Parameters
        ----------
        points : (n, 3)
            Metres.
        seconds : float
            Since frame 0; a keyed `mean` counts in frames and is taken at frame 0.

        Returns
        -------
        (n, 3) float64
            Metres per second.
        """
        at = table("points", points)
        if at.shape[1] != 3:
            raise ValueError(f"points must be (n, 3), got an array of shape {at.shape}")
        steady = self.steady
        mean = steady.at(0.0) if isinstance(steady, Keys) else steady
        found = np.tile(np.array(mean), (len(at), 1))
        if self._waves is not None:
            now = np.exp(-1j * self._waves.omega * real("seconds", seconds))
            found += self._waves.at(at, now)
        return found

    def extra(self, depth: Float64) -> tuple[Float64, Float64]:
        """Return what the profile adds at depths (n,): a factor of the mean, a velocity (n, 3)."""
        none = np.zeros((len(depth), 3))
        if self.profile is None:
            return np.zeros(len(depth)), none
        at, values = self.profile._frames, self.profile._values
        if self.profile.width is None:
            return np.interp(depth, at, values) - 1.0, none
        parts = [np.interp(depth, at, values[:, axis]) for axis in range(3)]
        return np.zeros(len(depth)), np.stack(parts, axis=1)


FIELDS = ("mean", "gusts", "swirl", "scale", "profile", "field", "spacing", "duration", "modes",
          "seed")  # fmt: skip


def _rebuilt(mean: Any, *values: Any) -> Wind:
    return Wind(mean, **dict(zip(FIELDS[1:], values, strict=True)))


def _profile(given: Any) -> Keys:
    try:
        keys = given if isinstance(given, Keys) else Keys(given)
    except (ValueError, TypeError) as error:
        raise type(error)(f"profile: {error}") from None
    if keys.width not in (None, 3):
        raise ValueError(f"profile must hold numbers or (x, y, z), got {keys.keys[0][1]!r}")
    if keys.keys[0][0] < 0.0:
        raise ValueError(f"profile: depths must not be negative, got {keys.keys[0][0]:g}")
    return keys


@dataclass(frozen=True, eq=False)
class Waves:
    """Plane waves of velocity: Re sum a exp(i (k . x - omega t)).

    Attributes
    ----------
    k : (m, 3) float64
        Radians per metre.
    omega : (m,) float64
        Radians per second.
    a : (m, 3) complex128
        Metres per second.
    own : (m,) float64
        How fast each changes for what rides on the mean wind, at least, radians per second.
    """

    k: Float64
    omega: Float64
    a: npt.NDArray[np.complex128]
    own: Float64

    def at(self, points: Float64, *factors: npt.NDArray[np.complex128]) -> Float64:
        """Return Re sum a factor exp(i k . x) at points (n, 3), one after the other: (n, 3 f)."""
        weights = np.concatenate([self.a * factor[:, None] for factor in factors], axis=1)
        result = np.empty((len(points), weights.shape[1]))
        parts = np.concatenate([weights.real, weights.imag], axis=1)
        cycles = self.k / (2.0 * np.pi)
        _core.wind_waves(result, np.ascontiguousarray(points), cycles, parts)
        return result

    def spread(self) -> float:
        """Return how far it carries flakes to and fro, root mean square, metres."""
        power = 0.5 * np.sum(np.abs(self.a) ** 2, axis=1)
        return float(np.sqrt(np.sum(power[self.own > 0.0] / self.own[self.own > 0.0] ** 2)))


def _waves_of(wind: Wind) -> Waves | None:
    parts = []
    mean = wind.steady
    if isinstance(mean, Keys):
        mean = tuple(np.mean([value for _, value in mean.keys], axis=0))
    kinds = (
        (wind.gusts, GUST_LENGTHS, GUST_TURNOVER),
        (wind.swirl, SWIRL_LENGTHS, SWIRL_TURNOVER),
    )
    for number, (speed, lengths, turnover) in enumerate(kinds):
        if speed > 0.0:
            sizes = (wind.scale * lengths[0], wind.scale * lengths[1])
            stream = _STREAM + 8 * number
            parts.append(_eddies(speed, sizes, turnover, mean, wind.seed, stream))
    if wind.field is not None:
        parts.append(_sampled(wind))
    parts = [part for part in parts if len(part.k)]
    if not parts:
        return None
    return Waves(
        *(np.concatenate([getattr(p, n) for p in parts]) for n in ("k", "omega", "a", "own"))
    )


def _eddies(
    speed: float, sizes: tuple[float, float], turnover: float, mean: Any, seed: int, stream: int
) -> Waves:
    """Return solenoidal waves of random directions whose speed squared has the mean speed^2."""
    draws = np.empty((5, WAVES))
    for row, draw in enumerate(draws):
        _core.uniform(draw, seed, stream + row)
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


def _sampled(wind: Wind) -> Waves:
    """Return the strongest waves of a periodic field, without its mean."""
    given = wind.field if wind.field.ndim == 5 else wind.field[None]
    count = given.shape[:4]
    spectrum = np.fft.fftn(given, axes=(0, 1, 2, 3)) / np.prod(count)
    turns = [2.0 * np.pi * np.fft.fftfreq(n, step) for n, step in
             zip(count, (wind.duration / count[0], *3 * (wind.spacing,)), strict=True)]  # fmt: skip
    omega, kz, ky, kx = np.meshgrid(*turns, indexing="ij")
    k = np.stack([kx, ky, kz], axis=-1).reshape(-1, 3)
    # exp(i (k x + w t)) of the transform is exp(i (k x - omega t)) here.
    omega = -omega.ravel()
    a = spectrum.reshape(-1, 3)
    # What is the same everywhere and always belongs to the mean.
    a[0] = 0.0
    power = np.sum(np.abs(a) ** 2, axis=1)
    # Of a wave and its mirror one is kept, twice as strong.
    mirror = _mirror(count)
    order = np.arange(len(power))
    a = np.where((mirror == order)[:, None], a, 2.0 * a)
    strongest = [i for i in np.argsort(-power, kind="stable") if i <= mirror[i] and power[i] > 0.0]
    chosen = np.array(strongest[: wind.modes], dtype=np.intp)
    # A field is taken to change as fast as it carries things through its own waves.
    speed = math.sqrt(0.5 * float(np.sum(np.abs(a[chosen]) ** 2)))
    own = speed * np.linalg.norm(k[chosen], axis=1)
    return Waves(k[chosen], omega[chosen], a[chosen], own)


def _mirror(count: tuple[int, ...]) -> npt.NDArray[np.intp]:
    """Return the flat index of the bin -k of every bin."""
    grids = np.meshgrid(*[(-np.arange(n)) % n for n in count], indexing="ij")
    return np.asarray(np.ravel_multi_index([g.ravel() for g in grids], count))


# Integrals along a known way ---------------------------------------------------------------------


@lru_cache(maxsize=32)
def carried(waves: Waves, course: Course, fps: float) -> tuple[Running, Running]:
    """Return the way q of a course, and the integral of exp(i (k . q - w t)) as (real, imaginary).

    The course is a velocity in metres per frame; integrals count frames.
    """

    def ways(start: Float64, end: Float64, inside: Float64) -> Float64:
        values, _ = course.line(0.5 * (start + end), inside)
        return np.asarray(values * (end - start)[:, None])

    way = Running.of(ways, course.knots)
    rate = waves.omega / fps

    def turns(start: Float64, end: Float64, inside: Float64) -> Float64:
        result = np.empty((len(start), 2 * len(rate)))
        values, slopes = course.line(start, inside)
        for row, (a, b, v, s) in enumerate(zip(start, end, values, slopes, strict=True)):
            first = waves.k @ way.to(a) - rate * a
            found = _turning_sum(first, waves.k @ v - rate, waves.k @ s, b - a)
            result[row, : len(rate)], result[row, len(rate) :] = found.real, found.imag
        return result

    sums = Running.of(turns, course.knots)
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

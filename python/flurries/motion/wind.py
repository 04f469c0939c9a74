"""Wind that differs from place to place: with the depth, in gusts and swirls, or as it is given."""

from __future__ import annotations

import dataclasses
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flurries._contract import Float64, integer, real, rows_of, sealed, seed_of, suggesting, table
from flurries.motion.keys import Keys, Vector, as_vector
from flurries.motion.waves import Waves, eddies, strongest

# Lengths of the waves, in units of `scale`.
GUST_LENGTHS = (2.0, 8.0)
SWIRL_LENGTHS = (0.25, 1.0)

# Eddies change at this many times their speed over their size: below 1 flakes would be folded over
# each other, far above the air would shake. Gusts carry less far than the swirls are wide.
GUST_TURNOVER, SWIRL_TURNOVER = 6.0, 3.0

_STREAM = 201


@suggesting
@dataclass(frozen=True, eq=False)
class Wind:
    """Wind that differs from place to place.

    Langer 2004, section 8, asks for such winds. A `field` that never changes carries what falls
    straight through its columns ever further; give it a period in time, or a mean. Gusts and swirls
    have no divergence; they displace a flake by a bounded way in a mean wind that does not change,
    since they drift upwards in it while what falls does not. A flake feels the wind of the place
    where it would be without them: see ``docs/internals/deviations.md``.

    Parameters
    ----------
    mean : (x, y, z) or Keys
        Mean velocity, metres per second, house axes: x right, y down, z away.
    gusts, swirl : float
        Speeds (root mean square) of large waves that travel with the mean wind, and of small
        eddies, metres per second.
    scale : float
        Size of the largest eddies, metres; the smallest have a quarter, gusts are 2 to 8 times it.
    profile : sequence of (depth, value) or Keys, optional
        How the mean changes with the depth in front of the camera, metres: numbers are factors of
        the mean, vectors (x, y, z) are added to it. Linear between, held outside. Only the part
        across the view counts, and the camera must not turn.
    field : (nz, ny, nx, 3) or (nt, nz, ny, nx, 3) array, optional
        A velocity field of your own, metres per second, house axes, added to the rest: samples of
        one period in space (and time).
    spacing, duration, modes : float, float, int
        Metres between samples of `field`, its period in time, seconds, and how many of its waves
        are kept, the strongest.
    seed : int, optional
        Of gusts and swirls; with the same seed all effects share the same air.

    Examples
    --------
    >>> import flurries as fl
    >>> wind = fl.Wind((1.0, 0.0, 0.0), gusts=0.8, swirl=0.4)
    >>> snow = fl.effects.TentSnow(wind=wind)
    >>> wind.velocity([(0.0, 0.0, 8.0)], 2.5).shape
    (1, 3)
    """

    mean: Vector = (0.0, 0.0, 0.0)
    _: KW_ONLY
    gusts: float = 0.0
    swirl: float = 0.0
    scale: float = 8.0
    profile: Any = None
    field: Any = None
    spacing: float = 1.0
    duration: float = 1.0
    modes: int = 64
    seed: int = 0
    # Of gusts, swirls and the field; None where the wind is the same everywhere.
    waves: Waves | None = dataclasses.field(init=False, repr=False)

    def __post_init__(self) -> None:
        profile = None if self.profile is None else _profile(self.profile)
        vars(self).update(
            mean=as_vector("mean", self.mean, 3), profile=profile, seed=seed_of(self.seed),
            gusts=real("gusts", self.gusts, low=0.0), swirl=real("swirl", self.swirl, low=0.0),
            scale=real("scale", self.scale, above=0.0),
            spacing=real("spacing", self.spacing, above=0.0),
            duration=real("duration", self.duration, above=0.0),
            modes=integer("modes", self.modes, low=1, high=4096),
        )  # fmt: skip
        if self.field is not None:
            given = table("field", self.field, ndim=None).copy()
            if given.ndim not in (4, 5) or given.shape[-1] != 3 or 0 in given.shape:
                raise ValueError(
                    "field must have shape (nz, ny, nx, 3) or (nt, nz, ny, nx, 3), "
                    f"got {given.shape}"
                )
            vars(self)["field"] = sealed(given)
        vars(self)["waves"] = _waves_of(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Wind, **{name: getattr(self, name) for name in FIELDS}), ()

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
    def uniform(self) -> bool:
        """Whether the wind is the same everywhere."""
        return self.profile is None and self.waves is None

    @property
    def steady(self) -> Vector:
        """The mean velocity, that of `field` included."""
        if self.field is None:
            return self.mean
        own = self.field.reshape(-1, 3).mean(axis=0)
        if isinstance(self.mean, Keys):
            return Keys([(frame, tuple(np.add(value, own))) for frame, value in self.mean.keys])
        return tuple(np.add(self.mean, own).tolist())

    def velocity(self, points: ArrayLike, seconds: float) -> Float64:
        """Return the air's velocity (n, 3), m/s, at places (n, 3) of the house axes, metres.

        At `seconds` since frame 0, without the profile; a keyed `mean` is taken at frame 0.
        """
        at = rows_of("points", points, 3)
        steady = self.steady
        mean = steady.at(0.0) if isinstance(steady, Keys) else steady
        found = np.tile(np.array(mean), (len(at), 1))
        if self.waves is not None:
            now = np.exp(-1j * self.waves.omega * real("seconds", seconds))
            found += self.waves.at(at, now)
        return found

    def extra(self, depth: Float64) -> tuple[Float64, Float64]:
        """Return the profile at depths (n,): a factor of the mean, and a velocity (n, 3)."""
        none = np.zeros((len(depth), 3))
        if self.profile is None:
            return np.zeros(len(depth)), none
        at, values = self.profile.columns
        if self.profile.width is None:
            return np.interp(depth, at, values) - 1.0, none
        parts = [np.interp(depth, at, values[:, axis]) for axis in range(3)]
        return np.zeros(len(depth)), np.stack(parts, axis=1)


FIELDS = tuple(field.name for field in dataclasses.fields(Wind) if field.init)


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


def _waves_of(wind: Wind) -> Waves | None:
    """Return the waves of gusts, swirls and a field together."""
    parts, mean = [], wind.steady
    if isinstance(mean, Keys):
        mean = tuple(np.mean([value for _, value in mean.keys], axis=0))
    gusts, swirls = (GUST_LENGTHS, GUST_TURNOVER), (SWIRL_LENGTHS, SWIRL_TURNOVER)
    for number, (speed, kind) in enumerate(((wind.gusts, gusts), (wind.swirl, swirls))):
        if speed > 0.0:
            (short, long), turnover = kind
            sizes, stream = (wind.scale * short, wind.scale * long), _STREAM + 8 * number
            parts.append(eddies(speed, sizes, turnover, mean, wind.seed, stream))
    if wind.field is not None:
        parts.append(strongest(wind.field, wind.spacing, wind.duration, wind.modes))
    parts = [part for part in parts if len(part.k)]
    each = ([getattr(part, name) for part in parts] for name in ("k", "omega", "a", "own"))
    return Waves(*map(np.concatenate, each)) if parts else None

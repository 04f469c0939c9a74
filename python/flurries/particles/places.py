"""Where flakes are: points in a box that wraps, at any time (Langer 2004, section 6).

A place follows from the seed and the flake's index alone, so frames can be made in any order, on
any number of threads or machines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    MOST_ELEMENTS,
    Float64,
    _came,
    integer,
    is_pair,
    output,
    real,
    seed_of,
    table,
    vector,
)


def positions(
    count: int,
    box: npt.ArrayLike,
    *,
    seed: int,
    velocity: npt.ArrayLike,
    time: float,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    sway: tuple[float, float] | None = None,
    out: Float64 | None = None,
) -> Float64:
    """Return the places of flakes at a time, in a box that wraps around a centre.

    p = c + wrap(B u + v t - c), wrap(x) = x - B floor(x / B + 1/2), with u uniform in [0, 1)^3,
    hashed from the seed and the flake's index: flake i is the same whatever `count` is.

    Parameters
    ----------
    count : int
        How many flakes, 0 or more.
    box : float or (3,) floats
        B, the sides of the box, world units, 1e-100 to 1e100.
    seed : int
        Any int64.
    velocity : (3,) or (count, 3)
        Flake minus world, world units per unit of time.
    time : float
        Any; the unit is the caller's (frames, in a scene).
    center : (3,), optional
        c, the middle of the box: as a rule where the camera is. World units.
    sway : (float, float), optional
        Of the offsets that are added after the wrap: see `sway_offsets`.

    Returns
    -------
    (count, 3) float64
        Row i is flake i's (x, y, z), absolute, world units. Without sway the offset from the centre
        lies in [-B/2, B/2) on each axis, up to the rounding of the sum with the centre.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described, or velocity * time overflows; the message names it.

    Notes
    -----
    velocity * time is reduced with the rounding error of the product carried along: at time 1e9 a
    position is as exact as at time 0, within 1e-15 B. Source: Langer 2004, section 6.
    """
    number = integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    sides, middle = _box(box, center)
    rate = rows_of("velocity", velocity, number, (3,), "(3,) or (count, 3)")
    result = output(out, (number, 3), np.dtype(np.float64), rate)
    _core.particle_positions(
        result, sides, middle, seed_of(seed), rate, real("time", time), _sway(sway)
    )
    return result


def sway_offsets(
    count: int,
    *,
    seed: int,
    time: float,
    sway: tuple[float, float],
    out: Float64 | None = None,
) -> Float64:
    """Return the offsets that `positions` adds for the sway at a time; exact at any time.

    Parameters
    ----------
    count, seed, time
        As given to `positions`.
    sway : (float, float)
        ``(amplitude, angular_frequency)``, world units and radians per unit of time.

    Returns
    -------
    (count, 3) float64
        Row i is amplitude * (sin(w t + phi1), 0, sin(w t + phi2)), world units, the phases hashed
        for flake i. Their difference over an exposure, over it, is the sway's part of a velocity.
    """
    number = integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    result = output(out, (number, 3), np.dtype(np.float64))
    swing = _sway(sway)
    if swing is None:
        raise TypeError("sway must be (amplitude, angular_frequency), got None")
    _core.particle_sway_offsets(result, seed_of(seed), real("time", time), swing)
    return result


def edge_fade(
    points: npt.ArrayLike,
    box: npt.ArrayLike,
    *,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    out: Float64 | None = None,
) -> Float64:
    """Return the share of each flake that is shown, so that none pops where the box wraps.

    Parameters
    ----------
    points : (n, 3)
        Absolute positions, as `positions` gives them, world units.
    box, center
        As given to `positions`.

    Returns
    -------
    (n,) float64
        The product over the axes of 1 - smoothstep(0.85, 1, 2 |p - c| / B), from 0 at the walls
        (and outside) to 1; to be multiplied into the opacity.
    """
    place = points_of(points)
    sides, middle = _box(box, center)
    result = output(out, (len(place),), np.dtype(np.float64), place)
    _core.particle_edge_fade(result, place, sides, middle)
    return result


def _single(value: object) -> bool:
    """Tell one number from an array; lists and tuples are arrays."""
    return getattr(value, "ndim", 0) == 0 and not isinstance(value, (list, tuple))


def _box(box: npt.ArrayLike, center: npt.ArrayLike) -> tuple[Any, Any]:
    middle = vector("center", center, 3).tolist()
    if _single(box):
        return [real("box", box, above=0.0)] * 3, middle
    return vector("box", box, 3).tolist(), middle


def points_of(points: npt.ArrayLike) -> Float64:
    place = table("points", points)
    if place.shape[1] != 3:
        raise ValueError(f"points must be (n, 3), got an array of shape {place.shape}")
    return place


def rows_of(
    name: str, value: npt.ArrayLike, count: int, row: tuple[int, ...], wanted: str
) -> Float64:
    """Return (1, *row) or (count, *row): a value for all flakes, or one for each."""
    if row == () and _single(value):
        return np.array([real(name, value)])
    values = table(name, value, ndim=None)
    if row != () and values.shape == row:
        return values.reshape((1, *row))
    if values.shape != (count, *row):
        raise ValueError(
            f"{name} must be {wanted} with {count} rows, got an array of shape {values.shape}"
        )
    return values


def _sway(sway: Any) -> tuple[float, float] | None:
    if sway is None:
        return None
    if not is_pair(sway):
        raise TypeError(f"sway must be (amplitude, angular_frequency), got {_came(sway)}")
    return real("sway[0]", sway[0]), real("sway[1]", sway[1])

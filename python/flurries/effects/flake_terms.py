"""Which patterns stand in the tiles of a frame: generations, and amounts between rungs."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64
from flurries.effects.flake_patterns import Patterns
from flurries.effects.weather import WRAPS, Film
from flurries.spectral.flakes import choices

# Amounts that patterns are kept for, where the amount of flakes changes.
LADDER = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)

# Generations change over this part of the time of each: two at a time are more and fainter flakes
# than there are.
CHANGE = 0.3

# Golden and other sections, for rows, columns, layers and seeds: tiles must not pulse together.
_SECTIONS = (0.6180339887, 0.7548776662, 0.5698402910, 0.1234567)


class Flight(NamedTuple):
    """How layers move at tiles; an axis of one tile stands for all that are alike.

    Attributes
    ----------
    moved : (rows, cols, L, 2)
        Pixels (x, y) since frame 0.
    turns : (rows, cols, L)
        Generations that have passed as the air came nearer.
    there : (rows, cols, L)
        Which part of the flakes is there.
    gains : (rows, cols, L)
    """

    moved: Float64
    turns: Float64
    there: Float64
    gains: Float64


class Terms(NamedTuple):
    """Arrays of a :class:`flurries.spectral.flakes.Request`, for some terms of each layer."""

    pattern: npt.NDArray[np.int32]
    gain: Float64
    shift: Float64
    mirror: npt.NDArray[np.bool_]


def tile_counts(shape: tuple[int, int], film: Film) -> tuple[int, int]:
    """Return the rows and columns of tiles of a picture."""
    rows, cols = (_core.tile_count(length, film.tile, film.overlap) for length in shape)
    return rows, cols


@lru_cache(maxsize=32)
def _offsets(tiles: tuple[int, int], number: int, seed: int) -> Float64:
    rows, cols, layers = np.meshgrid(*(np.arange(n) for n in (*tiles, number)), indexing="ij")
    a, b, c, d = _SECTIONS
    found: Float64 = np.modf(a * rows + b * cols + c * layers + (seed % 1009) * d)[0]
    return found


def terms_of(
    flight: Flight,
    film: Film,
    patterns: Patterns,
    tiles: tuple[int, int],
    seed: int,
    rungs: tuple[float, ...],
) -> Terms:
    """Return the terms of tiles: L for each generation and rung that is seen."""
    number = flight.turns.shape[2]
    # A torus that is sheared comes back near its first place after so many lengths.
    place = flight.moved[..., 1] / (WRAPS * film.tile) + _offsets(tiles, number, seed)
    if film.comes:
        place = place + flight.turns
        first = np.floor(place)
        part = np.clip(1.0 - (1.0 - (place - first)) / CHANGE, 0.0, 1.0)
    else:
        first = np.floor(place)
        # Only the last length of them gives way to the next generation.
        part = np.clip((place - first - 1.0 + 1.0 / WRAPS) * WRAPS, 0.0, 1.0)
    weights = [np.ones((1, 1, number))]
    if part.any():
        weights = [np.cos(0.5 * math.pi * part), np.sin(0.5 * math.pi * part)]
    mixes = _mixes(flight.there, rungs)
    pattern, gain, shift = [], [], []
    for generation, weight in enumerate(weights):
        taken = choices(
            seed,
            tiles,
            layers=number,
            patterns=patterns.number,
            tile=film.tile,
            generation=(first + generation).astype(np.int64),
            moved=flight.moved,
            placed=patterns.places > 1,
        )
        for rung, mix in mixes:
            factor = weight * mix * flight.gains
            named = taken.pattern + (rung * (number * patterns.each)).astype(np.int32)
            if not factor.all():
                named = np.where(factor > 0.0, named, np.int32(-1))
            pattern.append(named)
            gain.append(factor)
            shift.append(taken.shift)
    if len(pattern) == 1:
        return Terms(pattern[0], gain[0], shift[0], taken.mirror)
    widest = np.broadcast_shapes(*(one.shape for one in gain))
    return Terms(
        np.concatenate(pattern, axis=2),
        np.concatenate([np.broadcast_to(one, widest) for one in gain], axis=2),
        np.concatenate(shift, axis=2),
        taken.mirror,
    )


def _mixes(there: Float64, rungs: tuple[float, ...]) -> list[tuple[npt.NDArray[np.int64], Float64]]:
    """Return pairs of rungs and weights that make the amounts, arrays of the amounts' shape."""
    if len(rungs) == 1:
        return [(np.zeros((1, 1, 1), np.int64), np.ones((1, 1, 1)))]
    ladder = np.array(rungs)
    low = np.clip(np.searchsorted(rungs, there, side="right") - 1, 0, len(rungs) - 2)
    upper = (there - ladder[low]) / (ladder[low + 1] - ladder[low])
    both = [(low, 1.0 - upper), (low + 1, upper)]
    return [(rung, mix) for rung, mix in both if mix.any()] or both[:1]

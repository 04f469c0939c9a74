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
from flurries.spectral.flake_frames import choices

# Amounts that patterns are kept for, where the amount of flakes changes.
LADDER = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)

# A generation gives way to the next within so many frames, or at most this part of its time: two
# at a time are more and fainter flakes than there are, and sparse ones have depths below 0 between.
CHANGE, LONGEST_CHANGE = 3.0, 0.3

# Stops of a streak are at most so many pixels apart. Longer ones than so many stops are blurred,
# and flakes that move by less than the shortest one rest.
APART, MOST_STOPS, SHORTEST = 1.0, 8, 0.25

# Golden and other sections, for rows, columns, layers and seeds: tiles must not pulse together.
_SECTIONS = (0.6180339887, 0.7548776662, 0.5698402910, 0.1234567)


class Flight(NamedTuple):
    """The motion of layers at tiles; an axis of one tile stands for all that are alike.

    Attributes
    ----------
    moved : (rows, cols, L, 2)
        Pixels (x, y) since frame 0.
    turns : (rows, cols, L)
        Generations that have passed as the air came nearer.
    pace : (rows, cols, L)
        Generations that pass in a frame.
    there : (rows, cols, L)
        Which part of the flakes is there.
    gains : (rows, cols, L)
    streak : (rows, cols, L, 2)
        Pixels (x, y) that they move by while the shutter is open.
    """

    moved: Float64
    turns: Float64
    pace: Float64
    there: Float64
    gains: Float64
    streak: Float64


class Stops(NamedTuple):
    """The places of flakes on their way while the shutter is open, n of all layers.

    Attributes
    ----------
    layer : (n,) int
    along : (n,)
        From the middle of the way, in units of it.
    share : (n,)
        Of the exposure.
    blurred : (L,) bool
        Layers that have one stop, and are blurred instead.
    """

    layer: npt.NDArray[np.int64]
    along: Float64
    share: Float64
    blurred: npt.NDArray[np.bool_]


class Terms(NamedTuple):
    """Arrays of a :class:`flurries.spectral.flake_frames.Request`, and the layer of each term."""

    layer: npt.NDArray[np.int64]
    pattern: npt.NDArray[np.int32]
    gain: Float64
    shift: Float64


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


def stops_of(lengths: Float64, placed: bool) -> Stops:
    """Return the stops of layers whose longest streaks are so many pixels long, (L,).

    A blur of pixels rings where flakes are below a pixel, since it takes their waves beyond half a
    cycle for longer ones. Patterns that stand at places within a pixel are exact at each stop, and
    a few of these with the spread of the whole way are a short streak.
    """
    blurred = lengths > (APART * MOST_STOPS if placed else 0.0)
    number = np.where(blurred | (lengths < SHORTEST), 1, np.ceil(lengths / APART).clip(min=2))
    number = number.astype(int)
    layer = np.repeat(np.arange(len(lengths)), number)
    each = number[layer]
    index = np.arange(len(layer)) - np.repeat(np.cumsum(number) - number, number)
    # As far apart as gives them the variance of the way, 1/12.
    along = (index - 0.5 * (each - 1)) / np.sqrt(np.maximum(each**2 - 1, 1))
    return Stops(layer, along, 1.0 / each, blurred)


def terms_of(
    flight: Flight,
    film: Film,
    patterns: Patterns,
    tiles: tuple[int, int],
    seed: int,
    rungs: tuple[float, ...],
    stops: Stops,
) -> Terms:
    """Return the terms of tiles: the stops of each generation and rung that is seen."""
    number = flight.turns.shape[2]
    # A torus that is sheared comes back near its first place after so many lengths.
    place = flight.moved[..., 1] / (WRAPS * film.tile) + _offsets(tiles, number, seed)
    if film.comes:
        place = place + flight.turns
    first = np.floor(place)
    change = np.clip(CHANGE * flight.pace, 1e-9, LONGEST_CHANGE)
    part = np.clip(1.0 - (1.0 - (place - first)) / change, 0.0, 1.0)
    weights = [np.ones((1, 1, number))]
    if part.any():
        weights = [np.cos(0.5 * math.pi * part), np.sin(0.5 * math.pi * part)]
    mixes = _mixes(flight.there, rungs)
    layer = stops.layer
    moved = flight.moved[..., layer, :] + stops.along[:, None] * flight.streak[..., layer, :]
    pattern, gain, shift = [], [], []
    for generation, weight in enumerate(weights):
        taken = choices(
            seed,
            tiles,
            layers=number,
            patterns=patterns.number,
            tile=film.tile,
            generation=(first + generation).astype(np.int64)[..., layer],
            moved=moved,
            placed=patterns.places > 1,
            terms=layer.tolist(),
        )
        for rung, mix in mixes:
            factor = (weight * mix * flight.gains)[..., layer] * stops.share
            jump = (rung * (number * patterns.each)).astype(np.int32)
            named = taken.pattern + (jump[..., layer] if jump.shape[-1] > 1 else jump)
            if not factor.all():
                named = np.where(factor > 0.0, named, np.int32(-1))
            pattern.append(named)
            gain.append(factor)
            shift.append(taken.shift)
    if len(pattern) == 1:
        return Terms(layer, pattern[0], gain[0], shift[0])
    widest = np.broadcast_shapes(*(one.shape for one in gain))
    return Terms(
        np.tile(layer, len(pattern)),
        np.concatenate(pattern, axis=2),
        np.concatenate([np.broadcast_to(one, widest) for one in gain], axis=2),
        np.concatenate(shift, axis=2),
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

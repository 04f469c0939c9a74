"""A sheet of far flakes: a torus of them, made once and kept, of one layer of depth.

A flake lives until its sheet wraps, and every sheet has a period of its own. Sheets hang from the
principal point and their periods follow from the focal length, so that a crop or a larger picture
shows the same flakes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import ALL, Kept, kept
from flurries.camera.optics import Blur
from flurries.effects.weather import Film, Weather
from flurries.particles.population import Slab

# Rows and columns of a sheet over the focal length in pixels; a layer has up to a fifth more. At
# most so many pixels: a larger picture shows a sheet more than once.
_PERIOD, _LARGEST = (0.82, 0.86), 5_000_000

# A layer with less than this share of the variance of all may come back within the picture, so much
# sooner, and at least after so many pixels.
_FAINT, _SOONER, _LEAST = 0.012, 0.4, 96

# Bytes that all sheets of a process take at most, but for those of one frame.
MOST_BYTES = 512 << 20

# The part of a sheet's columns by which a flake that leaves it below comes in again aside.
SHEAR = 0.382

# Circles of confusion are told apart in steps of this, px; narrower ones than that blur nothing.
# What is wider is made as the last: flakes that cover hardly anything.
_STEP, _LEAST_BLUR, _WIDEST_BLUR = 0.125, 0.25, 32.0

_STREAM = 0x5368656574

SHEETS = ALL[__name__] = Kept(most_bytes=MOST_BYTES)


def sheets_of(keys: list[Any]) -> list[_core.FlakeSheet]:
    """Return all sheets of a frame by their arguments, made where they are not yet."""
    found = SHEETS.each(keys, lambda few: [_core.FlakeSheet(*key[1:]) for key in few])
    SHEETS.trim(len(found))
    return found


def key_of(
    weather: Weather, slab: Slab, seed: int, number: int, area: tuple[int, int], many: float,
    streak: tuple[float, float], circle: float, amount: float, scale: float = 1.0,
    thin: float = 1.0,
) -> Any:  # fmt: skip
    """Return the arguments of a layer's sheet, for images larger by a scale."""
    diameters = tuple((scale * diameters_of(slab)).tolist())
    return (
        _core.reproducible(), hash_of(seed, number), area, round(SHEAR * area[1]),
        slab.count / many / scale**2, diameters, streak, circle,
        weather.population.opacity, (0.0, amount), thin,
    )  # fmt: skip


def circles_of(blur: Blur | None, depths: Float64) -> list[float]:
    """Return the circles of confusion at depths, px, in steps; 0 where all is sharp."""
    if blur is None:
        return [0.0] * len(depths)
    circles = np.minimum(blur.circle(depths), _WIDEST_BLUR)
    found: list[float] = (_STEP * np.rint(circles / _STEP)).tolist()
    return found if max(found) >= _LEAST_BLUR else [0.0] * len(depths)


def areas_of(film: Film, focals: tuple[float, float]) -> list[tuple[int, int]]:
    """Return rows and columns of each layer's sheet, for focal lengths in pixels."""
    power, found = film.power, []
    for number, faint in enumerate((power < _FAINT * power.sum()).tolist()):
        own = (1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0)) * (_SOONER if faint else 1.0)
        rows, columns = (
            max(round(own * part * focals[1 - axis]), _LEAST) for axis, part in enumerate(_PERIOD)
        )
        smaller = min(math.sqrt(_LARGEST / (rows * columns)), 1.0)
        found.append((round(smaller * rows), round(smaller * columns)))
    return found


def hash_of(seed: int, number: int) -> int:
    """Return the seed of a layer's flakes, 64 bits."""
    draw = np.empty(1)
    _core.uniform(draw, seed, _STREAM + number)
    return int(draw[0] * 2**53)


@kept(256)
def diameters_of(slab: Slab, count: int = 24) -> Float64:
    """Return so many diameters that stand for even shares of flakes and cover what those do, px."""
    return np.asarray(np.sqrt((slab.diameters**2).reshape(count, -1).mean(axis=1)))

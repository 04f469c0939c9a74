"""Far flakes that all move alike: a sheet for each layer of depth, read where the layer has moved.

A sheet is a torus of flakes, made once; a frame reads each at its own place and adds them. A flake
lives until its sheet wraps, and every sheet has a period of its own. Sheets hang from the principal
point and their periods follow from the focal length, so that a crop or a larger picture shows the
same flakes.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._threads import reproducible
from flurries.effects.defocus import circles_of
from flurries.effects.flow import flow_of
from flurries.effects.weather import Film, Weather
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Rows and columns of a sheet over the focal length in pixels; a layer has up to a fifth more.
_PERIOD = (0.6, 0.9)

# A layer with less than this share of the variance of all may come back within the picture, so much
# sooner, and at least after so many pixels.
_FAINT, _SOONER, _LEAST = 0.012, 0.4, 96

# Bytes that sheets of a process take at most, and what a sheet takes at least: the oldest go.
MOST_BYTES = 256 << 20

# Sizes of flakes in a sheet.
_SIZES = 24

_STREAM = 0x5368656574

_kept: OrderedDict[Any, _core.FlakeSheet] = OrderedDict()


def read_sheets(weather: Weather, frame: Frame, film: Film, amount: float) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32."""
    top, bottom, left, right = frame.window
    result = plane((bottom - top, right - left))
    cx, cy = frame.camera.principal(frame.shape)
    x, y = cx - frame.camera.center_shift[0], cy - frame.camera.center_shift[1]
    row, column = math.floor(top - y), math.floor(left - x)
    moved, streaks = _motion(weather, frame, film)
    # What lies between whole pixels is a part of the way.
    moved = moved - np.array([left - x - column, top - y - row])
    sheets = sheets_of(weather, frame, film, streaks, amount)
    layers = [
        (sheet, (float(u), float(v)), 1.0, slab.near, slab.far)
        for sheet, (u, v), (_, slab) in zip(sheets, moved, film.layers, strict=True)
    ]
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_read(result, (row, column), layers, depth, True)
    return result


def _motion(weather: Weather, frame: Frame, film: Film) -> tuple[Float64, Float64]:
    """Return the layers' displacements since frame 0 and their streaks, px, (L, 2) each."""
    moved, streak = np.empty((len(film.layers), 2)), np.empty((len(film.layers), 2))
    exposure, zero = value_at(weather.motion.shutter, frame.t), np.zeros(1)
    for share, own, depths, _ in film.classes:
        way = share.motion.way(frame)
        now, rate, _ = flow_of(frame, share.motion, way, zero, zero)
        moved[own] = now.along[0] / depths + now.shift[0]
        streak[own] = exposure * (rate.along[0] / depths + rate.shift[0])
    return moved, streak


def sheets_of(
    weather: Weather, frame: Frame, film: Film, streaks: Float64, amount: float
) -> list[_core.FlakeSheet]:
    """Return the sheet of each layer."""
    focals = frame.camera.focals
    depths = [layer.slab.depth for layer in film.layers]
    circles = circles_of(frame.blur, depths) or (0.0,) * len(depths)
    # Of the same mean the variance goes with what one flake covers.
    power = np.array([slab.coverage * float(np.mean(slab.diameters**2)) for _, slab in film.layers])
    faint = power < _FAINT * power.sum()
    found, opacity = [], weather.opacity_at(frame.t)
    emission = amount * float(weather.emission)  # type: ignore[arg-type]
    for number, (_, slab) in enumerate(film.layers):
        # Rounding of a frame's time must not make other sheets.
        u, v = (round(float(way), 4) for way in streaks[number])
        sooner = _SOONER if faint[number] else 1.0
        own = 1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0)
        rows, columns = (
            max(round(sooner * own * part * focals[1 - axis]), _LEAST)
            for axis, part in enumerate(_PERIOD)
        )
        key = (
            frame.seed, number, slab.near, slab.far, slab.count, focals, opacity, emission, u, v,
            circles[number], rows, columns, reproducible(),
        )  # fmt: skip
        sheet = _kept.pop(key, None)
        if sheet is None:
            sheet = _core.FlakeSheet(
                hash_of(frame.seed, number), (rows, columns), slab.count / film.tile**2,
                diameters_of(slab.diameters, _SIZES), (u, v), circles[number], opacity,
                (0.0, emission),
            )  # fmt: skip
        # Out and in again: the order is that of use.
        _kept[key] = sheet
        found.append(sheet)
    _trim(len(found))
    return found


def hash_of(seed: int, number: int) -> int:
    """Return the seed of a layer's flakes, 64 bits."""
    draw = np.empty(1)
    _core.uniform(draw, seed, _STREAM + number)
    return int(draw[0] * 2**53)


def diameters_of(quantiles: Float64, count: int) -> list[float]:
    """Return so many diameters that stand for even shares of flakes and cover what those do, px.

    Parameters
    ----------
    quantiles : (n,)
        Of diameters at even shares.
    """
    fine = np.interp(np.linspace(0.0, len(quantiles) - 1.0, 64 * count + 1),
                     np.arange(len(quantiles)), quantiles)  # fmt: skip
    squares = 0.5 * (fine[1:] ** 2 + fine[:-1] ** 2)
    found: list[float] = np.sqrt(squares.reshape(count, -1).mean(axis=1)).tolist()
    return found


def _trim(now: int) -> None:
    """Let go of what has not been asked for longest, but for the last `now`."""
    total = sum(sheet.bytes for sheet in list(_kept.values()))
    while total > MOST_BYTES and len(_kept) > now:
        try:
            _, oldest = _kept.popitem(last=False)
        except KeyError:
            return
        total -= oldest.bytes

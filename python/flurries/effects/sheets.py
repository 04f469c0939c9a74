"""Far flakes that all move alike: a sheet for each layer of depth, read where the layer has moved.

A sheet is a torus of flakes, made once; a frame reads each at its own place and adds them. A flake
lives until its sheet wraps, and every sheet has a period of its own. Sheets hang from the principal
point and their periods follow from the focal length, so that a crop or a larger picture shows the
same flakes.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._threads import reproducible
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.effects.defocus import circles_of
from flurries.effects.weather import Film, Weather
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Rows and columns of a sheet over the focal length in pixels; a layer has up to a fifth more. At
# most so many pixels: a larger picture shows a sheet more than once.
_PERIOD, _LARGEST = (0.82, 0.86), 5_000_000

# A layer with less than this share of the variance of all may come back within the picture, so much
# sooner, and at least after so many pixels.
_FAINT, _SOONER, _LEAST = 0.012, 0.4, 96

# Bytes that all sheets of a process take at most, but for those of one frame, and those of a film.
MOST_BYTES, FILM_BYTES = 512 << 20, 384 << 20

# Pixels a frame above which a layer is read at half pixels, and at whole ones: it moves by many.
_FAST = (3.0, 12.0)

# Streaks of a sheet are at most so long along an axis, px.
_LONGEST = 128.0

# The part of a sheet's columns by which a flake that leaves it below comes in again aside.
_SHEAR = 0.382

# Flakes for each pixel of a sheet at most.
_MOST_FLAKES = 12.0

# Sizes of flakes in a sheet.
_SIZES = 24

_STREAM = 0x5368656574

_kept: OrderedDict[Any, _core.FlakeSheet] = OrderedDict()


class Standing(NamedTuple):
    """What is the same in all frames of a film.

    Attributes
    ----------
    keys : list of tuple
        The arguments of each layer's sheet.
    start, rate : (L, 2)
        Displacements of the layers at frame 0 and per frame, px, for an eye on the axis.
    aside : (L,)
        Pixels by which layers move for a metre of the eye aside.
    many : (L,)
        Flakes of a layer for each that its sheet has, or 1.
    places : (L, 1)
        At which it is read along a pixel: 1, 2 or 4.
    depths : list of (near, far)
        Metres.
    """

    keys: list[Any]
    start: Float64
    rate: Float64
    aside: Float64
    many: Float64
    places: Float64
    depths: list[tuple[float, float]]


def read_sheets(weather: Weather, frame: Frame, film: Film, amount: float) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32."""
    top, bottom, left, right = frame.window
    result = plane((bottom - top, right - left))
    camera, blur = frame.camera, frame.blur
    shown = amount * float(weather.emission)  # type: ignore[arg-type]
    known = _standing(
        weather, film, frame.path, frame.fps, camera.focals, camera.rotation, frame.seed, shown,
        value_at(weather.motion.shutter, frame.t), blur, reproducible(),
    )  # fmt: skip
    x, y = camera.principal(frame.shape)
    u, v = camera.center_shift
    row, column = math.floor(top - y + v), math.floor(left - x + u)
    moved = known.start + frame.t * known.rate
    moved -= known.aside[:, None] * np.array(camera.offset[:2]) * (1.0, camera.aspect)
    # What lies between whole pixels is a part of the way.
    moved += (u - (left - x + u - column), v - (top - y + v - row))
    moved = np.round(moved * known.places) / known.places
    layers, bytes_kept = [], 0
    for key, way, many, (near, far) in zip(
        known.keys, moved.tolist(), known.many.tolist(), known.depths, strict=True
    ):
        # Out and in again: the order is that of use.
        sheet = _kept.pop(key, None) or _core.FlakeSheet(*key[1:])
        _kept[key] = sheet
        root = math.sqrt(many)
        layers.append((sheet, way, (root, (many - root) * sheet.mean), near, far))
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_read(result, (row, column), layers, depth, True)
    for sheet in list(_kept.values()):
        bytes_kept += sheet.bytes
    # What has not been asked for longest goes; what the frame reads stays.
    while bytes_kept > MOST_BYTES and len(_kept) > len(layers):
        bytes_kept -= _kept.popitem(last=False)[1].bytes
    return result


@lru_cache(maxsize=32)
def _standing(
    weather: Weather, film: Film, path: CameraPath, fps: float, focals: tuple[float, float],
    rotation: tuple[float, float, float], seed: int, amount: float, exposure: float,
    blur: Blur | None, mode: bool,
) -> Standing:  # fmt: skip
    slabs = [layer.slab for layer in film.layers]
    depths = np.array([slab.depth for slab in slabs])
    circles = circles_of(blur, depths.tolist()) or (0.0,) * len(slabs)
    start, rate = np.empty((len(slabs), 2)), np.empty((len(slabs), 2))
    for number, (share, slab) in enumerate(film.layers):
        motion = share.motion
        found = path.relative(0.0, fps=fps, fall=motion.fall, wind=motion.mean_wind)
        for out, way in zip((start, rate), found, strict=True):
            # The picture moves the other way than the camera.
            out[number] = -np.array(focals) * (way @ rotation_matrix(rotation))[:2] / slab.depth
    # Of the same mean the variance goes with what one flake covers.
    power = np.array([slab.coverage * float(np.mean(slab.diameters**2)) for slab in slabs])
    faint = power < _FAINT * power.sum()
    many = np.array([max(slab.count / film.tile**2 / _MOST_FLAKES, 1.0) for slab in slabs])
    keys, areas = [], []
    for number, slab in enumerate(slabs):
        own = (1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0)) * (_SOONER if faint[number] else 1.0)
        rows, columns = (
            max(round(own * part * focals[1 - axis]), _LEAST) for axis, part in enumerate(_PERIOD)
        )
        smaller = min(math.sqrt(_LARGEST / (rows * columns)), 1.0)
        rows, columns = round(smaller * rows), round(smaller * columns)
        areas.append(rows * columns)
        # Longer streaks are as faint as can be seen.
        u, v = np.clip(exposure * rate[number], -_LONGEST, _LONGEST).tolist()
        keys.append((
            mode, hash_of(seed, number), (rows, columns), round(_SHEAR * columns),
            slab.count / film.tile**2 / many[number], tuple(diameters_of(slab.diameters, _SIZES)),
            (u, v), circles[number], weather.population.opacity, (0.0, amount),
        ))  # fmt: skip
    ends = [(slab.near, slab.far) for slab in slabs]
    places = _places(np.hypot(*rate.T), np.array(areas))
    return Standing(keys, start, rate, focals[0] / depths, many, places[:, None], ends)


def _places(speed: Float64, areas: Float64) -> Float64:
    """Return the places along a pixel of layers of a speed, px a frame: fewer of the fastest."""
    places = np.select([speed >= _FAST[1], speed >= _FAST[0]], [1.0, 2.0], 4.0)
    for number in np.argsort(-speed, kind="stable"):
        while places[number] > 1.0 and (places**2 * areas).sum() > FILM_BYTES:
            places[number] /= 2.0
    return places


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

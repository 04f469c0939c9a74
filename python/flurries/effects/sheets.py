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
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.effects.defocus import circles_of
from flurries.effects.weather import Film, Weather
from flurries.frame.view import Frame
from flurries.motion.keys import value_at
from flurries.particles.population import Slab

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
SHEAR = 0.382

# Flakes for each pixel of a sheet at most.
_MOST_FLAKES = 12.0

# Sizes of flakes in a sheet.
_SIZES = 24

_STREAM = 0x5368656574

_kept: OrderedDict[Any, _core.FlakeSheet] = OrderedDict()


class Standing(NamedTuple):
    """What is the same in all frames of a film whose places all move alike."""

    keys: list[Any]  # The arguments of each layer's sheet.
    # (L, 2): displacements of the layers at frame 0 and per frame, px, for an eye on the axis.
    start: Float64
    rate: Float64
    aside: Float64  # (L,): pixels by which layers move for a metre of the eye aside.
    many: Float64  # (L,): flakes of a layer for each that its sheet has, or 1.
    places: Float64  # (L, 1): at which it is read along a pixel: 1, 2 or 4.


def read_sheets(weather: Weather, frame: Frame, film: Film, amount: float) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32."""
    top, bottom, left, right = frame.window
    result = np.empty((bottom - top, right - left), np.float32)
    camera, blur = frame.camera, None if frame.lens is None else frame.blur
    shown = amount * float(weather.emission)  # type: ignore[arg-type]
    known = _standing(
        weather, film, frame.path, frame.fps, camera.focals, camera.rotation, frame.seed, shown,
        value_at(weather.motion.shutter, frame.t), blur, _core.reproducible(),
    )  # fmt: skip
    x, y = camera.principal(frame.shape)
    u, v = camera.center_shift
    row, column = math.floor(top - y + v), math.floor(left - x + u)
    moved = known.start + frame.t * known.rate
    moved -= known.aside[:, None] * np.array(camera.offset[:2]) * (1.0, camera.aspect)
    # What lies between whole pixels is a part of the way.
    moved += (u - (left - x + u - column), v - (top - y + v - row))
    moved = np.round(moved * known.places) / known.places
    layers = []
    for sheet, way, many, (_, slab) in zip(
        kept(known.keys), moved.tolist(), known.many.tolist(), film.layers, strict=True
    ):
        root = math.sqrt(many)
        gain = root, (many - root) * sheet.mean
        layers.append((sheet, way, gain, slab.near, slab.far))
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_read(result, (row, column), layers, depth, True)
    trim(len(layers))
    return result


def kept(keys: list[Any]) -> list[_core.FlakeSheet]:
    """Return the sheets of some arguments, made where they are not yet."""
    found = []
    for key in keys:
        # Out and in again: the order is that of use.
        sheet = _kept.pop(key, None) or _core.FlakeSheet(*key[1:])
        _kept[key] = sheet
        found.append(sheet)
    return found


def trim(used: int) -> None:
    """Drop what has not been asked for longest, but for the last so many."""
    size = sum(sheet.bytes for sheet in list(_kept.values()))
    while size > MOST_BYTES and len(_kept) > used:
        size -= _kept.popitem(last=False)[1].bytes


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
    axes = rotation_matrix(rotation)
    lines = {share: share.motion.line(path, fps) for share in film.shares}
    for number, (share, slab) in enumerate(film.layers):
        for out, way in zip((start, rate), lines[share] or (), strict=True):
            # The picture moves the other way than the camera.
            out[number] = -np.array(focals) * (np.array(way) @ axes)[:2] / slab.depth
    # Longer streaks are as faint as can be seen.
    streaks = np.clip(exposure * rate, -_LONGEST, _LONGEST).tolist()
    many = many_of(film)
    areas = areas_of(film, focals)
    keys = [
        key_of(weather, slab, seed, number, areas[number], many[number], streaks[number],
               circles[number], amount, mode)
        for number, slab in enumerate(slabs)
    ]  # fmt: skip
    pixels = np.array([rows * columns for rows, columns in areas])
    places = _places(np.hypot(*rate.T), pixels)
    return Standing(keys, start, rate, focals[0] / depths, many, places[:, None])


def many_of(film: Film) -> Float64:
    """Return the flakes of each layer for each that its sheet has, or 1."""
    return np.array([max(layer.slab.count / _MOST_FLAKES, 1.0) for layer in film.layers])


def areas_of(film: Film, focals: tuple[float, float]) -> list[tuple[int, int]]:
    """Return rows and columns of each layer's sheet, for focal lengths in pixels."""
    slabs = [layer.slab for layer in film.layers]
    # Of the same mean the variance goes with what one flake covers.
    power = np.array([slab.coverage * float(np.mean(slab.diameters**2)) for slab in slabs])
    found = []
    for number, faint in enumerate((power < _FAINT * power.sum()).tolist()):
        own = (1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0)) * (_SOONER if faint else 1.0)
        rows, columns = (
            max(round(own * part * focals[1 - axis]), _LEAST) for axis, part in enumerate(_PERIOD)
        )
        smaller = min(math.sqrt(_LARGEST / (rows * columns)), 1.0)
        found.append((round(smaller * rows), round(smaller * columns)))
    return found


def key_of(
    weather: Weather, slab: Slab, seed: int, number: int, area: tuple[int, int], many: float,
    streak: list[float], circle: float, amount: float, mode: bool, scale: float = 1.0,
    thin: float = 1.0,
) -> Any:  # fmt: skip
    """Return the arguments of a layer's sheet, for images larger by a scale."""
    diameters = tuple((scale * diameters_of(slab)).tolist())
    return (
        mode, hash_of(seed, number), area, round(SHEAR * area[1]), slab.count / many / scale**2,
        diameters, tuple(streak), circle, weather.population.opacity, (0.0, amount), thin,
    )  # fmt: skip


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


@lru_cache(maxsize=256)
def diameters_of(slab: Slab, count: int = _SIZES) -> Float64:
    """Return so many diameters that stand for even shares of flakes and cover what those do, px."""
    return np.asarray(np.sqrt((slab.diameters**2).reshape(count, -1).mean(axis=1)))

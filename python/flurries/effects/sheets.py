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

# Circles of confusion are told apart in steps of this, px; narrower ones than that blur nothing.
_STEP, _LEAST_BLUR = 0.125, 0.25

# Sizes of flakes in a sheet.
_SIZES = 24

_STREAM = 0x5368656574

_kept: OrderedDict[Any, Any] = OrderedDict()


class Standing(NamedTuple):
    """What is the same in all frames of a film whose places all move alike."""

    keys: list[Any]  # The arguments of each layer's sheet.
    # (L, 2): displacements of the layers at frame 0 and per frame, px, for an eye on the axis.
    start: Float64
    rate: Float64
    aside: Float64  # (L,): pixels by which layers move for a metre of the eye aside.
    many: list[float]  # Flakes of each layer for each that its sheet has, or 1.
    slabs: list[Slab]
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
    for key, way, many, slab in zip(
        known.keys, moved.tolist(), known.many, known.slabs, strict=True
    ):
        sheet, root = kept(key), math.sqrt(many)
        layers.append((sheet, way, (root, (many - root) * sheet.mean), slab.near, slab.far))
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_read(result, (row, column), layers, depth, True)
    trim(len(layers))
    return result


def kept(key: Any) -> _core.FlakeSheet:
    """Return the sheet of some arguments, made where it is not yet."""
    # Out and in again: the order is that of use.
    sheet: _core.FlakeSheet = _kept.pop(key, None) or _core.FlakeSheet(*key[1:])
    _kept[key] = sheet
    return sheet


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
    depths = depths_of(film)
    start, rate = np.empty((2, len(depths), 2))
    axes = rotation_matrix(rotation)
    lines = {share: share.motion.line(path, fps) for share in film.shares}
    for number, (share, slab) in enumerate(film.layers):
        for out, way in zip((start, rate), lines[share] or (), strict=True):
            # The picture moves the other way than the camera.
            out[number] = -np.array(focals) * (np.array(way) @ axes)[:2] / slab.depth
    # Longer streaks are as faint as can be seen.
    streaks = np.clip(exposure * rate, -_LONGEST, _LONGEST).tolist()
    areas, numbers, slabs = areas_of(film, focals), many_of(film).tolist(), slabs_in(film)
    keys = [
        key_of(weather, slab, seed, number, area, many, streak, circle, amount)
        for number, (slab, area, many, streak, circle) in enumerate(
            zip(slabs, areas, numbers, streaks, circles_of(blur, depths), strict=True)
        )
    ]
    pixels = np.array([rows * columns for rows, columns in areas])
    places = _places(np.hypot(*rate.T), pixels)
    return Standing(keys, start, rate, focals[0] / depths, numbers, slabs, places[:, None])


def circles_of(blur: Blur | None, depths: Float64) -> list[float]:
    """Return the circles of confusion at depths, px, in steps; 0 where all is sharp."""
    if blur is None:
        return [0.0] * len(depths)
    found = [_STEP * round(blur.circle(depth) / _STEP) for depth in depths.tolist()]
    return found if max(found) >= _LEAST_BLUR else [0.0] * len(depths)


def slabs_in(film: Film) -> list[Slab]:
    """Return the slabs of the layers, near ones first."""
    return [layer.slab for layer in film.layers]


def depths_of(film: Film) -> Float64:
    """Return the depths that layers move as, metres."""
    return np.array([slab.depth for slab in slabs_in(film)])


def covers_of(film: Film) -> Float64:
    """Return what layers cover of a pixel."""
    return np.array([slab.coverage for slab in slabs_in(film)])


def power_of(film: Film) -> Float64:
    """Return the variances of layers: of the same mean they go with what one flake covers."""
    return np.array([slab.coverage * float(np.mean(slab.diameters**2)) for slab in slabs_in(film)])


def many_of(film: Film) -> Float64:
    """Return the flakes of each layer for each that its sheet has, or 1."""
    return np.array([max(slab.count / _MOST_FLAKES, 1.0) for slab in slabs_in(film)])


def areas_of(film: Film, focals: tuple[float, float]) -> list[tuple[int, int]]:
    """Return rows and columns of each layer's sheet, for focal lengths in pixels."""
    power, found = power_of(film), []
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
    streak: list[float], circle: float, amount: float, scale: float = 1.0, thin: float = 1.0,
) -> Any:  # fmt: skip
    """Return the arguments of a layer's sheet, for images larger by a scale."""
    diameters = tuple((scale * diameters_of(slab)).tolist())
    return (
        _core.reproducible(), hash_of(seed, number), area, round(SHEAR * area[1]),
        slab.count / many / scale**2, diameters, tuple(streak), circle, weather.population.opacity,
        (0.0, amount), thin,
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

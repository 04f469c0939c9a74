"""The far flakes of a population: a torus of them for each layer of depth and class of size."""

import math
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import ALL, Kept, kept
from flurries.camera.lens import axes_of
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.effects.air import swing_of
from flurries.effects.uneven import gains_of
from flurries.effects.weather import Film, Weather
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.particles.population import EVENLY, Slab

# Rows and columns of a sheet over the focal length in pixels; a layer has up to a fifth more. At
# most so many pixels: a larger picture shows a sheet more than once.
_PERIOD, _LARGEST = (0.82, 0.86), 5_000_000

# A rigid layer with less than this share of all variance may come back within the picture, so much
# sooner; a sheet has at least so many pixels.
_FAINT, _SOONER, _LEAST = 0.018, 0.4, 96

# Bytes that all sheets of a process take at most, but for those of one frame, and those of a film.
MOST_BYTES, _FILM_BYTES = 512 << 20, 384 << 20

# The part of a sheet's columns by which a flake that leaves it below comes in again aside.
SHEAR = 0.382

# Circles of confusion are told apart in steps of this, px; narrower ones than that blur nothing.
# What is wider is made as the last: flakes that cover hardly anything.
_STEP, _LEAST_BLUR, _WIDEST_BLUR = 0.125, 0.25, 32.0

_STREAM = 0x5368656574

# Pixels a frame above which a layer is read at half pixels, and at whole ones: it moves by many.
_FAST = (3.0, 12.0)

# Streaks of a sheet are at most so long along an axis, px.
_LONGEST = 128.0

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
    for number, faint in enumerate((power < film.rigid * _FAINT * power.sum()).tolist()):
        own = (1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0)) * (_SOONER if faint else 1.0)
        sides = (own * part * focal for part, focal in zip(_PERIOD, focals[::-1], strict=True))
        rows, columns = (max(round(side), _LEAST) for side in sides)
        smaller = min(math.sqrt(_LARGEST / (rows * columns)), 1.0)
        found.append((round(smaller * rows), round(smaller * columns)))
    return found


def read_sheets(
    weather: Weather, frame: Frame, film: Film, amount: float, parts: Float64 | None = None
) -> Array:
    """Return the opacity of rigid layers, (h, w) float32; a crop shows the flakes of the whole."""
    # `parts` are shares of the layers, (L,).
    (top, _, left, _), camera = frame.window, frame.camera
    exposure, now = weather.motion.exposure(frame), weather.motion.now(frame.t)
    size = frame.size
    blur, result = None if frame.lens is None else frame.blur, plane(size)
    shown, focals = amount * float(weather.emission), camera.focals  # type: ignore[arg-type]
    (x, y), (u, v) = camera.principal(frame.shape), camera.center_shift
    swing, cycles = swing_of(weather.sway, now, frame.fps)
    keys, start, rate, ways, places = _standing(
        weather, film, frame.path, frame.fps, focals, camera.rotation, frame.seed, shown, exposure,
        blur, swing, _core.reproducible(),
    )  # fmt: skip
    row, column = math.floor(top - y + v), math.floor(left - x + u)
    angle = math.tau * cycles
    moved = start + frame.t * rate + math.sin(angle) * ways[0] + math.cos(angle) * ways[1]
    # Pixels that layers move by for a metre of the eye aside.
    aside = (focals[0] / film.depths)[:, None]
    moved -= aside * np.array(camera.offset[:2]) * (1.0, camera.aspect)
    # What lies between whole pixels is a part of the way.
    moved += (u - (left - x + u - column), v - (top - y + v - row))
    moved = np.round(moved * places) / places
    layers, sheets = [], sheets_of(keys)
    own = [1.0] * len(keys) if parts is None else parts.tolist()
    each = zip(sheets, moved.tolist(), film.many, film.slabs, own, strict=True)
    for sheet, way, many, slab, part in each:
        gain = (part * many**0.5, part * (many - many**0.5) * sheet.mean)
        layers.append((sheet, way, (0.0, 1.0), gain, slab.near, slab.far))
    depth = None if frame.depth is None else frame.crop(frame.depth)
    gains = gains_of(weather, frame, film.slabs)
    _core.sheet_read(result, (row, column), layers, depth, True, gains=gains)
    return result


@kept(32)
def _standing(
    weather: Weather, film: Film, path: CameraPath, fps: float, focals: tuple[float, float],
    rotation: tuple[float, float, float], seed: int, amount: float, exposure: float,
    blur: Blur | None, sway: float, mode: bool,
) -> tuple[list[Any], Float64, Float64, Float64, Float64]:  # fmt: skip
    """Return each layer's arguments, displacements (L, 2), sway and places in a pixel (L, 1)."""
    start, rate = np.empty((2, len(film.layers), 2))
    axes = axes_of(rotation)
    for number, (share, slab) in enumerate(film.layers):
        for out, way in zip((start, rate), share.motion.line(path, fps) or (), strict=True):
            # The picture moves the other way than the camera.
            out[number] = -np.array(focals) * (np.array(way) @ axes)[:2] / slab.depth
    # Longer streaks are as faint as can be seen.
    streaks = np.clip(exposure * rate, -_LONGEST, _LONGEST).tolist()
    areas, circles = areas_of(film, focals), circles_of(blur, film.depths)
    # Fewer places of the fastest.
    pixels, speed = np.array([rows * columns for rows, columns in areas]), np.hypot(*rate.T)
    places = np.select([speed >= _FAST[1], speed >= _FAST[0]], [1.0, 2.0], 4.0)
    for number in np.argsort(-speed, kind="stable"):
        while places[number] > 1.0 and (places**2 * pixels).sum() > _FILM_BYTES:
            places[number] /= 2.0
    each = zip(film.slabs, areas, film.many, streaks, circles, strict=True)
    keys = [
        key_of(weather, slab, seed, number, area, many, tuple(streak), circle, amount)
        for number, (slab, area, many, streak, circle) in enumerate(each)
    ]
    # Each sways as one flake does: factors of the sine and the cosine.
    phases = math.tau * np.outer(range(len(keys)), (0.6180339887, 0.0, 0.7548776662))
    swing = sway * np.stack([np.cos(phases), np.sin(phases)]) * (1.0, 0.0, 1.0)
    swing = swing @ axes[:, :2] * focals / film.depths[:, None]
    return keys, start, rate, swing, places[:, None]


def hash_of(seed: int, number: int) -> int:
    """Return the seed of a layer's flakes, 64 bits."""
    draw = np.empty(1)
    _core.uniform(draw, seed, _STREAM + number)
    return int(draw[0] * 2**53)


@kept(256)
def diameters_of(slab: Slab, count: int = 8) -> Float64:
    """Return the diameters of a sheet's sizes, which cover what their shares of flakes do, px."""
    upto = 1.0 - np.linspace(1.0, 0.0, count + 1) ** 2
    squares = np.append(0.0, np.cumsum(slab.diameters**2)) / len(slab.diameters)
    covered = np.interp(upto, EVENLY, squares)
    return np.asarray(np.sqrt(np.diff(covered) / np.diff(upto)))

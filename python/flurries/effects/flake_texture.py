"""The far flakes of a population: sheets, one for each layer of depth and class of size.

Where all layers move evenly and as a whole a frame reads each sheet at its own place and adds them;
else what a pixel sees of a sheet is told by `effects/bent.py`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.lens import axes_of
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.effects.bent import moved_by_wind, read_bent
from flurries.effects.clumps import gains_of
from flurries.effects.lighting import lamp_shade
from flurries.effects.motion import Motion
from flurries.effects.passes import plane_motion
from flurries.effects.sheets import areas_of, circles_of, key_of, sheets_of
from flurries.effects.weather import Film, Weather, times
from flurries.frame.layer import Shade
from flurries.frame.needs import Needs, Step, has_keys
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.light.phase import Optics

# Bytes that the sheets of a film take at most.
_FILM_BYTES = 384 << 20

# Pixels a frame above which a layer is read at half pixels, and at whole ones: it moves by many.
_FAST = (3.0, 12.0)

# Streaks of a sheet are at most so long along an axis, px.
_LONGEST = 128.0


@dataclass(frozen=True, eq=False)
class FlakeTexture:
    weather: Weather

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        weather = self.weather
        if not weather.film(frame).layers:
            return Needs.none("texture", "all flakes are drawn one by one")
        still = frame.settled and weather.motion.still and not has_keys(weather.emission)
        return Needs((Step("texture", once=still),), most=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float) -> Array:
        film = self.weather.film(frame)
        read = _read if film.rigid else read_bent
        return read(self.weather, frame, film, amount)

    def lamp_shade(self, frame: Frame, optics: Optics) -> Shade:
        """Return the light of the frame's lamps on it, by places."""
        film = self.weather.film(frame)
        return lamp_shade(frame, film.depths, film.covers, optics)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        film, motion = self.weather.film(frame), self.weather.motion
        weights, nearness = film.covers, film.covers / film.depths
        speed = float(nearness @ film.falls / nearness.sum() / self.weather.mean_speed)
        depth = np.full(frame.size, weights.sum() / nearness.sum(), np.float32)
        mean = Motion(times(motion.fall, speed), motion.wind)
        here, *places = mean.places(frame.path, frame.fps, [at.t for at in (frame, *others)])
        moves = [
            plane_motion(depth, frame, other, np.subtract(place, here))
            for other, place in zip(others, places, strict=True)
        ]
        if motion.varied is not None:
            for move, other in zip(moves, others, strict=True):
                move += moved_by_wind(self.weather, weights, frame, other)
        depth.fill(weights @ film.depths / weights.sum())
        return moves, depth


def _read(weather: Weather, frame: Frame, film: Film, amount: float) -> Array:
    """Return the opacity of layers that move as they do in all frames, (h, w) float32."""
    top, _, left, _ = frame.window
    exposure, size = weather.motion.exposure(frame), frame.size
    camera, blur = frame.camera, None if frame.lens is None else frame.blur
    result = plane(size)
    shown, focals = amount * float(weather.emission), camera.focals  # type: ignore[arg-type]
    x, y = camera.principal(frame.shape)
    keys, start, rate, places = _standing(
        weather, film, frame.path, frame.fps, focals, camera.rotation, frame.seed, shown, exposure,
        blur, _core.reproducible(),
    )  # fmt: skip
    u, v = camera.center_shift
    row, column = math.floor(top - y + v), math.floor(left - x + u)
    moved = start + frame.t * rate
    # Pixels that layers move by for a metre of the eye aside.
    aside = (focals[0] / film.depths)[:, None]
    moved -= aside * np.array(camera.offset[:2]) * (1.0, camera.aspect)
    # What lies between whole pixels is a part of the way.
    moved += (u - (left - x + u - column), v - (top - y + v - row))
    moved = np.round(moved * places) / places
    layers = []
    sheets = sheets_of(keys)
    for sheet, way, many, slab in zip(sheets, moved.tolist(), film.many, film.slabs, strict=True):
        gain = (many**0.5, (many - many**0.5) * sheet.mean)
        layers.append((sheet, way, gain, slab.near, slab.far))
    depth = None if frame.depth is None else frame.crop(frame.depth)
    gains = gains_of(weather, frame, film.slabs)
    _core.sheet_read(result, (row, column), layers, depth, True, gains=gains)
    return result


@kept(32)
def _standing(
    weather: Weather, film: Film, path: CameraPath, fps: float, focals: tuple[float, float],
    rotation: tuple[float, float, float], seed: int, amount: float, exposure: float,
    blur: Blur | None, mode: bool,
) -> tuple[list[Any], Float64, Float64, Float64]:  # fmt: skip
    """Return each layer's arguments, displacements (L, 2) and places in a pixel (L, 1)."""
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
    keys = [
        key_of(weather, slab, seed, number, area, many, tuple(streak), circle, amount)
        for number, (slab, area, many, streak, circle) in enumerate(
            zip(film.slabs, areas, film.many, streaks, circles, strict=True)
        )
    ]
    return keys, start, rate, places[:, None]

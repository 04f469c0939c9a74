"""Which planes of the air a camera sees: those that lie in its layers as it stands and looks.

The flakes of a layer lie on planes, one behind the other, as far apart as the layer is thick,
across the axes of poses that are some degrees apart. A plane is seen while it is in its layer and
the camera near its pose; then it gives way to the next one. All of it follows from where the camera
is and how it looks, not from a time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.effects.sheets import depths_of, slabs_in
from flurries.effects.weather import Film, Weather
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Pixels from node to node, as the kernel has them; the first ones lie so far before the picture.
APART = 64

# Radians that a camera turns, and by which logarithm a lens zooms, before other planes are seen. A
# whole number of the first make a round.
_ROUND = 36
_TURN, _ZOOM = math.tau / _ROUND, math.log(1.15)

# A plane gives way to the next within so many frames, or at most this part of its time.
_CHANGE, _LONGEST_CHANGE = 3.0, 0.2

# Less than this of a plane is not seen.
_LEAST_SEEN = 0.02

# Layers change their planes at places of their own along each of these.
_PHASES = (0.6180339887, 0.7548776662, 0.5698402910, 0.4331)


class Eyes(NamedTuple):
    """The camera as the shutter opens, and as it closes."""

    rays: Float64  # (2, R, C, 3): of the nodes, house axes, with a depth of 1.
    eye: Float64  # (2, L, 3): places of the eye in the air of each layer, house axes, metres.
    rate: Float64  # (L, 3): metres per frame.


class Plane(NamedTuple):
    """A plane that is seen."""

    layer: int
    weight: float  # Of its deviation.
    axes: Float64  # (3, 3): rows turn house axes into the plane's.
    at: float  # Along its axis in the air, metres.
    focal: float  # That its sheet is made for, over the longest.
    which: list[int]  # Its numbers among its like.


def eyes_of(weather: Weather, frame: Frame, film: Film) -> Eyes:
    half = 0.5 * value_at(weather.motion.shutter, frame.t)
    times = (frame.t - half, frame.t + half)
    bends = frame.path.turns or frame.path.zooms
    cameras = [frame.later(t - frame.t).camera if bends else frame.camera for t in times]
    height, width = (math.ceil(length / APART) + 3 for length in frame.shape)
    rays, each = np.ones((2, height, width, 3)), np.empty((2, len(film.shares), 3))
    rates = np.empty((len(film.shares), 3))
    for number, (t, camera) in enumerate(zip(times, cameras, strict=True)):
        x, y = camera.principal(frame.shape)
        rays[number, ..., 0] = (APART * np.arange(-1, width - 1) - x) / camera.focals[0]
        rays[number, ..., 1] = ((APART * np.arange(-1, height - 1) - y) / camera.focals[1])[:, None]
        axes = camera.matrix()
        rays[number] = rays[number] @ axes.T
        offset = axes @ np.array(camera.offset)
        for index, share in enumerate(film.shares):
            way, rates[index] = frame.path.relative(
                t, fps=frame.fps, fall=share.motion.fall, wind=share.motion.mean_wind
            )
            each[number, index] = way + offset
    own = [film.shares.index(layer.share) for layer in film.layers]
    return Eyes(rays, each[:, own], rates[own])


def planes_of(frame: Frame, film: Film, eyes: Eyes) -> Iterator[Plane]:
    """Yield the planes that are seen: one of each layer, and those that give way or come."""
    path, camera, layers = frame.path, frame.camera, np.arange(len(film.layers))
    phases: list[Any] = [(part * (layers + 1.0)) % 1.0 for part in _PHASES]
    # Angles, and the zoom: numbers of the poses that planes are made for, and how far each has
    # given way to the next.
    poses: list[tuple[npt.NDArray[np.int64], Float64]] = []
    if path.turns:
        before, after = (_angles(frame.later(step).camera.matrix()) for step in (-0.5, 0.5))
        for angle, rate in zip(_angles(camera.matrix()), after - before, strict=True):
            rate = (rate + math.pi) % math.tau - math.pi
            phase = phases[len(poses)]
            poses.append(_place(angle / _TURN - phase, abs(rate) / _TURN))
    if path.zooms:
        grown = math.log(camera.focal / path.longest_focal) / _ZOOM
        pace = abs(path.zoom(frame.t)[1]) / _ZOOM
        poses.append(_place(grown - phases[len(poses)], pace))
    for taken in itertools.product((0, 1), repeat=len(poses)):
        weight, which, middles = np.ones(len(layers)), [], []
        for number, (one, (first, share)) in enumerate(zip(taken, poses, strict=True)):
            weight = weight * (np.sin if one else np.cos)(0.5 * math.pi * share)
            round_ = path.turns and number < 3
            which.append((first + one) % _ROUND if round_ else first + one)
            middles.append(first + one + 0.5 + phases[number])
        axes = np.broadcast_to(camera.matrix().T, (len(layers), 3, 3))
        if path.turns:
            axes = np.stack([_axes(*(_TURN * angle[n] for angle in middles[:3])) for n in layers])
        focal = np.exp(_ZOOM * middles[-1]) if path.zooms else np.ones(len(layers))
        for at, own, numbers in _ahead(film, eyes, axes[:, 2], weight):
            table = np.stack([numbers, *which], axis=1).tolist() if film.comes else [[0]] * len(own)
            for n in np.flatnonzero(own > (_LEAST_SEEN if film.comes else -1.0)).tolist():
                yield Plane(n, float(own[n]), axes[n], float(at[n]), float(focal[n]), table[n])


def _ahead(
    film: Film, eyes: Eyes, axis: Float64, weight: Float64
) -> Iterator[tuple[Float64, Float64, npt.NDArray[np.int64]]]:
    """Yield where planes are along their axes, their weights and their numbers."""
    eye = 0.5 * (eyes.eye[0] + eyes.eye[1])
    along = np.einsum("la,la->l", axis, eye)
    if not film.comes:
        yield along + depths_of(film), weight, np.zeros(len(weight), np.int64)
        return
    slabs = slabs_in(film)
    far = np.array([slab.far for slab in slabs])
    thick = far - np.array([slab.near for slab in slabs])
    pace = np.abs(np.einsum("la,la->l", axis, eyes.rate)) / thick
    phase = (_PHASES[0] * (np.arange(len(thick)) + 1.0)) % 1.0
    first, share = _place(along / thick - phase, pace)
    for one, part in enumerate((np.cos, np.sin)):
        own = weight * part(0.5 * math.pi * share)
        yield far + (first + one + phase) * thick, own, first + one


def _place(at: Float64, pace: Float64 | float) -> tuple[npt.NDArray[np.int64], Float64]:
    """Return the number of the plane at places, and how far it has given way to the next."""
    first = np.floor(at)
    change = np.clip(_CHANGE * np.asarray(pace), 1e-9, _LONGEST_CHANGE)
    return first.astype(np.int64), np.clip(1.0 - (1.0 - (at - first)) / change, 0.0, 1.0)


def _angles(matrix: Float64) -> Float64:
    """Return yaw, pitch and roll of a camera's axes, radians."""
    x, y, z = matrix[:, 2]
    yaw, pitch = math.atan2(x, z), math.atan2(-y, math.hypot(x, z))
    right, down, _ = _axes(yaw, pitch, 0.0)
    return np.array((yaw, pitch, math.atan2(matrix[:, 0] @ down, matrix[:, 0] @ right)))


def _axes(yaw: float, pitch: float, roll: float) -> Float64:
    """Return the axes (right, down, ahead) of a camera by its angles, as rows."""
    a, b, c, d = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    right, ahead = np.array((a, 0.0, -b)), np.array((c * b, -d, c * a))
    down = np.cross(ahead, right)
    e, f = math.cos(roll), math.sin(roll)
    return np.stack([e * right + f * down, e * down - f * right, ahead])

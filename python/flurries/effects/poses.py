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
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.effects.weather import Film, Weather
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Pixels from node to node, as the kernel has them; the first ones lie so far before the picture.
APART = 64

# Radians that a camera turns, and by which logarithm a lens zooms, before other planes are seen. A
# whole number of the first make a round.
_TURN, _ZOOM = math.tau / 36.0, math.log(1.15)

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
    pixel: float  # Width of a pixel at a depth of 1.


class Planes(NamedTuple):
    """The planes that are seen of some layers."""

    layer: npt.NDArray[np.int64]  # (n,) int.
    weight: Float64  # (n,): of its deviation.
    axes: Float64  # (n, 3, 3): rows turn house axes into the plane's.
    at: Float64  # (n,): along its axis in the air, metres.
    focal: Float64  # (n,): that its sheet is made for, over the longest.
    which: npt.NDArray[np.int64]  # (n, k) int: numbers of the plane among its like.


def eyes_of(weather: Weather, frame: Frame, film: Film) -> Eyes:
    half = 0.5 * value_at(weather.motion.shutter, frame.t)
    times = (frame.t - half, frame.t + half)
    bends = frame.path.turns or frame.path.zooms
    cameras = [frame.later(t - frame.t).camera if bends else frame.camera for t in times]
    height, width = (math.ceil(length / APART) + 3 for length in frame.shape)
    rays, each = np.ones((2, height, width, 3)), np.empty((2, len(film.shares), 3))
    rates = np.empty((len(film.shares), 3))
    for number, (t, camera) in enumerate(zip(times, cameras, strict=True)):
        for axis, middle in enumerate(camera.principal(frame.shape)):
            nodes = APART * np.arange(-1, (width, height)[axis] - 1)
            at = (nodes - middle) / camera.focals[axis]
            rays[number, ..., axis] = at if axis == 0 else at[:, None]
        axes = camera.matrix()
        rays[number] = rays[number] @ axes.T
        offset = axes @ np.array(camera.offset)
        for index, share in enumerate(film.shares):
            way, rates[index] = frame.path.relative(
                t, fps=frame.fps, fall=share.motion.fall, wind=share.motion.mean_wind
            )
            each[number, index] = way + offset
    own = [film.shares.index(layer.share) for layer in film.layers]
    return Eyes(rays, each[:, own], rates[own], 1.0 / frame.camera.focal)


def planes_of(frame: Frame, film: Film, eyes: Eyes) -> Iterator[Planes]:
    """Yield the planes that are seen: one of each layer, and those that give way or come."""
    path, camera, depths = frame.path, frame.camera, [layer.slab.depth for layer in film.layers]
    layers = np.arange(len(depths))
    # Angles, and the zoom: places of the camera among poses that planes are made for.
    places: list[tuple[Float64, float, int]] = []
    if path.turns:
        before, after = (_angles(frame.later(step).camera.matrix()) for step in (-0.5, 0.5))
        for angle, rate in zip(_angles(camera.matrix()), after - before, strict=True):
            rate = (rate + math.pi) % math.tau - math.pi
            places.append((np.full(len(layers), angle / _TURN), abs(rate) / _TURN, 36))
    if path.zooms:
        grown = math.log(camera.focal / path.longest_focal)
        places.append((np.full(len(layers), grown / _ZOOM), abs(path.zoom(frame.t)[1]) / _ZOOM, 0))
    phases = [(part * (layers + 1.0)) % 1.0 for part in _PHASES]
    known = [_place(at - phase, pace) for (at, pace, _), phase in zip(places, phases, strict=False)]
    for taken in itertools.product((0, 1), repeat=len(places)):
        weight, which, middles = np.ones(len(layers)), [], []
        for one, (first, share), (_, _, round_), phase in zip(
            taken, known, places, phases, strict=False
        ):
            number = first + one
            weight = weight * (np.sin if one else np.cos)(0.5 * math.pi * share)
            which.append(number % round_ if round_ else number)
            middles.append(number + 0.5 + phase)
        axes = np.broadcast_to(camera.matrix().T, (len(layers), 3, 3))
        if path.turns:
            axes = np.stack([_axes(*(_TURN * angle[n] for angle in middles[:3])) for n in layers])
        focal = np.exp(_ZOOM * middles[-1]) if path.zooms else np.ones(len(layers))
        yield from _ahead(film, eyes, layers, weight, axes, focal, which)


def _ahead(
    film: Film, eyes: Eyes, layers: npt.NDArray[np.int64], weight: Float64, axes: Float64,
    focal: Float64, which: list[npt.NDArray[np.int64]],
) -> Iterator[Planes]:  # fmt: skip
    """Yield planes by where the camera is along their axes."""
    depths = np.array([layer.slab.depth for layer in film.layers])
    eye = 0.5 * (eyes.eye[0] + eyes.eye[1])
    along = np.einsum("la,la->l", axes[:, 2], eye)
    if not film.comes:
        yield Planes(layers, weight, axes, along + depths, focal, np.zeros((len(layers), 1), int))
        return
    ends = np.array([(layer.slab.near, layer.slab.far) for layer in film.layers])
    thick = ends[:, 1] - ends[:, 0]
    pace = np.abs(np.einsum("la,la->l", axes[:, 2], eyes.rate)) / thick
    phase = (0.6180339887 * (layers + 1.0)) % 1.0
    first, share = _place(along / thick - phase, pace)
    for one in (0, 1):
        own = weight * (np.sin if one else np.cos)(0.5 * math.pi * share)
        seen = own > _LEAST_SEEN
        number = first + one
        at = ends[:, 1] + (number + phase) * thick
        table = np.stack([number, *which], axis=1)
        if seen.any():
            yield Planes(layers[seen], own[seen], axes[seen], at[seen], focal[seen], table[seen])


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

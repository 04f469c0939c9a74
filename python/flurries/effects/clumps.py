"""Snow and rain that are denser in some places than in others: clumps, and the fronts of gusts.

The density is the mean times a function of a sum of waves (`denser` in `src/falling/air.rs`), which
is odd but for its mean of 1. Waves ride with flakes of the mean size, fronts ahead of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects.motion import Motion
from flurries.frame.view import Frame
from flurries.particles.population import Slab

# Pixels from node to node, as the kernel has them; the first ones lie so far before the picture.
APART = 64

# Waves of clumps and of fronts, each, and their lengths in metres.
_WAVES, _CLUMPS, _FRONTS = 5, (3.0, 14.0), (20.0, 70.0)

# Radians by which a front is turned from the wind at most, how far it leans, and how much faster
# than the wind fronts are.
_ASIDE, _LEAN, _FASTER = 0.5, 0.6, 0.5

# Groups of layers that are as dense as the one in their middle; and the stream of the numbers.
_GROUPS, _STREAM = 5, 0x636C756D70


class Clumps(NamedTuple):
    waves: Float64  # (m, 3): cycles per metre, house axes.
    weights: Float64  # (m, 2): real and imaginary parts at the camera.
    strength: float  # 0 to 1.


def clumps_of(weather: Any, frame: Frame) -> Clumps | None:
    """Return the clumps of a weather at a frame; None if it is even."""
    if not weather.clumps:
        return None
    return _clumps(weather.motion, frame.seed, frame.path, frame.fps, frame.t, weather.clumps)


@kept(32)
def _clumps(
    motion: Motion, seed: int, path: CameraPath, fps: float, t: float, strength: float
) -> Clumps:
    waves, phases, rates = _waves(motion, seed)
    (place,) = motion.places(path, fps, [t])
    turned = np.exp(2j * math.pi * (phases + waves @ place - rates * (motion.now(t) / fps)))
    weights = math.sqrt(1.0 / _WAVES) * np.stack([turned.real, turned.imag], axis=1)
    return Clumps(waves, weights, strength)


@kept(32)
def _waves(motion: Motion, seed: int) -> tuple[Float64, Float64, Float64]:
    """Return waves, phases and rates beyond the flakes' own motion, cycles, metres and seconds."""
    wind = motion.mean_wind_at(0.0)
    draws = np.empty((4, 2 * _WAVES))
    for row, draw in enumerate(draws):
        _core.uniform(draw, seed, _STREAM + row)
    # Lengths evenly spread over the octaves, so that every seed has its share of each.
    front, which = np.divmod(np.arange(2 * _WAVES), _WAVES)
    share = (which + draws[0]) / _WAVES
    least, most = np.where(front, np.transpose([_FRONTS]), np.transpose([_CLUMPS]))
    length = least * (most / least) ** share
    speed = math.hypot(wind[0], wind[2])
    ahead = math.atan2(wind[2], wind[0]) if speed else 2.0 * math.pi * draws[1, 0]
    # Clumps lie anyhow; fronts stand across the wind.
    around = np.where(front, ahead + _ASIDE * (2.0 * draws[1] - 1.0), 2.0 * math.pi * draws[1])
    up = np.where(front, _LEAN, 1.0) * (2.0 * draws[2] - 1.0)
    flat = np.sqrt(1.0 - up**2)
    unit = np.stack([flat * np.cos(around), up, flat * np.sin(around)], axis=1)
    waves = np.ascontiguousarray(unit / length[:, None])
    return waves, draws[3], np.where(front, _FASTER, 0.0) * (waves @ wind)


def rays_of(camera: Camera, shape: tuple[int, int]) -> tuple[Float64, Float64]:
    """Return the rays of the nodes, (R, C, 3), house axes, with a depth of 1; and the axes."""
    (x, y), (across, down), turn = camera.principal(shape), camera.focals, camera.matrix()
    height, width = (math.ceil(length / APART) + 3 for length in shape)
    rays = np.ones((height, width, 3))
    rays[..., 0] = (APART * np.arange(-1, width - 1) - x) / across
    rays[..., 1] = (APART * np.arange(-1, height - 1)[:, None] - y) / down
    return np.asarray(rays @ turn.T), turn


def denser(
    clumps: Clumps, camera: Camera, rays: Float64, turn: Float64, slabs: Sequence[Slab]
) -> Float64:
    """Return how many times as dense as the mean slabs are at the nodes of the frame, (S, R, C)."""
    length, along = np.linalg.norm(clumps.waves, axis=1), clumps.waves @ turn[:, 2]
    # Of waves shorter than a slab is thick, or than nodes are apart, the mean is seen.
    depths, thick = np.array([(slab.depth, slab.far - slab.near) for slab in slabs]).T[..., None]
    seen = np.sinc(along * thick)
    seen *= np.exp(-0.5 * (math.pi * (APART * depths / camera.focal) * length) ** 2)
    points = depths[..., None] * rays.reshape(-1, 3) + turn @ np.array(camera.offset)
    found, weights = np.empty(points.shape[:2]), clumps.weights * seen[..., None]
    _core.denser(found, points, clumps.waves, weights, clumps.strength)
    return found.reshape(-1, *rays.shape[:2])


def gains_of(weather: Any, frame: Frame, slabs: Sequence[Slab]) -> Any:
    """Return factors of groups of layers, near ones first, at the nodes, for `_core.sheet_read`."""
    clumps = clumps_of(weather, frame)
    if clumps is None:
        return None
    camera, most = frame.camera, min(_GROUPS, len(slabs))
    parts = np.array_split(np.arange(len(slabs)), most)
    middles = [slabs[part[len(part) // 2]] for part in parts]
    make = partial(denser, clumps, camera, *rays_of(camera, frame.shape), middles)
    alone = frame.shared is None
    found = make() if alone else frame.once(weather, "denser", make, eye=True)
    counts = [len(part) for part in parts]
    return np.asarray(found, np.float32), counts, (frame.window[0], frame.window[2])

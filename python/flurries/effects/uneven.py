"""The wind beyond its mean and the density by places: metres since frame 0, metres per frame."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects.motion import Motion, air_course
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, course_of, integral_of, integral_to, value_at
from flurries.motion.waves import Waves, carry, paced
from flurries.motion.wind import Wind
from flurries.particles.population import Slab

_TOGETHER = 4096  # Frames that the integral of a profile takes together.

_way_of = kept(32)(integral_of)


def wind_at(motion: Motion, frame: Frame, ahead: Float64) -> tuple[Float64, Float64]:
    """Return the air's way and velocity beyond the mean wind at places (..., 3), eye's axes."""
    wind = _varied(motion)
    points = np.ascontiguousarray(ahead.reshape(-1, 3))
    moved, rate = np.zeros((2, *points.shape))
    if wind.profile is not None:
        _require_straight(frame.path)
        factor, own = wind.extra(points[:, 2])
        mean = integral_to(wind.steady, frame.t) / frame.fps
        blows = np.array(value_at(wind.steady, frame.t)) / frame.fps
        moved = frame.to_camera(factor[:, None] * mean + own * (frame.t / frame.fps))
        rate = frame.to_camera(factor[:, None] * blows + own / frame.fps)
        # Without the part along the view.
        moved[:, 2] = rate[:, 2] = 0.0
    if wind.waves is not None:
        waves, path, fps = wind.waves, frame.path, frame.fps
        world = path.place(frame.t, fps=fps) + points @ frame.camera.matrix().T
        now = np.exp(-1j * waves.omega * frame.t / fps) / fps
        # Of the flake that is at the place now.
        way, sums = carry(waves, path.course(fps), fps)
        back = np.exp(-1j * (waves.k @ way.to(frame.t)))
        both = waves.at(world, np.asarray(_complex(sums.to(frame.t)) * back / fps), now)
        moved = moved + frame.to_camera(both[:, :3])
        rate = rate + frame.to_camera(both[:, 3:])
    return moved.reshape(ahead.shape), rate.reshape(ahead.shape)


def wave_weights(motion: Motion, fps: float, times: Sequence[float], start: Float64) -> Float64:
    """Return what gusts and swirls have done to flakes at n frames, as sums of waves, (m, 6 n)."""
    waves = _varied(motion).waves
    assert waves is not None
    way = waves, air_course(fps, motion.fall, motion.mean_wind)
    _, sums = carry(*(way if motion.pace == 1.0 else paced(*way, fps, motion.pace)), fps)
    there = np.exp(1j * (waves.k @ start)) / fps
    parts = [waves.a * (_complex(sums.to(motion.now(t))) * there)[:, None] for t in times]
    weights = np.concatenate(parts, axis=1)
    return np.ascontiguousarray(np.concatenate([weights.real, weights.imag], axis=1))


@kept(32)
def cycles_of(waves: Waves) -> Float64:
    """Return the waves' vectors in cycles per metre, (m, 3)."""
    return np.ascontiguousarray(waves.k / (2.0 * np.pi))


def carried_by_profile(
    motion: Motion, path: CameraPath, fps: float, t: float, ahead: Float64
) -> Float64:
    """Return how far a wind of depth has carried flakes since frame 0, (n, 2) metres, x and y."""
    _require_straight(path)
    wind, steady = _varied(motion), motion.mean_wind
    depth = ahead + (path.place(t, fps=fps)[2] - path.place(0.0, fps=fps)[2])
    course, t = air_course(fps, motion.fall, steady), motion.now(t)
    bends = course.slopes is not None and course.slopes[:, 2].any()
    if not (course.values[:, 2].any() or bends):
        factor, own = wind.extra(depth)
        moved = factor[:, None] * (integral_to(steady, t) / fps) + own * (t / fps)
        return np.asarray(moved[:, :2])
    # One that comes nearer has felt the wind of every depth that it came through.
    way, blowing = _way_of(course), course_of(steady)
    nearer = float(way.to(t)[2])
    felt = np.zeros((len(depth), 3))
    for times, lengths in _middles(t):
        was = depth + (way.at(times)[:, 2] - nearer)[:, None]
        factor, own = wind.extra(was.ravel())
        mean, _ = blowing.line(times, times)
        felt += np.einsum("t,tn,ta->na", lengths, factor.reshape(was.shape), mean)
        felt += np.einsum("t,tna->na", lengths, own.reshape(*was.shape, 3))
    return np.asarray(felt[:, :2] / fps)


def _require_straight(path: CameraPath) -> None:
    if path.turns:
        # What is behind what would change.
        raise ValueError("wind: a profile over depth needs a camera that does not turn")


def _varied(motion: Motion) -> Wind:
    assert isinstance(motion.wind, Wind)
    return motion.wind


def _complex(parts: Float64) -> Any:
    """Return numbers whose real parts come first, then their imaginary ones."""
    half = len(parts) // 2
    return parts[:half] + 1j * parts[half:]


def _middles(t: float) -> Iterator[tuple[Float64, Float64]]:
    """Yield the middles of the frames from 0 to `t`, the last a part of one, and their lengths."""
    whole = math.trunc(t)
    sign = -1.0 if t < 0.0 else 1.0
    for first in range(0, abs(whole), _TOGETHER):
        numbers = np.arange(first, min(first + _TOGETHER, abs(whole)), dtype=np.float64)
        yield (numbers + 0.5) * sign, np.full(len(numbers), sign)
    yield np.array([0.5 * (whole + t)]), np.array([t - whole])


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
    wind = motion.mean_wind
    wind = wind.value(0.0) if isinstance(wind, Keys) else wind
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


@kept(8)
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
    length, along = np.sqrt((clumps.waves**2).sum(axis=1)), clumps.waves @ turn[:, 2]
    # Of waves shorter than a slab is thick, or than nodes are apart, the mean is seen.
    depths, thick = np.array([(slab.depth, slab.far - slab.near) for slab in slabs]).T[..., None]
    seen = np.sinc(along * thick)
    seen *= np.exp(-0.5 * (math.pi * (APART * depths / camera.focal) * length) ** 2)
    points = depths[..., None] * rays.reshape(-1, 3) + turn @ np.array(camera.offset)
    sums = np.empty((*points.shape[:2], 1))
    for own, at, weights in zip(sums, points, clumps.weights * seen[..., None], strict=True):
        _core.wind_waves(own, at, clumps.waves, weights)
    sums = clumps.strength * sums / np.sqrt(1.0 + sums * sums)
    return 1.0 + sums.reshape(-1, *rays.shape[:2])


def gains_of(weather: Any, frame: Frame, slabs: Sequence[Slab]) -> Any:
    """Return factors of groups of layers, near ones first, at the nodes, for `_core.sheet_read`."""
    clumps = clumps_of(weather, frame)
    if clumps is None:
        return None
    camera, most = frame.camera, min(_GROUPS, len(slabs))
    parts = np.array_split(np.arange(len(slabs)), most)
    middles = [slabs[part[len(part) // 2]] for part in parts]
    make = partial(denser, clumps, camera, *rays_of(camera, frame.shape), middles)
    found = make() if frame.shared is None else frame.once(weather, "denser", make, eye=True)
    counts = [len(part) for part in parts]
    return np.asarray(found, np.float32), counts, (frame.window[0], frame.window[2])

"""Flakes as points in a box that wraps, and their picture (Langer 2004, sections 6 and 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import MOST_ELEMENTS, Array, ArrayLike, Float64
from flurries.camera.lens import Camera, expect_camera

__all__ = ["edge_fade", "ids", "positions", "splat", "sway_offsets"]


def positions(
    count: int, box: ArrayLike, *, seed: int, velocity: ArrayLike, time: float,
    center: ArrayLike = (0.0, 0.0, 0.0), sway: tuple[float, float] | None = None,
    out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the places (count, 3) of flakes at a time, in a box that wraps around a centre.

    p = c + wrap(B u + v t - c), wrap(x) = x - B floor(x / B + 1/2), with u uniform in [0, 1)^3,
    hashed from the seed and the flake's index: flake i is row i whatever `count` is, (x, y, z)
    float64, absolute, world units. Without sway the offset from the centre lies in [-B/2, B/2) on
    each axis, up to the rounding of the sum. At time 1e9 a place is exact within 1e-15 B.

    Parameters
    ----------
    count : int
        How many flakes, 0 or more.
    box : float or (3,) floats
        B, the sides of the box, world units, 1e-100 to 1e100.
    velocity, time : (3,) or (count, 3), and float
        v, flake minus world, world units per unit of time, and t (frames, in a scene).
    center : (3,), optional
        c, the middle of the box: as a rule where the camera is. World units.
    sway : (float, float), optional
        Of the offsets that are added after the wrap: see :func:`sway_offsets`.
    """
    number = check.integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    sides, middle = _box(box, center)
    rate = check.each_of("velocity", velocity, number, (3,))
    result = check.output(out, (number, 3), np.dtype(np.float64), rate)
    swing = None if sway is None else _sway(sway)
    moment = check.real("time", time)
    _core.particle_positions(result, sides, middle, check.seed_of(seed), rate, moment, swing)
    return result


def sway_offsets(
    count: int, *, seed: int, time: float, sway: tuple[float, float], out: Float64 | None = None
) -> Float64:
    """Return the offsets (count, 3) that :func:`positions` adds for the sway at a time.

    Row i is amplitude * (sin(w t + phi1), 0, sin(w t + phi2)), world units, the phases hashed for
    flake i; `sway` is (amplitude, w), world units and radians per unit of time. Their difference
    over an exposure, over it, is the sway's part of a velocity.
    """
    number = check.integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    result = check.output(out, (number, 3), np.dtype(np.float64))
    _core.particle_sway_offsets(result, check.seed_of(seed), check.real("time", time), _sway(sway))
    return result


def edge_fade(
    points: ArrayLike, box: ArrayLike, *, center: ArrayLike = (0.0, 0.0, 0.0),
    out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return the share (n,) of each flake that is shown, so that none pops where the box wraps.

    It is the product over the axes of 1 - smoothstep(0.85, 1, 2 |p - c| / B) of `points` (n, 3),
    with the box and the centre of :func:`positions`: from 0 at the walls and outside to 1.
    """
    place = check.rows_of("points", points, 3)
    sides, middle = _box(box, center)
    result = check.output(out, (len(place),), np.dtype(np.float64), place)
    _core.particle_edge_fade(result, place, sides, middle)
    return result


def splat(
    shape: tuple[int, int], points: ArrayLike, radius: ArrayLike, camera: Camera, *,
    opacity: ArrayLike, velocity: ArrayLike | None = None, shutter: float = 0.0, near: float = 0.1,
    depth: ArrayLike | None = None, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return the alpha (H, W) of many flakes of one color, 1 - prod(1 - alpha_i), 0 to 1.

    A flake of radius r at depth D is a Gaussian with sigma = f r / (3 D) px around (cx + f x / z,
    cy + f y / z), drawn with sigma_e^2 = max(sigma^2 + 1/12, 0.38) and an amplitude lowered by
    sigma^2 / sigma_e^2, which keeps its energy: one faint flake's alpha at the pixel centres (j +
    1/2, i + 1/2) sums to 2 pi opacity sigma^2 within 0.2 %. Footprints go smoothly to 0 from 3 to 4
    sigma_e. One that moves is the exact integral along its path, cut at the near plane before the
    perspective division. Flakes whose image is farther out or wider than 1e30 px are left out.

    Parameters
    ----------
    points : (n, 3)
        Where the flakes are at mid-exposure, in camera axes (x right, y down, z forward), world
        units. ``camera.offset`` is subtracted; ``camera.rotation`` is not applied.
    radius, opacity : float or (n,)
        World units, 0 or more; a third of it is sigma. And the opacity in the centre of a large
        resting flake, 0 to 1.
    camera : Camera
        Its focal length, principal point and offset are used.
    velocity, shutter : (3,) or (n, 3), and float
        Flake minus camera, world units per frame, and exposure in frames: the flake moves from p -
        v shutter / 2 to p + v shutter / 2.
    near : float, optional
        Nothing nearer than this depth is drawn, world units, more than 0. A flake that crosses it
        keeps the share of its opacity that the exposure had in front.
    depth : (H, W), optional
        Depth of what stands in the picture, world units; infinity is the sky. It hides a flake that
        is farther, at the middle of its clipped path. NaN hides nothing.
    """
    size, kind = check.shape_of("shape", shape), check.float_dtype(dtype)
    flakes, inputs = _read(size, points, radius, camera, opacity, velocity, shutter, near, depth)
    result = check.output(out, size, kind, *inputs)
    _core.particle_splat(result, *flakes)
    return result


def ids(
    shape: tuple[int, int], points: ArrayLike, radius: ArrayLike, camera: Camera, *,
    opacity: ArrayLike, velocity: ArrayLike | None = None, shutter: float = 0.0, near: float = 0.1,
    depth: ArrayLike | None = None, out: npt.NDArray[np.int32] | None = None,
) -> npt.NDArray[np.int32]:  # fmt: skip
    """Return the number (H, W) of the flake that each pixel shows, drawn as by :func:`splat`.

    It is the row in `points` of the flake whose own opacity at the pixel's centre is the greatest,
    the first of equals; -1 outside all footprints. A footprint ends where its opacity is 0.
    """
    size = check.shape_of("shape", shape)
    flakes, inputs = _read(size, points, radius, camera, opacity, velocity, shutter, near, depth)
    result = check.output(out, size, np.dtype(np.int32), *inputs)
    _core.particle_ids(result, *flakes)
    return result


def _read(
    shape: tuple[int, int], points: ArrayLike, radius: ArrayLike, camera: Camera,
    opacity: ArrayLike, velocity: ArrayLike | None, shutter: float, near: float,
    depth: ArrayLike | None,
) -> tuple[tuple[Any, ...], list[npt.NDArray[Any]]]:  # fmt: skip
    place = check.rows_of("points", points, 3)
    aspect = expect_camera(camera, stretched=True).aspect
    width = check.each_of("radius", radius, len(place))
    cover = check.each_of("opacity", opacity, len(place))
    moves = np.zeros(3) if velocity is None else velocity
    rate = check.each_of("velocity", moves, len(place), (3,))
    exposure = check.real("shutter", shutter, low=0.0)
    closest = check.real("near", near, above=0.0)
    map_ = None if depth is None else check.plane_of("depth", depth, shape)
    inputs = [place, width, cover, rate, *([] if map_ is None else [map_])]
    if aspect != 1.0:
        # Everything is as much higher as pixels are.
        stretch = np.array([1.0, aspect, 1.0])
        place, rate = place * stretch, rate * stretch
    x, y, z = camera.offset
    lens = (camera.focal, *camera.principal(shape), (x, aspect * y, z), closest)
    return ((place, width, cover, rate, exposure), lens, map_), inputs


def _box(box: ArrayLike, center: ArrayLike) -> tuple[Any, Any]:
    one = check.rectangular("box", box).ndim == 0
    sides = [check.real("box", box, above=0.0)] * 3 if one else check.vector("box", box, 3).tolist()
    return sides, check.vector("center", center, 3).tolist()


def _sway(sway: Any) -> tuple[float, float]:
    if not check.is_pair(sway):
        raise TypeError(f"sway must be (amplitude, angular_frequency), got {check._came(sway)}")
    return check.real("sway[0]", sway[0]), check.real("sway[1]", sway[1])

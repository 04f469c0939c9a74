"""Sparse flakes in front of the texture (Langer 2004, sections 6 and 7).

Flakes are points in a box that wraps. Where each is at any time follows from the seed and its index
alone, so frames can be made in any order, on any number of threads or machines.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    MOST_ELEMENTS,
    Array,
    Float64,
    _came,
    float_dtype,
    integer,
    is_pair,
    output,
    pixels,
    real,
    seed_of,
    shape_of,
    table,
    vector,
)
from flurries.camera.lens import Camera, expect_camera

__all__ = ["edge_fade", "ids", "positions", "splat", "sway_offsets"]

_Triple = tuple[float, float, float]


def positions(
    count: int,
    box: npt.ArrayLike,
    *,
    seed: int,
    velocity: npt.ArrayLike,
    time: float,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    sway: tuple[float, float] | None = None,
    out: Float64 | None = None,
) -> Float64:
    """Return where the flakes are at a time: stateless, in a box that wraps around a centre.

    p = c + wrap(B u + v t - c), wrap(x) = x - B floor(x / B + 1/2), with u uniform in [0, 1)^3,
    hashed from the seed and the flake's index. The density is the same everywhere in the box, at
    every time, wherever the centre goes; flake i is the same whatever `count` is.

    Parameters
    ----------
    count : int
        How many flakes, 0 or more.
    box : float or (3,) floats
        B, the sides of the box, world units, 1e-100 to 1e100.
    seed : int
        Any int64.
    velocity : (3,) or (count, 3)
        Flake minus world, world units per unit of time.
    time : float
        Any; the unit is the caller's (frames, in a scene).
    center : (3,), optional
        c, the middle of the box: as a rule where the camera is. World units.
    sway : (float, float), optional
        ``(amplitude, angular_frequency)``, world units and radians per unit of time: adds
        amplitude * (sin(w t + phi1), 0, sin(w t + phi2)) after the wrap, the phases hashed per
        flake. See `sway_offsets`.
    out : (count, 3) float64, optional
        Array to write into and return.

    Returns
    -------
    (count, 3) float64
        Row i is flake i's (x, y, z), absolute, world units. Without sway the offset from the centre
        lies in [-B/2, B/2) on each axis, up to the rounding of the sum with the centre.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described, or velocity * time overflows; the message names it.

    Notes
    -----
    velocity * time is reduced by whole boxes with the rounding error of the product carried along,
    so at time 1e9 a position is as exact as at time 0: within 1e-15 B, for the velocity as given in
    float64. A centre far away costs the last digits of its own coordinates and no more.

    Source: Langer 2004, section 6.
    """
    number = integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    sides, middle = _box(box, center)
    rate = _rows("velocity", velocity, number, (3,), "(3,) or (count, 3)")
    result = output(out, (number, 3), np.dtype(np.float64), rate)
    _core.particle_positions(
        result, sides, middle, seed_of(seed), rate, real("time", time), _sway(sway)
    )
    return result


def sway_offsets(
    count: int,
    *,
    seed: int,
    time: float,
    sway: tuple[float, float],
    out: Float64 | None = None,
) -> Float64:
    """Return what `positions` adds for the sway at a time.

    The difference over an exposure, divided by it, is the sway's part of a flake's velocity:
    ``(sway_offsets(n, time=t + s/2, ...) - sway_offsets(n, time=t - s/2, ...)) / s``.

    Parameters
    ----------
    count : int
        How many flakes, 0 or more.
    seed : int
        As given to `positions`.
    time : float
        Any.
    sway : (float, float)
        ``(amplitude, angular_frequency)``, world units and radians per unit of time.
    out : (count, 3) float64, optional
        Array to write into and return.

    Returns
    -------
    (count, 3) float64
        Row i is amplitude * (sin(w t + phi1), 0, sin(w t + phi2)) of flake i, world units.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described; the message names it.

    Notes
    -----
    The angle w t is reduced exactly, so it is as good at time 1e9 as at time 0.
    """
    number = integer("count", count, low=0, high=MOST_ELEMENTS // 3)
    result = output(out, (number, 3), np.dtype(np.float64))
    swing = _sway(sway)
    if swing is None:
        raise TypeError("sway must be (amplitude, angular_frequency), got None")
    _core.particle_sway_offsets(result, seed_of(seed), real("time", time), swing)
    return result


def edge_fade(
    points: npt.ArrayLike,
    box: npt.ArrayLike,
    *,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    out: Float64 | None = None,
) -> Float64:
    """Return how much of each flake is shown, so that none pops where the box wraps.

    Parameters
    ----------
    points : (n, 3)
        Absolute positions, as `positions` gives them, world units.
    box : float or (3,) floats
        B, the sides of the box, world units.
    center : (3,), optional
        c, the middle of the box, world units.
    out : (n,) float64, optional
        Array to write into and return.

    Returns
    -------
    (n,) float64
        The product over the axes of 1 - smoothstep(0.85, 1, 2 |p - c| / B), from 0 at the walls
        (and outside) to 1; to be multiplied into the opacity.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described; the message names it.
    """
    place = _points(points)
    sides, middle = _box(box, center)
    result = output(out, (len(place),), np.dtype(np.float64), place)
    _core.particle_edge_fade(result, place, sides, middle)
    return result


def splat(
    shape: tuple[int, int],
    points: npt.ArrayLike,
    radius: npt.ArrayLike,
    camera: Camera,
    *,
    opacity: npt.ArrayLike,
    velocity: npt.ArrayLike | None = None,
    shutter: float = 0.0,
    near: float = 0.1,
    depth: npt.ArrayLike | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return the alpha of many flakes of one color.

    A flake of radius r at depth D is a Gaussian with sigma = f r / (3 D) px around
    (cx + f x / z, cy + f y / z). It is drawn with sigma_e^2 = max(sigma^2 + 1/12, 0.38) and an
    amplitude lowered by sigma^2 / sigma_e^2, which keeps its energy at every sub-pixel position.
    One that moves during the exposure becomes the exact integral of that Gaussian along its path,
    cut at the near plane before the perspective division.

    Parameters
    ----------
    shape : (int, int)
        (H, W), px.
    points : (n, 3)
        Where the flakes are at mid-exposure, in camera axes (x right, y down, z forward), world
        units. ``camera.offset`` is subtracted; ``camera.rotation`` is not applied.
    radius : float or (n,)
        World units, 0 or more; a third of it is sigma.
    camera : Camera
        Its focal length, principal point and offset are used.
    opacity : float or (n,)
        Opacity in the centre of a large resting flake, 0 to 1.
    velocity : (3,) or (n, 3), optional
        Flake minus camera, world units per frame. Without it flakes rest.
    shutter : float, optional
        Exposure, frames: the flake moves from p - v shutter / 2 to p + v shutter / 2.
    near : float, optional
        Nothing nearer than this depth is drawn, world units, more than 0. A flake that crosses it
        keeps the share of its opacity that the exposure had in front.
    depth : (H, W), optional
        Depth of what stands in the picture, world units; infinity is the sky. Where it is nearer
        than the flake (at the middle of its clipped path), the flake is hidden. NaN hides nothing.
    dtype : float32 or float64, optional
        Type of the result.
    out : (H, W) array of that dtype, optional
        Array to write into and return.

    Returns
    -------
    (H, W) array
        alpha = 1 - prod(1 - alpha_i) at the pixel centres (j + 1/2, i + 1/2), from 0 to 1. The sum
        of one faint flake's alpha is 2 pi opacity sigma^2 within 0.2 %, resting or moving.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described; the message names it.

    Notes
    -----
    The order of the flakes does not matter beyond rounding, and the bits do not depend on the
    thread count; other vector instructions may change the last ones, unless
    :func:`flurries.set_reproducible` keeps them. Transmittance is accumulated in float64: 1e5
    layers are right to 1e-6. float32 differs from float64 by less than 4e-6 where flakes overlap.

    The footprint is the Gaussian (or its integral) inside 3 sigma_e and goes smoothly to 0 at
    4 sigma_e, along and across the motion (along x and y if that is shorter than sigma_e). Its
    amplitude carries a factor 1 + 4.8e-4 / sigma_e^2 that makes up for the end. A path is taken as
    straight and evenly bright in the picture. Flakes whose image is farther out or wider than
    1e30 px are left out. Time grows with the number of pixels that flakes cover.

    Source: Langer 2004, sections 6 and 7.
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    flakes, inputs = settled(
        size, points, radius, camera, opacity=opacity, velocity=velocity, shutter=shutter,
        near=near, depth=depth,
    )  # fmt: skip
    result = output(out, size, kind, *inputs)
    _core.particle_splat(result, *flakes)
    return result


def ids(
    shape: tuple[int, int],
    points: npt.ArrayLike,
    radius: npt.ArrayLike,
    camera: Camera,
    *,
    opacity: npt.ArrayLike,
    velocity: npt.ArrayLike | None = None,
    shutter: float = 0.0,
    near: float = 0.1,
    depth: npt.ArrayLike | None = None,
    out: npt.NDArray[np.int32] | None = None,
) -> npt.NDArray[np.int32]:
    """Return which flake each pixel shows.

    Parameters
    ----------
    shape, points, radius, camera, opacity, velocity, shutter, near, depth
        As given to `splat`.
    out : (H, W) int32, optional
        Array to write into and return.

    Returns
    -------
    (H, W) int32
        The row in `points` of the flake whose own opacity at the pixel's centre is the greatest,
        the first of equals; -1 outside all footprints. A footprint ends where its opacity is 0.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described; the message names it.

    Notes
    -----
    Time grows with the flakes' footprints, and is about that of `splat` in float64.
    """
    size = shape_of("shape", shape)
    flakes, inputs = settled(
        size, points, radius, camera, opacity=opacity, velocity=velocity, shutter=shutter,
        near=near, depth=depth,
    )  # fmt: skip
    result = output(out, size, np.dtype(np.int32), *inputs)
    _core.particle_ids(result, *flakes)
    return result


def settled(
    shape: tuple[int, int],
    points: npt.ArrayLike,
    radius: npt.ArrayLike,
    camera: Camera,
    *,
    opacity: npt.ArrayLike,
    velocity: npt.ArrayLike | None,
    shutter: float,
    near: float,
    depth: npt.ArrayLike | None,
) -> tuple[tuple[Any, ...], list[npt.NDArray[Any]]]:
    """Return flakes as the kernels read them, and the arrays that no output may overlap."""
    place = _points(points)
    count = len(place)
    aspect = expect_camera(camera, stretched=True).aspect
    width = _rows("radius", radius, count, (), "one number or (n,)")
    cover = _rows("opacity", opacity, count, (), "one number or (n,)")
    rate = _rows(
        "velocity", (0.0, 0.0, 0.0) if velocity is None else velocity, count, (3,), "(3,) or (n, 3)"
    )
    exposure = real("shutter", shutter, low=0.0)
    closest = real("near", near, above=0.0)
    inputs = [place, width, cover, rate]
    map_: npt.NDArray[Any] | None = None
    if depth is not None:
        map_, _ = pixels("depth", depth, ndim=2)
        if map_.shape != shape:
            raise ValueError(f"depth must have shape {shape}, got {map_.shape}")
        inputs.append(map_)
    x, y = camera.principal(shape)
    eye_x, eye_y, eye_z = camera.offset
    if aspect != 1.0:
        # Everything is as much higher as pixels are.
        stretch = np.array([1.0, aspect, 1.0])
        place, rate = place * stretch, rate * stretch
    lens = (camera.focal, x, y, (eye_x, aspect * eye_y, eye_z), closest)
    return (place, width, cover, rate, exposure, lens, map_), inputs


def _triple(values: Float64) -> _Triple:
    x, y, z = values.tolist()
    return x, y, z


def _single(value: object) -> bool:
    """Tell one number from an array; lists and tuples are arrays."""
    return getattr(value, "ndim", 0) == 0 and not isinstance(value, (list, tuple))


def _box(box: npt.ArrayLike, center: npt.ArrayLike) -> tuple[_Triple, _Triple]:
    middle = _triple(vector("center", center, 3))
    if _single(box):
        side = real("box", box, above=0.0)
        return (side, side, side), middle
    return _triple(vector("box", box, 3)), middle


def _points(points: npt.ArrayLike) -> Float64:
    place = table("points", points)
    if place.shape[1] != 3:
        raise ValueError(f"points must be (n, 3), got an array of shape {place.shape}")
    return place


def _rows(
    name: str, value: npt.ArrayLike, count: int, row: tuple[int, ...], wanted: str
) -> Float64:
    """Return (1, *row) or (count, *row): a value for all flakes, or one for each."""
    if row == () and _single(value):
        return np.array([real(name, value)])
    values = table(name, value, ndim=None)
    if row != () and values.shape == row:
        return values.reshape((1, *row))
    if values.shape != (count, *row):
        raise ValueError(
            f"{name} must be {wanted} with {count} rows, got an array of shape {values.shape}"
        )
    return values


def _sway(sway: Any) -> tuple[float, float] | None:
    if sway is None:
        return None
    if not is_pair(sway):
        raise TypeError(f"sway must be (amplitude, angular_frequency), got {_came(sway)}")
    return real("sway[0]", sway[0]), real("sway[1]", sway[1])

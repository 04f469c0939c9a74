"""The picture of flakes: alpha, and the flake of each pixel (Langer 2004, sections 6 and 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, float_dtype, output, pixels, real, shape_of
from flurries.camera.lens import Camera, expect_camera
from flurries.particles.places import points_of, rows_of


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
    (cx + f x / z, cy + f y / z), drawn with sigma_e^2 = max(sigma^2 + 1/12, 0.38) and an amplitude
    lowered by sigma^2 / sigma_e^2, which keeps its energy. One that moves is the exact integral of
    that Gaussian along its path, cut at the near plane before the perspective division.

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
        Depth of what stands in the picture, world units; infinity is the sky. It hides a flake that
        is farther, at the middle of its clipped path. NaN hides nothing.

    Returns
    -------
    (H, W) array
        alpha = 1 - prod(1 - alpha_i) at the pixel centres (j + 1/2, i + 1/2), from 0 to 1. The sum
        of one faint flake's alpha is 2 pi opacity sigma^2 within 0.2 %, resting or moving.

    Notes
    -----
    The order of the flakes does not matter beyond rounding. float32 differs from float64 by less
    than 4e-6 where flakes overlap. The footprint goes smoothly to 0 from 3 to 4 sigma_e, which a
    factor 1 + 4.8e-4 / sigma_e^2 makes up for. Flakes whose image is farther out or wider than
    1e30 px are left out. Source: Langer 2004, sections 6 and 7.
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    flakes, inputs = _read(size, points, radius, camera, opacity, velocity, shutter, near, depth)
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
    """Return the number of the flake that each pixel shows; parameters as in `splat`.

    Returns
    -------
    (H, W) int32
        The row in `points` of the flake whose own opacity at the pixel's centre is the greatest,
        the first of equals; -1 outside all footprints. A footprint ends where its opacity is 0.
    """
    size = shape_of("shape", shape)
    flakes, inputs = _read(size, points, radius, camera, opacity, velocity, shutter, near, depth)
    result = output(out, size, np.dtype(np.int32), *inputs)
    _core.particle_ids(result, *flakes)
    return result


def _read(
    shape: tuple[int, int], points: npt.ArrayLike, radius: npt.ArrayLike, camera: Camera,
    opacity: npt.ArrayLike, velocity: npt.ArrayLike | None, shutter: float, near: float,
    depth: npt.ArrayLike | None,
) -> tuple[tuple[Any, ...], list[npt.NDArray[Any]]]:  # fmt: skip
    """Return flakes as the kernels read them, and the arrays that no output may overlap."""
    place = points_of(points)
    count = len(place)
    aspect = expect_camera(camera, stretched=True).aspect
    width = rows_of("radius", radius, count, (), "one number or (n,)")
    cover = rows_of("opacity", opacity, count, (), "one number or (n,)")
    moved = (0.0, 0.0, 0.0) if velocity is None else velocity
    rate = rows_of("velocity", moved, count, (3,), "(3,) or (n, 3)")
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
    return ((place, width, cover, rate, exposure), lens, map_), inputs

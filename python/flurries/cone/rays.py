"""Where a pixel's ray meets the double cone: azimuth, height, footprint and fade."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Float64, real, shape_of, table, vector
from flurries.camera.lens import Camera, expect_camera

__all__ = ["Rays", "rays"]

# What a kernel needs to know of a camera in a cone: focal, cx, cy, rotation, axis, slope, eye.
Pose: TypeAlias = tuple[
    float, float, float, list[float], tuple[float, ...], float, tuple[float, ...]
]

# An eye further off the middle than this share of the radius may see the cone from outside.
FARTHEST_EYE = 0.5


@dataclass(frozen=True)
class Rays:
    """The point of the cone that every pixel sees.

    Attributes
    ----------
    azimuth : (H, W) float64
        Turns around the axis, in [0, 1).
    height : (H, W) float64
        Along the axis over the cone's radius: ``s / (c + slope |s|)`` for a ray with s along the
        axis and c across it.
    azimuth_step, height_step : (H, W) float64
        How much each changes from pixel to pixel: the lengths of their gradients in the picture.
    fade : (H, W) float64
        How much is shown, 1 up to 82 degrees from the equator, 0 from 89.4 degrees on.
    """

    azimuth: Float64
    height: Float64
    azimuth_step: Float64
    height_step: Float64
    fade: Float64


def rays(
    shape: tuple[int, int],
    camera: Camera,
    *,
    axis: npt.ArrayLike,
    slope: float = 0.0,
    radius: float = math.inf,
    points_px: npt.ArrayLike | None = None,
) -> Rays:
    """Return the places on a double cone that the pixels see.

    Parameters
    ----------
    shape, camera, axis, slope, radius
        See :func:`layer`.
    points_px : (n, 2), optional
        Positions (x, y) in the picture, in place of every pixel's centre.

    Returns
    -------
    Rays
        Planes (H, W), or rows (n,) for `points_px`.
    """
    size = shape_of("shape", shape)
    given = pose(size, camera, axis, slope, radius)
    wanted: tuple[int, ...] = size
    if points_px is None:
        places = np.mgrid[: size[0], : size[1]][::-1].reshape(2, -1).T + 0.5
    else:
        places = table("points_px", points_px)
        wanted = (len(places),)
        if places.shape[1] != 2:
            raise ValueError(f"points_px must have shape (n, 2), got {places.shape}")
    values = np.empty((len(places), 5))
    _core.cone_rays(values, np.ascontiguousarray(places), given)
    return Rays(*(np.ascontiguousarray(column).reshape(wanted) for column in values.T))


def pose(
    shape: tuple[int, int], camera: Camera, axis: npt.ArrayLike, slope: float, radius: float
) -> Pose:
    """Return the pose of a camera in a cone, as a kernel takes it."""
    view = expect_camera(camera)
    x, y = view.principal(shape)
    cone = real("slope", slope, low=0.0, high=1e6)
    way = vector("axis", axis, 3)
    if not way.any():
        raise ValueError(f"axis must not be zero, got {tuple(way.tolist())}")
    # No negative zeros.
    eye = np.array(view.offset) / reach_of(radius) + 0.0
    if float(np.linalg.norm(eye)) * (1.0 + cone) > FARTHEST_EYE:
        raise ValueError(
            f"radius must be at least {(1.0 + cone) / FARTHEST_EYE:g} times the length of "
            f"camera.offset {view.offset}, got {radius!r}"
        )
    rotation = view.matrix().ravel().tolist()
    return view.focal, x, y, rotation, tuple(way.tolist()), cone, tuple(eye.tolist())


def reach_of(radius: object) -> float:
    """Return the radius of a cone, which may be infinite."""
    if isinstance(radius, float) and radius == math.inf:
        return math.inf
    return real("radius", radius, above=0.0)

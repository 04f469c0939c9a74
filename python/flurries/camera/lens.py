"""The camera: where a point of the air is seen, and how its image moves (Langer 2004, section 7).

Axes: x right, y down, z forward = depth. Pixel (row i, column j) has its centre at x = j + 1/2,
y = i + 1/2. Every motion comes from one formula without a division by the forward speed, so that a
camera that moves sideways, stands still or flies backwards is no special case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flurries._contract import (
    LARGEST,
    SMALLEST,
    Array,
    Float64,
    output,
    real,
    shape_of,
    table,
    tile_of,
    vector,
)
from flurries.spectral.tiles import starts

__all__ = ["Camera", "image_velocity", "project", "tile_drift", "tile_shift", "tile_zoom"]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Parameters
    ----------
    focal : float
        Focal length in pixels.
    center : (cx, cy), optional
        Principal point in pixels; (W/2, H/2) of the picture if not given.
    offset : (x, y, z)
        Place of this eye in the camera's axes, world units.
    center_shift : (x, y)
        Added to the principal point, pixels (convergence of two eyes).
    rotation : (x, y, z)
        Orientation as a rotation vector: axis times angle in radians, right-handed in the axes x
        right, y down, z forward; (0, 0.1, 0) looks to the right.
    aspect : float
        Focal length down over focal length across, fy / fx, of pixels that are not square or of
        calibrated cameras. Snow and rain know it; flakes stay round in pixels.

    Raises
    ------
    ValueError, TypeError
        For a number that is not finite or a focal length that is not positive.
    """

    focal: float
    center: tuple[float, float] | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    center_shift: tuple[float, float] = (0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    aspect: float = 1.0

    def __post_init__(self) -> None:
        settle = object.__setattr__
        settle(self, "focal", real("focal", self.focal, low=SMALLEST, high=LARGEST))
        if self.center is not None:
            settle(self, "center", tuple(vector("center", self.center, 2).tolist()))
        settle(self, "offset", tuple(vector("offset", self.offset, 3).tolist()))
        settle(self, "center_shift", tuple(vector("center_shift", self.center_shift, 2).tolist()))
        settle(self, "rotation", tuple(vector("rotation", self.rotation, 3).tolist()))
        settle(self, "aspect", real("aspect", self.aspect, low=0.05, high=20.0))

    @property
    def focals(self) -> tuple[float, float]:
        """Focal lengths across and down, (fx, fy) pixels."""
        return self.focal, self.focal * self.aspect

    def principal(self, shape: tuple[int, int]) -> tuple[float, float]:
        """Return the principal point (cx, cy) in a picture of `shape` (H, W), shift included."""
        height, width = shape
        cx, cy = (width / 2, height / 2) if self.center is None else self.center
        return cx + self.center_shift[0], cy + self.center_shift[1]

    def matrix(self) -> Float64:
        """Return R (3, 3): a direction d of the camera's axes is R d in the house axes."""
        return np.array(_matrix(self.rotation))


def rotation_matrix(rotation: npt.ArrayLike) -> Float64:
    """Rotation matrix of a rotation vector (Rodrigues' formula).

    Parameters
    ----------
    rotation : (3,)
        Axis times angle in radians.

    Returns
    -------
    (3, 3) float64
    """
    x, y, z = vector("rotation", rotation, 3)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-8:
        # sin(a)/a and (1 - cos a)/a^2 at 0, right to a^2.
        small: Float64 = np.eye(3) + cross + 0.5 * cross @ cross
        return small
    half = math.sin(0.5 * angle) / angle
    matrix: Float64 = np.eye(3) + math.sin(angle) / angle * cross + 2.0 * half**2 * cross @ cross
    return matrix


@lru_cache(maxsize=256)
def _matrix(rotation: tuple[float, float, float]) -> Float64:
    # Asked for several times in a frame.
    return rotation_matrix(rotation)


def expect_camera(camera: object, *, stretched: bool = False) -> Camera:
    """Return a camera, or refuse what is none, or has an aspect that the caller does not know."""
    if not isinstance(camera, Camera):
        raise TypeError(f"camera must be a flurries.camera.Camera, got {type(camera).__name__}")
    if camera.aspect != 1.0 and not stretched:
        raise ValueError(f"camera must have an aspect of 1 here, got {camera.aspect:g}")
    return camera


def project(
    points: npt.ArrayLike, camera: Camera, shape: tuple[int, int]
) -> tuple[Float64, Float64]:
    """Pixel positions and depths of points.

    Parameters
    ----------
    points : (n, 3)
        Points relative to the camera's place, house axes, world units.
    camera : Camera
        Its rotation turns the points into camera axes, then its offset is subtracted.
    shape : (H, W)
        Size of the picture.

    Returns
    -------
    px : (n, 2) float64
        (x, y) in pixels, ``center + focal * (x, y) / z``; NaN where the depth is not positive.
    depth : (n,) float64
        z in camera axes, world units.
    """
    given = _rows("points", points, 3)
    view = expect_camera(camera, stretched=True)
    size = shape_of("shape", shape)
    local = given @ view.matrix() - np.array(view.offset)
    depth = np.ascontiguousarray(local[:, 2])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        px = view.focals * local[:, :2] / depth[:, None] + np.array(view.principal(size))
    px[depth <= 0.0] = np.nan
    return px, depth


def image_velocity(
    points_px: npt.ArrayLike,
    depth: npt.ArrayLike,
    velocity: npt.ArrayLike,
    camera: Camera,
    shape: tuple[int, int],
    *,
    rotation: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Float64:
    """How the image of points of the air moves.

    Parameters
    ----------
    points_px : (n, 2)
        Image positions (x, y), pixels.
    depth : (n,) or float
        Depth of each point, world units, positive.
    velocity : (3,)
        Camera minus flake per frame, house axes: still snow and a still camera give 0; falling snow
        is a camera that rises.
    camera : Camera
        The eye.
    shape : (H, W)
        Size of the picture.
    rotation : (3,)
        Radians per frame in camera axes, right-handed (a pan to the right is +y).

    Returns
    -------
    (n, 2) float64
        Pixels per frame: ``(Tz x - f Tx, Tz y - f Ty) / Z`` (Langer 2004, Eq. 8, without its
        division by Tz), plus the flow of the rotation, which the paper leaves out
        (``docs/deviations.md``, 17). Pure translation vanishes at the focus of expansion
        ``f (Tx, Ty) / Tz``.
    """
    given = _rows("points_px", points_px, 2)
    view = expect_camera(camera, stretched=True)
    size = shape_of("shape", shape)
    # One number comes as an array of one.
    distance = table("depth", depth, ndim=None).reshape(np.shape(depth))
    if distance.ndim not in (0, 1) or (distance.ndim == 1 and distance.shape != given.shape[:1]):
        raise ValueError(f"depth must be a number or {len(given)} of them, got {distance.shape}")
    if not (distance > 0.0).all():
        raise ValueError(f"depth must be positive, got {distance.min()}")
    omega = vector("rotation", rotation, 3)
    # An eye beside the axis of rotation is carried along by it.
    tx, ty, tz = vector("velocity", velocity, 3) @ view.matrix() + np.cross(omega, view.offset)
    fx, fy = view.focals
    x, y = (given - np.array(view.principal(size))).T
    flow = np.stack([tz * x - fx * tx, tz * y - fy * ty], axis=1)
    flow /= np.atleast_1d(distance)[:, None]
    turned = _rotational(x, y, view.focals, omega)
    flow[:, 0] += turned[0]
    flow[:, 1] += turned[1]
    return flow


def tile_drift(
    shape: tuple[int, int],
    displacement: npt.ArrayLike,
    camera: Camera,
    *,
    near_depth: float,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    out: Float64 | None = None,
) -> Float64:
    """Drift of every tile of :func:`flurries.spectral.field` for a moving camera.

    Parameters
    ----------
    shape : (H, W)
        Size of the picture.
    displacement : (3,)
        P, camera minus air since time 0, in camera axes, world units.
    camera : Camera
        The eye; its offset is added to P, so that a second eye is a camera moved aside.
    near_depth : float
        Depth that the longest wave stands for, world units, positive.
    tile, overlap : int
        As given to the field.
    out : (rows, cols, 2) float64, optional
        Array to write into and return.

    Returns
    -------
    (rows, cols, 2) float64
        ``(Pz x - f Px, Pz y - f Py) / near_depth`` pixels, (x, y) the tile's centre from the
        principal point. Exact for sideways motion of any size; to first order in forward motion.
    """
    size = shape_of("shape", shape)
    view = expect_camera(camera, stretched=True)
    near = real("near_depth", near_depth, low=SMALLEST)
    moved = vector("displacement", displacement, 3)
    x, y = tile_middles(size, view, *tile_of(tile, overlap))
    result = output(out, (len(y), len(x), 2), np.dtype(np.float64))
    return drift_at(x, y, moved, view, near, result)


def tile_middles(
    shape: tuple[int, int], camera: Camera, tile: tuple[int, int], overlap: int
) -> tuple[Float64, Float64]:
    """Return where the middles of tiles are, px from the principal point: across, and down."""
    cx, cy = camera.principal(shape)
    x = starts(shape[1], tile[1], overlap) + tile[1] / 2 - cx
    y = starts(shape[0], tile[0], overlap) + tile[0] / 2 - cy
    return np.asarray(x, np.float64), np.asarray(y, np.float64)


def drift_at(
    x: Float64, y: Float64, displacement: Float64, camera: Camera, near: float, result: Float64
) -> Float64:
    """Fill `result` (y, x, 2) with the drift of `tile_drift` at places from the principal point."""
    p = displacement + np.array(camera.offset)
    fx, fy = camera.focals
    result[..., 0] = (p[2] * x - fx * p[0])[None, :] / near
    result[..., 1] = (p[2] * y - fy * p[1])[:, None] / near
    return result


def tile_shift(
    shape: tuple[int, int],
    rotation: npt.ArrayLike,
    camera: Camera,
    *,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    out: Float64 | None = None,
) -> Float64:
    """Shift of every tile of :func:`flurries.spectral.field` for a turning camera.

    Parameters
    ----------
    shape : (H, W)
        Size of the picture.
    rotation : (3,)
        Radians in camera axes, right-handed (a pan to the right is +y): the rate of turning, or its
        sum over the frames.
    camera : Camera
        The eye.
    tile, overlap : int
        As given to the field.
    out : (rows, cols, 2) float64, optional
        Array to write into and return.

    Returns
    -------
    (rows, cols, 2) float64
        How far the content of the tile moves, pixels, whatever its depth: at the tile's centre
        (x, y) from the principal point ``-(f + x^2/f) wy + (x y/f) wx + y wz`` across and
        ``(f + y^2/f) wx - (x y/f) wy - x wz`` down. The flow that Langer 2004 leaves out
        (``docs/deviations.md``, 17).
    """
    size = shape_of("shape", shape)
    view = expect_camera(camera, stretched=True)
    omega = vector("rotation", rotation, 3)
    x, y = tile_middles(size, view, *tile_of(tile, overlap))
    result = output(out, (len(y), len(x), 2), np.dtype(np.float64))
    return shift_at(x, y, omega, view, result)


def shift_at(x: Float64, y: Float64, rotation: Float64, camera: Camera, result: Float64) -> Float64:
    """Fill `result` (y, x, 2) with the shift of `tile_shift` at places from the principal point."""
    flow = _rotational(x[None, :], y[:, None], camera.focals, rotation)
    result[..., 0], result[..., 1] = flow
    return result


def tile_zoom(
    shape: tuple[int, int],
    growth: float,
    camera: Camera,
    *,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    out: Float64 | None = None,
) -> Float64:
    """Shift of every tile of :func:`flurries.spectral.field` for a lens that zooms.

    Parameters
    ----------
    shape : (H, W)
        Size of the picture.
    growth : float
        Relative change of the focal length: its rate per frame, or its sum over the frames, the
        logarithm of the ratio.
    camera : Camera
        The eye.
    tile, overlap : int
        As given to the field.
    out : (rows, cols, 2) float64, optional
        Array to write into and return.

    Returns
    -------
    (rows, cols, 2) float64
        ``growth * (x, y)`` pixels, (x, y) the tile's centre from the principal point: how far its
        content moves, whatever its depth.
    """
    size = shape_of("shape", shape)
    view = expect_camera(camera, stretched=True)
    part = real("growth", growth)
    x, y = tile_middles(size, view, *tile_of(tile, overlap))
    result = output(out, (len(y), len(x), 2), np.dtype(np.float64))
    result[..., 0], result[..., 1] = part * x[None, :], part * y[:, None]
    return result


def _rotational(
    x: Array, y: Array, focals: tuple[float, float], omega: Float64
) -> tuple[Array, Array]:
    """Return the flow of a rotation at (x, y) from the principal point."""
    (fx, fy), (wx, wy, wz) = focals, omega
    across = -(fx + x * x / fx) * wy + (x * y / fy) * wx + (fx / fy) * y * wz
    down = (fy + y * y / fy) * wx - (x * y / fx) * wy - (fy / fx) * x * wz
    return across, down


def _rows(name: str, value: object, columns: int) -> Float64:
    array = table(name, value)
    if array.shape[1] != columns:
        raise ValueError(f"{name} must have shape (n, {columns}), got {array.shape}")
    return array

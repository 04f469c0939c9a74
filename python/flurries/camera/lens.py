"""The camera, its axes x right, y down, z forward: where a point is seen, and how it moves there.

Motions have no division by the forward speed: a camera that stands or flies back is no special
case. Pixel (row i, column j) has its centre at x = j + 1/2, y = i + 1/2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _contract as check
from flurries._contract import LARGEST, SMALLEST, Array, ArrayLike, Float64
from flurries._kept import kept


@check.suggesting
@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Parameters
    ----------
    focal, aspect : float
        Focal length in pixels, and that down over that across, fy / fx. Flakes stay round in
        pixels.
    center : (cx, cy), optional
        Principal point in pixels; (W/2, H/2) of the picture if not given.
    offset : (x, y, z)
        Place of the eye in the camera's axes, world units.
    center_shift : (x, y)
        Shift of the principal point, pixels (convergence of two eyes).
    rotation : (x, y, z)
        Orientation: axis times angle, radians, right-handed in the axes x right, y down, z forward;
        (0, 0.1, 0) looks to the right.
    """

    focal: float
    center: tuple[float, float] | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    center_shift: tuple[float, float] = (0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    aspect: float = 1.0

    def __post_init__(self) -> None:
        def numbers(name: str, count: int) -> Any:
            return tuple(check.vector(name, getattr(self, name), count).tolist())

        vars(self).update(
            focal=check.real("focal", self.focal, low=SMALLEST, high=LARGEST),
            center=None if self.center is None else numbers("center", 2),
            offset=numbers("offset", 3), center_shift=numbers("center_shift", 2),
            rotation=numbers("rotation", 3),
            aspect=check.real("aspect", self.aspect, low=0.05, high=20.0),
        )  # fmt: skip

    def derive(self, **changes: Any) -> Camera:
        """Return the camera with some values changed, without checks."""
        made = object.__new__(Camera)
        made.__dict__.update(self.__dict__, **changes)
        return made

    def magnified(self, ratio: float) -> Camera:
        """Return the camera with another focal length, its principal point shifted as much."""
        shift = (ratio * self.center_shift[0], ratio * self.center_shift[1])
        return self.derive(focal=ratio * self.focal, center_shift=shift)

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
        turned: Float64 = axes_of(self.rotation).copy()
        return turned


@kept(64)
def axes_of(rotation: tuple[float, float, float]) -> Float64:
    """Return the matrix (3, 3) of a rotation, shared and so read-only."""
    return rotation_matrix(rotation)


def expect_camera(camera: object, *, stretched: bool = False) -> Camera:
    """Return a camera, or refuse what is none, or has an aspect that the caller does not know."""
    if not isinstance(camera, Camera):
        raise TypeError(f"camera must be a flurries.camera.Camera, got {type(camera).__name__}")
    if camera.aspect != 1.0 and not stretched:
        raise ValueError(f"camera must have an aspect of 1 here, got {camera.aspect:g}")
    return camera


def project(points: ArrayLike, camera: Camera, shape: tuple[int, int]) -> tuple[Float64, Float64]:
    """Places (n, 2) and depths (n,) of points in a picture, float64.

    Places (x, y) are ``center + focal * (x, y) / z`` in pixels, NaN where the depth is not
    positive; depths are z in camera axes, world units.

    Parameters
    ----------
    points : (n, 3)
        Relative to the camera's place, house axes, world units. The camera's rotation turns them
        into its axes, then its offset is subtracted.
    """
    given = check.rows_of("points", points, 3)
    view = expect_camera(camera, stretched=True)
    size = check.shape_of("shape", shape)
    local = given @ view.matrix() - np.array(view.offset)
    depth = np.ascontiguousarray(local[:, 2])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        px = view.focals * local[:, :2] / depth[:, None] + np.array(view.principal(size))
    # Points behind the eye would be seen upside down.
    px[depth <= 0.0] = np.nan
    return px, depth


def image_velocity(
    points_px: ArrayLike, depth: ArrayLike, velocity: ArrayLike, camera: Camera,
    shape: tuple[int, int], *, rotation: ArrayLike = (0.0, 0.0, 0.0),
) -> Float64:  # fmt: skip
    """Velocities (n, 2) of the images of points of the air, pixels per frame, float64.

    It is ``(Tz x - f Tx, Tz y - f Ty) / Z`` (Langer 2004, Eq. 8), 0 at the focus of expansion
    ``f (Tx, Ty) / Tz``, plus the flow of the rotation, which the paper leaves out
    (``docs/internals/deviations.md``, 17).

    Parameters
    ----------
    points_px : (n, 2)
        Image positions (x, y), pixels.
    depth : (n,) or float
        Depth of each point, world units, positive.
    velocity : (3,)
        Camera minus flake per frame, house axes: falling snow is a camera that rises.
    rotation : (3,)
        Radians per frame in camera axes, right-handed (a pan to the right is +y).
    """
    given = check.rows_of("points_px", points_px, 2)
    view = expect_camera(camera, stretched=True)
    size = check.shape_of("shape", shape)
    distance = check.each_of("depth", depth, len(given))
    if not (distance > 0.0).all():
        raise ValueError(f"depth must be positive, got {distance.min()}")
    omega = check.vector("rotation", rotation, 3)
    # An eye beside the axis of rotation is carried along by it.
    moved = check.vector("velocity", velocity, 3) @ view.matrix()
    tx, ty, tz = moved + np.cross(omega, view.offset)
    fx, fy = view.focals
    x, y = (given - np.array(view.principal(size))).T
    flow = np.stack([tz * x - fx * tx, tz * y - fy * ty], axis=1)
    return np.asarray(flow / distance[:, None] + np.stack(rotational(x, y, view.focals, omega), 1))


def rotational(
    x: Array, y: Array, focals: tuple[float, float], omega: Float64
) -> tuple[Array, Array]:
    """Return the flow of a rotation at (x, y) from the principal point."""
    (fx, fy), (wx, wy, wz) = focals, omega
    across = -(fx + x * x / fx) * wy + (x * y / fy) * wx + (fx / fy) * y * wz
    down = (fy + y * y / fy) * wx - (x * y / fx) * wy - (fy / fx) * x * wz
    return across, down


def rotation_matrix(rotation: Iterable[float]) -> Float64:
    """Return the matrix (3, 3) of a rotation vector (3,), radians (Rodrigues' formula)."""
    x, y, z = rotation
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-8:
        # sin(a)/a and (1 - cos a)/a^2 at 0, right to a^2.
        small: Float64 = np.eye(3) + cross + 0.5 * cross @ cross
        return small
    half = math.sin(0.5 * angle) / angle
    matrix: Float64 = np.eye(3) + math.sin(angle) / angle * cross + 2.0 * half**2 * cross @ cross
    return matrix


def rotation_vector(matrix: Float64) -> Float64:
    """Return axis times angle, (3,), of a rotation matrix; the angle is from 0 to pi."""
    w, *xyz = quaternions_of(matrix[None])[0]
    axis = np.array(xyz)
    if w < 0.0:
        w, axis = -w, -axis
    length = float(np.linalg.norm(axis))
    # The limit of 2 atan2(s, c) / s.
    factor = 2.0 / w if length < 1e-150 else 2.0 * float(np.arctan2(length, w)) / length
    return np.asarray(factor * axis)


def quaternions_of(matrices: Float64) -> Float64:
    """Return (n, 4), (w, x, y, z), of rotation matrices; each from its largest part."""
    result = np.empty((len(matrices), 4))
    for k, m in enumerate(matrices):
        turn, (x, y, z) = m - m.T, np.diag(m)
        # 4 q q^T: each row is the quaternion times one of its parts.
        products = np.zeros((4, 4))
        products[1:, 1:] = m + m.T
        products[0, 1:] = products[1:, 0] = turn[2, 1], turn[0, 2], turn[1, 0]
        np.fill_diagonal(products, (1 + x + y + z, 1 + x - y - z, 1 - x + y - z, 1 - x - y + z))
        result[k] = products[np.diag(products).argmax()]
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


def matrices_of(q: Float64) -> Float64:
    """Return (n, 3, 3) of unit quaternions (w, x, y, z)."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))

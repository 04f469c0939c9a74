"""The slow twin of the camera: projection, turns and the drift of tiles, in float64 NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from twin import Floats, Shape, tile_starts


class Camera:
    """A pinhole: focal length in px, an eye's offset in camera axes, a rotation vector."""

    def __init__(
        self,
        focal: float,
        *,
        center: tuple[float, float] | None = None,
        offset: ArrayLike = (0.0, 0.0, 0.0),
        center_shift: tuple[float, float] = (0.0, 0.0),
        rotation: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.focal, self.center, self.center_shift = focal, center, center_shift
        self.offset = np.asarray(offset, dtype=np.float64)
        self.axes = rotation_matrix(rotation)

    def principal_point(self, shape: Shape) -> Floats:
        """(cx, cy) with the shift; the default centre is (W/2, H/2)."""
        center = (shape[1] / 2, shape[0] / 2) if self.center is None else self.center
        return np.add(center, self.center_shift)


def rotation_matrix(vector: ArrayLike) -> Floats:
    """Rodrigues' formula: right-handed turn about the vector by its length in radians."""
    vector = np.asarray(vector, dtype=np.float64)
    angle = float(np.sqrt(np.sum(vector**2)))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def project(points: ArrayLike, camera: Camera, shape: Shape) -> tuple[Floats, Floats]:
    """Camera coordinates R^T p - offset; px = c + f x/z; NaN at or behind the eye."""
    seen = np.asarray(points, dtype=np.float64) @ camera.axes - camera.offset
    depth = seen[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = camera.principal_point(shape) + camera.focal * seen[:, :2] / depth[:, None]
    pixels[depth <= 0.0] = np.nan
    return pixels, depth


def tile_drift(
    shape: Shape,
    displacement: ArrayLike,
    camera: Camera,
    *,
    near_depth: float,
    tile: int = 64,
    overlap: int = 10,
) -> Floats:
    """(Pz x - f Px, Pz y - f Py)/near_depth at each tile's centre, start + M/2."""
    px, py, pz = np.asarray(displacement, dtype=np.float64) + camera.offset
    cx, cy = camera.principal_point(shape)
    y = tile_starts(shape[0], tile=tile, overlap=overlap) + tile / 2 - cy
    x = tile_starts(shape[1], tile=tile, overlap=overlap) + tile / 2 - cx
    drift_x, drift_y = pz * x - camera.focal * px, pz * y - camera.focal * py
    return np.stack(np.meshgrid(drift_x, drift_y, indexing="xy"), axis=-1) / near_depth

"""Cameras of KITTI's odometry: a matrix a line."""

from __future__ import annotations

import os

from flurries.camera.importers.matrices import AXES, from_matrices
from flurries.camera.importers.text import read_numbers
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath


def read_kitti(path: str | os.PathLike[str], camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of KITTI's poses: a line is a matrix (3, 4) to the first camera."""
    file, rows = read_numbers(path, (12,))
    try:
        return from_matrices(rows.reshape(-1, 3, 4), camera, axes=AXES[0], scale=scale)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None

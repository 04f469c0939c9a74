"""Cameras of KITTI's odometry: a matrix a line."""

from __future__ import annotations

import os

from flurries.camera.importers.matrices import AXES, from_matrices
from flurries.camera.importers.text import read_numbers
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath


def read_kitti(path: str | os.PathLike[str], camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of KITTI's poses.

    Parameters
    ----------
    path : str or path
        A line for each frame: the rows of the matrix (3, 4) from the camera's axes to those of the
        first camera, x right, y down, z forward.
    camera : Camera
        The lens: ``P0`` of KITTI's calibration holds focal length and principal point.
    scale : float
        Metres to a unit of the file.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `load`.
    """
    file, rows = read_numbers(path, (12,))
    try:
        return from_matrices(rows.reshape(-1, 3, 4), camera, axes=AXES[0], scale=scale)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None

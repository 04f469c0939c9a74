"""Cameras from text files: Nuke's ``.chan``, KITTI's odometry, and what COLMAP's share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from flurries._contract import Float64, integer, shape_of
from flurries.camera.csv import floats
from flurries.camera.importers.matrices import AXES, FLIP, from_matrices, path_of
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.io.files import plain_file, read_text

_MOST_BYTES = 1 << 25


def read_numbers(path: str | os.PathLike[str], widths: tuple[int, ...]) -> tuple[Path, Float64]:
    """Return a file of numbers as rows, comments and empty lines left out."""
    file = plain_file(path)
    rows: list[list[float]] = []
    for number, line in lines_of(file):
        parts = line.partition("#")[0].split()
        if not parts:
            continue
        if len(parts) not in widths or (rows and len(parts) != len(rows[0])):
            wanted = " or ".join(map(str, widths))
            raise ValueError(
                f"{file}, line {number}: {wanted} numbers are wanted, got {len(parts)}"
            )
        rows.append(floats(file, number, parts))
    if not rows:
        raise ValueError(f"{file}: no camera is there")
    return file, np.array(rows)


def lines_of(file: Path) -> list[tuple[int, str]]:
    """Return the lines of a text file with their numbers."""
    return list(enumerate(read_text(file, _MOST_BYTES, "camera file").splitlines(), 1))


def read_chan(
    path: str | os.PathLike[str], shape: tuple[int, int], *, camera: Camera | None = None,
    order: str = "ZXY", scale: float = 1.0, start: int | None = None,
) -> CameraPath:  # fmt: skip
    """Return the camera path of a Nuke ``.chan`` file."""
    # Lines of `frame tx ty tz rx ry rz` and perhaps `vfov`: degrees, y up, looking along -z. The
    # angle of view is that of the pictures' height; `camera` is the lens where there is none, and
    # `start` the number that the first frame gets. Nuke's default order turns about z first and
    # about y last.
    height, width = shape_of("shape", shape)
    if not isinstance(order, str) or sorted(order) != ["X", "Y", "Z"]:
        raise ValueError(f"order must be one such as 'ZXY', got {order!r}")
    file, rows = read_numbers(path, (7, 8))
    frames = _frames(file, rows[:, 0], start)
    matrices = np.array([FLIP @ _euler(angles, order) @ FLIP for angles in rows[:, 4:7]])
    lens = Camera(1.2 * width) if camera is None else expect_camera(camera, stretched=True)
    focal = None
    if rows.shape[1] == 8:
        if not ((rows[:, 7] > 0.0) & (rows[:, 7] < 180.0)).all():
            raise ValueError(f"{file}: vfov must be between 0 and 180 degrees")
        focal = 0.5 * height / np.tan(np.radians(rows[:, 7]) / 2.0) / lens.aspect
    return path_of(frames, rows[:, 1:4] @ FLIP, matrices, lens, focal, scale)


def _frames(file: Path, given: Float64, start: int | None) -> Float64:
    if not (np.diff(given) > 0.0).all():
        raise ValueError(f"{file}: frames must increase")
    if start is None:
        return given
    first = integer("start", start, low=-(2**31), high=2**31)
    return np.asarray(given - given[0] + first)


def _euler(degrees: Float64, order: str) -> Float64:
    """Return the rotation about x, y and z by degrees, the first axis of `order` first."""
    first, second, last = (
        rotation_matrix(np.eye(3)[axis] * np.radians(degrees[axis]))
        for axis in map("XYZ".index, order)
    )
    return np.asarray(last @ second @ first)


def read_kitti(path: str | os.PathLike[str], camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of KITTI's poses: a line is a matrix (3, 4) to the first camera."""
    file, rows = read_numbers(path, (12,))
    try:
        return from_matrices(rows.reshape(-1, 3, 4), camera, axes=AXES[0], scale=scale)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None

"""Cameras of Nuke: ``.chan`` files."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from flurries._contract import Float64, integer, shape_of
from flurries.camera.importers.matrices import FLIP, path_of
from flurries.camera.importers.text import read_numbers
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath


def read_chan(
    path: str | os.PathLike[str],
    shape: tuple[int, int],
    *,
    camera: Camera | None = None,
    order: str = "ZXY",
    scale: float = 1.0,
    start: int | None = None,
) -> CameraPath:
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
    matrix = np.eye(3)
    for axis in order:
        angle = math.radians(degrees["XYZ".index(axis)])
        cos, sin = math.cos(angle), math.sin(angle)
        one = {
            "X": [[1, 0, 0], [0, cos, -sin], [0, sin, cos]],
            "Y": [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]],
            "Z": [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]],
        }[axis]
        matrix = np.array(one) @ matrix
    return matrix

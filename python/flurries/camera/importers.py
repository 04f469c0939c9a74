"""Cameras from elsewhere: trackers, compositing programs, data sets.

Every reader turns its program's axes into those of the house: x right, y down, z forward, snow
falling along +y. Lengths become metres by `scale`.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import (
    Float64,
    choice,
    flag,
    integer,
    moderate,
    real,
    shape_of,
    table,
    vector,
)
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath
from flurries.camera.turning import rotation_vector
from flurries.io.headers import plain_file
from flurries.io.paths import read_path
from flurries.motion.keys import Keys

__all__ = ["from_matrices", "load", "read_chan", "read_colmap", "read_kitti"]

_MOST_BYTES = 1 << 28

# y up and looking along -z, as OpenGL, Nuke, Maya and Blender's cameras: half a turn about x.
_FLIP = np.diag([1.0, -1.0, -1.0])

_AXES = ("x right, y down, z forward", "x right, y up, z back")

# COLMAP's models: where focal lengths and the principal point are among the numbers.
_MODELS = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2), "PINHOLE": (0, 1, 2, 3), "SIMPLE_RADIAL": (0, 0, 1, 2),
    "RADIAL": (0, 0, 1, 2), "OPENCV": (0, 1, 2, 3), "FULL_OPENCV": (0, 1, 2, 3),
}  # fmt: skip


def load(
    path: str | os.PathLike[str], shape: tuple[int, int], *, camera: Camera | None = None
) -> CameraPath:
    """Return the camera path of a file, by its kind.

    Parameters
    ----------
    path : str or path
        ``.chan`` (Nuke), ``.csv`` (see :func:`flurries.io.read_path`), ``.txt`` with twelve numbers
        a line (KITTI), or a folder with COLMAP's ``images.txt`` and ``cameras.txt``.
    shape : (H, W)
        Of the pictures to be made.
    camera : Camera, optional
        The lens, where the file says nothing of it; 1.2 picture widths if not given.

    Raises
    ------
    FileNotFoundError, OSError
        If a file cannot be read.
    ValueError
        If it is of no known kind, or not as its kind should be; the message names file and line.
    """
    size = shape_of("shape", shape)
    lens = Camera(1.2 * size[1]) if camera is None else expect_camera(camera, stretched=True)
    place = Path(path)
    suffix = place.suffix.lower()
    if place.is_dir():
        return read_colmap(place, size)
    if suffix == ".chan":
        return read_chan(place, size, camera=lens)
    if suffix == ".csv":
        return CameraPath(lens, **read_path(place))
    if suffix == ".txt":
        return read_kitti(place, lens)
    raise ValueError(
        f"{place}: a camera is a .chan, .csv or .txt file, or a folder of COLMAP's, not {suffix!r}"
    )


def read_chan(
    path: str | os.PathLike[str],
    shape: tuple[int, int],
    *,
    camera: Camera | None = None,
    order: str = "ZXY",
    scale: float = 1.0,
    start: int | None = None,
) -> CameraPath:
    """Return the camera path of a Nuke ``.chan`` file.

    Parameters
    ----------
    path : str or path
        Lines of ``frame tx ty tz rx ry rz`` and perhaps ``vfov``: degrees, y up, looking along -z.
    shape : (H, W)
        Of the pictures; the angle of view is that of their height.
    camera : Camera, optional
        The lens, where there is no ``vfov``.
    order : str
        Nuke's rotation order: "ZXY", its default, turns about z first and about y last.
    scale : float
        Metres to a unit of the file.
    start : int, optional
        The file's frame that becomes frame 0; its lowest, as that of a plate's files, if not given.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `load`.
    """
    height, width = shape_of("shape", shape)
    if not isinstance(order, str) or sorted(order) != ["X", "Y", "Z"]:
        raise ValueError(f"order must be one such as 'ZXY', got {order!r}")
    file, rows = _numbers(path, (7, 8))
    frames = _frames(file, rows[:, 0], start)
    matrices = np.array([_FLIP @ _turned(angles, order) @ _FLIP for angles in rows[:, 4:7]])
    lens = Camera(1.2 * width) if camera is None else expect_camera(camera, stretched=True)
    focal = None
    if rows.shape[1] == 8:
        if not ((rows[:, 7] > 0.0) & (rows[:, 7] < 180.0)).all():
            raise ValueError(f"{file}: vfov must be between 0 and 180 degrees")
        focal = 0.5 * height / np.tan(np.radians(rows[:, 7]) / 2.0) / lens.aspect
    return _path(frames, rows[:, 1:4] @ _FLIP, matrices, lens, focal, scale)


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
    file, rows = _numbers(path, (12,))
    try:
        return from_matrices(rows.reshape(-1, 3, 4), camera, scale=scale)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def from_matrices(
    matrices: npt.ArrayLike,
    camera: Camera,
    *,
    axes: str = "x right, y down, z forward",
    inverse: bool = False,
    focal: npt.ArrayLike | None = None,
    scale: float = 1.0,
) -> CameraPath:
    """Return the camera path of poses, one for each frame from 0 on.

    Parameters
    ----------
    matrices : (n, 3, 4) or (n, 4, 4)
        Rotation and place: from the camera's axes to the world's.
    camera : Camera
        The lens.
    axes : {"x right, y down, z forward", "x right, y up, z back"}
        Of camera and world: those of OpenCV, KITTI and ROS' optical frames, or of OpenGL, Nuke,
        Maya and NeRF data.
    inverse : bool
        The matrices go from the world's axes to the camera's (extrinsics).
    focal : (n,), optional
        Pixels, of a lens that zooms.
    scale : float
        Metres to a unit of the places.

    Raises
    ------
    ValueError, TypeError
        If something is not as described, or a matrix is no rotation.
    """
    poses = moderate("matrices", table("matrices", matrices, ndim=3))
    if poses.shape[1:] not in ((3, 4), (4, 4)) or len(poses) == 0:
        raise ValueError(f"matrices must be (n, 3, 4) or (n, 4, 4), got {poses.shape}")
    choice("axes", axes, _AXES)
    turns, places = poses[:, :3, :3], poses[:, :3, 3]
    if flag("inverse", inverse):
        turns = turns.transpose(0, 2, 1)
        places = -np.einsum("nij,nj->ni", turns, places)
    if axes == _AXES[1]:
        turns, places = _FLIP @ turns @ _FLIP, places @ _FLIP
    lens = expect_camera(camera, stretched=True)
    lengths = None if focal is None else table("focal", focal, ndim=1)
    if lengths is not None and len(lengths) != len(poses):
        raise ValueError(f"focal must have {len(poses)} numbers, one a matrix, got {len(lengths)}")
    return _path(np.arange(len(poses), dtype=np.float64), places, turns, lens, lengths, scale)


def read_colmap(
    folder: str | os.PathLike[str],
    shape: tuple[int, int],
    *,
    down: npt.ArrayLike | None = None,
    scale: float = 1.0,
) -> CameraPath:
    """Return the camera path of a COLMAP reconstruction in text.

    Parameters
    ----------
    folder : str or path
        Holds ``images.txt`` and ``cameras.txt``. Images are frames in the order of their names; if
        all names end in numbers, these count from the lowest on.
    shape : (H, W)
        Of the pictures to be made; lenses are scaled to it from the pictures' own size.
    down : (3,), optional
        Where things fall, in the reconstruction's axes, which have no relation to the ground: the
        mean of the cameras' own down if not given.
    scale : float
        Metres to a unit of the reconstruction, which has none of its own.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `load`; also where images differ in size, principal point or aspect.

    Warns
    -----
    UserWarning
        If a lens distorts: that is left out, pictures should be undistorted.
    """
    place = Path(folder)
    height, width = shape_of("shape", shape)
    lenses = _colmap_lenses(place / "cameras.txt")
    file = plain_file(place / "images.txt")
    rows: list[tuple[str, list[float], str]] = []
    lines = [(number, line) for number, line in _lines(file) if not line.lstrip().startswith("#")]
    # Every second line holds an image's points, and may be empty.
    while lines and not lines[-1][1].strip() and len(lines) % 2:
        lines.pop()
    for number, line in lines[::2]:
        parts = line.split(maxsplit=9)
        if len(parts) != 10:
            raise ValueError(f"{file}, line {number}: an image has 10 entries, got {len(parts)}")
        rows.append((parts[9].strip(), _floats(file, number, parts[1:8]), parts[8]))
        if parts[8] not in lenses:
            raise ValueError(f"{file}, line {number}: camera {parts[8]} is not in cameras.txt")
    if not rows:
        raise ValueError(f"{file}: no image is there")
    rows.sort(key=lambda row: row[0])
    frames = _numbered([name for name, _, _ in rows])
    ordered = np.argsort(frames, kind="stable")
    frames, rows = frames[ordered], [rows[i] for i in ordered]
    turns = np.array([_of_quaternion(file, row[1][:4]) for row in rows]).transpose(0, 2, 1)
    places = -np.einsum("nij,nj->ni", turns, np.array([row[1][4:] for row in rows]))
    seen = np.array([lenses[camera] for _, _, camera in rows])
    if np.ptp(seen[:, [0, 1, 4, 5]], axis=0).any() or np.ptp(seen[:, 3] / seen[:, 2]) > 1e-9:
        raise ValueError(f"{file}: images must have one size, principal point and aspect")
    across, high = width / seen[0, 0], height / seen[0, 1]
    focal = across * seen[:, 2]
    lens = Camera(
        float(focal[0]),
        center=(across * seen[0, 4], high * seen[0, 5]),
        aspect=float(high * seen[0, 3] / (across * seen[0, 2])),
    )
    world = _upright(turns[:, :, 1].mean(axis=0) if down is None else vector("down", down, 3))
    lengths = focal if np.ptp(focal) > 0.0 else None
    return _path(frames, places @ world.T, world @ turns, lens, lengths, scale)


def _colmap_lenses(path: Path) -> dict[str, tuple[float, ...]]:
    """Return (width, height, fx, fy, cx, cy) of COLMAP's cameras."""
    file = plain_file(path)
    found: dict[str, tuple[float, ...]] = {}
    distorted = False
    for number, line in _lines(file):
        parts = line.split()
        if not parts or parts[0].startswith("#"):
            continue
        if len(parts) < 5 or parts[1] not in _MODELS:
            known = ", ".join(_MODELS)
            raise ValueError(f"{file}, line {number}: a camera's model is one of {known}")
        values = _floats(file, number, parts[2:])
        params = values[2:]
        if len(params) <= max(_MODELS[parts[1]]):
            raise ValueError(f"{file}, line {number}: {parts[1]} needs more numbers")
        fx, fy, cx, cy = (params[place] for place in _MODELS[parts[1]])
        if min(fx, fy, *values[:2]) <= 0.0:
            raise ValueError(f"{file}, line {number}: sizes and focal lengths must be positive")
        distorted |= any(params[max(_MODELS[parts[1]]) + 1 :])
        found[parts[0]] = (values[0], values[1], fx, fy, cx, cy)
    if distorted:
        warnings.warn(f"{file}: lens distortion is left out", UserWarning, stacklevel=4)
    return found


def _path(
    frames: Float64,
    places: Float64,
    turns: Float64,
    lens: Camera,
    focal: Float64 | None,
    scale: float,
) -> CameraPath:
    """Return a path through places and orientations at frames."""
    places = real("scale", scale, above=0.0) * places
    if focal is not None:
        lens = replace(lens, focal=float(focal[0]))
        focal = focal if np.ptp(focal) > 0.0 else None
    if np.array_equal(frames, np.arange(len(frames))):
        return CameraPath(lens, position=places, orientation=turns, focal=focal)
    # Keys cannot be matrices, and are not checked as these are.
    CameraPath(lens, orientation=turns)

    def keyed(values: Sequence[Any]) -> Keys:
        return Keys(list(zip(frames.tolist(), values, strict=True)))

    return CameraPath(
        lens,
        position=keyed(places.tolist()),
        orientation=keyed([_quaternion(matrix) for matrix in turns]),
        focal=None if focal is None else keyed(focal.tolist()),
    )


def _frames(file: Path, given: Float64, start: int | None) -> Float64:
    if not (np.diff(given) > 0.0).all():
        raise ValueError(f"{file}: frames must increase")
    return given - (
        given[0] if start is None else integer("start", start, low=-(2**31), high=2**31)
    )


def _numbered(names: list[str]) -> Float64:
    """Return frames of sorted names: the numbers that they end in, or their order."""
    found = [re.search(r"(\d{1,15})\D*$", Path(name).stem) for name in names]
    numbers = [int(match[1]) for match in found if match is not None]
    if len(numbers) == len(names) and len(set(numbers)) == len(names):
        return np.array(numbers, np.float64) - min(numbers)
    return np.arange(len(names), dtype=np.float64)


def _turned(degrees: Float64, order: str) -> Float64:
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


def _of_quaternion(file: Path, values: list[float]) -> Float64:
    """Return the matrix of (w, x, y, z)."""
    length = math.sqrt(sum(value * value for value in values))
    if not 0.99 < length < 1.01:
        raise ValueError(f"{file}: quaternions must have length 1, got {length:g}")
    w, x, y, z = (value / length for value in values)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _quaternion(matrix: Float64) -> tuple[float, ...]:
    """Return (w, x, y, z) of a matrix."""
    x, y, z = rotation_vector(matrix).tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    part = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), part * x, part * y, part * z


def _upright(down: Float64) -> Float64:
    """Return the smallest rotation that turns a direction to (0, 1, 0)."""
    length = float(np.linalg.norm(down))
    if length < 1e-6:
        raise ValueError("down: the cameras' own down has no mean; give one")
    unit = down / length
    axis = np.cross(unit, (0.0, 1.0, 0.0))
    sine, cosine = float(np.linalg.norm(axis)), float(unit[1])
    if sine < 1e-12:
        return np.eye(3) if cosine > 0.0 else np.diag([1.0, -1.0, -1.0])
    x, y, z = axis / sine
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Float64 = np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross
    return turn


def _numbers(path: str | os.PathLike[str], widths: tuple[int, ...]) -> tuple[Path, Float64]:
    """Return a file of numbers as rows, comments and empty lines left out."""
    file = plain_file(path)
    rows: list[list[float]] = []
    for number, line in _lines(file):
        parts = line.partition("#")[0].split()
        if not parts:
            continue
        if len(parts) not in widths or (rows and len(parts) != len(rows[0])):
            wanted = " or ".join(map(str, widths))
            raise ValueError(
                f"{file}, line {number}: {wanted} numbers are wanted, got {len(parts)}"
            )
        rows.append(_floats(file, number, parts))
    if not rows:
        raise ValueError(f"{file}: no camera is there")
    return file, np.array(rows)


def _lines(file: Path) -> list[tuple[int, str]]:
    if file.stat().st_size > _MOST_BYTES:
        raise ValueError(f"{file}: a camera file has at most {_MOST_BYTES} bytes")
    try:
        return list(enumerate(file.read_text(encoding="utf-8-sig").splitlines(), 1))
    except UnicodeDecodeError as error:
        raise ValueError(f"{file}: not a text file: {error}") from None


def _floats(file: Path, number: int, parts: Sequence[str]) -> list[float]:
    found = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{file}, line {number}: not a finite number: {part[:40]!r}")
        found.append(value)
    return found

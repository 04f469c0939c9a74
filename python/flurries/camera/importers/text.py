"""Cameras from text files: tables with a header, Nuke's ``.chan``, KITTI's odometry."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from flurries._contract import Float64, integer, real, shape_of
from flurries.camera.importers.matrices import AXES, FLIP, from_matrices, path_of
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.io.files import read_text
from flurries.motion.keys import Keys

_MOST_BYTES = 1 << 25

# What columns of a table make; orientations have two forms.
_COLUMNS = (
    ("position", ("x", "y", "z")), ("orientation", ("rx", "ry", "rz")),
    ("orientation", ("qw", "qx", "qy", "qz")), ("focal", ("focal",)),
)  # fmt: skip
_KNOWN = ("frame", *(name for _, names in _COLUMNS for name in names))


def lines_of(path: str | os.PathLike[str]) -> list[str]:
    return read_text(path, _MOST_BYTES, "camera file").splitlines()


def floats(file: object, number: int, parts: Sequence[str]) -> list[float]:
    """Return the numbers of a line, each finite."""
    found = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{file}, line {number}: not a finite number: {part.strip()[:40]!r}")
        found.append(value)
    return found


def read_csv(path: str | os.PathLike[str], camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of a table, as trackers and modelling programs export them."""
    file = os.fspath(path)
    try:
        rows = [row for row in csv.reader(lines_of(path)) if any(map(str.strip, row))]
    except csv.Error as error:
        raise ValueError(f"{file}: not a CSV file: {error}") from None
    if len(rows) < 2:
        raise ValueError(f"{file}: a camera path needs a header and at least one row")
    names = [name.strip().lower() for name in rows[0]]
    for name in names:
        if name not in _KNOWN or names.count(name) > 1:
            known = ", ".join(_KNOWN)
            raise ValueError(f"{file}, line 1: columns are {known}, each once; got {name!r}")
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            wanted = f"{len(names)} entries are wanted, got {len(row)}"
            raise ValueError(f"{file}, line {line}: {wanted}")
    values = np.array([floats(file, line, row) for line, row in enumerate(rows[1:], 2)])
    columns = dict(zip(names, values.T, strict=True))
    given = [(key, group) for key, group in _COLUMNS if columns.keys() & set(group)]
    if len(dict(given)) < len(given):
        raise ValueError(f"{file}, line 1: give rx, ry, rz or qw, qx, qy, qz, not both")
    if not given:
        raise ValueError(f"{file}, line 1: neither x, y, z nor an orientation")
    found: dict[str, Any] = {}
    for key, group in given:
        missing = [name for name in group if name not in columns]
        if missing:
            raise ValueError(f"{file}, line 1: column {missing[0]!r} is missing")
        found[key] = columns[key] if key in columns else np.stack([columns[n] for n in group], 1)
    if "position" in found:
        found["position"] *= real("scale", scale, above=0.0)
    if "frame" in columns:
        try:
            for key, given in found.items():
                frames = columns["frame"].tolist()
                found[key] = Keys(list(zip(frames, given.tolist(), strict=True)))
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from None
    return CameraPath(camera, **found, extend="stop")


def _read_numbers(path: str | os.PathLike[str], widths: tuple[int, ...]) -> tuple[str, Float64]:
    """Return a file of numbers as rows, comments and empty lines left out."""
    file, rows = os.fspath(path), list[list[float]]()
    for number, line in enumerate(lines_of(path), 1):
        parts = line.partition("#")[0].split()
        if not parts:
            continue
        if len(parts) not in widths or (rows and len(parts) != len(rows[0])):
            wanted = f"{' or '.join(map(str, widths))} numbers are wanted, got {len(parts)}"
            raise ValueError(f"{file}, line {number}: {wanted}")
        rows.append(floats(file, number, parts))
    if not rows:
        raise ValueError(f"{file}: no camera is there")
    return file, np.array(rows)


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
    file, rows = _read_numbers(path, (7, 8))
    frames = rows[:, 0]
    if not (np.diff(frames) > 0.0).all():
        raise ValueError(f"{file}: frames must increase")
    if start is not None:
        frames = frames - frames[0] + integer("start", start, low=-(2**31), high=2**31)
    matrices = np.array([FLIP @ _euler(angles, order) @ FLIP for angles in rows[:, 4:7]])
    lens = Camera(1.2 * width) if camera is None else expect_camera(camera, stretched=True)
    focal = None
    if rows.shape[1] == 8:
        if not ((rows[:, 7] > 0.0) & (rows[:, 7] < 180.0)).all():
            raise ValueError(f"{file}: vfov must be between 0 and 180 degrees")
        focal = 0.5 * height / np.tan(np.radians(rows[:, 7]) / 2.0) / lens.aspect
    return path_of(frames, rows[:, 1:4] @ FLIP, matrices, lens, focal, scale)


def _euler(degrees: Float64, order: str) -> Float64:
    """Return the rotation about x, y and z by degrees, the first axis of `order` first."""
    first, second, last = (
        rotation_matrix(np.eye(3)[axis] * np.radians(degrees[axis]))
        for axis in map("XYZ".index, order)
    )
    return np.asarray(last @ second @ first)


def read_kitti(path: str | os.PathLike[str], camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of KITTI's poses: a line is a matrix (3, 4) to the first camera."""
    file, rows = _read_numbers(path, (12,))
    try:
        return from_matrices(rows.reshape(-1, 3, 4), camera, axes=AXES[0], scale=scale)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None

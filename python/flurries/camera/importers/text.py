"""Cameras from text: tables with a header, Nuke's ``.chan``, KITTI's odometry, COLMAP's folders."""

from __future__ import annotations

import csv
import math
import os
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import ArrayLike, Float64, PathLike, naming, real, shape_of, vector
from flurries.camera.importers.matrices import AXES, FLIP, from_matrices, path_of
from flurries.camera.lens import Camera, expect_camera, matrices_of, rotation_matrix
from flurries.camera.path import CameraPath
from flurries.io.files import read_text
from flurries.motion.keys import Keys

_MOST_BYTES = 1 << 25

# What columns of a table make; orientations have two forms.
_COLUMNS = (
    ("position", ("x", "y", "z")), ("orientation", ("rx", "ry", "rz")),
    ("orientation", ("qw", "qx", "qy", "qz")), ("focal", ("focal",)),
)  # fmt: skip
_KNOWN = ("frame", *(name for _, names in _COLUMNS for name in names))

# COLMAP's models: where focal lengths and the principal point are among the numbers.
_MODELS = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2), "PINHOLE": (0, 1, 2, 3), "SIMPLE_RADIAL": (0, 0, 1, 2),
    "RADIAL": (0, 0, 1, 2), "OPENCV": (0, 1, 2, 3), "FULL_OPENCV": (0, 1, 2, 3),
}  # fmt: skip


def _lines_of(path: PathLike) -> list[str]:
    return read_text(path, _MOST_BYTES, "camera file").splitlines()


def _floats(file: object, number: int, parts: Sequence[str]) -> list[float]:
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


def read_csv(path: PathLike, camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of a table, as trackers and modelling programs export them."""
    file = os.fspath(path)
    with naming(f"{file}: not a CSV file", csv.Error, then=ValueError):
        rows = [row for row in csv.reader(_lines_of(path)) if any(map(str.strip, row))]
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
    values = np.array([_floats(file, line, row) for line, row in enumerate(rows[1:], 2)])
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
        with naming(file, ValueError):
            for key, given in found.items():
                frames = columns["frame"].tolist()
                found[key] = Keys(list(zip(frames, given.tolist(), strict=True)))
    return CameraPath(camera, **found, extend="stop")


def _read_numbers(path: PathLike, widths: tuple[int, ...]) -> tuple[str, Float64]:
    """Return a file of numbers as rows, comments and empty lines left out."""
    file, rows = os.fspath(path), list[list[float]]()
    for number, line in enumerate(_lines_of(path), 1):
        parts = line.partition("#")[0].split()
        if not parts:
            continue
        if len(parts) not in widths or (rows and len(parts) != len(rows[0])):
            wanted = f"{' or '.join(map(str, widths))} numbers are wanted, got {len(parts)}"
            raise ValueError(f"{file}, line {number}: {wanted}")
        rows.append(_floats(file, number, parts))
    if not rows:
        raise ValueError(f"{file}: no camera is there")
    return file, np.array(rows)


def read_chan(
    path: PathLike, shape: tuple[int, int], *, camera: Camera | None = None, scale: float = 1.0
) -> CameraPath:
    """Return the camera path of a Nuke ``.chan`` file."""
    # Lines of `frame tx ty tz rx ry rz` and perhaps `vfov`: degrees, y up, looking along -z. The
    # angle of view is that of the pictures' height; `camera` is the lens where there is none.
    height, width = shape_of("shape", shape)
    file, rows = _read_numbers(path, (7, 8))
    frames = rows[:, 0]
    if not (np.diff(frames) > 0.0).all():
        raise ValueError(f"{file}: frames must increase")
    axes = [np.diag(angles) for angles in np.radians(rows[:, 4:7])]
    # Degrees about x, y and z, as Nuke's: about z first and y last.
    turns = [[rotation_matrix(axis) for axis in each] for each in axes]
    matrices = np.array([FLIP @ (y @ x @ z) @ FLIP for x, y, z in turns])
    lens = Camera(1.2 * width) if camera is None else expect_camera(camera, stretched=True)
    focal = None
    if rows.shape[1] == 8:
        if not ((rows[:, 7] > 0.0) & (rows[:, 7] < 180.0)).all():
            raise ValueError(f"{file}: vfov must be between 0 and 180 degrees")
        focal = 0.5 * height / np.tan(np.radians(rows[:, 7]) / 2.0) / lens.aspect
    return path_of(frames, rows[:, 1:4] @ FLIP, matrices, lens, focal, scale)


def read_kitti(path: PathLike, camera: Camera, *, scale: float = 1.0) -> CameraPath:
    """Return the camera path of KITTI's poses: a line is a matrix (3, 4) to the first camera."""
    file, rows = _read_numbers(path, (12,))
    with naming(file, ValueError):
        return from_matrices(rows.reshape(-1, 3, 4), camera, axes=AXES[0], scale=scale)


def read_colmap(
    folder: PathLike, shape: tuple[int, int], *, down: ArrayLike | None = None, scale: float = 1.0
) -> CameraPath:
    """Return the camera path of a COLMAP reconstruction in text, a folder."""
    # Images are frames by the numbers that their names end in; if not all do, in the order of their
    # names. The axes have no relation to the ground and no unit: `down` is where things fall, the
    # mean of the cameras' own if not given, and `scale` metres to a unit. Lenses are scaled to
    # `shape`.
    height, width = shape_of("shape", shape)
    lenses = _lenses(Path(folder) / "cameras.txt")
    file = Path(folder) / "images.txt"
    lines = [(i, line) for i, line in enumerate(_lines_of(file), 1) if line.lstrip()[:1] != "#"]
    # Every second line holds an image's points, and may be empty.
    while lines and not lines[-1][1].strip() and len(lines) % 2:
        lines.pop()
    rows: list[tuple[str, list[float], str]] = []
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
    frames = _frame_numbers([name for name, _, _ in rows])
    ordered = np.argsort(frames, kind="stable")
    frames, rows = frames[ordered], [rows[i] for i in ordered]
    turning = np.array([row[1][:4] for row in rows])
    lengths = np.linalg.norm(turning, axis=1, keepdims=True)
    if np.abs(lengths - 1.0).max() > 0.01:
        raise ValueError(f"{file}: quaternions must have length 1")
    turns = matrices_of(turning / lengths).transpose(0, 2, 1)
    places = -np.einsum("nij,nj->ni", turns, np.array([row[1][4:] for row in rows]))
    seen = np.array([lenses[camera] for _, _, camera in rows])
    if np.ptp(seen[:, [0, 1, 4, 5]], axis=0).any() or np.ptp(seen[:, 3] / seen[:, 2]) > 1e-9:
        raise ValueError(f"{file}: images must have one size, principal point and aspect")
    across, high = width / seen[0, 0], height / seen[0, 1]
    focal = across * seen[:, 2]
    lens = Camera(
        float(focal[0]), center=(across * seen[0, 4], high * seen[0, 5]),
        aspect=float(high * seen[0, 3] / (across * seen[0, 2])),
    )  # fmt: skip
    world = _upright(turns[:, :, 1].mean(axis=0) if down is None else vector("down", down, 3))
    return path_of(frames, places @ world.T, world @ turns, lens, focal, scale)


def _lenses(file: Path) -> dict[str, tuple[float, ...]]:
    """Return (width, height, fx, fy, cx, cy) of COLMAP's cameras."""
    found: dict[str, tuple[float, ...]] = {}
    distorted = False
    for number, line in enumerate(_lines_of(file), 1):
        parts = line.split()
        if not parts or parts[0].startswith("#"):
            continue
        if len(parts) < 5 or parts[1] not in _MODELS:
            known = ", ".join(_MODELS)
            raise ValueError(f"{file}, line {number}: a camera's model is one of {known}")
        width, height, *numbers = _floats(file, number, parts[2:])
        places = _MODELS[parts[1]]
        if len(numbers) <= max(places):
            raise ValueError(f"{file}, line {number}: {parts[1]} needs more numbers")
        fx, fy, cx, cy = (numbers[place] for place in places)
        if min(fx, fy, width, height) <= 0.0:
            raise ValueError(f"{file}, line {number}: sizes and focal lengths must be positive")
        distorted |= any(numbers[max(places) + 1 :])
        found[parts[0]] = width, height, fx, fy, cx, cy
    if distorted:
        warnings.warn(f"{file}: lens distortion is left out", UserWarning, stacklevel=4)
    return found


def _frame_numbers(names: list[str]) -> Float64:
    """Return frames of sorted names: the numbers that they end in, or their order."""
    found = [re.search(r"(\d{1,15})\D*$", Path(name).stem) for name in names]
    numbers = [int(match[1]) for match in found if match is not None]
    if len(numbers) == len(names) and len(set(numbers)) == len(names):
        return np.array(numbers, np.float64)
    return np.arange(len(names), dtype=np.float64)


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
    return rotation_matrix(axis * (math.atan2(sine, cosine) / sine))

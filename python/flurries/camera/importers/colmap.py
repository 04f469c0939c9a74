"""Cameras of COLMAP's reconstructions in text."""

from __future__ import annotations

import math
import os
import re
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, shape_of, vector
from flurries.camera.importers.matrices import path_of
from flurries.camera.importers.text import floats, lines_of
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.camera.rotation import matrices_of, rotation_matrix

# COLMAP's models: where focal lengths and the principal point are among the numbers.
_MODELS = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2), "PINHOLE": (0, 1, 2, 3), "SIMPLE_RADIAL": (0, 0, 1, 2),
    "RADIAL": (0, 0, 1, 2), "OPENCV": (0, 1, 2, 3), "FULL_OPENCV": (0, 1, 2, 3),
}  # fmt: skip


def read_colmap(
    folder: str | os.PathLike[str], shape: tuple[int, int], *, down: npt.ArrayLike | None = None,
    scale: float = 1.0,
) -> CameraPath:  # fmt: skip
    """Return the camera path of a COLMAP reconstruction in text, a folder."""
    # Images are frames by the numbers that their names end in; if not all do, in the order of their
    # names. The axes have no relation to the ground and no unit: `down` is where things fall, the
    # mean of the cameras' own if not given, and `scale` metres to a unit. Lenses are scaled to
    # `shape`.
    height, width = shape_of("shape", shape)
    lenses = _lenses(Path(folder) / "cameras.txt")
    file = Path(folder) / "images.txt"
    lines = [(i, line) for i, line in enumerate(lines_of(file), 1) if line.lstrip()[:1] != "#"]
    # Every second line holds an image's points, and may be empty.
    while lines and not lines[-1][1].strip() and len(lines) % 2:
        lines.pop()
    rows: list[tuple[str, list[float], str]] = []
    for number, line in lines[::2]:
        parts = line.split(maxsplit=9)
        if len(parts) != 10:
            raise ValueError(f"{file}, line {number}: an image has 10 entries, got {len(parts)}")
        rows.append((parts[9].strip(), floats(file, number, parts[1:8]), parts[8]))
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
        float(focal[0]),
        center=(across * seen[0, 4], high * seen[0, 5]),
        aspect=float(high * seen[0, 3] / (across * seen[0, 2])),
    )
    world = _upright(turns[:, :, 1].mean(axis=0) if down is None else vector("down", down, 3))
    return path_of(frames, places @ world.T, world @ turns, lens, focal, scale)


def _lenses(file: Path) -> dict[str, tuple[float, ...]]:
    """Return (width, height, fx, fy, cx, cy) of COLMAP's cameras."""
    found: dict[str, tuple[float, ...]] = {}
    distorted = False
    for number, line in enumerate(lines_of(file), 1):
        parts = line.split()
        if not parts or parts[0].startswith("#"):
            continue
        if len(parts) < 5 or parts[1] not in _MODELS:
            known = ", ".join(_MODELS)
            raise ValueError(f"{file}, line {number}: a camera's model is one of {known}")
        width, height, *numbers = floats(file, number, parts[2:])
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

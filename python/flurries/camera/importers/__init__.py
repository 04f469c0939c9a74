"""Cameras from elsewhere: trackers, compositing programs, data sets.

Every reader turns its program's axes into those of the house: x right, y down, z forward, snow
falling along +y. Lengths become metres by `scale`. Frames keep the numbers that the files give
them; outside of these a scene asks what to do (`CameraPath.extend` is "stop").
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from flurries._contract import ArrayLike, PathLike, shape_of
from flurries.camera.importers.matrices import from_matrices
from flurries.camera.importers.text import read_chan, read_colmap, read_csv, read_kitti
from flurries.camera.importers.usd import SUFFIXES, read_usd
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath

__all__ = ["from_matrices", "load", "read_chan", "read_colmap", "read_kitti", "read_usd"]


def load(
    path: PathLike, shape: tuple[int, int], *, camera: Camera | None = None,
    down: ArrayLike | None = None, scale: float = 1.0,
) -> CameraPath:  # fmt: skip
    """Return the camera path of a file, by its kind.

    Parameters
    ----------
    path : str or path
        ``.chan`` (Nuke), ``.usd``, ``.usda``, ``.usdc`` or ``.usdz`` (Blender, Houdini, Maya; of
        several cameras ``a.usdc:/shot/camera``), ``.txt`` with twelve numbers a line (KITTI), a
        folder with COLMAP's ``images.txt`` and ``cameras.txt``, or ``.csv`` with a header. Its
        columns, in any order: ``x, y, z``, world units, x right, y down, z forward; ``rx, ry, rz``,
        a rotation vector in radians, or ``qw, qx, qy, qz``, a unit quaternion; ``focal``, pixels,
        of a lens that zooms; and ``frame``, for keys, without which rows are frames from 0 on.
    shape : (H, W)
        Of the pictures to be made.
    camera : Camera, optional
        The lens, where the file says nothing of it; 1.2 picture widths if not given. ``.chan``,
        ``.csv`` and ``.txt`` never say a shift of the lens, its `center`.
    down : (3,), optional
        Where things fall, in the axes of COLMAP's world, which have no relation to the ground; the
        mean of the cameras' own down if not given.
    scale : float
        Metres to a unit of the file, above 0; times the unit that a USD stage says.
    """
    size = shape_of("shape", shape)
    lens = Camera(1.2 * size[1]) if camera is None else expect_camera(camera, stretched=True)
    stage = re.fullmatch(r"(.+\.usd[acz]?):(/.+)", os.fspath(path), re.IGNORECASE)
    place = Path(stage[1] if stage else path)
    suffix = place.suffix.lower()
    if place.is_dir():
        return read_colmap(place, size, down=down, scale=scale)
    if down is not None:
        raise ValueError(f"{place}: down is for COLMAP's folders: other files say which way it is")
    if suffix in (".csv", ".txt"):
        return (read_csv if suffix == ".csv" else read_kitti)(place, lens, scale=scale)
    if suffix == ".chan":
        return read_chan(place, size, camera=lens, scale=scale)
    if suffix in SUFFIXES:
        return read_usd(place, size, camera=lens, prim=stage and stage[2], scale=scale)
    known = ".chan, .usd, .csv or .txt file, or a folder of COLMAP's"
    raise ValueError(f"{place}: a camera is a {known}, not {suffix!r}")

"""Cameras from poses, and the path that every other reader ends in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flurries._contract import ArrayLike, Float64, choice, flag, integer, moderate, real, table
from flurries.camera.lens import Camera, expect_camera, quaternions_of
from flurries.camera.path import CameraPath
from flurries.motion.keys import Keys

# y up and looking along -z, as OpenGL, Nuke, Maya and Blender's cameras: half a turn about x.
FLIP = np.diag([1.0, -1.0, -1.0])

AXES = ("x right, y down, z forward", "x right, y up, z back")


def from_matrices(
    matrices: ArrayLike, camera: Camera, *, axes: str, inverse: bool = False,
    focal: ArrayLike | None = None, scale: float = 1.0, start: int = 0,
) -> CameraPath:  # fmt: skip
    """Return the camera path of poses, one for each frame from `start` on.

    Parameters
    ----------
    matrices : (n, 3, 4) or (n, 4, 4)
        From the camera's axes to the world's; `inverse` (extrinsics): the other way.
    camera, focal : Camera, (n,) or None
        The lens, and the focal lengths in pixels of one that zooms.
    axes : {"x right, y down, z forward", "x right, y up, z back"}
        Of camera and world: of OpenCV, KITTI and ROS' optical frames, or of OpenGL, Nuke, Maya and
        NeRF data. Matrices do not say which, and the wrong one turns the world over.
    scale : float
        Metres to a unit of the places.
    """
    poses = moderate("matrices", table("matrices", matrices, ndim=3))
    if poses.shape[1:] not in ((3, 4), (4, 4)) or len(poses) == 0:
        raise ValueError(f"matrices must be (n, 3, 4) or (n, 4, 4), got {poses.shape}")
    choice("axes", axes, AXES)
    turns, places = poses[:, :3, :3], poses[:, :3, 3]
    if flag("inverse", inverse):
        turns = turns.transpose(0, 2, 1)
        places = -np.einsum("nij,nj->ni", turns, places)
    if axes == AXES[1]:
        turns, places = FLIP @ turns @ FLIP, places @ FLIP
    lens = expect_camera(camera, stretched=True)
    lengths = None if focal is None else table("focal", focal, ndim=1)
    if lengths is not None and len(lengths) != len(poses):
        raise ValueError(f"focal must have {len(poses)} numbers, one a matrix, got {len(lengths)}")
    first = integer("start", start, low=-(2**31), high=2**31)
    frames = first + np.arange(len(poses), dtype=np.float64)
    return path_of(frames, places, turns, lens, lengths, scale)


def path_of(
    frames: Float64, places: Float64, turns: Float64, lens: Camera, focal: Float64 | None,
    scale: float,
) -> CameraPath:  # fmt: skip
    """Return a path through places and orientations at frames."""
    places = real("scale", scale, above=0.0) * places
    if focal is not None:
        lens = replace(lens, focal=float(focal[0]))
        focal = focal if np.ptp(focal) > 0.0 else None
    if np.array_equal(frames, np.arange(len(frames))):
        return CameraPath(lens, position=places, orientation=turns, focal=focal, extend="stop")
    # Keys cannot be matrices, and are not checked as these are.
    CameraPath(lens, orientation=turns)

    def keys_of(values: Sequence[Any]) -> Keys:
        return Keys(list(zip(frames.tolist(), values, strict=True)))

    return CameraPath(
        lens, position=keys_of(places.tolist()),
        orientation=keys_of(quaternions_of(turns).tolist()),
        focal=None if focal is None else keys_of(focal.tolist()), extend="stop",
    )  # fmt: skip

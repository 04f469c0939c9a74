"""What an effect is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera import Camera
from flurries.path import CameraPath


@dataclass(frozen=True)
class Frame:
    """One eye's view of the air at one time: all that an effect may depend on.

    Attributes
    ----------
    shape : (H, W)
        Size of the whole frame, pixels.
    window : (top, bottom, left, right)
        The part that is wanted, pixels.
    t : float
        Frame number.
    fps : float
        Frames per second.
    camera : Camera
        The eye.
    path : CameraPath
        Its way.
    seed : int
        The effect's own.
    """

    shape: tuple[int, int]
    window: tuple[int, int, int, int]
    t: float
    fps: float
    camera: Camera
    path: CameraPath
    seed: int

    @property
    def width_scale(self) -> float:
        """Size of the picture against one of 1024 px, so that looks do not change with it."""
        return self.shape[1] / 1024.0

    def crop(self, plane: Array) -> Array:
        """Return the window of a plane of the whole frame."""
        top, bottom, left, right = self.window
        return plane[top:bottom, left:right]

    def to_camera(self, vectors: Float64) -> Float64:
        """Return house axes turned into the camera's."""
        return np.ascontiguousarray(vectors @ self.camera.matrix())


@dataclass(frozen=True)
class Layer:
    """One effect's part of a frame.

    Attributes
    ----------
    name : str
        What it is.
    alpha : (h, w) float32
        Opacity over the window.
    colour : (r, g, b)
        Its one colour, display values 0 to 1.
    """

    name: str
    alpha: Array
    colour: tuple[float, float, float]

    def rgba(self, colour: Any) -> Array:
        """Return (h, w, 4) float32, premultiplied with `colour` (3,)."""
        result = np.empty((*self.alpha.shape, 4), np.float32)
        np.multiply(self.alpha[..., None], np.asarray(colour, np.float32), out=result[..., :3])
        result[..., 3] = self.alpha
        return result

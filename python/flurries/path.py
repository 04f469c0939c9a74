"""The camera's way through the air: one path drives the texture, the flakes and both eyes."""

from __future__ import annotations

import bisect
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Float64, table
from flurries.camera import Camera
from flurries.timeline import Keys, as_vector, integral_to, value_at

__all__ = ["CameraPath"]


@dataclass(frozen=True, eq=False)
class CameraPath:
    """A camera that moves, without turning.

    Give one of `position` and `velocity`, or neither for a camera that stands still.

    Parameters
    ----------
    camera : Camera
        Lens and orientation.
    position : (n, 3) array or Keys, optional
        Places in world units, x right, y down, z forward: one for each frame from 0 on, or keyed.
        Linear between them; outside they go on with the first and the last rate.
    velocity : (3,) or Keys, optional
        World units per second; integrated in closed form from frame 0.

    Raises
    ------
    ValueError, TypeError
        For wrong shapes, numbers that are not finite, or both ways at once.

    Examples
    --------
    >>> import flurries as fl
    >>> path = fl.CameraPath(fl.camera.Camera(1200.0), velocity=(0.0, -0.5, 3.0))
    >>> path.place(60.0, fps=30.0).tolist()
    [0.0, -1.0, 6.0]
    """

    camera: Camera
    position: Any = None
    velocity: Any = None

    def __post_init__(self) -> None:
        settle = object.__setattr__
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera must be a Camera, got {type(self.camera).__name__}")
        if self.position is not None and self.velocity is not None:
            raise ValueError("position and velocity must not both be given")
        if self.velocity is not None:
            settle(self, "velocity", as_vector("velocity", self.velocity, 3))
        if isinstance(self.position, Keys):
            as_vector("position", self.position, 3)
        elif self.position is not None:
            places = table("position", self.position)
            if places.shape[1] != 3 or len(places) == 0:
                raise ValueError(f"position must have shape (n, 3), got {places.shape}")
            places = places.copy()
            places.flags.writeable = False
            settle(self, "position", places)

    @property
    def still(self) -> bool:
        """Whether the camera never moves."""
        return self.position is None and self.velocity is None

    def goes_along(self, axis: Float64) -> bool:
        """Whether the camera ever moves along a direction of the house axes, (3,)."""
        if self.velocity is not None:
            keys = self.velocity.keys if isinstance(self.velocity, Keys) else [(0, self.velocity)]
            return any(np.dot(axis, value) != 0.0 for _, value in keys)
        if self.position is None:
            return False
        places = self.position
        if isinstance(places, Keys):
            places = np.array([value for _, value in places.keys])
        return bool((np.diff(places, axis=0) @ axis != 0.0).any())

    def place(self, t: float, *, fps: float) -> Float64:
        """Return the place at frame `t`, (3,) world units."""
        if self.velocity is not None:
            return np.asarray(integral_to(self.velocity, t) / fps, dtype=np.float64)
        if self.position is None:
            return np.zeros(3)
        if isinstance(self.position, Keys):
            return np.asarray(self.position.at(t, extend=True))
        if len(self.position) == 1:
            return np.array(self.position[0])
        i = self._piece(t)
        before, after = self.position[i], self.position[i + 1]
        return np.asarray(before + (t - i) * (after - before))

    def rate(self, t: float, *, fps: float) -> Float64:
        """Return the change of place per frame at `t`, (3,) world units."""
        if self.velocity is not None:
            return np.asarray(value_at(self.velocity, t)) / fps
        if self.position is None or len(getattr(self.position, "keys", self.position)) == 1:
            return np.zeros(3)
        if isinstance(self.position, Keys):
            return np.asarray(self.position.slope(t, extend=True))
        i = self._piece(t)
        return np.asarray(self.position[i + 1] - self.position[i])

    def _piece(self, t: float) -> int:
        last = len(self.position) - 2
        return min(max(bisect.bisect_right(range(last + 1), t) - 1, 0), last)


def as_path(camera: object, default_focal: float) -> CameraPath:
    """Return a path from what a scene was given: nothing, a camera, or a path."""
    if camera is None:
        return CameraPath(Camera(default_focal))
    if isinstance(camera, Camera):
        return CameraPath(camera)
    if isinstance(camera, CameraPath):
        return camera
    raise TypeError(f"camera must be a Camera or a CameraPath, got {type(camera).__name__}")

"""The pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: x right, y down, z forward."""

    focal: float
    center: tuple[float, float] | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    center_shift: tuple[float, float] = (0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def principal(self, shape: tuple[int, int]) -> tuple[float, float]:
        """Return the principal point (cx, cy) in px, center_shift included."""
        x, y = (shape[1] / 2, shape[0] / 2) if self.center is None else self.center
        return x + self.center_shift[0], y + self.center_shift[1]

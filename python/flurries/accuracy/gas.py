"""Splatted gas: footprints, stopping early."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from flurries import gas as splatting
from flurries._contract import Array
from flurries.accuracy.ways import Way, largest
from flurries.camera.lens import Camera

SHAPE = (240, 320)
EYE = Camera(280.0)
RIM = np.exp(-4.5)


def _cloud(count: int) -> Array:
    box = np.random.default_rng(2).uniform(-2.5, 2.5, (count, 3))
    return np.asarray(box + np.array([0.0, 0.0, 5.5]))


def _line_integrals(centers: Array, radius: float, density: float) -> Array:
    """alpha = 1 - prod (1 - rho g(q)), q = 3 |C x d| / r for the ray d of each pixel."""
    height, width = SHAPE
    y, x = np.mgrid[:height, :width] + 0.5
    rays = np.stack([(x - width / 2) / EYE.focal, (y - height / 2) / EYE.focal, np.ones(SHAPE)], -1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    through = np.ones(SHAPE)
    for center in centers:
        along = rays @ center
        square = 9.0 * np.maximum(center @ center - along**2, 0.0) / radius**2
        g = np.maximum((np.exp(-0.5 * square) - RIM) / (1.0 - RIM), 0.0)
        through *= 1.0 - density * g * (along > 0.0)
    return 1.0 - through


def footprint() -> list[Way]:
    """The models of a particle's footprint."""
    centers, radius, density = _cloud(300), 0.45, 0.4
    centers = centers[centers[:, 2] > 3.2]
    exact = _line_integrals(centers, radius, density)

    def mean(made: Array) -> float:
        return float(np.mean(np.abs(made.astype(np.float64) - exact)))

    def way(model: str, dtype: Any, edge: str = "taper") -> Way:
        return Way(
            f"{model}, {np.dtype(dtype).name}" + (", square" if edge == "square" else ""),
            lambda: splatting.alpha(
                SHAPE, centers, radius, density, EYE, footprint=model, edge=edge, dtype=dtype
            ),
            mean,
        )

    models = ("viewplane", "viewplane_c", "viewpoint", "volume", "table")
    ways = [way(model, np.float32) for model in models]
    return [*ways, way("viewplane_c", np.float32, "square"), way("volume", np.float64)]


def stop() -> list[Way]:
    """Front to back until what is behind can no longer be seen."""
    centers = _cloud(2000)

    def make(error: float | None, dtype: Any) -> Array:
        return splatting.alpha(SHAPE, centers, 0.6, 0.8, EYE, error=error, dtype=dtype)

    off = largest(make(None, np.float64))
    ways = [
        Way(f"until {error:.2g} is left", partial(make, error, np.float32), off)
        for error in (1e-1, 1e-2, 1.0 / 255.0, 1e-3, 1e-4)
    ]
    return [*ways, Way("to the end, float32", lambda: make(None, np.float32), off)]

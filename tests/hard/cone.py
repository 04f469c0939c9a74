"""Hard cases of the double cone: its frame, mapping, elongation and path."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

import flurries as fl
from flurries import _core
from hard.case import Case

K = fl.cone
EYE = fl.Camera(100.0)
SHAPE = (60, 80)


def turned(angle: float) -> Any:
    """How far x, turned as the default axis is to one `angle` from straight up, is off."""

    def measure(dtype: Any) -> float:
        with mpmath.workdps(40):
            # In the plane of y and (x + z)/sqrt 2; the axis is pi - angle from (0, 1, 0).
            theta = mpmath.pi - mpmath.mpf(angle)
            across = mpmath.sin(theta) / mpmath.sqrt(2)
            axis = [float(across), float(mpmath.cos(theta)), float(across)]
            first = _core.cone_basis(tuple(axis))[1]
            # Rodrigues about n = (1, 0, -1)/sqrt 2 with (0, 1, 0) x axis along it.
            n = [1 / mpmath.sqrt(2), mpmath.mpf(0), -1 / mpmath.sqrt(2)]
            c, s = mpmath.cos(theta), mpmath.sin(theta)
            x = [mpmath.mpf(1), mpmath.mpf(0), mpmath.mpf(0)]
            pairs = ((1, 2), (2, 0), (0, 1))
            cross = [n[i] * x[j] - n[j] * x[i] for i, j in pairs]
            along = sum(a * b for a, b in zip(n, x, strict=True))
            exact = [c * x[i] + s * cross[i] + (1 - c) * along * n[i] for i in range(3)]
            return max(abs(float(first[i] - exact[i])) for i in range(3))

    return measure


def on_axis_finite(axis: tuple[float, float, float]) -> Any:
    """Numbers of the mapping that are not finite, with a pixel exactly on the axis."""

    def measure(dtype: Any) -> float:
        camera = fl.Camera(100.0, center=(40.5, 30.5))
        found = K.rays(SHAPE, camera, axis=axis, slope=0.2)
        parts = (found.azimuth, found.height, found.azimuth_step, found.height_step, found.fade)
        return float(sum(np.count_nonzero(~np.isfinite(part)) for part in parts))

    return measure


def azimuth_range(dtype: Any) -> float:
    """Azimuths outside [0, 1), of rays that turn back from it by 1e-32 to 1e-14 among them."""
    across = np.concatenate([np.logspace(-30, -12, 200), -np.logspace(-30, -12, 200)])
    places = np.column_stack([np.full(400, 20.0), across])
    camera = fl.Camera(30.0, center=(8.0, 0.0))
    outside = 0
    for found in (
        K.rays(SHAPE, fl.Camera(30.0), axis=(0.0, 1e-30, 1.0), slope=0.0).azimuth,
        K.rays((16, 16), camera, axis=(0.0, 0.0, 1.0), points_px=places).azimuth,
    ):
        outside += np.count_nonzero((found < 0.0) | (found >= 1.0))
    return float(outside)


CASES = [
    *[
        Case(f"the frame {a:g} rad from straight up", turned(a), 0.0, tol,
             "eps of the axis over the angle", "o = |a0 + a|^2 / 2, not 1 + cos")
        for a, tol in ((1.0, 1e-15), (1e-3, 1e-12), (1e-5, 1e-10))
    ],
    *[
        Case(f"a pixel on the axis {axis}: numbers that are not finite", on_axis_finite(axis), 0.0,
             0.0, "a count", "denominators have a floor")
        for axis in ((0.0, 0.0, 1.0), (0.0, -0.0, -1.0))
    ],
    Case("azimuths outside [0, 1)", azimuth_range, 0.0, 0.0, "a count", "the wrap at +-0"),
]  # fmt: skip

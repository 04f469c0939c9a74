"""Hard cases of gas: billboard errors, footprints, near plane, occlusion, sums."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np

import flurries as fl
from hard.case import Case, worst

G = fl.gas
EYE = fl.Camera(300.0)
RIM = math.exp(-4.5)
# The taper's integral over the plane in squares of sigma: 2 pi (1 - e^-4.5 - 4.5 e^-4.5)/(1 - ..).
TAPER = 2.0 * math.pi - 9.0 * math.pi * RIM / (1.0 - RIM)


def _direct(x: Any, depth: Any, radius: Any) -> Any:
    """Viewplane less viewpoint edge of a billboard, N = 1, from its geometry."""
    slant = mpmath.sqrt(x * x + depth * depth)
    tilted = mpmath.tan(mpmath.atan(x / depth) + mpmath.atan(radius / slant))
    return (x + radius) / depth - tilted


def projection(x: float, depth: float, radius: float = 0.45) -> Any:
    """Relative error of the closed form of a billboard's projection error."""

    def measure(dtype: Any) -> float:
        x_, depth_ = float(dtype(x)), float(dtype(depth))
        got = G.projection_error(np.array([[x_, 0.0, depth_]]), radius)[0, 0]
        with mpmath.workdps(400):
            exact = _direct(mpmath.mpf(x_), mpmath.mpf(depth_), mpmath.mpf(radius))
            return float(abs(mpmath.mpf(float(got)) / exact - 1))

    return measure


def parallax(distance: float, x: float = 0.7) -> Any:
    """Relative error of the parallax error of two eyes."""

    def measure(dtype: Any) -> float:
        got = G.parallax_error(np.array([[x, 0.0, 4.0]]), 0.45, eye_distance=distance)[0, 0]
        with mpmath.workdps(80):
            half, depth, radius = mpmath.mpf(distance) / 2, mpmath.mpf(4), mpmath.mpf(0.45)
            at = mpmath.mpf(x)
            exact = _direct(at - half, depth, radius) - _direct(at + half, depth, radius)
            return float(abs(mpmath.mpf(float(got)) / exact - 1))

    return measure


def outside_the_domain(dtype: Any) -> float:
    """Errors that are NaN: behind the eye, at it, and where D S <= r C_x."""
    centers = np.array([[0, 0, -1], [0, 0, 0], [3, 0, 0.1], [1, 0, 0.2]], dtype)
    found = G.projection_error(centers, [0.45, 0.45, 1.0, 1.0])
    return float(np.isnan(found).all(axis=1).sum())


def on_the_axis(dtype: Any) -> float:
    return worst(G.projection_error(np.array([[0.0, 0.3, 5.0]], dtype), 0.45)[0])


def table_peak(size: int) -> Any:
    return lambda dtype: float(G.footprint_table(size).max())


def drawn(depth: float, *, radius: float = 0.3, density: float = 0.5, wall: float | None = None,
          shape: tuple[int, int] = (33, 33), **options: Any) -> Any:  # fmt: skip
    """The opacity at the middle of a particle straight ahead."""

    def measure(dtype: Any) -> float:
        hidden = None if wall is None else np.full(shape, wall, dtype)
        got = G.alpha(shape, [[0.0, 0.0, depth]], radius, density, EYE, depth=hidden, dtype=dtype,
                      **options)  # fmt: skip
        return float(got[shape[0] // 2, shape[1] // 2])

    return measure


def light(radius_px: float) -> Any:
    """The sum of a faint particle's opacity over its integral."""

    def measure(dtype: Any) -> float:
        depth, density = 10.0, 1e-3
        got = G.alpha((64, 64), [[0.011, 0.007, depth]], radius_px * depth / EYE.focal, density,
                      EYE, footprint="viewplane", dtype=dtype)  # fmt: skip
        return float(np.sum(got, dtype=np.float64) / (density * TAPER * (radius_px / 3.0) ** 2))

    return measure


def equal_depths(dtype: Any) -> float:
    """Of two opaque particles at one depth the first is in front: the red of the middle."""
    got = G.splat((9, 9), [[0.0, 0.0, 3.0]] * 2, 3.0, 1.0, [[1.0, 0, 0], [0, 1.0, 0]],
                  fl.Camera(300.0, center=(4.5, 4.5)), dtype=dtype)  # fmt: skip
    return float(got[4, 4, 0])


def beta(count: float, radius: float, density: float) -> Any:
    return lambda dtype: G.extinction(count, 125.0, radius, density)


FORM = "a bound on the stable form, 1e-13"
CASES = [
    *[
        Case(f"billboard error at x = {x:g}, depth {d:g}: relative error", projection(x, d), 0.0,
             1e-13, FORM, "no difference of nearly equal projections")
        for x, d in ((1e-9, 5.0), (1.0, 1e4), (1e-3, 1e6), (-0.5, 2.0), (1.0, 1.0))
    ],
    Case("billboard error at x = 1e-30, depth 5: relative error", projection(1e-30, 5.0), 0.0,
         1e-13, FORM, "no difference of nearly equal projections"),
    Case("billboard error on the axis", on_the_axis, 0.0, 0.0, "exact", "a factor C_x"),
    *[
        Case(f"parallax error of eyes {i:g} apart: relative error", parallax(i), 0.0, 1e-13, FORM,
             "no difference of nearly equal errors")
        for i in (0.065, 1e-6, 1e-10)
    ],
    Case("billboard errors outside their domain are NaN", outside_the_domain, 4.0, 0.0, "a count",
         "D > 0 and D S > r C_x"),
    Case("an odd table has 1 in the middle", table_peak(65), 1.0, 0.0, "exact",
         "scaled by the origin"),
    Case("an even table of 16 has no sample there", table_peak(16), math.exp(-0.25 * 0.4**2),
         1e-15, "4 eps", "scaled by the origin, not by the largest entry"),
    Case("a table of 2 has its corners only", table_peak(2), math.exp(-9.0), 1e-18, "4 eps",
         "scaled by the origin, not by the largest entry"),
    *[
        Case(f"light of a particle of {r:g} px", light(r), 1.0, (tol + 1.2e-4, tol),
             "exact box below 2 px, samples above; float32: an eps of 1 against 1e-3",
             "pixels are integrals below 2 px")
        for r, tol in ((0.25, 2e-6), (1.0, 2e-6), (1.999, 2e-6), (2.001, 2e-3), (12.0, 2e-4))
    ],
    Case("a particle 2,450 px wide, at its middle",
         drawn(0.1, radius=0.9, near=1e-3, near_mode="cull"), 0.5, 1e-6,
         "the pixel's own middle is on the axis", "bounds are clamped before they are integers"),
    Case("opacity 1 hides all", drawn(3.0, radius=2.0, density=1.0), 1.0, (1e-6, 1e-9),
         "the pixel's own middle is on the axis", "no logarithm of 0"),
    Case("at the near plane a particle has faded", drawn(0.2, near=0.2), 0.0, 0.0, "exact",
         "smoothstep from the near plane on"),
    Case("a third of its radius behind it is whole", drawn(0.3000001, near=0.2), 0.5, 1e-6,
         "smoothstep ends", "smoothstep ends at near + r/3"),
    Case("behind the eye there is nothing", drawn(-1.0), 0.0, 0.0, "exact", "the near plane"),
    Case("a particle at the wall's depth, hard", drawn(3.0, wall=3.0, occlusion="hard"), 0.0, 0.0,
         "exact", "strictly in front"),
    Case("a particle at the wall's depth, soft: half", drawn(3.0, wall=3.0), 0.25, (1e-6, 1e-12),
         "Phi(0) is 1/2", "the normal law"),
    Case("a wall before the near plane hides all, line integral",
         drawn(0.5, near=0.2, wall=0.1, footprint="volume"), 0.0, 1e-12, "Phi of equal ends",
         "an empty interval is empty"),
    Case("at equal depths the first comes first", equal_depths, 1.0, (1e-6, 1e-9),
         "an opaque middle", "a stable order"),
    *[
        Case(f"extinction of {name}", beta(n, r, rho), n / 125.0 * rho * TAPER * (r / 3.0) ** 2,
             1e-14, "4 eps", "the taper's integral")
        for name, n, r, rho in (
            ("clouds", 1500, 0.37, 0.4), ("mist", 1000, 0.45, 0.15), ("fog", 1200, 0.45, 0.4))
    ],
]  # fmt: skip

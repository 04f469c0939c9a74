"""Mist, fog and clouds as splatted Gaussian particles (Johnson 2005).

A gas is particles, one or n of each: `centers` (n, 3), their middles in camera axes (x right, y
down, z forward); `radius`, three sigma of a Gaussian, positive; `density`, the opacity in the
middle, 0 to 1; colors in linear light. Lengths are world units. :func:`splat` draws them for a
camera, :func:`alpha` their opacity, :func:`extinction` and :func:`visibility` say how far one sees
in them, :func:`light` shades them. :func:`projection_error` and :func:`parallax_error` are the
paper's analysis of its billboards.
"""

from flurries.gas.optics import (
    extinction,
    footprint_table,
    light,
    parallax_error,
    phase,
    projection_error,
    visibility,
)
from flurries.gas.splatting import alpha, splat

__all__ = [
    "alpha", "extinction", "footprint_table", "light", "parallax_error", "phase",
    "projection_error", "splat", "visibility",
]  # fmt: skip

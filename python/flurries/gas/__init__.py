"""Mist, fog and clouds as splatted Gaussian particles (Johnson 2005).

A gas is particles: middles, radii of three sigma, densities (the opacity of a particle's middle)
and colors in linear light. :func:`splat` draws them for a camera, :func:`alpha` their opacity,
:func:`extinction` and :func:`visibility` say how far one sees in them, :func:`light` shades them.
:func:`projection_error` and :func:`parallax_error` are the paper's analysis of its billboards.
"""

from flurries.gas.billboards import parallax_error, projection_error
from flurries.gas.optics import extinction, footprint_table, light, phase, visibility
from flurries.gas.splatting import alpha, splat

__all__ = [
    "alpha", "extinction", "footprint_table", "light", "parallax_error", "phase",
    "projection_error", "splat", "visibility",
]  # fmt: skip

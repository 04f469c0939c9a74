"""Mist, fog and clouds as splatted Gaussian particles (Johnson 2005).

A gas is particles: middles, radii of three sigma, densities (the opacity of a particle's middle)
and colors in linear light. :func:`splat` draws them for a camera; :func:`alpha` their opacity
alone. :func:`particles_of` makes them from a gridded density, :func:`extinction` and
:func:`visibility` say how far one sees in them, :func:`light` shades them. :func:`projection_error`
and :func:`parallax_error` are the paper's analysis of its billboards, corrected.
"""

from flurries.gas.billboards import parallax_error, projection_error
from flurries.gas.grid import particles_of
from flurries.gas.lighting import light, phase
from flurries.gas.splatting import alpha, splat
from flurries.gas.table import footprint_table
from flurries.gas.visibility import count_for_visibility, density_for_visibility, extinction
from flurries.gas.visibility import visibility as visibility

__all__ = [
    "alpha",
    "count_for_visibility",
    "density_for_visibility",
    "extinction",
    "footprint_table",
    "light",
    "parallax_error",
    "particles_of",
    "phase",
    "projection_error",
    "splat",
    "visibility",
]

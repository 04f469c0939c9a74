"""Drops and flakes as textures on a double cone around the camera (Wang 2004).

A cone whose axis is the drops' way relative to the camera surrounds the eye, so that precipitation
falls towards a moving camera and nothing breaks as it turns. Textures on it scroll along the axis;
four of them, each smaller and slower than the one before, give depth. The cost of a frame does not
depend on how heavy the rain is.

:func:`path` gives the axis, the phase and the stretch of a whole way at once, :func:`layer` draws
one texture, :func:`layers` four in one pass.
"""

from flurries.cone.path import Path, State, path
from flurries.cone.sheet import Rays, layer, rays
from flurries.cone.stack import layers
from flurries.cone.tiles import Texture, rain_tile, snow_tile

__all__ = [
    "Path",
    "Rays",
    "State",
    "Texture",
    "layer",
    "layers",
    "path",
    "rain_tile",
    "rays",
    "snow_tile",
]

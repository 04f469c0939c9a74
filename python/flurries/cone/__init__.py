"""Drops and flakes as textures on a double cone around the camera (Wang 2004).

Its axis is the drops' way relative to the camera. Four textures scroll along it, each smaller and
slower than the one before; the cost of a frame does not depend on how heavy the rain is.
"""

from flurries.cone.path import Path, State, path
from flurries.cone.sheet import Rays, Texture, layer, rain_tile, rays, snow_tile
from flurries.cone.stack import layers

__all__ = [
    "Path", "Rays", "State", "Texture", "layer", "layers", "path", "rain_tile", "rays",
    "snow_tile",
]  # fmt: skip

"""One texture on the double cone, filtered exactly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    Float64,
    flag,
    float_dtype,
    integer,
    output,
    real,
    shape_of,
    shares,
    vector,
)
from flurries._contract import pixels as pixels_of
from flurries.camera.lens import Camera
from flurries.cone.rays import pose

__all__ = ["layer"]

MOST_REPEATS = 4096
LARGEST_TILE = 4096


def layer(
    shape: tuple[int, int],
    camera: Camera,
    tile: npt.ArrayLike,
    *,
    axis: npt.ArrayLike,
    phase: float,
    stretch: float = 1.0,
    slope: float = 0.0,
    repeats: int = 4,
    offset: tuple[float, float] = (0.0, 0.0),
    gain: float = 1.0,
    conserve: bool = True,
    radius: float = math.inf,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return the alpha of one texture on a double cone around the camera.

    A pixel at azimuth a (turns) and height w sees the texture around
    ``(a repeats + offset_x, repeats / (2 pi) w / stretch - phase + offset_y)``, tiles: the mean of
    a box as large as the pixel, and at least one texel, in float64.

    Parameters
    ----------
    shape : (H, W)
        Size of the picture.
    camera : Camera
        Its lens, rotation and offset.
    tile : (n, n)
        Toroidal opacities, 0 to 1; rows run along the axis. See :func:`rain_tile`.
    axis : (3,)
        Direction in which the drops go, seen from the camera, house axes; from :func:`path`.
    phase : float
        Distance that the texture has moved along the axis, tiles; from :func:`path`.
    stretch : float
        L, how many times as long a drop is along the axis as in the tile, more than 0.
    slope : float
        k, radius over height of the cone, 0 or more. On a cylinder, 0, images move exactly as those
        of points in space, on a cone faster by ``(1 + k tan e)^2`` at elevation e.
    repeats : int
        Number of tiles around the cone, 1 to 4096.
    offset : (x, y)
        Shift of the texture in tiles, so that layers of one texture differ.
    gain : float
        Factor of the opacity, 0 or more.
    conserve : bool
        Divide the opacity by `stretch`, so that the light of a drop stays the same.
    radius : float
        Of the cone, world units; it matters for a camera with an `offset` only.

    Returns
    -------
    (H, W) array
        Alpha, 0 to 1; against 10 x 10 supersampling the mean error is below 0.012.

    Notes
    -----
    Wang 2004, corrected: ``docs/internals/deviations.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> rain = fl.cone.rain_tile(128, seed=1)
    >>> view = fl.Camera(focal=150.0)
    >>> alpha = fl.cone.layer((90, 120), view, rain, axis=(0, 1, 0), phase=0.25)
    >>> alpha.shape, alpha.dtype.name
    ((90, 120), 'float32')
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    texture = texture_of(tile)
    length = real("stretch", stretch, low=1e-6, high=1e6)
    given = pose(size, camera, axis, slope, radius)
    place = vector("offset", offset, 2)
    strength = real("gain", gain, low=0.0, high=1e6)
    if flag("conserve", conserve):
        strength /= length
    result = output(out, size, kind, texture)
    sheet = (
        integer("repeats", repeats, low=1, high=MOST_REPEATS),
        wrapped(real("phase", phase)),
        length,
        (wrapped(float(place[0])), wrapped(float(place[1]))),
        strength,
    )
    _core.cone_layer(result, texture, given, sheet)
    return result


def wrapped(tiles: float) -> float:
    """Return a place in tiles without whole tiles, in [0, 1)."""
    part = math.fmod(tiles, 1.0)
    part = part + 1.0 if part < 0.0 else part
    return 0.0 if part >= 1.0 else part


def texture_of(tile: Any) -> Float64:
    """Return a square, finite texture of opacities in float64."""
    texture, _ = pixels_of("tile", tile, ndim=2)
    if texture.shape[0] != texture.shape[1]:
        raise ValueError(f"tile must be square, got shape {texture.shape}")
    if len(texture) > LARGEST_TILE:
        raise ValueError(f"tile must be at most {LARGEST_TILE} texels wide, got {len(texture)}")
    texture = np.ascontiguousarray(texture, dtype=np.float64)
    shares("tile", texture)
    return texture

"""Toroidal textures of rain and snow, drawn from a seed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    Float64,
    aligned,
    float_dtype,
    integer,
    output,
    real,
    seed_of,
)
from flurries.cone.sheet import LARGEST_TILE

__all__ = ["rain_tile", "snow_tile"]

# Streams of counter-based numbers: places, sizes, opacities.
ACROSS, ALONG, SIZE, OPACITY = 311, 312, 313, 314

MOST_DROPS = 1_000_000


def rain_tile(
    size: int,
    *,
    seed: int,
    drops: int = 220,
    width: float = 0.003,
    length: float = 0.03,
    spread: float = 0.5,
    opacity: float = 0.8,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return a toroidal texture of raindrops.

    Parameters
    ----------
    size : int
        n, texels to a side, 4 to 4096.
    seed : int
        Any int64.
    drops : int
        How many.
    width : float
        Width of a drop, two sigma of a Gaussian, tiles. A thinner one than a texel is drawn wider
        and fainter.
    length : float
        Length of a drop along the axis, tiles, 0 to 0.5; the cone's `stretch` makes it longer.
    spread : float
        Spread of sizes, 0 to 1: drops are ``1 - spread / 2`` to ``1 + spread / 2`` times as large.
    opacity : float
        Opacity in the middle of a drop, 0 to 1, with the same spread.

    Returns
    -------
    (n, n) array
        Opacities, 0 to 1: ``1 - prod(1 - alpha_i)``, without an edge.

    Examples
    --------
    >>> import flurries as fl
    >>> fl.cone.rain_tile(64, seed=7).shape
    (64, 64)
    """
    rows = _sprites(size, "drops", drops, seed, width, spread, opacity)
    rows[:, 3] = 0.5 * size * real("length", length, low=0.0, high=0.5)
    rows[:, 3] *= rows[:, 2] / max(0.5 * size * width, 1e-300)
    return _drawn(size, rows, dtype, out)


def snow_tile(
    size: int,
    *,
    seed: int,
    flakes: int = 160,
    width: float = 0.012,
    spread: float = 0.9,
    opacity: float = 0.85,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return a toroidal texture of snowflakes: Gaussian discs.

    Parameters and result are those of :func:`rain_tile`; `width` is two sigma of a flake, tiles.
    """
    rows = _sprites(size, "flakes", flakes, seed, width, spread, opacity)
    return _drawn(size, rows, dtype, out)


def _sprites(
    size: int, name: str, many: int, seed: int, width: float, spread: float, opacity: float
) -> Float64:
    """Return rows (u, v, sigma, half length, opacity) in texels."""
    texels = integer("size", size, low=4, high=LARGEST_TILE)
    count = integer(name, many, low=0, high=MOST_DROPS)
    chosen = seed_of(seed)
    draw = np.empty((4, count))
    for row, stream in zip(draw, (ACROSS, ALONG, SIZE, OPACITY), strict=True):
        _core.uniform(row, chosen, stream)
    differ = real("spread", spread, low=0.0, high=1.0)
    peak = real("opacity", opacity, low=0.0, high=1.0)
    rows = np.zeros((count, 5))
    rows[:, 0], rows[:, 1] = texels * draw[0], texels * draw[1]
    rows[:, 2] = 0.5 * texels * real("width", width, above=0.0, high=1.0)
    rows[:, 2] *= 1.0 + differ * (draw[2] - 0.5)
    rows[:, 4] = peak * (1.0 - differ * draw[3] / 2.0)
    return rows


def _drawn(size: int, rows: Float64, dtype: npt.DTypeLike, out: Array | None) -> Array:
    result = output(out, (size, size), float_dtype(dtype))
    _core.cone_tile(result, aligned(rows, np.float64))
    return result

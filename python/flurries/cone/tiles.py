"""Toroidal textures of rain, snow and sleet, drawn from a seed, or made of a picture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    Float64,
    aligned,
    flag,
    float_dtype,
    integer,
    output,
    real,
    rectangular,
    require,
    seed_of,
)
from flurries._contract import pixels as pixels_of
from flurries.cone.sheet import LARGEST_TILE
from flurries.particles.population import smoothstep

__all__ = ["rain_tile", "sleet_tile", "snow_tile", "tile_of"]

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
        Width of a drop, two sigma of a Gaussian, tiles.
    length : float
        Length of a drop along the axis, tiles, 0 to 0.5; the cone's `stretch` makes it longer.
    spread : float
        Spread of sizes, 0 to 1: drops are ``1 - spread / 2`` to ``1 + spread / 2`` times as large.
    opacity : float
        Opacity in the middle of a drop, 0 to 1, with the same spread.

    Returns
    -------
    (n, n) array
        Opacities, 0 to 1: ``1 - prod(1 - alpha_i)``. Every distance is the shortest around the
        torus, so that the tile has no edge. A drop thinner than a texel is drawn wider and
        fainter, with the same energy.

    Examples
    --------
    >>> import flurries as fl
    >>> tile = fl.cone.rain_tile(64, seed=7)
    >>> bool(tile.max() <= 1.0) and tile.shape == (64, 64)
    True
    """
    texels, count = _size(size), _count("drops", drops)
    rows = _sprites(texels, count, seed, width, spread, opacity)
    rows[:, 3] = 0.5 * texels * real("length", length, low=0.0, high=0.5)
    rows[:, 3] *= rows[:, 2] / max(0.5 * texels * width, 1e-300)
    return _drawn(texels, rows, dtype, out)


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
    texels, count = _size(size), _count("flakes", flakes)
    return _drawn(texels, _sprites(texels, count, seed, width, spread, opacity), dtype, out)


def sleet_tile(
    size: int,
    *,
    seed: int,
    drops: int = 130,
    flakes: int = 70,
    width: float = 0.004,
    length: float = 0.02,
    flake_width: float = 0.011,
    spread: float = 0.7,
    opacity: float = 0.8,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return a toroidal texture of drops and flakes together.

    Parameters and result are those of :func:`rain_tile` and :func:`snow_tile`.
    """
    texels = _size(size)
    wet, white = _count("drops", drops), _count("flakes", flakes)
    rows = _sprites(texels, wet + white, seed, 1.0 / texels, spread, opacity)
    # One list of numbers: those of the first are drops, the others flakes.
    sizes = rows[:, 2] * 2.0
    across = (
        real("width", width, above=0.0, high=1.0),
        real("flake_width", flake_width, above=0.0, high=1.0),
    )
    rows[:wet, 2], rows[wet:, 2] = (
        0.5 * texels * sizes[part] * wide
        for part, wide in zip((slice(None, wet), slice(wet, None)), across, strict=True)
    )
    rows[:wet, 3] = 0.5 * texels * sizes[:wet] * real("length", length, low=0.0, high=0.5)
    return _drawn(texels, rows, dtype, out)


def tile_of(
    picture: npt.ArrayLike,
    *,
    size: int | None = None,
    border: float = 0.1,
    invert: bool = False,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return a toroidal texture made of a picture.

    Parameters
    ----------
    picture : (h, w), (h, w, 3) or (h, w, 4)
        uint8, uint16 or float: brightness is opacity (multiplied by the alpha, where there is one).
        It is cut to a square in its middle.
    size : int, optional
        n; the picture's own if not given. Another size takes means of areas.
    border : float
        Share of the side, 0 to 0.5, over which opposite edges are faded into each other; 0 for a
        picture that is toroidal already.
    invert : bool
        Dark drops on a light ground.

    Returns
    -------
    (n, n) array
        Opacities, 0 to 1.
    """
    plane = _brightness(picture)
    if flag("invert", invert):
        plane = 1.0 - plane
    side = min(plane.shape)
    top, left = ((length - side) // 2 for length in plane.shape)
    plane = plane[top : top + side, left : left + side]
    texels = _size(side if size is None else size)
    kind = float_dtype(dtype)
    result = output(out, (texels, texels), kind)
    share = real("border", border, low=0.0, high=0.5)
    for axis in (0, 1):
        plane = _joined(plane, axis, share)
    for axis in (0, 1):
        plane = _resampled(plane, axis, texels)
    result[...] = plane
    return result


def _brightness(picture: npt.ArrayLike) -> Float64:
    array = rectangular("picture", picture)
    if array.ndim not in (2, 3):
        raise ValueError(f"picture must be (h, w), (h, w, 3) or (h, w, 4), got {array.shape}")
    scale = {"u1": 255.0, "u2": 65535.0}.get(array.dtype.str[1:], 1.0)
    values, _ = pixels_of("picture", array, ndim=array.ndim)
    values = np.asarray(values, np.float64) / scale
    whole = (values >= 0.0) & (values <= 1.0)
    require("picture", values, whole, "from 0 to 1 everywhere, or uint8, or uint16")
    if values.ndim == 2:
        return values
    if values.shape[2] not in (3, 4):
        raise ValueError(f"picture must be (h, w), (h, w, 3) or (h, w, 4), got {array.shape}")
    grey = values[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    return np.asarray(grey * values[..., 3] if values.shape[2] == 4 else grey)


def _joined(plane: Float64, axis: int, share: float) -> Float64:
    """Fade the last rows into what lies before the first ones, and drop as many."""
    lines = np.moveaxis(plane, axis, 0)
    wide = min(round(share * len(lines)), len(lines) // 2)
    if wide == 0:
        return plane
    keep = lines[: len(lines) - wide].copy()
    weight = smoothstep((np.arange(wide) + 0.5) / wide)[:, None]
    # Row -1 of the result is the one before the rows that were cut off: they lead into row 0.
    keep[:wide] = weight * keep[:wide] + (1.0 - weight) * lines[len(lines) - wide :]
    return np.ascontiguousarray(np.moveaxis(keep, 0, axis))


def _resampled(plane: Float64, axis: int, count: int) -> Float64:
    """Return means over equal parts of a toroidal side; or linear values, where it grows."""
    lines = np.moveaxis(plane, axis, 0)
    old = len(lines)
    if old == count:
        return plane
    width = max(old / count, 1.0)
    middle = (np.arange(count) + 0.5) * old / count
    sums = np.concatenate([np.zeros((1, lines.shape[1])), np.cumsum(lines, axis=0)])

    def integral(at: Float64) -> Float64:
        turns, rest = np.divmod(at, old)
        whole = np.minimum(rest.astype(np.int64), old - 1)
        part = (rest - whole)[:, None]
        return np.asarray(
            turns[:, None] * sums[-1] + sums[whole] + part * (sums[whole + 1] - sums[whole])
        )

    means = (integral(middle + 0.5 * width) - integral(middle - 0.5 * width)) / width
    return np.ascontiguousarray(np.moveaxis(np.clip(means, 0.0, 1.0), 0, axis))


def _size(size: int) -> int:
    return integer("size", size, low=4, high=LARGEST_TILE)


def _count(name: str, value: int) -> int:
    return integer(name, value, low=0, high=MOST_DROPS)


def _sprites(
    size: int, count: int, seed: int, width: float, spread: float, opacity: float
) -> Float64:
    """Return rows (u, v, sigma, half length, opacity) in texels."""
    chosen = seed_of(seed)
    draw = np.empty((4, count))
    for row, stream in zip(draw, (ACROSS, ALONG, SIZE, OPACITY), strict=True):
        _core.uniform(row, chosen, stream)
    differ = real("spread", spread, low=0.0, high=1.0)
    peak = real("opacity", opacity, low=0.0, high=1.0)
    rows = np.zeros((count, 5))
    rows[:, 0], rows[:, 1] = size * draw[0], size * draw[1]
    rows[:, 2] = 0.5 * size * real("width", width, above=0.0, high=1.0)
    rows[:, 2] *= 1.0 + differ * (draw[2] - 0.5)
    rows[:, 4] = peak * (1.0 - differ * draw[3] / 2.0)
    return rows


def _drawn(size: int, rows: Float64, dtype: npt.DTypeLike, out: Array | None) -> Array:
    result = output(out, (size, size), float_dtype(dtype))
    _core.cone_tile(result, aligned(rows, np.float64))
    return result

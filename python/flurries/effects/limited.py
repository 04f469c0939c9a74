"""The texture in front of a scene that ends: only the air before it has snow in it.

A wave of wavelength L stands for the depth near_depth * longest / L. Before a wall at depth Z only
the waves longer than near_depth * longest / Z are left, with the amplitudes that they have before
the sky (Langer 2004, section 8).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flurries._contract import Array, Float64
from flurries.frame.layer import Frame
from flurries.motion.keys import value_at
from flurries.spectral import opacity
from flurries.spectral.contrast import kept_power, mean_opacity
from flurries.spectral.tiles import tile_starts

if TYPE_CHECKING:
    from flurries.effects.falling import Falling

Map = tuple[float, float, float, float]


def deepened(effect: Falling, frame: Frame, mapped: Map) -> Array:
    """Return the texture's opacity over the window, as far as the scene's depth leaves it."""
    far, depth = effect.far_depth(frame.shape), frame.depth
    if depth is None or frame.once(effect, "nearest", lambda: float(depth.min())) >= far:
        return effect.drawn(frame, mapped)
    if effect.depth_mode == "tile":
        return _by_tile(effect, frame, mapped)
    return _by_pixel(effect, frame, mapped)


def share_of(depth: Array, near: float, far: float) -> Float64:
    """Return the share of the texture's power that lies before depths: equal for every octave."""
    with np.errstate(divide="ignore"):
        share = np.log(depth.astype(np.float64) / near) / math.log(far / near)
    return np.asarray(np.clip(share, 0.0, 1.0))


def _faded(share: Float64, mapped: Map, most: float | None = None) -> Float64:
    """Return the factor that brings the mean opacity down to the share that is left.

    Less variance alone would leave the even veil that the map's mean makes, even before a wall that
    no snow is in front of.
    """
    mean, spread, power, _ = mapped
    whole = mean_opacity(np.ones(1), mean, spread, power)[0]
    left = mean_opacity(share.ravel(), mean, spread, power, most=most).reshape(share.shape)
    factor = np.divide(share * whole, left, out=np.zeros_like(share), where=left > 0.0)
    return np.asarray(np.minimum(factor, 1.0))


def farthest(effect: Falling, frame: Frame) -> Array:
    """Return the farthest depth of each tile, (rows, cols)."""
    assert frame.depth is not None
    (height, width), (tile, overlap) = frame.shape, effect.tiles(frame)
    # The farthest of each run of columns first, so that a pixel is not read for every tile.
    cols = tile_starts(width, tile=tile, overlap=overlap)
    bands = np.stack([frame.depth[:, x : x + tile].max(axis=1) for x in cols], axis=1)
    rows = tile_starts(height, tile=tile, overlap=overlap)
    return np.stack([bands[y : y + tile].max(axis=0) for y in rows])


def _by_tile(effect: Falling, frame: Frame, mapped: Map) -> Array:
    """Limit the band of each tile by its farthest depth."""
    shortest, down, across = frame.once(effect, "limits", lambda: _limits(effect, frame, mapped))
    top, bottom, left, right = frame.window
    factor = frame.here(effect, "factor", lambda: _product(down[top:bottom], across[left:right]))
    alpha = effect.drawn(frame, mapped, shortest=shortest)
    alpha *= factor
    return alpha


# Numbers of a product that are held in float64.
_HELD = 1 << 16


def _product(down: Float64, across: Float64) -> Array:
    """Return ``down @ across.T`` as float32, (h, w), few rows of float64 at a time."""
    result = np.empty((len(down), len(across)), np.float32)
    rows = max(_HELD // len(across), 1)
    wide = np.empty((rows, len(across)))
    for first in range(0, len(down), rows):
        part = down[first : first + rows]
        result[first : first + rows] = np.matmul(part, across.T, out=wide[: len(part)])
    return result


def _limits(effect: Falling, frame: Frame, mapped: Map) -> tuple[Float64, Float64, Float64]:
    """Return each tile's shortest wave, px, and two whose product is each pixel's factor."""
    (height, width), ((tile, _), overlap) = frame.shape, effect.layout(frame)[0]
    near, far = effect.near_depth, effect.far_depth(frame.shape)
    rows = tile_starts(height, tile=tile, overlap=overlap)
    cols = tile_starts(width, tile=tile, overlap=overlap)
    ends = farthest(effect, frame)
    longest = effect.band(frame.shape)[1]
    shortest = near * longest / ends.astype(np.float64)
    faded = _faded(share_of(ends, near, far), mapped)
    down = weights(rows, height, tile, overlap)
    across = weights(cols, width, tile, overlap)
    return shortest, down @ faded, across


def weights(starts: Array, length: int, tile: int, overlap: int) -> Float64:
    """Return each tile's share of each pixel along one axis, (length, tiles); rows sum to 1."""
    place = np.arange(length)[:, None] - starts[None, :] + 0.5
    ramp = np.minimum(place, tile - place) / max(overlap, 1)
    if overlap == 0:
        ramp = np.where((place > 0.0) & (place < tile), 1.0, 0.0)
    share = np.sin(0.5 * np.pi * np.clip(ramp, 0.0, 1.0)) ** 2
    return np.asarray(share / share.sum(axis=1, keepdims=True))


def _by_pixel(effect: Falling, frame: Frame, mapped: Map) -> Array:
    """Weigh octaves of the texture by how much of their air is before the pixel."""
    assert frame.depth is not None
    near, far = effect.near_depth, effect.far_depth(frame.shape)
    depth = frame.crop(frame.depth)
    octaves = max(math.ceil(math.log2(far / near) - 1e-9), 1)
    edges = near * (far / near) ** (np.arange(octaves + 1) / octaves)
    longest = effect.band(frame.shape)[1]
    (tile, _), overlap = effect.layout(frame)[0]
    grid = tuple(len(tile_starts(n, tile=tile, overlap=overlap)) for n in frame.shape)
    total = np.zeros(depth.shape, np.float32)
    before = None

    def octave(number: int) -> Array:
        # The root of the share of an octave's power; the same for both eyes.
        limits = edges[number], edges[number + 1]
        return frame.here(
            effect,
            f"octave {number}",
            lambda: np.sqrt(share_of(depth, *limits)).astype(np.float32),
        )

    for number in range(octaves):
        # All waves that stand for depths up to the far edge of this octave.
        limit = 0.0 if number + 1 == octaves else near * longest / edges[number + 1]
        name, shortest = f"texture {number}", np.full(grid, limit)
        nearer = effect.drawn(frame, None, name=name, shortest=shortest)
        part = octave(number)
        total += part * (nearer if before is None else nearer - before)
        before = nearer
    share = share_of(depth, near, far)
    # Of the whole frame, so that a window has its bits.
    whole = frame.depth
    most = float(
        frame.once(effect, "most", lambda: share_of(whole.max(keepdims=True), near, far)).item()
    )
    mean, spread, power, amount = mapped
    alpha = opacity(total, mean=mean, spread=spread, power=power)
    if effect.preserves_mean:
        kept = kept_power(
            effect.cycles(frame), effect.alias, shutter=value_at(effect.shutter, frame.t)
        )
        lost = mean_opacity(share.ravel(), mean, spread, power, most=most) - mean_opacity(
            kept * share.ravel(), mean, spread, power, most=kept * most
        )
        alpha += lost.reshape(share.shape).astype(np.float32)
    alpha *= (amount * _faded(share, mapped, most)).astype(np.float32)
    return np.clip(alpha, 0.0, 1.0, out=alpha)


def veil(haze: float, depth: Array, far: float) -> Array:
    """Return the opacity of an even veil before depths: whole from the texture's far end on.

    Its optical depth grows with the way through it.
    """
    way = np.minimum(depth / np.float32(far), np.float32(1.0))
    return np.asarray(1.0 - (1.0 - haze) ** way, np.float32)

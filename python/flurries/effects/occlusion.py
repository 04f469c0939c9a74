"""The tent's texture in front of a scene that ends: only the air before it has snow in it.

A wave stands for a depth. Before a wall only the waves of nearer depths are left, with the
amplitudes that they have before the sky (Langer 2004, section 8). The mean opacity goes with the
share of the air: less variance alone would leave the even veil that the map's mean makes, even
before a wall that no snow is in front of.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.effects.field import Field, Map
from flurries.effects.motion import Way
from flurries.frame.view import Frame
from flurries.spectral.contrast import kept_power, mean_opacity
from flurries.spectral.tables import wave_depth
from flurries.spectral.tiles import power_shares

# Numbers of a product that are held in float64.
_HELD = 1 << 16


def before_scene(field: Field, frame: Frame, way: Way, mapped: Map, keep: bool, mode: str) -> Array:
    """Return the opacity of a field over the window, as far as the scene's depth leaves it.

    Parameters
    ----------
    mapped : Map
        From the field to opacity.
    keep : bool
        Whether the mean opacity that blur takes is added again.
    mode : {"tile", "pixel"}
        Whether the band ends with each tile's farthest depth, or with each pixel's.
    """
    depth = frame.depth
    assert depth is not None
    if frame.once(field, "nearest", lambda: float(depth.min())) >= field.far_depth:
        return field.pixels(frame, way, mapped, keep)
    if mode == "tile":
        return _by_tile(field, frame, way, mapped, keep)
    return _by_pixel(field, frame, way, mapped, keep)


def share_before(depth: Array, near: float, far: float) -> Float64:
    """Return the share of the texture's power that lies before depths: equal for every octave."""
    with np.errstate(divide="ignore"):
        share = np.log(depth.astype(np.float64) / near) / math.log(far / near)
    return np.asarray(np.clip(share, 0.0, 1.0))


def _fade(
    share: Float64, mapped: Map, *, power: Float64 | None = None, most: float | None = None
) -> Float64:
    """Return the factor that brings the mean opacity down to the share of the air that is left.

    Parameters
    ----------
    share : array
        Of the air before the scene.
    power : array of the same shape, optional
        Of the whole field there; 1 if not given.
    most : float, optional
        The largest share of all that are asked for in parts, which decides about the bits.
    """
    mean, spread, exponent, _ = mapped
    if power is None:
        whole = mean_opacity(np.ones(1), mean, spread, exponent)[0]
        left = mean_opacity(share.ravel(), mean, spread, exponent, most=most)
    else:
        whole = mean_opacity(power.ravel(), mean, spread, exponent, most=1.0).reshape(share.shape)
        left = mean_opacity((power * share).ravel(), mean, spread, exponent, most=1.0)
    left = left.reshape(share.shape)
    factor = np.divide(share * whole, left, out=np.zeros_like(share), where=left > 0.0)
    return np.asarray(np.minimum(factor, 1.0))


def _by_tile(field: Field, frame: Frame, way: Way, mapped: Map, keep: bool) -> Array:
    """Limit the band of each tile by its farthest depth."""
    assert frame.depth is not None
    layout, whole = field.layout(frame), frame.depth
    ends = frame.once(field, "ends", lambda: layout.farthest(whole).astype(np.float64))
    shortest = wave_depth(ends, near_depth=field.near_depth, longest=layout.band[1])
    alpha = field.pixels(frame, way, mapped, keep, shortest=shortest)
    alpha *= frame.here(field, "factor", lambda: _tile_factor(field, frame, mapped, ends))
    return alpha


def _tile_factor(field: Field, frame: Frame, mapped: Map, ends: Float64) -> Array:
    """Return the factor of the opacity at each pixel of the window, (h, w) float32."""
    share = share_before(ends, field.near_depth, field.far_depth)
    (down, tall), (across, wide) = _axes(field, frame)
    top, bottom, left, right = frame.window
    if field.blend == "power":
        return _product((down @ _fade(share, mapped))[top:bottom], across[left:right])
    mixed = _product((down @ share)[top:bottom], across[left:right]).astype(np.float64)
    power = np.outer(tall[top:bottom], wide[left:right])
    return _fade(mixed, mapped, power=power).astype(np.float32)


def _axes(field: Field, frame: Frame) -> tuple[tuple[Float64, Float64], tuple[Float64, Float64]]:
    """Return shares of the tiles and the field's power along the frame's rows and columns."""
    (tall, wide), overlap = field.layout(frame).tiling
    height, width = frame.shape
    return (
        power_shares(height, tile=tall, overlap=overlap, blend=field.blend),
        power_shares(width, tile=wide, overlap=overlap, blend=field.blend),
    )


def _product(down: Float64, across: Float64) -> Array:
    """Return ``down @ across.T`` as float32, (h, w), few rows of float64 at a time."""
    result = np.empty((len(down), len(across)), np.float32)
    rows = max(_HELD // len(across), 1)
    wide = np.empty((rows, len(across)))
    for first in range(0, len(down), rows):
        part = down[first : first + rows]
        result[first : first + rows] = np.matmul(part, across.T, out=wide[: len(part)])
    return result


def _by_pixel(field: Field, frame: Frame, way: Way, mapped: Map, keep: bool) -> Array:
    """Weigh octaves of the texture by how much of their air is before the pixel."""
    assert frame.depth is not None
    near, far = field.near_depth, field.far_depth
    whole, depth = frame.depth, frame.crop(frame.depth)
    octaves = max(math.ceil(math.log2(far / near) - 1e-9), 1)
    edges = near * (far / near) ** (np.arange(octaves + 1) / octaves)
    total, before = np.zeros(depth.shape, np.float32), None
    for number in range(octaves):
        nearer = _waves_before(field, frame, way, number, octaves, edges[number + 1])
        # The root of the share of an octave's power; the same for both eyes.
        root = partial(_root_share, depth, edges[number], edges[number + 1])
        part = frame.here(field, f"octave {number}", root)
        total += part * (nearer if before is None else nearer - before)
        before = nearer
    share = share_before(depth, near, far)
    # Of the whole frame, so that a window has its bits.
    most = frame.once(
        field, "most", lambda: share_before(whole.max(keepdims=True), near, far).item()
    )
    power = None
    if field.blend != "power":
        (_, tall), (_, wide) = _axes(field, frame)
        top, bottom, left, right = frame.window
        power = np.outer(tall[top:bottom], wide[left:right])
    alpha = np.empty_like(total)
    _core.opacity(alpha, total, (*mapped[:3], 1.0))
    if keep:
        alpha += _lost_mean(field, frame, way, share, mapped, power, most)
    alpha *= (mapped[3] * _fade(share, mapped, power=power, most=most)).astype(np.float32)
    return np.clip(alpha, 0.0, 1.0, out=alpha)


def _root_share(depth: Array, near: float, far: float) -> Array:
    return np.sqrt(share_before(depth, near, far)).astype(np.float32)


def _waves_before(
    field: Field, frame: Frame, way: Way, number: int, octaves: int, edge: float
) -> Array:
    """Return the field of all waves that stand for depths up to the far edge of an octave."""
    layout = field.layout(frame)
    shortest = np.zeros(layout.grid)
    if number + 1 < octaves:
        shortest[:] = wave_depth([edge], near_depth=field.near_depth, longest=layout.band[1])
    return field.pixels(frame, way, None, name=f"texture {number}", shortest=shortest)


def _lost_mean(
    field: Field,
    frame: Frame,
    way: Way,
    share: Float64,
    mapped: Map,
    power: Float64 | None,
    most: float,
) -> Array:
    """Return what alias law and shutter take of the mean opacity at each pixel."""
    kept = kept_power(field.cycles(frame, way), field.alias, shutter=way.shutter)
    there = share if power is None else share * power
    full, left = (
        mean_opacity(part * there.ravel(), *mapped[:3], most=part * most) for part in (1.0, kept)
    )
    return (full - left).reshape(share.shape).astype(np.float32)

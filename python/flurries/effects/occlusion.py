"""The tent's texture in front of a scene that ends: only the air before it has snow in it.

A wave stands for a depth. Before a wall only the waves of nearer depths are left, with the
amplitudes that they have before the sky (Langer 2004, section 8), and the map to opacity is the
wall's own (`flurries/effects/wall.py`): these waves keep their contrast, and the mean opacity goes
with the share of the air.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.effects.field import Field
from flurries.effects.motion import Way
from flurries.effects.wall import wall_maps
from flurries.frame.needs import standing
from flurries.frame.view import Frame
from flurries.spectral.contrast import kept_power, mean_opacity
from flurries.spectral.frame import Map
from flurries.spectral.tables import band_amplitude, wave_depth

# Pixels whose maps are made together, in float64.
_HELD = 1 << 14

# So few depths of tiles have entries of their own in the table of maps.
_FEW = 32


def before_scene(field: Field, frame: Frame, way: Way, mapped: Map, keep: bool, mode: str) -> Array:
    """Return the opacity of a field over the window, as far as the scene's depth leaves it."""
    depth = frame.depth
    assert depth is not None
    if frame.once_before(field, "nearest", lambda: float(depth.min())) >= field.far_depth:
        return field.pixels(frame, way, mapped, keep)
    waves, remap = (_by_tile if mode == "tile" else _by_pixel)(field, frame, way, mapped)
    layout = field.layout(frame)
    # The values that the map of a depth is made of, besides the depth.
    key = mapped, _cycles(field, frame, way), way.shutter, layout.tiling, layout.band
    scale, base, lost = standing(frame, field, "map", key, remap)
    waves *= scale
    waves += base
    alpha = np.empty_like(waves)
    _core.opacity(alpha, waves, (0.0, 0.5, mapped[2], 1.0))
    if keep:
        # As much as there is air.
        alpha += lost
    alpha *= np.float32(mapped[3])
    return np.clip(alpha, 0.0, mapped[3], out=alpha)


def share_before(depth: Array, near: float, far: float) -> Float64:
    """Return the share of the texture's power that lies before depths: equal for every octave."""
    with np.errstate(divide="ignore"):
        share = np.log(depth.astype(np.float64) / near) / math.log(far / near)
    return np.asarray(np.clip(share, 0.0, 1.0))


def _by_tile(field: Field, frame: Frame, way: Way, mapped: Map) -> tuple[Array, Callable[[], Any]]:
    """Limit the band of each tile by its farthest depth."""
    assert frame.depth is not None
    layout, whole = field.layout(frame), frame.depth
    near, far, longest = field.near_depth, field.far_depth, layout.band[1]
    ends = frame.once_before(field, "ends", lambda: layout.farthest(whole).astype(np.float64))
    shortest = wave_depth(ends, near_depth=near, longest=longest)

    def left(share: Float64) -> Float64:
        depth = near * (far / near) ** share
        return _power_longer(field, frame, wave_depth(depth, near_depth=near, longest=longest))

    def remap() -> tuple[Array, Array, Array]:
        (down, _), (across, _) = field.shares(frame)
        top, bottom, first, last = frame.window
        air, across = share_before(ends, near, far), across[first:last].T
        parts = [(down @ part)[top:bottom] for part in (air, _power_longer(field, frame, shortest))]

        def there(rows: slice) -> tuple[Float64, Float64]:
            shares, power = (part[rows] @ across for part in parts)
            return shares, power

        some = np.unique(air)
        exact = tuple(some) if len(some) <= _FEW else ()
        return _remap(field, frame, way, mapped, there, exact, left)

    return field.pixels(frame, way, None, shortest=shortest), remap


def _by_pixel(field: Field, frame: Frame, way: Way, mapped: Map) -> tuple[Array, Callable[[], Any]]:
    """Weigh octaves of the texture by how much of their air is before the pixel."""
    assert frame.depth is not None
    near, far, layout = field.near_depth, field.far_depth, field.layout(frame)
    depth, longest = frame.crop(frame.depth), layout.band[1]
    octaves = max(math.ceil(math.log2(far / near) - 1e-9), 1)
    edges = near * (far / near) ** (np.arange(octaves + 1) / octaves)
    ends = np.append(wave_depth(edges[1:-1], near_depth=near, longest=longest), 0.0)
    total, before = np.zeros(depth.shape, np.float32), np.float32(0.0)
    for number, (start, end) in enumerate(pairwise(edges.tolist())):
        # The field of all waves that stand for depths up to the octave's end.
        nearer = field.pixels(frame, way, None, shortest=np.full(layout.grid, ends[number]))
        # The root of the share of an octave's power; the same for both eyes.
        root = partial(_root_share, depth, start, end)
        total += standing(frame, field, f"octave {number}", octaves, root) * (nearer - before)
        before = nearer
    first = wave_depth(edges[:1], near_depth=near, longest=longest)
    steps = np.diff(_power_longer(field, frame, np.append(first, ends)))

    def left(share: Float64) -> Float64:
        parts = np.clip(share[..., None] * octaves - np.arange(octaves), 0.0, 1.0)
        return np.asarray(parts @ steps)

    def there(rows: slice) -> tuple[Float64, Float64]:
        air = share_before(depth[rows], near, far)
        return air, left(air)

    return total, partial(_remap, field, frame, way, mapped, there, (), left)


def _root_share(depth: Array, near: float, far: float) -> Array:
    return np.sqrt(share_before(depth, near, far)).astype(np.float32)


def _cycles(field: Field, frame: Frame, way: Way) -> float:
    """Return the rate of the longest wave; rounding of a frame's time makes no other map."""
    return round(field.cycles(frame, way), 9)


def _remap(
    field: Field, frame: Frame, way: Way, mapped: Map,
    there: Callable[[slice], tuple[Float64, Float64]], exact: tuple[float, ...],
    left: Callable[[Float64], Float64],
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Return what makes opacity of waves, and what blur takes of its mean, (h, w) each."""
    mean, spread, exponent, _ = mapped
    top, bottom, first, last = frame.window
    (_, tall), (_, wide) = field.shares(frame)
    seams = field.blend != "power"
    least = float(tall.min() * wide.min()) if seams else 1.0
    kept = kept_power(_cycles(field, frame, way), field.alias, shutter=way.shutter)
    deviation = max(0.5 / spread * math.sqrt(kept), 1e-6)
    maps = wall_maps((mean, deviation, exponent), least, exact, left)
    full, blurred = (
        mean_opacity(part * maps.roots**2, mean, spread, exponent) for part in (1.0, kept)
    )
    scales, base, lost = np.empty((3, bottom - top, last - first), np.float32)
    step = max(_HELD // (last - first), 1)
    for start in range(0, bottom - top, step):
        rows = slice(start, min(start + step, bottom - top))
        air, power = there(rows)
        root = np.sqrt(np.outer(tall[top:bottom][rows], wide[first:last])) if seams else None
        base[rows], scale = maps.at(air, root)
        scale *= 0.5 / spread
        some = power > 0.0
        scales[rows] = np.divide(scale, np.sqrt(power), out=np.zeros(air.shape), where=some)
        gone = full - blurred
        lost[rows] = air * (gone if root is None else np.interp(root, maps.roots, gone))
    return scales, base, lost


def _power_longer(field: Field, frame: Frame, shortest: Float64) -> Float64:
    """Return the power of the waves of a tile that are longer than some, against all of them."""
    layout = field.layout(frame)
    squares, power = _lattice(layout.tiling.tile, layout.band, field.exponent)
    # As the kernel decides: a wave as long as the limit is left out.
    with np.errstate(divide="ignore"):
        return power[np.searchsorted(squares, 1.0 / np.asarray(shortest) ** 2, side="left")]


@kept(32)
def _lattice(
    tile: tuple[int, int], band: tuple[float, float], exponent: float
) -> tuple[Float64, Float64]:
    """Return squares of frequencies of a tile's waves, and the power of all before each one."""
    power = band_amplitude(tile, wavelengths=band, exponent=exponent) ** 2
    fy, fx = (np.fft.fftfreq(length) for length in tile)
    squares = fy[:, None] ** 2 + fx**2
    order = np.argsort(squares, axis=None, kind="stable")
    total = np.concatenate([[0.0], np.cumsum(power.ravel()[order])])
    return squares.ravel()[order], np.minimum(total / total[-1], 1.0)

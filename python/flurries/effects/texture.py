"""The tent's texture of all that is far: its opacity at the picture's size, before a scene."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries._warnings import warn
from flurries.effects.field import Field
from flurries.effects.maps import map_at, power_share, wall_maps
from flurries.effects.motion import Way
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at
from flurries.spectral.frame import Map
from flurries.spectral.tables import band_amplitude, kept_power, wave_depth
from flurries.spectral.tiles import mean_opacity


@dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """A field of waves as opacity; the other fields are those of `TentSnow` and `TentRain`."""

    field: Field  # The waves.
    opacity: Number  # The largest, 0 to 1.
    mean: Number
    spread: Number
    power: Number
    depth_mode: str
    renormalise: bool = False  # Whether the waves that are left get the contrast that all had.

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none, and the tiles of which nothing is seen."""
        opacity = amount * value_at(self.opacity, frame.t)
        if opacity == 0.0:
            return Needs.none("texture", "its opacity is 0")
        still = frame.settled and self.field.motion.still and not has_keys(self)
        visible, out = frame.visible, []
        if visible is not None:
            hidden = int((~visible.tiles(*self.field.layout(frame).tiling)).sum())
            if hidden:
                out = [LeftOut(f"{hidden} tiles", "they are behind what stands in front")]
        return Needs((Step("texture", once=still),), tuple(out), most=opacity)

    def map(self, frame: Frame, amount: float, way: Way) -> Map:
        """Return mean, spread, power and amount of the map to opacity at the picture's size."""
        t, field = frame.t, self.field
        most, power = amount * value_at(self.opacity, t), value_at(self.power, t)
        mean, spread = value_at(self.mean, t), value_at(self.spread, t)
        if field.wavelengths is None:
            share = power_share(field.tuned, field.exponent, frame.shape[1])
            mean, spread = map_at(mean, spread, power, share)
        if self.renormalise:
            kept = kept_power(field.cycles(frame, way), field.alias)
            spread = max(spread * math.sqrt(kept), 1e-3)
        return mean, spread, power, most

    def alpha(self, frame: Frame, amount: float) -> Array:
        way = self.field.motion.way(frame)
        # What blur takes of the mean is added again; renormalised, it has lost nothing.
        mapped, keep = self.map(frame, amount, way), not self.renormalise
        if frame.depth is None:
            return self.field.pixels(frame, way, mapped, keep)
        return before_scene(self.field, frame, way, mapped, keep, self.depth_mode)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        return self.field.passes(frame, others)

    def warn_ambiguous(
        self, shape: tuple[int, int], focal: float, distance: float, index: int
    ) -> None:
        """Warn if two eyes see the longest wave, and so every wave, half a cycle apart or more."""
        cycles = focal * distance / (self.field.near_depth * self.field.band(shape)[1])
        if cycles < 0.5 or self.opacity == 0.0:
            return
        warn(
            f"effects[{index}]: eyes {distance:g} apart see its texture {cycles:.2g} cycles apart, "
            f"which is ambiguous from 0.5 on; take near_depth above "
            f"{2.0 * cycles * self.field.near_depth:.3g}, or longer waves, or eyes closer together"
        )


_HELD = 1 << 14  # Pixels whose maps are made together, in float64.
_FEW = 32  # So few depths of tiles have entries of their own in the table of maps.


def before_scene(field: Field, frame: Frame, way: Way, mapped: Map, keep: bool, mode: str) -> Array:
    """Return the opacity of a field over the window, as far as the scene's depth leaves it."""
    depth = frame.depth
    assert depth is not None
    nearest = frame.once(field, "nearest", lambda: float(depth.min()), depth=True)
    if nearest >= field.far_depth:
        return field.pixels(frame, way, mapped, keep)
    waves, remap = (_by_tile if mode == "tile" else _by_pixel)(field, frame, way, mapped)
    layout = field.layout(frame)
    # What the map of a depth is made of, besides that; rounding of a time makes no other map.
    key = mapped, round(field.cycles(frame, way), 9), way.shutter, layout.tiling, layout.band
    scale, base, lost = frame.standing(field, key, remap)
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
    ends = frame.once(field, "ends", lambda: layout.farthest(whole).astype(np.float64), depth=True)
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
            return parts[0][rows] @ across, parts[1][rows] @ across

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
        def root(near: float = start, far: float = end) -> Array:
            return np.sqrt(share_before(depth, near, far)).astype(np.float32)

        total += frame.standing(field, (number, octaves), root) * (nearer - before)
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
    kept = kept_power(round(field.cycles(frame, way), 9), field.alias, shutter=way.shutter)
    deviation = max(0.5 / spread * math.sqrt(kept), 1e-6)
    maps = wall_maps((mean, deviation, exponent), least, exact, left)
    squares = maps.roots**2
    gone = mean_opacity(squares, mean, spread, exponent)
    gone = gone - mean_opacity(kept * squares, mean, spread, exponent)
    scales, base, lost = np.empty((3, bottom - top, last - first), np.float32)
    step = max(_HELD // (last - first), 1)
    for start in range(0, bottom - top, step):
        rows = slice(start, min(start + step, bottom - top))
        air, power = there(rows)
        root = np.sqrt(np.outer(tall[top:bottom][rows], wide[first:last])) if seams else None
        base[rows], scale = maps.at(air, root)
        scale *= 0.5 / spread
        scales[rows] = np.divide(scale, np.sqrt(power), out=np.zeros(air.shape), where=power > 0.0)
        lost[rows] = air * (gone if root is None else np.interp(root, maps.roots, gone))
    return scales, base, lost


def _power_longer(field: Field, frame: Frame, shortest: Float64) -> Float64:
    """Return the power of the waves of a tile that are longer than some, against all of them."""
    layout = field.layout(frame)
    squares, power = _lattice(layout.tiling[0], layout.band, field.exponent)
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

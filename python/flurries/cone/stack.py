"""Four layers of a cone at once, and the chart of their rays, kept while camera and axis stand."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    _came,
    aligned,
    flag,
    float_dtype,
    integer,
    is_pair,
    output,
    real,
    shape_of,
    table,
)
from flurries._contract import pixels as pixels_of
from flurries.camera.lens import Camera
from flurries.cone.sheet import MOST_REPEATS, layer, pose, reach_of, wrapped
from flurries.cone.tiles import Table, Texture

__all__ = ["Mapping", "layers"]

BLOCK = 16

# The first layer nearest, each of the others half as large and twice as far.
MULTIPLES = (1, 2, 4, 8)

# Tiles by which the layers are set apart: no two of them repeat at one place.
OFFSETS = ((0.0, 0.0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.83))

# Azimuth, height, fade, what the blocks are, footprints: see src/cone/chart.rs.
Chart: TypeAlias = tuple[Array, Array, Array, Array, Array]

# Multiple, offsets as words, gain, log2 of the texels in a tile.
Sheet: TypeAlias = tuple[int, int, int, float, float]


class Mapping:
    """The point of the textures that every pixel sees: the part of a frame that does not scroll.

    While its arguments stay the same one mapping serves all frames. :func:`layers` does without
    where none is given, with the same result to the last bit.

    Parameters
    ----------
    shape, camera, axis, stretch, slope, repeats, radius
        See :func:`layer`; the first layer's.
    rows : (start, stop), optional
        Only these rows of the picture, with the bits of the whole.
    depth : (H, W) array, optional
        Planar depth of what stands in the picture, world units, before layers of a `radius`.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        camera: Camera,
        *,
        axis: npt.ArrayLike,
        stretch: float = 1.0,
        slope: float = 0.0,
        repeats: int = 4,
        radius: float = math.inf,
        rows: tuple[int, int] | None = None,
        depth: npt.ArrayLike | None = None,
    ) -> None:
        self.shape = shape_of("shape", shape)
        self.stretch = real("stretch", stretch, low=1e-6, high=1e6)
        self.repeats = integer("repeats", repeats, low=1, high=MOST_REPEATS)
        radius = reach_of(radius)
        self.rows = _rows_of(rows, (0, self.shape[0]))
        # Blocks lie where they lie in the whole picture.
        self._top = self.rows[0] - self.rows[0] % BLOCK
        self._course = self.repeats, self.stretch, self._top
        self._poses = [
            pose(self.shape, camera, axis, slope, radius * factor) for factor in MULTIPLES
        ]
        # From the middle all layers are seen alike.
        self._together = self._poses[0][-1] == (0.0, 0.0, 0.0)
        self._shown: Array | None = None
        if depth is not None:
            self._shown = self._before(depth, real("radius", radius, above=0.0))

    @cached_property
    def _charts(self) -> list[Chart]:
        """One for all layers, or one for each."""
        height, blocks = self.rows[1] - self._top, -(-self.shape[1] // BLOCK)
        wide, charts = (height, blocks * BLOCK), []
        for number, given in enumerate(self._poses[: 1 if self._together else None]):
            across, along = np.empty(wide, np.uint32), np.empty(wide, np.uint32)
            fade, state = np.empty(wide, np.float32), np.empty((height, blocks), np.uint8)
            _core.cone_chart(across, along, fade, state, given, self._course)
            charts.append((across, along, fade, state, self._footprints(number)))
        return charts

    def _footprints(self, number: int = 0) -> Array:
        """Return log2 of a pixel's footprint in tiles for blocks of the picture, (.., .., 2)."""
        height = self.rows[1] - self._top
        steps = np.empty((-(-height // BLOCK), -(-self.shape[1] // BLOCK), 2), np.float32)
        _core.cone_footprints(steps, self._poses[number], self._course)
        return steps

    def _before(self, depth: npt.ArrayLike, radius: float) -> Array:
        """Return the number of layers, nearest first, that stand before the depth map."""
        map_, _ = pixels_of("depth", depth, ndim=2)
        if map_.shape != self.shape:
            raise ValueError(f"depth must have shape {self.shape}, got {map_.shape}")
        part = aligned(map_[self._top : self.rows[1]], np.float32)
        counts = np.zeros((len(part), -(-self.shape[1] // BLOCK) * BLOCK), np.uint8)
        radii = [radius * factor for factor in MULTIPLES]
        _core.cone_shown(counts, part, self._poses[0], radii, self._top)
        return counts

    def _drawn(self, whole: Array, top: int, sheets: list[Sheet], texture: Texture) -> None:
        """Draw rows from the first of a block on."""
        lines = slice(top - self._top, top - self._top + len(whole))
        blocks = slice(lines.start // BLOCK, -(-lines.stop // BLOCK))
        parts = [sheets] if self._together else [[sheet] for sheet in sheets]
        clear: Array | None = None
        for index, (planes, drawn) in enumerate(zip(self._charts, parts, strict=True)):
            across, along, fade, state = (plane[lines] for plane in planes[:4])
            shown = None if self._shown is None else self._shown[lines]
            if shown is not None and not self._together:
                shown = (shown > index).astype(np.uint8)
            chart, steps = (across, along, fade, state, shown), planes[4][blocks]
            tables = _tables(texture, steps, drawn)
            _core.cone_stack(whole, chart, None, steps, drawn, texture._levels, tables)
            if not self._together:
                clear = 1.0 - whole if clear is None else clear * (1.0 - whole)
        if clear is not None:
            np.subtract(1.0, clear, out=whole)


def layers(
    shape: tuple[int, int],
    camera: Camera,
    tile: npt.ArrayLike | Texture,
    *,
    axis: npt.ArrayLike,
    phase: float,
    stretch: float = 1.0,
    slope: float = 0.0,
    repeats: int = 4,
    gains: npt.ArrayLike = 1.0,
    conserve: bool = True,
    radius: float = math.inf,
    mapping: Mapping | None = None,
    rows: tuple[int, int] | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return the joint alpha of four layers of one texture, each smaller and farther away.

    They repeat 1, 2, 4 and 8 times `repeats` times around, and stand for cones as many times as
    large: each shows smaller drops that move slower. All share axis and phase.

    Parameters
    ----------
    shape, camera, axis, phase, stretch, slope, repeats, conserve, radius, dtype, out
        See :func:`layer`.
    tile : Texture or (n, n)
        Give a :class:`Texture` for many frames: from an array a new one is made at each call.
    gains : float or (4,)
        Factors of the opacity, 0 or more.
    mapping : Mapping, optional
        One of the same arguments; its own `rows` and `depth` count.
    rows : (start, stop), optional
        Only these rows of the picture, or of the mapping.

    Returns
    -------
    (H, W) array
        ``1 - prod(1 - alpha_i)``, 0 to 1; of the wanted rows only.

    Notes
    -----
    float32 looks into tables of 8 bits, filtered beforehand. float64 is the composition of
    :func:`layer` (a mapping's `depth` is not used). The two differ by less than 0.011 in the mean.

    Examples
    --------
    >>> import flurries as fl
    >>> rain = fl.cone.Texture(fl.cone.rain_tile(128, seed=1))
    >>> view = fl.Camera(focal=150.0)
    >>> still = fl.cone.Mapping((90, 120), view, axis=(0, 1, 0))
    >>> alpha = fl.cone.layers((90, 120), view, rain, axis=(0, 1, 0), phase=0.1, mapping=still)
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    chart = mapping
    if chart is None:
        chart = Mapping(
            size, camera, axis=axis, stretch=stretch, slope=slope, repeats=repeats, radius=radius,
            rows=rows,
        )  # fmt: skip
    elif not isinstance(chart, Mapping):
        raise TypeError(f"mapping must be a Mapping, got {type(mapping).__name__}")
    elif chart.shape != size:
        raise ValueError(f"mapping must be of shape {size}, got {chart.shape}")
    start, stop = _rows_of(rows, chart.rows)
    strengths = table("gains", gains, ndim=None)
    if strengths.shape not in ((1,), (4,)) or not (strengths >= 0.0).all():
        raise ValueError("gains must be one number or 4, none negative")
    each = list(zip(MULTIPLES, OFFSETS, np.broadcast_to(strengths, 4).tolist(), strict=True))
    shared = flag("conserve", conserve)
    moved = wrapped(real("phase", phase))
    if kind == np.float64:
        exact = tile.tile if isinstance(tile, Texture) else tile
        rest = np.ones(size)
        for factor, place, strength in each:
            rest *= 1.0 - layer(
                size, camera, exact, axis=axis, phase=moved, stretch=chart.stretch, slope=slope,
                repeats=chart.repeats * factor, offset=place, gain=strength, conserve=shared,
                radius=radius * factor, dtype=kind,
            )  # fmt: skip
        result = output(out, (stop - start, size[1]), kind)
        return np.subtract(1.0, rest[start:stop], out=result)
    texture = tile if isinstance(tile, Texture) else Texture(tile)
    result = output(out, (stop - start, size[1]), kind)
    top = start - start % BLOCK
    whole = result if top == start else np.empty((stop - top, size[1]), np.float32)
    full, texels = texture._peak / (chart.stretch if shared else 1.0), math.log2(len(texture.tile))
    sheets = [
        (factor, _word(x), _word(y - moved), full * strength, texels)
        for factor, (x, y), strength in each
    ]
    if mapping is None and chart._together:
        steps, view = chart._footprints(), (chart._poses[0], chart._course)
        tables = _tables(texture, steps, sheets)
        _core.cone_stack(whole, None, view, steps, sheets, texture._levels, tables)
    else:
        chart._drawn(whole, top, sheets, texture)
    if whole is not result:
        # The rows above, of a block that was begun, are of no use to anybody.
        result[...] = whole[start - top :]
    return result


def _rows_of(rows: Any, there: tuple[int, int]) -> tuple[int, int]:
    """Return the rows that are asked for, of those that are there."""
    if rows is None:
        return there
    if not is_pair(rows):
        raise TypeError(f"rows must be (start, stop), got {_came(rows)}")
    start = integer("rows[0]", rows[0], low=there[0], high=there[1] - 1)
    return start, integer("rows[1]", rows[1], low=start + 1, high=there[1])


def _word(tiles: float) -> int:
    """Return a place in tiles as a fraction of 32 bits."""
    return round(wrapped(tiles) * 2**32) % 2**32


def _tables(
    texture: Texture, footprints: Array, sheets: list[Sheet]
) -> list[tuple[int, int, Table]]:
    """Return the tables that these layers look into, with their levels."""
    needed = np.zeros((texture._levels,) * 2, np.uint8)
    _core.cone_needed(needed, footprints, sheets)
    return [
        (across, along, texture._table(across, along))
        for across, along in np.argwhere(needed).tolist()
    ]

"""Four layers of a cone at once; the chart of their rays is kept while camera and axis stand."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import Array, ArrayLike
from flurries._kept import kept
from flurries.camera.lens import Camera, expect_camera
from flurries.cone.sheet import MOST_REPEATS, Pose, Table, Texture, layer, pose, reach_of, wrapped

BLOCK = 16

# A chart is three words a pixel: of larger pictures only the rows that are asked for have one.
LARGEST_CHART = 1 << 22

# The first layer nearest, each of the others half as large and twice as far.
MULTIPLES = (1, 2, 4, 8)

# Tiles by which the layers are set apart: no two of them repeat at one place.
OFFSETS = ((0.0, 0.0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.83))

# Azimuth, height, fade, what the blocks are, footprints: see src/cone/chart.rs.
Chart: TypeAlias = tuple[Array, Array, Array, Array, Array]

Course: TypeAlias = tuple[int, float, int]  # Tiles around, stretch, the first row.

# Multiple, offsets as words, gain, log2 of the texels in a tile.
Sheet: TypeAlias = tuple[int, int, int, float, float]


def layers(
    shape: tuple[int, int], camera: Camera, tile: ArrayLike | Texture, *, axis: ArrayLike,
    phase: float, stretch: float = 1.0, slope: float = 0.0, repeats: int = 4,
    gains: ArrayLike = 1.0, conserve: bool = True, radius: float = math.inf,
    depth: ArrayLike | None = None, rows: tuple[int, int] | None = None,
    dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return the joint alpha of four layers of one texture, each smaller and farther away.

    They repeat 1, 2, 4 and 8 times `repeats` times around, and stand for cones as many times as
    large: each shows smaller drops that move slower. It is ``1 - prod(1 - alpha_i)``, (H, W), 0 to
    1: in float32 by tables of 8 bits, filtered beforehand, in float64 the composition of
    :func:`layer`, which differ by less than 0.011 in the mean. Other arguments are those of
    :func:`layer`; while all but the phase stays the same, the rays are looked up.

    Parameters
    ----------
    tile : Texture or (n, n)
        Give a :class:`Texture` for many frames: from an array a new one is made at each call.
    gains : float or (4,)
        Factors of the opacity, 0 or more.
    depth : (H, W), optional
        Planar depth of what stands in the picture, world units, before layers of a `radius`.
    rows : (start, stop), optional
        Only these rows of the picture, with the bits of the whole.
    """
    size = check.shape_of("shape", shape)
    kind = check.float_dtype(dtype)
    eye, way = expect_camera(camera), tuple(check.vector("axis", axis, 3).tolist())
    moved = wrapped(check.real("phase", phase))
    length = check.real("stretch", stretch, low=1e-6, high=1e6)
    around = check.integer("repeats", repeats, low=1, high=MOST_REPEATS)
    lean, reach = check.real("slope", slope, low=0.0, high=1e6), reach_of(radius)
    strengths = check.table("gains", gains, ndim=None)
    if strengths.shape not in ((1,), (4,)) or not (strengths >= 0.0).all():
        raise ValueError("gains must be one number or 4, none negative")
    each = list(zip(MULTIPLES, OFFSETS, np.broadcast_to(strengths, 4).tolist(), strict=True))
    shared = check.flag("conserve", conserve)
    rows = (0, size[0]) if rows is None else rows
    if not check.is_pair(rows):
        raise TypeError(f"rows must be (start, stop), got {check._came(rows)}")
    start = check.integer("rows[0]", rows[0], low=0, high=size[0] - 1)
    stop = check.integer("rows[1]", rows[1], low=start + 1, high=size[0])
    # Blocks lie where they lie in the whole picture.
    top = start - start % BLOCK
    apart = depth is not None or size[0] * size[1] > LARGEST_CHART
    course = around, length, top if apart else 0
    view = _view(size, eye, way, lean, reach, course, stop if apart else size[0])
    shown = None if depth is None else _before(depth, size, view, check.real("radius", reach))
    if kind == np.float64:
        exact = tile.tile if isinstance(tile, Texture) else tile
        rest = np.ones((stop - start, size[1]))
        for index, (factor, place, strength) in enumerate(each):
            alpha = layer(
                size, eye, exact, axis=way, phase=moved, stretch=length, slope=lean,
                repeats=around * factor, offset=place, gain=strength, conserve=shared,
                radius=reach * factor, dtype=kind,
            )[start:stop]  # fmt: skip
            if shown is not None:
                alpha *= shown[start - top :, : size[1]] > index
            rest *= 1.0 - alpha
        return np.subtract(1.0, rest, out=check.output(out, rest.shape, kind))
    texture = tile if isinstance(tile, Texture) else Texture(tile)
    result = check.output(out, (stop - start, size[1]), kind)
    whole = result if top == start else np.empty((stop - top, size[1]), np.float32)
    full, texels = texture._peak / (length if shared else 1.0), math.log2(len(texture.tile))
    sheets = [
        (factor, _word(x), _word(y - moved), full * strength, texels)
        for factor, (x, y), strength in each
    ]
    if view.first(moved) and view.together and shown is None:
        given = view.poses[0], (around, length, top)
        steps = _footprints(*given, whole.shape)
        tables = _tables(texture, steps, sheets)
        _core.cone_stack(whole, None, given, steps, sheets, texture._levels, tables)
    else:
        view.draw(whole, top, sheets, texture, shown)
    if whole is not result:
        # The rows above, of a block that was begun, are of no use to anybody.
        result[...] = whole[start - top :]
    return result


class _View:
    """Rows of a picture of a cone, and the chart of their rays: what does not scroll."""

    def __init__(self, poses: list[Pose], course: Course, shape: tuple[int, int]) -> None:
        self.poses, self.course, self.shape = poses, course, shape
        # From the middle all layers are seen alike.
        self.together = poses[0][-1] == (0.0, 0.0, 0.0)
        self._phase: float | None = None

    def first(self, phase: float) -> bool:
        """Whether no other moment was asked for: a camera that moves has no use for a chart."""
        if self._phase is None:
            self._phase = phase
        return self._phase == phase

    @cached_property
    def _charts(self) -> list[Chart]:
        blocks, charts = -(-self.shape[1] // BLOCK), []
        wide = self.shape[0], blocks * BLOCK
        for given in self.poses[: 1 if self.together else None]:
            across, along = np.empty(wide, np.uint32), np.empty(wide, np.uint32)
            fade, state = np.empty(wide, np.float32), np.empty((wide[0], blocks), np.uint8)
            _core.cone_chart(across, along, fade, state, given, self.course)
            steps = _footprints(given, self.course, self.shape)
            charts.append((across, along, fade, state, steps))
        return charts

    def draw(
        self, whole: Array, top: int, sheets: list[Sheet], texture: Texture, shown: Array | None
    ) -> None:
        """Draw rows from the first of a block on; `shown` layers stand before the picture."""
        first = top - self.course[2]
        lines = slice(first, first + len(whole))
        blocks = slice(first // BLOCK, -(-lines.stop // BLOCK))
        parts = [sheets] if self.together else [[sheet] for sheet in sheets]
        clear: Array | None = None
        for index, (planes, drawn) in enumerate(zip(self._charts, parts, strict=True)):
            across, along, fade, state = (plane[lines] for plane in planes[:4])
            before = shown
            if shown is not None and not self.together:
                before = (shown > index).astype(np.uint8)
            chart, steps = (across, along, fade, state, before), planes[4][blocks]
            tables = _tables(texture, steps, drawn)
            _core.cone_stack(whole, chart, None, steps, drawn, texture._levels, tables)
            if not self.together:
                clear = 1.0 - whole if clear is None else clear * (1.0 - whole)
        if clear is not None:
            np.subtract(1.0, clear, out=whole)


@kept(4, by_mode=True)
def _view(
    size: tuple[int, int], camera: Camera, axis: tuple[float, ...], slope: float, radius: float,
    course: Course, stop: int,
) -> _View:  # fmt: skip
    poses = [pose(size, camera, axis, slope, radius * factor) for factor in MULTIPLES]
    return _View(poses, course, (stop - course[2], size[1]))


def _before(depth: ArrayLike, size: tuple[int, int], view: _View, radius: float) -> Array:
    """Return the number of layers, nearest first, before a depth map, of a view's rows."""
    top, height = view.course[2], view.shape[0]
    part = check.aligned(check.plane_of("depth", depth, size)[top : top + height], np.float32)
    counts = np.zeros((height, -(-size[1] // BLOCK) * BLOCK), np.uint8)
    radii = [radius * factor for factor in MULTIPLES]
    _core.cone_shown(counts, part, view.poses[0], radii, top)
    return counts


def _footprints(given: Pose, course: Course, shape: tuple[int, ...]) -> Array:
    """Return log2 of a pixel's footprint in tiles for blocks of a picture, (.., .., 2)."""
    steps = np.empty((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK), 2), np.float32)
    _core.cone_footprints(steps, given, course)
    return steps


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

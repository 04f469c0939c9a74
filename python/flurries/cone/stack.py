"""Several layers of a cone at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    flag,
    float_dtype,
    integer,
    output,
    real,
    shape_of,
    table,
)
from flurries.camera.lens import Camera
from flurries.cone.mapping import (
    BLOCK,
    MULTIPLES,
    Mapping,
    footprints_of,
    multiples_of,
    two_of,
)
from flurries.cone.rays import pose
from flurries.cone.sheet import MOST_REPEATS, layer, wrapped
from flurries.cone.texture import Table, Texture

__all__ = ["layers"]

# Tiles by which the layers are set apart: no two of them repeat at one place.
OFFSETS = ((0.0, 0.0), (0.37, 0.61), (0.71, 0.23), (0.13, 0.83))

# Multiple, offsets as words, gain, log2 of the texels in a tile.
Sheet: TypeAlias = tuple[int, int, int, float, float]


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
    multiples: Sequence[int] = MULTIPLES,
    offsets: npt.ArrayLike | None = None,
    gains: npt.ArrayLike = 1.0,
    conserve: bool = True,
    radius: float = math.inf,
    mapping: Mapping | None = None,
    rows: tuple[int, int] | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Return the joint alpha of several layers of one texture, each smaller and farther away.

    Layer i repeats ``repeats * multiples[i]`` times around and stands for a cone ``multiples[i]``
    times as large: it shows smaller drops that move slower. All share axis and phase.

    Parameters
    ----------
    shape, camera, axis, phase, stretch, slope, repeats, conserve, radius, dtype, out
        See :func:`flurries.cone.layer`.
    tile : Texture or (n, n)
        Give a :class:`Texture` for many frames: from an array a new one is made at each call.
    multiples : sequence of int
        One for each layer, increasing.
    offsets : (layers, 2), optional
        Tiles. Four that hide the repetition if not given.
    gains : float or (layers,)
        Factors of the opacity, 0 or more.
    mapping : Mapping, optional
        A mapping of the same shape, camera and axis, to be used again while these stay the same.
        Its own `rows` and `depth` count.
    rows : (start, stop), optional
        Only these rows of the picture, or of the mapping; they have the same bits as in the whole
        picture.

    Returns
    -------
    (H, W) array
        ``1 - prod(1 - alpha_i)``, 0 to 1; of the wanted rows only.

    Notes
    -----
    float32 looks into tables of 8 bits (of the texture's largest value) that are filtered
    beforehand for footprints in steps of the square root of two, and goes linearly between their
    entries; a look-up costs the same whatever the footprint. float64 is the composition of
    :func:`layer`, exact boxes and all (a mapping's `depth` is not used). On textures of the
    package's own the two differ by less than 0.011 in the mean, by 0.004 where a pixel is no wider
    than a texel of the nearest layer.

    Examples
    --------
    >>> import flurries as fl
    >>> rain = fl.cone.Texture(fl.cone.rain_tile(128, seed=1))
    >>> view = fl.Camera(focal=150.0)
    >>> still = fl.cone.Mapping((90, 120), view, axis=(0, 1, 0))
    >>> frames = [
    ...     fl.cone.layers((90, 120), view, rain, axis=(0, 1, 0), phase=p, mapping=still)
    ...     for p in (0.0, 0.1, 0.2)
    ... ]
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    if mapping is not None:
        if not isinstance(mapping, Mapping):
            raise TypeError(f"mapping must be a Mapping, got {type(mapping).__name__}")
        if mapping.shape != size:
            raise ValueError(f"mapping must be of shape {size}, got {mapping.shape}")
        multiples, stretch, repeats = mapping.multiples, mapping.stretch, mapping.repeats
    factors = multiples_of(multiples)
    places = table("offsets", _offsets(len(factors)) if offsets is None else offsets)
    if places.shape != (len(factors), 2):
        raise ValueError(f"offsets must have shape ({len(factors)}, 2), got {places.shape}")
    strengths = table("gains", gains, ndim=None)
    if strengths.shape not in ((1,), (len(factors),)) or not (strengths >= 0.0).all():
        raise ValueError(f"gains must be one number or {len(factors)}, none negative")
    strengths = np.broadcast_to(strengths, (len(factors),))
    length = real("stretch", stretch, low=1e-6, high=1e6)
    shared = flag("conserve", conserve)
    moved = wrapped(real("phase", phase))
    start, stop = _wanted(rows, (0, size[0]) if mapping is None else mapping.rows)
    if kind == np.float64:
        exact = tile.tile if isinstance(tile, Texture) else tile
        rest = np.ones(size)
        for factor, place, strength in zip(factors, places, strengths, strict=True):
            rest *= 1.0 - layer(
                size, camera, exact, axis=axis, phase=moved, stretch=length, slope=slope,
                repeats=repeats * factor, offset=tuple(place), gain=float(strength),
                conserve=shared, radius=radius * factor, dtype=kind,
            )  # fmt: skip
        rest = rest[start:stop]
        result = output(out, rest.shape, kind)
        np.subtract(1.0, rest, out=result)
        return result
    texture = tile if isinstance(tile, Texture) else Texture(tile)
    result = output(out, (stop - start, size[1]), kind)
    # Blocks lie where they lie in the whole picture.
    top = start - start % BLOCK
    whole = result if top == start else np.empty((stop - top, size[1]), np.float32)
    texels = math.log2(len(texture.tile))
    sheets = [
        (
            factor,
            _word(float(place[0])),
            _word(float(place[1]) - moved),
            texture._peak * float(strength) / (length if shared else 1.0),
            texels,
        )
        for factor, place, strength in zip(factors, places, strengths, strict=True)
    ]
    given = pose(size, camera, axis, slope, radius)
    if mapping is None and given[-1] == (0.0, 0.0, 0.0):
        course = (integer("repeats", repeats, low=1, high=MOST_REPEATS), length, top)
        steps = footprints_of(whole.shape, given, course)
        tables = _tables(texture, steps, sheets)
        view = given, course
        _core.cone_stack(whole, None, view, steps, sheets, texture._levels, tables)
    else:
        if mapping is None:
            mapping = Mapping(
                size, camera, axis=axis, stretch=length, slope=slope, repeats=repeats,
                radius=radius, multiples=factors, rows=(start, stop),
            )  # fmt: skip
        _stacked(whole, top, mapping, sheets, texture)
    if whole is not result:
        # The rows above, of a block that was begun, are of no use to anybody.
        result[...] = whole[start - top :]
    return result


def _wanted(rows: object, there: tuple[int, int]) -> tuple[int, int]:
    """Return the rows that are asked for, of those that are there."""
    if rows is None:
        return there
    first, last = two_of("rows", rows)
    start = integer("rows[0]", first, low=there[0], high=there[1] - 1)
    return start, integer("rows[1]", last, low=start + 1, high=there[1])


def _offsets(count: int) -> list[tuple[float, float]]:
    """Return places that no two layers share."""
    rest = [(0.618034 * i % 1.0, 0.754878 * i % 1.0) for i in range(len(OFFSETS), count)]
    return [*OFFSETS, *rest][:count]


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


def _stacked(
    whole: Array,
    top: int,
    mapping: Mapping,
    sheets: list[Sheet],
    texture: Texture,
) -> None:
    """Draw rows of a mapping, from the first of a block on."""
    above = top - mapping._top
    lines = slice(above, above + len(whole))
    blocks = slice(above // BLOCK, -(-lines.stop // BLOCK))
    parts = [(mapping._charts[0], sheets)]
    if not mapping._together:
        parts = [(chart, [sheet]) for chart, sheet in zip(mapping._charts, sheets, strict=True)]
    clear: Array | None = None
    for index, (planes, drawn) in enumerate(parts):
        across, along, fade, state = (plane[lines] for plane in planes[:4])
        steps = planes[4][blocks]
        tables = _tables(texture, steps, drawn)
        shown = None if mapping._shown is None else mapping._shown[lines]
        if shown is not None and not mapping._together:
            shown = (shown > index).astype(np.uint8)
        chart = across, along, fade, state, shown
        _core.cone_stack(whole, chart, None, steps, drawn, texture._levels, tables)
        if not mapping._together:
            clear = 1.0 - whole if clear is None else clear * (1.0 - whole)
    if clear is not None:
        np.subtract(1.0, clear, out=whole)

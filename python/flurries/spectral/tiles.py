"""From tables to pixels: the transform of a tile, the blend of many, the map to opacity."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import OVERLAP, TILE, Array, ArrayLike, Float64

Blend: TypeAlias = Literal["power", "linear"]

_MOST_TILES = 2**22  # Of one axis; more would be a list longer than the picture is wide.


def inverse_transform(
    amplitude: ArrayLike, phase: ArrayLike, *, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Real field of two wave tables: the unnormalised inverse transform.

    Of amplitudes and phases in cycles, (H, W), it is
    ``sum_k amplitude(k) cos 2 pi (f_k . (x, y) + phase(k))`` over all bins, at integer x and y:
    mean 0 and variance 1 for the tables of :func:`band_amplitude` and :func:`random_phase`.
    Tables without symmetry are taken as they stand: the sum is the Hermitian part's transform.
    """
    waves = check.table("amplitude", amplitude)
    turns = check.table("phase", phase)
    size = check.shape_of("amplitude", waves.shape)
    if turns.shape != size:
        raise ValueError(f"phase must have the shape of amplitude, {size}, got {turns.shape}")
    precision = check.float_dtype(dtype)
    # Twice, since the kernel's partial sums may be larger than the field.
    if 2.0 * float(np.abs(waves).sum()) > float(np.finfo(precision).max):
        raise ValueError(f"amplitude must have a sum that {precision} can hold")
    result = check.output(out, size, precision, waves, turns)
    _core.inverse_transform(result, waves, turns)
    return result


def tile_starts(length: int, *, tile: int = TILE, overlap: int = OVERLAP) -> npt.NDArray[np.intp]:
    """First pixel of each tile along one axis: 0, tile - overlap, ..., until `length` is covered.

    Neighbours share `overlap` pixels, 0 or more and fewer than `tile`; the last tile may stick out.
    There are 19 for 1024 px and the defaults.
    """
    pixels_ = check.integer("length", length, low=1, high=2**31 - 1)
    size = check.integer("tile", tile, low=1, high=2**15)
    (rows, _), shared = check.tile_of(size, overlap)
    count = _core.tile_count(pixels_, rows, shared)
    if count > _MOST_TILES:
        raise ValueError(
            f"length must take at most {_MOST_TILES} tiles, got {pixels_}, which takes {count} "
            f"of {rows} px with {shared} shared"
        )
    return starts(pixels_, rows, shared)


def starts(length: int, tile: int, overlap: int) -> npt.NDArray[np.intp]:
    """Return the first pixels of tiles, for numbers that are checked."""
    count = _core.tile_count(length, tile, overlap)
    return np.arange(count, dtype=np.intp) * (tile - overlap)


def power_shares(length: int, *, tile: int, overlap: int, blend: str) -> tuple[Float64, Float64]:
    """Return each tile's share of the field's power at each pixel of an axis, and that power."""
    # The power (length,) against a tile's middle is 1, and falls in overlaps for "linear".
    weights = np.empty((length, len(starts(length, tile, overlap))))
    _core.tile_shares(weights, tile, overlap, blend)
    if blend == "power":
        return weights, np.ones(length)
    squares = weights**2
    power = squares.sum(axis=1)
    return squares / power[:, None], power


def blend_tiles(
    tiles: ArrayLike, shape: tuple[int, int], *, overlap: int = OVERLAP, blend: Blend = "power",
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Blend a grid of overlapping tiles into one picture (H, W), in their dtype.

    Langer 2004, section 7; ``docs/internals/deviations.md``, 16.

    Parameters
    ----------
    tiles : (rows, cols, M, M)
        As many as :func:`tile_starts` gives for each axis, `overlap` pixels shared by neighbours.
    blend : {"power", "linear"}
        Squares of the weights sum to 1, which keeps the variance of independent fields; or the
        weights do (the paper), and the variance dips to 1/2 at edges and 1/4 at corners.
    """
    given, kept = check.pixels("tiles", tiles, ndim=4)
    check.finite("tiles", given)
    size = check.shape_of("shape", shape)
    _, shared = check.tile_of((given.shape[2], given.shape[3]), overlap)
    law = check.choice("blend", blend, Blend)
    result = check.output(out, size, kept, given)
    return check.filled(result, given.dtype, lambda v: _core.blend_tiles(v, given, shared, law))


def opacity(
    field: ArrayLike, *, mean: float = 0.5, spread: float = 3.0, power: float = 2.0,
    amount: float = 1.0, out: Array | None = None,
) -> Array:  # fmt: skip
    """Opacity of a field: ``amount * clip(mean + field / (2 spread), 0, 1) ** power``.

    Langer 2004, section 5.6. The scale comes from the known variance, never from the frame: a
    per-frame minimum and maximum flickers (``docs/internals/deviations.md``, 20). The defaults have
    mean 0.2776 and standard deviation 0.1706.

    Parameters
    ----------
    field : (H, W) or (n, H, W)
        Field of variance 1, or a film of it.
    mean : float
        Where the field's zero goes. Less than the paper's 0.5 leaves separate flakes.
    spread : float
        Deviations of the field that reach from 1/2 to 0 or 1; 3, which is ours, holds 99.7 %.
    power, amount : float
        Above 0, which the paper squares; and 0 to 1.
    """
    frames = check.rectangular("field", field)
    given, kept = check.pixels("field", frames, ndim=3 if frames.ndim == 3 else 2)
    check.finite("field", given)
    mapped = opacity_map(mean, spread, power, amount)
    result = check.output(out, given.shape, kept, given)
    rows = (-1, given.shape[-1])
    return check.filled(
        result, given.dtype,
        lambda view: _core.opacity(view.reshape(rows), given.reshape(rows), mapped),
    )  # fmt: skip


def mean_opacity(variance: Float64, mean: float, spread: float, power: float) -> Float64:
    """Return the mean of clip(mean + z / (2 spread), 0, 1)^power for fields of variances (n,)."""
    deviation = np.sqrt(np.maximum(variance, 0.0)) / (2.0 * spread)
    # On a table of deviations: frames have a variance for every pixel.
    table = np.linspace(0.0, max(float(deviation.max()), 1e-12), 129)
    z = np.linspace(-9.0, 9.0, 1801)
    weight = np.exp(-0.5 * z * z)
    weight /= weight.sum()
    base = table[:, None] * z
    # In place: it is larger than many a window.
    base += mean
    np.clip(base, 0.0, 1.0, out=base)
    base **= power
    return np.asarray(np.interp(deviation, table, base @ weight))


def opacity_map(
    mean: object, spread: object, power: object, amount: object
) -> tuple[float, float, float, float]:
    return (
        check.real("mean", mean),
        check.real("spread", spread, above=0.0),
        check.real("power", power, above=0.0),
        check.real("amount", amount, low=0.0, high=1.0),
    )

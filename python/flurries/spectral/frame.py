"""One whole frame of the texture: overlapping tiles, their motion, their blend."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    LARGEST,
    Array,
    Float64,
    bounded,
    choice,
    flag,
    float_dtype,
    output,
    real,
    seed_of,
    shape_of,
    table,
    tile_of,
)
from flurries.spectral.tables import ALIAS, Aliasing, band_of, warn_far, warn_long
from flurries.spectral.tiles import BLEND, Blend, opacity_map
from flurries.trace import count


class Request(NamedTuple):
    """A frame of the field as the kernel reads it: every argument settled and checked."""

    shape: tuple[int, int]
    tile: tuple[int, int]
    overlap: int
    blend: str
    wavelengths: tuple[float, float]
    exponent: float
    seed: int
    jitter: bool
    ring_edges: Float64
    ring_gains: Float64
    drift: Float64
    shift: Float64
    velocity: Float64
    shift_rate: Float64
    alias: Aliasing
    soft_from: float
    shutter: float
    shortest: Float64 | None
    window: tuple[int, int, int, int]
    # Of a film that begins again: drift and shift over all of it, and how much of it has passed.
    lap: tuple[Float64, Float64, float] | None = None

    def arrays(self) -> list[Float64]:
        """Return those of its values that are arrays, and perhaps the caller's own."""
        return [value for value in self if isinstance(value, np.ndarray)]


# The default of displacements that are seldom given.
NOWHERE = (0.0, 0.0)
_ZERO = np.zeros((1, 1, 1, 2))


def _vectors(name: str, value: object, rings: int | None) -> Float64:
    """Return (rows or 1, cols or 1, rings or 1, 2) from any of the shapes that api.md allows."""
    if value is NOWHERE:
        return _ZERO
    array = bounded(name, value)
    ringed = rings is not None
    if array.ndim == 1 and array.shape == (2,):
        return array.reshape(1, 1, 1, 2)
    if array.ndim == 2 and ringed and array.shape == (rings, 2):
        return array.reshape(1, 1, -1, 2)
    if array.ndim == 3 and array.shape[2] == 2:
        return array.reshape(array.shape[0], array.shape[1], 1, 2)
    if array.ndim == 4 and ringed and array.shape[2:] == (rings, 2):
        return array
    wanted = "(2,) or (rows, cols, 2)"
    if name in ("drift", "velocity"):
        wanted += (
            f", or ({rings}, 2) or (rows, cols, {rings}, 2) for the rings of ring_edges"
            if ringed
            else "; rings need ring_edges"
        )
    raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")


def request(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike,
    shift: npt.ArrayLike = NOWHERE,
    seed: int,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    wavelengths: tuple[float, float] = (4.0, 32.0),
    exponent: float = 1.0,
    velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None,
    alias: Aliasing = "keep",
    soft_from: float = 0.4,
    shutter: float = 0.0,
    jitter: bool = False,
    shortest: npt.ArrayLike | None = None,
    ring_edges: npt.ArrayLike | None = None,
    ring_gains: npt.ArrayLike | None = None,
    blend: Blend = "power",
    window: tuple[int, int, int, int] | None = None,
) -> Request:
    """Settle the arguments of :func:`field`; `window` is (top, bottom, left, right) in pixels."""
    size = shape_of("shape", shape)
    tile_size, shared = tile_of(tile, overlap)
    band = band_of(wavelengths)
    rings: int | None = None
    edges = np.empty(0)
    if ring_edges is not None:
        edges = table("ring_edges", ring_edges, ndim=1)
        if len(edges) < 2 or not (np.diff(edges) > 0).all():
            raise ValueError(
                f"ring_edges must be at least two increasing wavelengths, got {edges.tolist()}"
            )
        rings = len(edges) - 1
    gains = np.empty(0)
    if ring_gains is not None:
        gains = table("ring_gains", ring_gains, ndim=1)
        if rings is None or len(gains) != rings:
            raise ValueError(
                f"ring_gains must be one number for each ring of ring_edges "
                f"({'none' if rings is None else rings}), got {len(gains)}"
            )
    choice("alias", alias, ALIAS)
    exposure = real("shutter", shutter, low=0.0, high=LARGEST)
    if velocity is None and (alias != "keep" or exposure > 0.0):
        raise ValueError(
            f"velocity is needed for alias={alias!r} and shutter={exposure:g}, got None"
        )
    limits = None if shortest is None else table("shortest", shortest)
    warn_long(tile_size, band, stacklevel=4)
    offsets = _vectors("drift", drift, rings)
    if offsets is not _ZERO and band[1] > 0.0:
        warn_far(float(np.abs(offsets).max(initial=0.0)) / band[1], stacklevel=4)
    return Request(
        shape=size,
        tile=tile_size,
        overlap=shared,
        blend=choice("blend", blend, BLEND),
        wavelengths=band,
        exponent=real("exponent", exponent),
        seed=seed_of(seed),
        jitter=flag("jitter", jitter),
        ring_edges=edges,
        ring_gains=gains,
        drift=offsets,
        shift=_vectors("shift", shift, None),
        velocity=_ZERO if velocity is None else _vectors("velocity", velocity, rings),
        shift_rate=_ZERO if shift_rate is None else _vectors("shift_rate", shift_rate, None),
        alias=alias,
        soft_from=real("soft_from", soft_from),
        shutter=exposure,
        shortest=limits,
        window=(0, size[0], 0, size[1]) if window is None else window,
    )


def _window_shape(asked: Request) -> tuple[int, int]:
    top, bottom, left, right = asked.window
    return bottom - top, right - left


def field(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike,
    shift: npt.ArrayLike = NOWHERE,
    seed: int,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    wavelengths: tuple[float, float] = (4.0, 32.0),
    exponent: float = 1.0,
    velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None,
    alias: Aliasing = "keep",
    soft_from: float = 0.4,
    shutter: float = 0.0,
    jitter: bool = False,
    shortest: npt.ArrayLike | None = None,
    ring_edges: npt.ArrayLike | None = None,
    ring_gains: npt.ArrayLike | None = None,
    blend: Blend = "power",
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """One whole frame of the snow field, made in overlapping tiles and blended.

    Parameters
    ----------
    shape : (H, W)
        Size of the frame in pixels.
    drift : (2,), (rows, cols, 2), (rings, 2) or (rows, cols, rings, 2)
        Displacement in pixels, (x, y), of the longest wave since time 0, for all tiles, for each
        tile, or for each ring of wavelengths; see `ring_edges`. Tiles are those of
        :func:`tile_starts`.
    shift : (2,) or (rows, cols, 2)
        Displacement in pixels of all waves alike (a turning camera).
    seed : int
        Any int64. Tiles are independent whatever the drift.
    tile, overlap : int
        Tile size in pixels (a pair (rows, cols) for tiles that are not square) and pixels shared by
        neighbours. A torus is one tile of the image's size with overlap 0.
    wavelengths, exponent
        See :func:`band_amplitude`.
    velocity, shift_rate : like `drift` and `shift`, optional
        Their change per frame. An `alias` other than "keep", or a shutter, needs `velocity`.
    alias, soft_from, shutter
        See :func:`temporal_filter`. Power that they take is not restored.
    jitter : bool
        Spread each wave's direction on the tent over its cell of the lattice. Without it the waves
        exactly across the motion stand still: 8 % of the power for vertical snow and 64 px tiles.
    shortest : (rows, cols), optional
        Per tile, the wavelength in pixels up to which waves are left out (a scene nearer than they
        stand for). The normaliser stays, so that there is less snow in front of a near wall.
    ring_edges : (rings + 1,), optional
        Increasing wavelengths in pixels; ring r holds edges[r] < wavelength <= edges[r + 1], the
        outer rings what lies beyond. For wind that varies with depth.
    ring_gains : (rings,), optional
        Relative amplitude of each ring's waves, 0 or more; the whole keeps the variance 1.
    blend : {"power", "linear"}
        See :func:`blend_tiles`.
    dtype : float32 or float64
        Precision of the pixels; geometry and phases are float64 always.
    out : (H, W), optional
        Array to write into and return.

    Returns
    -------
    (H, W) float32 or float64
        Field of mean 0 and variance 1 (less what filter and depth limits take), y down. Equals the
        composition of the functions above within rounding, and has the same bits for any number of
        threads. Enlarging the image keeps the pixels away from the old right and bottom borders.

    Raises
    ------
    ValueError, TypeError
        For an argument that is not as described; the message names it.

    Notes
    -----
    Langer 2004, sections 5 and 7, in the form of ``docs/internals/deviations.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> z = fl.spectral.field((480, 640), drift=(1.0, 8.0), seed=7)
    >>> z.shape, z.dtype.name
    ((480, 640), 'float32')
    """
    asked = request(
        shape, drift=drift, shift=shift, seed=seed, tile=tile, overlap=overlap,
        wavelengths=wavelengths, exponent=exponent, velocity=velocity, shift_rate=shift_rate,
        alias=alias, soft_from=soft_from, shutter=shutter, jitter=jitter, shortest=shortest,
        ring_edges=ring_edges, ring_gains=ring_gains, blend=blend,
    )  # fmt: skip
    result = output(out, asked.shape, float_dtype(dtype), *asked.arrays())
    _core.field(result, asked)
    return result


def alpha(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike,
    shift: npt.ArrayLike = NOWHERE,
    seed: int,
    tile: int | tuple[int, int] = 64,
    overlap: int = 10,
    wavelengths: tuple[float, float] = (4.0, 32.0),
    exponent: float = 1.0,
    velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None,
    alias: Aliasing = "keep",
    soft_from: float = 0.4,
    shutter: float = 0.0,
    jitter: bool = False,
    shortest: npt.ArrayLike | None = None,
    ring_edges: npt.ArrayLike | None = None,
    ring_gains: npt.ArrayLike | None = None,
    blend: Blend = "power",
    mean: float = 0.5,
    spread: float = 3.0,
    power: float = 2.0,
    amount: float = 1.0,
    preserve_mean: bool = False,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Opacity of one whole frame: :func:`opacity` of :func:`field` in one pass.

    Parameters
    ----------
    shape, drift, shift, seed, tile, overlap, wavelengths, exponent, velocity, shift_rate, alias
        See :func:`field`.
    soft_from, shutter, jitter, shortest, ring_edges, ring_gains, blend, dtype
        See :func:`field`.
    mean, spread, amount
        See :func:`opacity`.
    power : float
        Of :func:`opacity`; `exponent` is the slope of the spectrum.
    preserve_mean : bool
        Add back the mean opacity that `alias` and `shutter` take from each tile: blurring a field
        and squaring it is not blurring its square.
    out : (H, W), optional
        Array to write into and return.

    Returns
    -------
    (H, W) float32 or float64
        Opacity in [0, amount].
    """
    asked = request(
        shape, drift=drift, shift=shift, seed=seed, tile=tile, overlap=overlap,
        wavelengths=wavelengths, exponent=exponent, velocity=velocity, shift_rate=shift_rate,
        alias=alias, soft_from=soft_from, shutter=shutter, jitter=jitter, shortest=shortest,
        ring_edges=ring_edges, ring_gains=ring_gains, blend=blend,
    )  # fmt: skip
    mapped = opacity_map(mean, spread, power, amount)
    keep = flag("preserve_mean", preserve_mean)
    result = output(out, asked.shape, float_dtype(dtype), *asked.arrays())
    _core.field(result, asked, mapped, keep)
    return result


def alpha_of(
    asked: Request,
    mapped: tuple[float, float, float, float],
    *,
    preserve_mean: bool = False,
    dtype: npt.DTypeLike = np.float32,
) -> Array:
    """Opacity of a settled request's window; what the scene calls."""
    result = np.empty(_window_shape(asked), float_dtype(dtype))
    count("tiles", _core.field(result, asked, mapped, preserve_mean))
    return result


def field_of(asked: Request, *, dtype: npt.DTypeLike = np.float32) -> Array:
    """Field of a settled request's window."""
    result = np.empty(_window_shape(asked), float_dtype(dtype))
    count("tiles", _core.field(result, asked))
    return result

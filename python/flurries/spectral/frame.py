"""One whole frame of the texture: overlapping tiles, their motion, their blend."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import OVERLAP, TILE, Array, flag, float_dtype, output
from flurries.spectral.own import own_field, own_of
from flurries.spectral.request import NOWHERE, request
from flurries.spectral.tables import BANDS, SOFT_FROM, Aliasing
from flurries.spectral.tiles import Blend, opacity, opacity_map


def _known(
    velocity: npt.ArrayLike | None, drift: npt.ArrayLike, rate: npt.ArrayLike | None
) -> npt.ArrayLike | None:
    """Return the change of the drift; none at all where `rate` alone moves the waves."""
    if velocity is None and rate is not None and drift is NOWHERE:
        return NOWHERE
    return velocity


def field(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike = NOWHERE,
    shift: npt.ArrayLike = NOWHERE,
    seed: int,
    tile: int | tuple[int, int] = TILE,
    overlap: int = OVERLAP,
    wavelengths: tuple[float, float] = BANDS["paper"],
    exponent: float = 1.0,
    velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None,
    alias: Aliasing = "keep",
    soft_from: float = SOFT_FROM,
    shutter: float = 0.0,
    jitter: bool = False,
    shortest: npt.ArrayLike | None = None,
    ring_edges: npt.ArrayLike | None = None,
    ring_gains: npt.ArrayLike | None = None,
    envelope: npt.ArrayLike | None = None,
    rate: npt.ArrayLike | None = None,
    time: float = 0.0,
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
    envelope : (rows, cols) of a tile, optional
        A spectrum of your own in place of `wavelengths` and `exponent`: amplitude of each wave in
        fftfreq order, 0 or more, of any scale. Waves k and -k get the mean of both, frequency 0
        gets nothing, and the whole is scaled to variance 1. `wavelengths[1]` is still the wave that
        `drift` belongs to.
    rate : (rows, cols) of a tile, optional
        A temporal law of your own: cycles per frame of each wave in fftfreq order, odd in k; it is
        added to what `drift` and `shift` do. ``-(fx * vx + fy * vy)`` moves the picture as a whole
        by (vx, vy) pixels per frame. With it `alias` and `shutter` need no `velocity` unless there
        is a `drift`.
    time : float
        Frames that `rate` has run, any number.
    blend : {"power", "linear"}
        See :func:`blend_tiles`.
    dtype : float32 or float64
        Precision of the pixels; geometry and phases are float64 always.

    Returns
    -------
    (H, W) float32 or float64
        Field of mean 0 and variance 1 (less what filter and depth limits take), y down. Equals the
        composition of the functions above within rounding, and has the same bits for any number of
        threads. Enlarging the image keeps the pixels away from the old right and bottom borders.

    Notes
    -----
    Langer 2004, sections 5 and 7, in the form of ``docs/internals/deviations.md``. With `envelope`
    or `rate` tiles are made one by one from the steps above, which takes a tenth of a second and
    more for a million pixels; `jitter` and `ring_edges` are refused.

    Examples
    --------
    >>> import flurries as fl
    >>> z = fl.spectral.field((480, 640), drift=(1.0, 8.0), seed=7)
    >>> z.shape, z.dtype.name
    ((480, 640), 'float32')

    Gravity waves of deep water, which all run to the right or left: longer ones are faster.

    >>> import numpy as np
    >>> fx, fy = np.meshgrid(np.fft.fftfreq(64), np.fft.fftfreq(64))
    >>> f = np.hypot(fx, fy)
    >>> envelope = np.exp(-((f - 0.1) ** 2) / (2 * 0.03**2))
    >>> rate = -np.sign(fx) * 0.1 * np.sqrt(f)
    >>> water = fl.spectral.field((480, 640), seed=7, envelope=envelope, rate=rate, time=12.0)
    >>> water.shape
    (480, 640)
    """
    asked = request(
        shape, drift=drift, shift=shift, seed=seed, tile=tile, overlap=overlap,
        wavelengths=wavelengths, exponent=exponent, velocity=_known(velocity, drift, rate),
        shift_rate=shift_rate,
        alias=alias, soft_from=soft_from, shutter=shutter, jitter=jitter, shortest=shortest,
        ring_edges=ring_edges, ring_gains=ring_gains, blend=blend,
        enveloped=envelope is not None,
    )  # fmt: skip
    own = own_of(asked, envelope, rate, time)
    result = output(out, asked.shape, float_dtype(dtype), *asked.arrays())
    if own is None:
        _core.field(result, asked)
    else:
        own_field(asked, own, result)
    return result


def alpha(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike = NOWHERE,
    shift: npt.ArrayLike = NOWHERE,
    seed: int,
    tile: int | tuple[int, int] = TILE,
    overlap: int = OVERLAP,
    wavelengths: tuple[float, float] = BANDS["paper"],
    exponent: float = 1.0,
    velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None,
    alias: Aliasing = "keep",
    soft_from: float = SOFT_FROM,
    shutter: float = 0.0,
    jitter: bool = False,
    shortest: npt.ArrayLike | None = None,
    ring_edges: npt.ArrayLike | None = None,
    ring_gains: npt.ArrayLike | None = None,
    envelope: npt.ArrayLike | None = None,
    rate: npt.ArrayLike | None = None,
    time: float = 0.0,
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
    soft_from, shutter, jitter, shortest, ring_edges, ring_gains, envelope, rate, time, blend, dtype
        See :func:`field`.
    mean, spread, amount
        See :func:`opacity`.
    power : float
        Of :func:`opacity`; `exponent` is the slope of the spectrum.
    preserve_mean : bool
        Add back the mean opacity that `alias` and `shutter` take from each tile: blurring a field
        and squaring it is not blurring its square.

    Returns
    -------
    (H, W) float32 or float64
        Opacity in [0, amount].
    """
    asked = request(
        shape, drift=drift, shift=shift, seed=seed, tile=tile, overlap=overlap,
        wavelengths=wavelengths, exponent=exponent, velocity=_known(velocity, drift, rate),
        shift_rate=shift_rate,
        alias=alias, soft_from=soft_from, shutter=shutter, jitter=jitter, shortest=shortest,
        ring_edges=ring_edges, ring_gains=ring_gains, blend=blend,
        enveloped=envelope is not None,
    )  # fmt: skip
    own = own_of(asked, envelope, rate, time)
    mapped = opacity_map(mean, spread, power, amount)
    keep = flag("preserve_mean", preserve_mean)
    result = output(out, asked.shape, float_dtype(dtype), *asked.arrays())
    if own is None:
        _core.field(result, asked, mapped, keep)
        return result
    if keep:
        raise ValueError("preserve_mean must be False beside envelope or rate, got True")
    whole = np.empty(asked.shape, result.dtype)
    own_field(asked, own, whole)
    return opacity(whole, mean=mean, spread=spread, power=power, amount=amount, out=result)

"""One whole frame of the texture: overlapping tiles, their motion, their blend."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import Array
from flurries.spectral.own import own_field, own_of
from flurries.spectral.request import NOWHERE, Request, request
from flurries.spectral.texture import Texture
from flurries.spectral.tiles import opacity_map

# Mean, spread, power and amount of the map from field to opacity.
Map = tuple[float, float, float, float]

# The paper's.
PLAIN = Texture()


def field(
    shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN, drift: npt.ArrayLike = NOWHERE,
    shift: npt.ArrayLike = NOWHERE, velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None, shortest: npt.ArrayLike | None = None,
    time: float = 0.0, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """One whole frame of the snow field, made in overlapping tiles and blended.

    Parameters
    ----------
    shape : (H, W)
        Size of the frame in pixels.
    seed : int
        Any int64. Tiles are independent whatever the drift.
    texture : Texture
        What the field is made of; the paper's if not given.
    drift : (2,), (rows, cols, 2), (rings, 2) or (rows, cols, rings, 2)
        Displacement in pixels, (x, y), of the longest wave since time 0, for all tiles, for each
        tile, or for each ring of the texture's `ring_edges`. Tiles are those of
        :func:`tile_starts`.
    shift : (2,) or (rows, cols, 2)
        Displacement in pixels of all waves alike (a turning camera).
    velocity, shift_rate : like `drift` and `shift`, optional
        Their change per frame. A texture with an `alias` other than "keep", or with a shutter,
        needs `velocity`; one with a `rate` only beside a `drift`.
    shortest : (rows, cols), optional
        Per tile, the wavelength in pixels up to which waves are left out (a scene nearer than they
        stand for). The normaliser stays, so that there is less snow in front of a near wall.
    time : float
        Frames that the texture's `rate` has run, any number.
    dtype : float32 or float64
        Precision of the pixels; geometry and phases are float64 always.

    Returns
    -------
    (H, W) float32 or float64
        Field of mean 0 and variance 1 (less what filter and depth limits take), y down: within
        rounding the composition of this module's functions, with the same bits for any number of
        threads. A larger image has the same pixels but at the old right and bottom borders.

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
        shape, texture, drift=drift, shift=shift, seed=seed, velocity=velocity,
        shift_rate=shift_rate, shortest=shortest,
    )  # fmt: skip
    return _made(asked, texture, time, None, False, dtype, out)


def alpha(
    shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN, drift: npt.ArrayLike = NOWHERE,
    shift: npt.ArrayLike = NOWHERE, velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None, shortest: npt.ArrayLike | None = None,
    time: float = 0.0, mean: float = 0.5, spread: float = 3.0, power: float = 2.0,
    amount: float = 1.0, preserve_mean: bool = False, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Opacity of one whole frame: :func:`opacity` of :func:`field` in one pass.

    Parameters
    ----------
    shape, seed, texture, drift, shift, velocity, shift_rate, shortest, time, dtype
        See :func:`field`.
    mean, spread, amount
        See :func:`opacity`.
    power : float
        Of :func:`opacity`; a texture's `exponent` is the slope of its spectrum.
    preserve_mean : bool
        Add back the mean opacity that `alias` and `shutter` take from each tile: blurring a field
        and squaring it is not blurring its square.

    Returns
    -------
    (H, W) float32 or float64
        Opacity in [0, amount].
    """
    asked = request(
        shape, texture, drift=drift, shift=shift, seed=seed, velocity=velocity,
        shift_rate=shift_rate, shortest=shortest,
    )  # fmt: skip
    mapped = opacity_map(mean, spread, power, amount)
    return _made(
        asked, texture, time, mapped, check.flag("preserve_mean", preserve_mean), dtype, out
    )


def movie(
    frames: int, shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN,
    velocity: npt.ArrayLike = NOWHERE, contrast: float | None = None, mean: float = 0.5,
    dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Frames 0 to T - 1 of a texture, as one array.

    Parameters
    ----------
    frames : int
        T, how many.
    shape, seed, texture, dtype
        See :func:`field`; a Motion Cloud is a texture of :func:`cloud`.
    velocity : (vx, vy)
        Pixels per frame of the longest wave.
    contrast : float, optional
        RMS contrast: the standard deviation of the luminance over its mean, 0 or more. If not given
        the film is the field itself.
    mean : float
        Mean luminance of a film with a contrast.
    out : (T, H, W), optional
        Array to write into and return.

    Returns
    -------
    (T, H, W) float32 or float64
        ``mean (1 + contrast field)``, not clipped; or the field, of mean 0 and variance 1.
    """
    count = check.integer("frames", frames, low=1, high=2**31 - 1)
    speed = check.vector("velocity", velocity, 2)
    asked = request(shape, texture, seed=seed, velocity=speed)
    whole = (count, *asked.shape)
    if math.prod(whole) > check.MOST_ELEMENTS:
        raise ValueError(f"frames must hold at most {check.MOST_ELEMENTS} pixels, got {whole}")
    level = check.real("mean", mean)
    strength = None if contrast is None else level * check.real("contrast", contrast, low=0.0)
    result = check.output(out, whole, check.float_dtype(dtype), speed)
    for t, picture in enumerate(result):
        moved = asked._replace(drift=t * asked.velocity)
        time = 0.0 if texture.rate is None else float(t)
        _made(moved, texture, time, None, False, dtype, picture)
        if strength is not None:
            picture *= strength
            picture += level
    return result


def _made(
    asked: Request, texture: Texture, time: float, mapped: Map | None, keep: bool,
    dtype: npt.DTypeLike, out: Array | None,
) -> Array:  # fmt: skip
    own = own_of(asked, texture, time)
    result = check.output(out, asked.shape, check.float_dtype(dtype), *asked.arrays())
    if own is None:
        _core.field(result, asked, mapped, keep)
    elif keep:
        raise ValueError("preserve_mean must be False beside envelope or rate, got True")
    else:
        whole = result if mapped is None else np.empty_like(result)
        own_field(asked, own, whole)
        if mapped is not None:
            _core.opacity(result, whole, mapped)
    return result

"""One whole frame of the texture: overlapping tiles, their motion, their blend."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, Array, ArrayLike, Float64
from flurries.spectral.tables import random_phase, temporal_gain, tent_rate, warn_far, warn_long
from flurries.spectral.texture import Texture, reads_texture
from flurries.spectral.tiles import blend_tiles, opacity_map, starts

# Mean, spread, power and amount of the map from field to opacity.
Map = tuple[float, float, float, float]

PLAIN = Texture()  # The paper's.

# The default of displacements that are not given.
NOWHERE = (0.0, 0.0)
_ZERO = np.zeros((1, 1, 1, 2))

# A wave as long as the limit counts as too short, whatever the rounding of its length.
_EQUAL = 1.0 + 1e-12


class Request(NamedTuple):
    """A frame of the field as the kernel reads it: every argument settled and checked."""

    texture: Texture
    shape: tuple[int, int]
    seed: int
    drift: Float64
    shift: Float64
    velocity: Float64
    shift_rate: Float64
    shortest: Float64 | None
    window: tuple[int, int, int, int]
    # Of a film that begins again: drift and shift over all of it, and how much of it has passed.
    lap: tuple[Any, ...] | None = None

    def __getattr__(self, name: str) -> Any:
        # For who checks types: what the texture has is there.
        raise AttributeError(name)


reads_texture(Request)


def request(
    shape: tuple[int, int], texture: Texture, *, seed: int, drift: ArrayLike = NOWHERE,
    shift: ArrayLike = NOWHERE, velocity: ArrayLike | None = None,
    shift_rate: ArrayLike | None = None, shortest: ArrayLike | None = None,
) -> Request:  # fmt: skip
    """Settle the arguments of `field`."""
    size = check.shape_of("shape", shape)
    if not isinstance(texture, Texture):
        raise TypeError(f"texture must be a flurries.spectral.Texture, got {texture!r:.60}")
    band, edges = texture.wavelengths, texture.ring_edges
    if velocity is None and texture.rate is not None and drift is NOWHERE:
        # The rate alone moves the waves.
        velocity = NOWHERE
    if velocity is None and (texture.alias != "keep" or texture.shutter > 0.0):
        raise ValueError(
            f"velocity is needed for alias={texture.alias!r} and shutter={texture.shutter:g}, "
            "got None"
        )
    if texture.envelope is None:
        warn_long(texture.sides, band)
    rings = None if edges is None else np.size(edges) - 1
    offsets = _vectors("drift", drift, rings)
    if offsets is not _ZERO and band[1] > 0.0:
        warn_far(float(np.abs(offsets).max(initial=0.0)) / band[1])
    return Request(
        texture, size, check.seed_of(seed), drift=offsets, shift=_vectors("shift", shift, None),
        velocity=_ZERO if velocity is None else _vectors("velocity", velocity, rings),
        shift_rate=_ZERO if shift_rate is None else _vectors("shift_rate", shift_rate, None),
        shortest=None if shortest is None else check.table("shortest", shortest),
        window=(0, size[0], 0, size[1]),
    )  # fmt: skip


def _vectors(name: str, value: object, rings: int | None) -> Float64:
    """Return (rows or 1, cols or 1, rings or 1, 2) from any of the shapes that `field` allows."""
    if value is NOWHERE:
        return _ZERO
    array = check.bounded(name, value)
    if array.shape == (2,) or (array.ndim == 3 and array.shape[2] == 2):
        return array.reshape(*(array.shape[:-1] or (1, 1)), 1, 2)
    if array.ndim in (2, 4) and array.shape[-2:] == (rings, 2):
        return array.reshape(*(array.shape[:-2] or (1, 1)), -1, 2)
    wanted = "(2,) or (rows, cols, 2)"
    if name in ("drift", "velocity"):
        wanted += ", and with ring_edges also (rings, 2) or (rows, cols, rings, 2)"
    raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")


def field(
    shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN, drift: ArrayLike = NOWHERE,
    shift: ArrayLike = NOWHERE, velocity: ArrayLike | None = None,
    shift_rate: ArrayLike | None = None, shortest: ArrayLike | None = None,
    time: float = 0.0, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """One whole frame (H, W) of the snow field, made in overlapping tiles and blended.

    It has mean 0 and variance 1 (less what filter and depth limits take), y down: within rounding
    the composition of this module's functions, with the same bits for any number of threads. A
    larger image has the same pixels but at the old right and bottom borders. Langer 2004, sections
    5 and 7, in the form of ``docs/internals/deviations.md``.

    Parameters
    ----------
    texture : Texture
        What the field is made of; the paper's if not given. Tiles are independent.
    drift : (2,), (rows, cols, 2), (rings, 2) or (rows, cols, rings, 2)
        Displacement in pixels, (x, y), of the longest wave since time 0, for all tiles, for each
        tile of :func:`tile_starts`, or for each ring of the texture's `ring_edges`.
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
    """
    asked = request(
        shape, texture, drift=drift, shift=shift, seed=seed, velocity=velocity,
        shift_rate=shift_rate, shortest=shortest,
    )  # fmt: skip
    return _made(asked, texture, time, None, False, dtype, out)


def alpha(
    shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN, drift: ArrayLike = NOWHERE,
    shift: ArrayLike = NOWHERE, velocity: ArrayLike | None = None,
    shift_rate: ArrayLike | None = None, shortest: ArrayLike | None = None, time: float = 0.0,
    mean: float = 0.5, spread: float = 3.0, power: float = 2.0, amount: float = 1.0,
    preserve_mean: bool = False, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Opacity (H, W), 0 to `amount`: :func:`opacity` of :func:`field` in one pass.

    Parameters
    ----------
    texture, drift, shift, velocity, shift_rate, shortest, time
        See :func:`field`.
    mean, spread, power, amount
        See :func:`opacity`; the texture's `exponent` is another one, the slope of its spectrum.
    preserve_mean : bool
        Add back the mean opacity that `alias` and `shutter` take from each tile: blurring a field
        and squaring it is not blurring its square.
    """
    asked = request(
        shape, texture, drift=drift, shift=shift, seed=seed, velocity=velocity,
        shift_rate=shift_rate, shortest=shortest,
    )  # fmt: skip
    mapped = opacity_map(mean, spread, power, amount)
    keep = check.flag("preserve_mean", preserve_mean)
    return _made(asked, texture, time, mapped, keep, dtype, out)


def movie(
    frames: int, shape: tuple[int, int], *, seed: int, texture: Texture = PLAIN,
    velocity: ArrayLike = NOWHERE, contrast: float | None = None, mean: float = 0.5,
    dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Frames 0 to T - 1 of a texture, as one array (T, H, W).

    It is ``mean (1 + contrast field)``, not clipped; or the field, of mean 0 and variance 1.

    Parameters
    ----------
    frames : int
        T, how many.
    texture : Texture
        See :func:`field`; a Motion Cloud is a texture of :func:`cloud`.
    velocity : (vx, vy)
        Pixels per frame of the longest wave.
    contrast : float, optional
        RMS contrast: the standard deviation of the luminance over its mean, 0 or more. If not given
        the film is the field itself.
    mean : float
        Mean luminance of a film with a contrast.
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
    now = check.real("time", time, low=-LARGEST, high=LARGEST)
    if texture.rate is None and now != 0.0:
        raise ValueError(
            f"time must be 0 without a texture's rate, since drift says the rest, got {now:g}"
        )
    given = [value for value in asked if isinstance(value, np.ndarray)]
    result = check.output(out, asked.shape, check.float_dtype(dtype), *given)
    if not texture.is_own:
        _core.field(result, asked, mapped, keep)
    elif keep:
        raise ValueError("preserve_mean must be False beside envelope or rate, got True")
    else:
        whole = result if mapped is None else np.empty_like(result)
        _own_field(asked, texture, now, whole)
        if mapped is not None:
            _core.opacity(result, whole, mapped)
    return result


def _own_field(asked: Request, texture: Texture, time: float, result: Array) -> None:
    """Write the field of a spectrum and a motion of the caller's own, tile by tile."""
    fy, fx = np.meshgrid(*map(np.fft.fftfreq, asked.tile), indexing="ij")
    with np.errstate(divide="ignore"):
        length = 1.0 / np.hypot(fy, fx)
    # A wave of half a cycle is its own mirror, and moves neither way.
    fy, fx = (np.where(f == -0.5, 0.0, f) for f in (fy, fx))
    longest = asked.wavelengths[1]
    turns = texture._own_rate * time
    turns -= np.rint(turns)
    filtered = asked.alias != "keep" or asked.shutter > 0.0
    sides = zip(asked.shape, asked.tile, strict=True)
    rows, cols = (len(starts(n, side, asked.overlap)) for n, side in sides)
    motion = {
        name: _by_tile(name, getattr(asked, name), (rows, cols))
        for name in ("drift", "shift", "velocity", "shift_rate")
    }
    nearest = asked.shortest
    if nearest is not None and nearest.shape != (rows, cols):
        raise ValueError(f"shortest must have shape {(rows, cols)}, got {nearest.shape}")
    tiles = np.empty((rows, cols, *asked.tile), result.dtype)
    for place in np.ndindex(rows, cols):
        waves = texture._own_amplitude
        if filtered:
            across, down = motion["shift_rate"][place]
            rate = tent_rate(asked.tile, motion["velocity"][place], wavelength_max=longest)
            rate += texture._own_rate
            rate -= fx * across + fy * down
            waves = waves * temporal_gain(
                rate, alias=asked.alias, soft_from=asked.soft_from, shutter=asked.shutter
            )
        if nearest is not None:
            waves = np.where(length > nearest[place] * _EQUAL, waves, 0.0)
        phase = random_phase(asked.tile, seed=asked.seed, tile=(place[0], place[1])) + turns
        moved = np.empty(asked.tile)
        cycles = motion["drift"][place] / longest
        _core.advance_phase(moved, phase, cycles.tolist(), motion["shift"][place].tolist())
        _core.inverse_transform(tiles[place], np.ascontiguousarray(waves), moved)
    blend_tiles(tiles, asked.shape, overlap=asked.overlap, blend=asked.blend, out=result)


def _by_tile(name: str, vectors: Float64, grid: tuple[int, int]) -> Float64:
    """Return (rows, cols, 2) of what a request has for all tiles or for each."""
    if vectors.shape[:2] not in ((1, 1), grid):
        raise ValueError(
            f"{name} must have shape (2,) or {(*grid, 2)} for these tiles, got "
            f"{(*vectors.shape[:2], 2)}"
        )
    return np.asarray(np.broadcast_to(vectors[:, :, 0], (*grid, 2)))

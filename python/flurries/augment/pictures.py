"""What pictures, clips and batches may look like, and how weather is mixed into them."""

from __future__ import annotations

import numpy as np

from flurries import _core
from flurries._contract import Array, _came, aligned
from flurries._warnings import warn_of_levels

DTYPES = ("uint8", "uint16", "float16", "float32", "float64")
_TYPES = frozenset(np.dtype(name).type for name in DTYPES)


def picture_of(name: str, value: object) -> Array:
    """Return one picture (H, W) or (H, W, 1 or 3) as it came, checked."""
    given = _numbers(name, value)
    if given.ndim == 4:
        raise ValueError(
            f"{name} must be one picture, got {_came(given)}; a clip (T, H, W, C) goes to .clip, "
            "a batch (N, H, W, C) to .batch"
        )
    if given.ndim != 2 and not (given.ndim == 3 and given.shape[2] in (1, 3)):
        hint = ""
        if given.ndim == 3 and given.shape[0] in (1, 3):
            hint = "; channels come last"
        raise ValueError(f"{name} must have shape (H, W), (H, W, 1) or (H, W, 3), got "
                         f"{given.shape}{hint}")  # fmt: skip
    return given


def stack_of(name: str, value: object) -> Array:
    """Return pictures (N, H, W) or (N, H, W, 1 or 3) as they came, checked."""
    given = _numbers(name, value)
    if given.ndim != 3 and not (given.ndim == 4 and given.shape[3] in (1, 3)):
        hint = "; channels come last" if given.ndim == 4 and given.shape[1] in (1, 3) else ""
        raise ValueError(
            f"{name} must have shape (N, H, W), (N, H, W, 1) or (N, H, W, 3), got "
            f"{given.shape}{hint}"
        )
    return given


def _numbers(name: str, value: object) -> Array:
    try:
        given = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} must be a rectangular array, got {_came(value)}") from None
    if given.dtype.type not in _TYPES:
        raise TypeError(f"{name} must be {', '.join(DTYPES[:-1])} or {DTYPES[-1]}, got "
                        f"{_came(value)}")  # fmt: skip
    if 0 in given.shape:
        raise ValueError(f"{name} must not be empty, got shape {given.shape}")
    return given


def planes_of(given: Array) -> Array:
    """Return (H, W, C) C-contiguous in a dtype that kernels read."""
    native = given.dtype.newbyteorder("=")
    planes = given if given.ndim == 3 else given[..., None]
    return aligned(planes, np.float32 if native == np.float16 else native)


def mixed(given: Array, alpha: Array, color: tuple[float, ...], white: float) -> Array:
    """Return a picture under a layer of one color, in its own dtype; never written to.

    Parameters
    ----------
    given : array
        As `picture_of` returns it.
    alpha : (H, W) float32
        From 0 to 1.
    color : (r, g, b)
        Display values, 0 to 1.
    white : float
        What float pictures call white.
    """
    planes = planes_of(given)
    floats = planes.dtype.kind == "f"
    if floats and white == 1.0:
        warn_of_levels("image", planes, "give the transform white=255")
    light = [c * (white if floats else 1.0) for c in channels_of(color, planes.shape[2])]
    result: Array = np.empty(planes.shape, planes.dtype)
    kind = np.float64 if planes.dtype == np.float64 else np.float32
    _core.snow(result, planes, aligned(alpha, kind), light)
    kept = given.dtype.newbyteorder("=")
    if kept != result.dtype:
        with np.errstate(over="ignore"):
            result = result.astype(kept)
    return result.reshape(given.shape)


def channels_of(color: tuple[float, ...], count: int) -> list[float]:
    """Return a color for pictures of so many channels: of one, its luminance."""
    if count == 3:
        return list(color)
    return [0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]]

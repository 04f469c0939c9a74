"""What pictures, clips and batches may look like, and how weather is mixed into them."""

import numpy as np

from flurries import _core
from flurries._contract import Array, _came, aligned, rectangular
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
    return _shaped(name, given, 0)


def stack_of(name: str, value: object) -> Array:
    """Return pictures (N, H, W) or (N, H, W, 1 or 3) as they came, checked."""
    return _shaped(name, _numbers(name, value), 1)


def _shaped(name: str, given: Array, first: int) -> Array:
    """Return pictures whose height is the dimension `first`."""
    if given.ndim == first + 2 or (given.ndim == first + 3 and given.shape[-1] in (1, 3)):
        return given
    n = "N, " * first
    hint = given.ndim == first + 3 and given.shape[first] in (1, 3)
    raise ValueError(
        f"{name} must have shape ({n}H, W), ({n}H, W, 1) or ({n}H, W, 3), got {given.shape}"
        + "; channels come last" * hint
    )


def _numbers(name: str, value: object) -> Array:
    given = rectangular(name, value)
    if given.dtype.type not in _TYPES:
        raise TypeError(f"{name} must be {', '.join(DTYPES[:-1])} or {DTYPES[-1]}, got "
                        f"{_came(value)}")  # fmt: skip
    if 0 in given.shape:
        raise ValueError(f"{name} must not be empty, got shape {given.shape}")
    return given


def mixed(given: Array, alpha: Array, color: tuple[float, ...], white: float) -> Array:
    """Return a picture under a layer of one color, in its own dtype; never written to."""
    kept = given.dtype.newbyteorder("=")
    planes = given if given.ndim == 3 else given[..., None]
    planes = aligned(planes, np.float32 if kept == np.float16 else kept)
    floats = planes.dtype.kind == "f"
    if floats and white == 1.0:
        warn_of_levels("image", planes, "give the transform white=255")
    if planes.shape[2] == 1:
        color = (0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2],)
    light = [c * (white if floats else 1.0) for c in color]
    result: Array = np.empty(planes.shape, planes.dtype)
    kind = np.float64 if planes.dtype == np.float64 else np.float32
    _core.snow(result, planes, aligned(alpha, kind), light)
    if kept != result.dtype:
        with np.errstate(over="ignore"):
            result = result.astype(kept)
    return result.reshape(given.shape)


def layer_of(alpha: Array, color: tuple[float, ...]) -> Array:
    """Return (..., 4) float32: a color, premultiplied with an opacity."""
    layer = np.empty((*alpha.shape, 4), np.float32)
    np.multiply(alpha[..., None], np.asarray(color, np.float32), out=layer[..., :3])
    layer[..., 3] = alpha
    return layer

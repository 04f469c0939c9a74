"""Snow and premultiplied layers over a background (Langer 2004, section 5.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, _came, aligned, finite, output, pixels, real, shares, vector
from flurries._warnings import warn_of_levels

__all__ = ["join", "over", "snow"]

PAPER_WHITE = 250 / 255

# What kernels read, by the dtype that came.
_WORKING: dict[np.dtype[Any], np.dtype[Any]] = {
    np.dtype(np.uint8): np.dtype(np.uint8),
    np.dtype(np.uint16): np.dtype(np.uint16),
    np.dtype(np.float16): np.dtype(np.float32),
    np.dtype(np.float32): np.dtype(np.float32),
    np.dtype(np.float64): np.dtype(np.float64),
}


def _native(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the dtype with the machine's order of bytes."""
    return dtype if dtype.isnative else dtype.newbyteorder("=")


def _background(background: object, channels: Sequence[int]) -> tuple[Array, Array]:
    """Return the picture as (H, W, C) of a dtype that kernels read, and the array as it came."""
    try:
        given = np.asarray(background)
    except ValueError:
        raise ValueError("background must be a rectangular array, got a ragged one") from None
    working = _WORKING.get(_native(given.dtype))
    if working is None:
        raise TypeError(
            f"background must be uint8, uint16, float16, float32 or float64, got {given.dtype}"
        )
    if given.ndim == 2 and 1 in channels:
        planes = given[..., None]
    elif given.ndim == 3 and given.shape[2] in channels:
        planes = given
    else:
        wanted = " or ".join(["(H, W)"] * (1 in channels) + [f"(H, W, {c})" for c in channels])
        raise ValueError(f"background must have shape {wanted}, got {given.shape}")
    if 0 in planes.shape:
        raise ValueError(f"background must not be empty, got shape {given.shape}")
    warn_of_levels("background", planes, "divide it by 255")
    return aligned(planes, working), given


def _result(given: Array, planes: Array, out: Array | None, *inputs: Array) -> tuple[Array, Array]:
    """Return the array to give back, and the (H, W, C) array that the kernel writes."""
    kept = _native(given.dtype)
    result = output(out, given.shape, kept, given, *inputs)
    wide = result if kept == planes.dtype else np.empty(given.shape, planes.dtype)
    return result, wide


def snow(
    background: npt.ArrayLike, alpha: npt.ArrayLike, *,
    intensity: float | Sequence[float] = PAPER_WHITE, out: Array | None = None,
) -> Array:  # fmt: skip
    """Snow of one color over a picture, Eq. 7 in the picture's own values.

    Parameters
    ----------
    background : (H, W) or (H, W, 1 or 3)
        uint8 or uint16 of full scale 1, or floats as they are. Never written to.
    alpha : (H, W)
        Opacity, 0 to 1, float.
    intensity : float or RGB
        Color of the snow as a fraction of full scale; above 1 for bright snow in linear light. The
        default is the paper's 250 of 255.
    out : like `background`, optional
        Array to write into and return; not the background itself.

    Returns
    -------
    array of the shape and dtype of `background`
        ``intensity * alpha + (1 - alpha) * background``; integers are rounded. Where alpha is 0 the
        background's bits are kept; NaN in the background stays where it was.

    Notes
    -----
    Langer 2004, Eq. 7. Eq. 7 mixes display values; give linear light and get linear light.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> picture = np.full((480, 640, 3), 40, np.uint8)
    >>> alpha = fl.spectral.alpha((480, 640), drift=(1.0, 8.0), seed=7, mean=0.1)
    >>> snowy = fl.composite.snow(picture, alpha)
    >>> snowy.dtype.name, bool((snowy >= picture).all())
    ('uint8', True)
    """
    planes, given = _background(background, (1, 3))
    cover, _ = pixels("alpha", alpha, ndim=2)
    if cover.shape != planes.shape[:2]:
        raise ValueError(f"alpha must have shape {planes.shape[:2]}, got {cover.shape}")
    shares("alpha", cover)
    color = _intensity(intensity, planes.shape[2])
    result, wide = _result(given, planes, out, cover)
    _core.snow(wide.reshape(planes.shape), planes, cover, color)
    if wide is not result:
        result[...] = wide
    return result


def _intensity(intensity: Any, channels: int) -> list[float]:
    if isinstance(intensity, (float, int, complex, np.number, str)) or intensity is None:
        return [real("intensity", intensity, low=0.0)] * channels
    color: list[float] = vector("intensity", intensity, channels).tolist()
    if min(color) < 0.0:
        raise ValueError(f"intensity must not be negative, got {color}")
    return color


def over(background: npt.ArrayLike, layer: npt.ArrayLike, *, out: Array | None = None) -> Array:
    """Premultiplied RGBA layer over a picture.

    Parameters
    ----------
    background : (H, W, 3) or (H, W, 4)
        uint8 or uint16 of full scale 1, or floats; four channels are premultiplied. Never written
        to.
    layer : (H, W, 4)
        Premultiplied RGBA, float, full scale 1, in the light of the background.
    out : like `background`, optional
        Array to write into and return; not the background itself.

    Returns
    -------
    array of the shape and dtype of `background`
        ``layer + (1 - layer alpha) * background``, integers rounded.
    """
    planes, given = _background(background, (3, 4))
    front, _ = pixels("layer", layer, ndim=3)
    if front.shape != (*planes.shape[:2], 4):
        raise ValueError(f"layer must have shape {(*planes.shape[:2], 4)}, got {front.shape}")
    shares("layer: alpha", front[..., 3])
    finite("layer", front)
    result, wide = _result(given, planes, out, front)
    _core.over(wide, planes, front)
    if wide is not result:
        result[...] = wide
    return result


def join(
    layers: Sequence[npt.ArrayLike], *, haze: float = 0.0, matte: npt.ArrayLike | None = None,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Opacity of layers of one color together, behind a matte.

    Parameters
    ----------
    layers : sequence of (H, W)
        Opacities, at least one; all of one dtype, float32 or float64.
    haze : float
        An even veil, 0 to 1.
    matte : (H, W), optional
        What stands in front of them all: 1 hides them.

    Returns
    -------
    (H, W), dtype of the layers
        ``(1 - (1 - haze) prod (1 - alpha_i)) (1 - matte)``; the layers' order does not matter.
    """
    single = isinstance(layers, np.ndarray) and layers.ndim == 0
    if single or not isinstance(layers, (list, tuple, np.ndarray)):
        raise TypeError(f"layers must be a sequence of opacities, got {_came(layers)}")
    if len(layers) == 0:
        raise ValueError("layers must hold at least one opacity, got none")
    first, kept = pixels("layers[0]", layers[0], ndim=2)
    planes = [first]
    for index, layer in enumerate(layers[1:], 1):
        plane, _ = pixels(f"layers[{index}]", layer, ndim=2)
        if plane.dtype != first.dtype or plane.shape != first.shape:
            raise ValueError(
                f"layers must agree: layers[0] is {first.dtype} {first.shape}, "
                f"layers[{index}] is {plane.dtype} {plane.shape}"
            )
        planes.append(plane)
    for index, plane in enumerate(planes):
        shares(f"layers[{index}]", plane)
    veil = real("haze", haze, low=0.0, high=1.0)
    front = None
    if matte is not None:
        front = aligned(pixels("matte", matte, ndim=2)[0], first.dtype)
        if front.shape != first.shape:
            raise ValueError(f"matte must have shape {first.shape}, got {front.shape}")
        shares("matte", front)
    result = output(out, first.shape, kept, *planes, *([] if front is None else [front]))
    wide = result if kept == first.dtype else np.empty(first.shape, first.dtype)
    _core.join(wide, planes, veil, front)
    if wide is not result:
        result[...] = wide
    return result

"""Snow and premultiplied layers over a background (Langer 2004, section 5.7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flurries import _contract as check
from flurries import _core
from flurries._contract import Array, ArrayLike
from flurries._warnings import warn_of_levels

__all__ = ["join", "over", "snow"]

PAPER_WHITE = 250 / 255


def _background(background: object, channels: Sequence[int]) -> tuple[Array, Array]:
    """Return the picture as (H, W, C) of a dtype that kernels read, and as it came."""
    given = check.numbers("background", background)
    planes = given[..., None] if given.ndim == 2 and 1 in channels else given
    if planes.ndim != 3 or planes.shape[2] not in channels:
        wanted = " or ".join(["(H, W)"] * (1 in channels) + [f"(H, W, {c})" for c in channels])
        raise ValueError(f"background must have shape {wanted}, got {given.shape}")
    if 0 in planes.shape:
        raise ValueError(f"background must not be empty, got shape {given.shape}")
    warn_of_levels("background", planes, "divide it by 255")
    # Kernels read all but float16, which is mixed in float32.
    kind = np.dtype(np.float32) if given.dtype == np.float16 else given.dtype
    return check.aligned(planes, kind), given


def snow(
    background: ArrayLike, alpha: ArrayLike, *,
    intensity: float | Sequence[float] = PAPER_WHITE, out: Array | None = None,
) -> Array:  # fmt: skip
    """Snow of one color over a picture: ``intensity * alpha + (1 - alpha) * background``.

    Langer 2004, Eq. 7, which mixes display values; give linear light and get linear light. It has
    the shape and dtype of `background`, integers rounded. Where alpha is 0 the background's bits
    are kept; NaN in the background stays where it was.

    Parameters
    ----------
    background : (H, W) or (H, W, 1 or 3)
        uint8 or uint16 of full scale 1, or floats as they are. Never written to.
    alpha : (H, W)
        Opacity, 0 to 1, float.
    intensity : float or RGB
        Color of the snow as a fraction of full scale, above 1 for bright snow in linear light. The
        default is the paper's 250 of 255.
    """
    planes, given = _background(background, (1, 3))
    cover = check.plane_of("alpha", alpha, planes.shape[:2])
    check.shares("alpha", cover)
    levels, channels = check.bounded("intensity", intensity), planes.shape[2]
    if levels.shape not in ((1,), (channels,)) or levels.min() < 0.0:
        wanted = f"one number or {channels}, at least 0"
        raise ValueError(f"intensity must be {wanted}, got {check._came(intensity)}")
    color = np.broadcast_to(levels, channels).tolist()
    result = check.output(out, given.shape, given.dtype, given, cover)
    shape = planes.shape
    return check.filled(
        result, planes.dtype, lambda view: _core.snow(view.reshape(shape), planes, cover, color)
    )


def over(background: ArrayLike, layer: ArrayLike, *, out: Array | None = None) -> Array:
    """Premultiplied RGBA layer over a picture: ``layer + (1 - layer alpha) * background``.

    Parameters
    ----------
    background : (H, W, 3) or (H, W, 4)
        uint8 or uint16 of full scale 1, or floats, which the result is, too; four channels are
        premultiplied. Never written to.
    layer : (H, W, 4)
        Premultiplied RGBA, float, full scale 1, in the light of the background.
    """
    planes, given = _background(background, (3, 4))
    front, _ = check.pixels("layer", layer, ndim=3)
    if front.shape != (*planes.shape[:2], 4):
        raise ValueError(f"layer must have shape {(*planes.shape[:2], 4)}, got {front.shape}")
    check.shares("layer: alpha", front[..., 3])
    check.finite("layer", front)
    result = check.output(out, given.shape, given.dtype, given, front)
    return check.filled(result, planes.dtype, lambda view: _core.over(view, planes, front))


def join(
    layers: Sequence[ArrayLike], *, haze: float = 0.0, matte: ArrayLike | None = None,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Opacity of layers of one color together, behind a matte.

    It is ``(1 - (1 - haze) prod (1 - alpha_i)) (1 - matte)``, in the dtype of the layers.

    Parameters
    ----------
    layers : sequence of (H, W)
        Opacities, at least one, in any order; all of one dtype, float32 or float64.
    haze : float
        An even veil, 0 to 1.
    matte : (H, W), optional
        What stands in front of them all: 1 hides them.
    """
    single = isinstance(layers, np.ndarray) and layers.ndim == 0
    if single or not isinstance(layers, (list, tuple, np.ndarray)):
        raise TypeError(f"layers must be a sequence of opacities, got {check._came(layers)}")
    if len(layers) == 0:
        raise ValueError("layers must hold at least one opacity, got none")
    first, kept = check.pixels("layers[0]", layers[0], ndim=2)
    planes = []
    for index, layer in enumerate(layers):
        plane, _ = check.pixels(f"layers[{index}]", layer, ndim=2)
        if plane.dtype != first.dtype or plane.shape != first.shape:
            raise ValueError(
                f"layers must agree: layers[0] is {first.dtype} {first.shape}, "
                f"layers[{index}] is {plane.dtype} {plane.shape}"
            )
        check.shares(f"layers[{index}]", plane)
        planes.append(plane)
    veil = check.real("haze", haze, low=0.0, high=1.0)
    front = None
    if matte is not None:
        front = check.aligned(check.plane_of("matte", matte, first.shape), first.dtype)
        check.shares("matte", front)
    result = check.output(out, first.shape, kept, *planes, *([] if front is None else [front]))
    return check.filled(result, first.dtype, lambda view: _core.join(view, planes, veil, front))

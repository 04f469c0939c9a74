"""Two eyes: their cameras, and pictures that show both (Johnson 2005, section 4).

The eyes stand side by side on the camera's x axis and look the same way.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flurries import _contract as check
from flurries._contract import LARGEST, SMALLEST, Array, ArrayLike, choice, flag, output, real
from flurries._threads import reproducible
from flurries.camera.lens import Camera, expect_camera
from flurries.io.color import encode_bytes, linear_to_srgb, to_integer, to_linear

__all__ = ["anaglyph", "eyes", "over_under", "side_by_side"]

# Dubois' least squares projections for red and cyan glasses, linear light: rows red, green, blue of
# what is shown, columns red, green, blue of an eye's picture.
MATRICES = {
    "lsq2001": (
        ((0.4561, 0.500484, 0.176381), (-0.0400822, -0.0378246, -0.0157589),
         (-0.0152161, -0.0205971, -0.00546856)),
        ((-0.0434706, -0.0879388, -0.00155529), (0.378476, 0.73364, -0.0184503),
         (-0.0721527, -0.112961, 1.2264)),
    ),
    "lcd2009": (
        ((0.437, 0.449, 0.164), (-0.062, -0.062, -0.024), (-0.048, -0.050, -0.017)),
        ((-0.011, -0.032, -0.007), (0.377, 0.761, 0.009), (-0.026, -0.093, 1.234)),
    ),
}  # fmt: skip

_ROWS = 64  # Rows of a picture that are worked on together: they stay in the cache.


def eyes(
    camera: Camera, *, distance: float, convergence: float | None = None
) -> tuple[Camera, Camera]:
    """Return the left and the right eye of a camera.

    Their `offset` is less and more by half the distance along x, their `center_shift` by ``focal
    distance / (2 convergence)`` px the other way: a point at depth Z is seen ``focal distance (1/Z
    - 1/convergence)`` px farther left by the right eye than by the left.

    Parameters
    ----------
    camera : Camera
        The camera between the eyes.
    distance : float
        Distance between the eyes, world units, 0 or more; people's eyes are 0.065 m apart.
    convergence : float, optional
        Depth in world units that both eyes see at one place of the picture; nearer things come out
        of it. If not given the eyes look straight ahead and infinity is there.
    """
    middle = expect_camera(camera, stretched=True)
    half = 0.5 * real("distance", distance, low=0.0, high=LARGEST)
    shift = 0.0
    if convergence is not None:
        away = real("convergence", convergence, low=SMALLEST)
        shift = middle.focal * half / away
        if shift > LARGEST:
            raise ValueError(f"convergence must be farther away, got {away:g}")
    x, y, z = middle.offset
    cx, cy = middle.center_shift
    left, right = (
        replace(middle, offset=(x + side * half, y, z), center_shift=(cx + side * shift, cy))
        for side in (-1.0, 1.0)
    )
    return left, right


def anaglyph(
    left: ArrayLike, right: ArrayLike, *, matrix: str = "lsq2001", out: Array | None = None
) -> Array:
    """Return one picture (H, W, 3) for red and cyan glasses, like `left` in dtype and light.

    It is clipped once to 0..1 in linear light. Grey that both eyes see stays grey, to 1e-3.

    Parameters
    ----------
    left, right : (H, W, 3)
        Pictures of one shape and dtype: floats in linear light, or uint8 or uint16 sRGB.
    matrix : {"lsq2001", "lcd2009"}
        Dubois' projection of 2001, or the one for flat screens of 2009.

    Notes
    -----
    E. Dubois, "A projection method to generate anaglyph stereo images", ICASSP 2001. The projection
    is one of light: on display values it would be off by .03 on average and .3 at worst.
    """
    first, second = _pair(left, right, (3,))
    toward = [np.array(m) for m in MATRICES[choice("matrix", matrix, tuple(MATRICES))]]
    result = output(out, first.shape, first.dtype, first, second)
    working = np.float64 if first.dtype == np.float64 else np.float32
    encoding = "display" if first.dtype.kind == "u" else "linear"
    for top in range(0, len(first), _ROWS):
        rows = slice(top, top + _ROWS)
        light = np.zeros(first[rows].shape, working)
        for picture, way in zip((first, second), toward, strict=True):
            part = to_linear(picture[rows], encoding).astype(working, copy=False)
            light += _mixed(part, np.ascontiguousarray(way.T, dtype=working))
        np.clip(light, 0.0, 1.0, out=light)
        result[rows] = _shown(light, result.dtype)
    return result


def side_by_side(
    left: ArrayLike, right: ArrayLike, *, cross: bool = False, out: Array | None = None
) -> Array:
    """Return both pictures next to each other, (H, 2 W, ...), in their dtype.

    Parameters
    ----------
    left, right : (H, W) or (H, W, C)
        Pictures of the two eyes: uint8, uint16 or float, both of one shape and dtype.
    cross : bool
        Whether the right eye's picture comes first, for crossed eyes.
    """
    pair = _pair(left, right, None)
    return _packed(pair[::-1] if flag("cross", cross) else pair, 1, out)


def over_under(left: ArrayLike, right: ArrayLike, *, out: Array | None = None) -> Array:
    """Return pictures as :func:`side_by_side` does, but the left above, (2 H, W, ...)."""
    return _packed(_pair(left, right, None), 0, out)


def _packed(pair: tuple[Array, Array], axis: int, out: Any) -> Array:
    shape = list(pair[0].shape)
    shape[axis] *= 2
    result = output(out, tuple(shape), pair[0].dtype, *pair)
    return np.concatenate(pair, axis=axis, out=result)


def _pair(
    left: ArrayLike, right: ArrayLike, channels: tuple[int, ...] | None
) -> tuple[Array, Array]:
    """Return two pictures of one shape and native dtype."""
    pictures = []
    for name, picture in (("left", left), ("right", right)):
        array = check.numbers(name, picture)
        fits = array.ndim == 3 and array.shape[2] in channels if channels else array.ndim in (2, 3)
        if not fits or 0 in array.shape:
            wanted = "(H, W, 3)" if channels else "(H, W) or (H, W, C)"
            raise ValueError(f"{name} must be {wanted}, got shape {array.shape}")
        pictures.append(array)
    first, second = pictures
    if first.shape != second.shape or first.dtype != second.dtype:
        raise ValueError(
            f"right must be like left ({first.dtype} {first.shape}), "
            f"got {second.dtype} {second.shape}"
        )
    return first, second


def _mixed(light: Array, matrix: Array) -> Array:
    if not reproducible():
        return np.asarray(light @ matrix)
    # Libraries of linear algebra round as their processor likes.
    red, green, blue = (light[..., i, None] * matrix[i] for i in range(3))
    return np.asarray(red + green + blue)


def _shown(light: Array, dtype: np.dtype[Any]) -> Array:
    """Return linear light of 0 to 1 in the dtype and the light of a picture."""
    if dtype.kind == "f":
        return light
    if dtype == np.uint16:
        return to_integer(linear_to_srgb(light), 16)
    return encode_bytes(light)

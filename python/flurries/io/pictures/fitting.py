"""Fitting a picture into a frame of another size."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from flurries._contract import choice, rectangular
from flurries.io.color import Array, linear_to_srgb, to_integer, to_linear, to_unit
from flurries.io.oiio import last_error, openimageio

_FILTER = "lanczos3"

# Pixels that are turned into light at a time.
_CHUNK = 1 << 20
Fit: TypeAlias = Literal["cover", "contain", "stretch"]


def fit(
    pixels: npt.ArrayLike, size: Sequence[int], how: Fit = "cover", *, encoding: str | None = None
) -> Array:
    """Resize a picture to `size`, through a Lanczos filter of three lobes.

    Filtering happens in linear light, in float32. Ringing is cut at the smallest and the largest
    value of each channel; a lamp of a single pixel gains light by that, up to a third. A picture
    that has the size already comes back as an unchanged copy.

    Parameters
    ----------
    pixels : array_like
        (H, W), (H, W, 1), (H, W, 3) or (H, W, 4); uint8, uint16 or float, kept. A fourth channel is
        alpha: the colors of floats are multiplied by it, those of integers are not.
    size : (int, int)
        (width, height) in px.
    how : {"cover", "contain", "stretch"}
        Keep the aspect and fill the frame, cutting off both sides; keep the aspect and
        show all, with black bars (transparent with alpha); or let both directions go their own way.
    encoding : {"display", "linear"}, optional
        What the numbers are; by default integers are display values and floats linear light.
    """
    array = rectangular("pixels", pixels)
    if array.dtype.name not in ("uint8", "uint16", "float16", "float32", "float64"):
        raise TypeError(f"pixels must be uint8, uint16 or float, got {array.dtype}")
    if (
        array.ndim not in (2, 3)
        or 0 in array.shape
        or array.shape[2:] not in ((), (1,), (3,), (4,))
    ):
        raise ValueError(f"pixels must be (H, W) or (H, W, 1, 3 or 4), got {array.shape}")
    width, height = checked_size(size)
    choice("how", how, get_args(Fit))
    integers = array.dtype.kind == "u"
    if encoding is None:
        encoding = "display" if integers else "linear"
    if encoding not in ("display", "linear"):
        raise ValueError(f"encoding must be 'display' or 'linear', got {encoding!r}")
    if array.shape[:2] == (height, width):
        return array.astype(array.dtype.newbyteorder("="))
    planes = array[..., np.newaxis] if array.ndim == 2 else array
    resized = _resize(_Light(planes, encoding, straight=integers), width, height, how)
    values = _from_light(resized, encoding, straight=integers)
    if integers:
        result = to_integer(values, 8 * array.dtype.itemsize)
    else:
        result = values.astype(array.dtype.newbyteorder("="))
    return result[..., 0] if array.ndim == 2 else result


def fit_nearest(plane: npt.ArrayLike, size: Sequence[int]) -> Array:
    """Scale data to cover a frame as `fit` does a picture, without making values in between.

    Parameters
    ----------
    plane : (h, w) array
        Numbers of which no mean may be taken, such as depths. A pixel of the frame gets the value
        of the pixel that its centre falls into.
    size : (int, int)
        (width, height) in px.
    """
    width, height = checked_size(size)
    array = rectangular("plane", plane)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"plane must hold numbers, got {array.dtype}")
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"plane must have shape (h, w) and not be empty, got {array.shape}")
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    rows, columns = array.shape
    scale = max(width / columns, height / rows)
    places = []
    for length, stored in ((height, rows), (width, columns)):
        scaled = _scaled(stored * scale, length)
        first = (scaled - length) // 2
        at = (np.arange(length) + first + 0.5) * (stored / scaled)
        places.append(np.clip(at.astype(np.int64), 0, stored - 1))
    return np.ascontiguousarray(array[np.ix_(*places)])


def checked_size(size: Sequence[int], most: int = 2**16) -> tuple[int, int]:
    if not isinstance(size, (Sequence, np.ndarray)) or isinstance(size, (str, bytes)):
        raise TypeError(f"size must be (width, height), got {size!r:.60}")
    if len(size) != 2:
        raise ValueError(f"size must be (width, height), got {size!r}")
    try:
        width, height = operator.index(size[0]), operator.index(size[1])
    except TypeError:
        raise TypeError(f"size must be two integers, got {size!r}") from None
    if not (1 <= width <= most and 1 <= height <= most):
        raise ValueError(f"size must be from 1 to {most} px each way, got {width} x {height}")
    return width, height


class _Light:
    """A picture in linear light multiplied by alpha, made some rows at a time; see `fit`."""

    def __init__(self, planes: Array, encoding: str, *, straight: bool) -> None:
        library = openimageio()
        self.shape = rows, columns, channels = planes.shape
        self.buffer = library.ImageBuf(library.ImageSpec(columns, rows, channels, "float"))
        low = np.full(columns * channels, np.nan, np.float32)
        high = low.copy()
        step = max(_CHUNK // columns, 1)
        for top in range(0, rows, step):
            light = _to_light(planes[top : top + step], encoding, straight=straight)
            light = np.ascontiguousarray(light, np.float32)
            region = library.ROI(0, columns, top, top + len(light), 0, 1, 0, channels)
            self.buffer.set_pixels(region, light)
            # Of whole rows first: three numbers at a time would take as long as the rest.
            flat = light.reshape(len(light), -1)
            np.fmin(low, np.fmin.reduce(flat), out=low)
            np.fmax(high, np.fmax.reduce(flat), out=high)
        self.low = np.fmin.reduce(low.reshape(columns, channels))
        self.high = np.fmax.reduce(high.reshape(columns, channels))


def _to_light(planes: Array, encoding: str, *, straight: bool) -> Array:
    """Return rows of a picture as linear light multiplied by alpha."""
    light = to_linear(planes[..., :3], encoding)
    if planes.shape[2] < 4:
        return light
    alpha = to_unit(planes[..., 3:])
    return np.concatenate([light * alpha if straight else light, alpha], axis=-1)


def _from_light(light: Array, encoding: str, *, straight: bool) -> Array:
    """Return display values, straight where they came straight."""
    color, alpha = light[..., :3], light[..., 3:]
    if alpha.shape[2] and straight:
        color = np.divide(color, alpha, out=color.copy(), where=alpha > 0)
    if encoding == "display":
        color = linear_to_srgb(color)
    return np.concatenate([color, alpha], axis=-1)


def _resize(light: _Light, width: int, height: int, how: str) -> Array:
    """Scale the picture and take the central part, or put it in the middle of a black frame."""
    library = openimageio()
    rows, columns, channels = light.shape
    across, down = width / columns, height / rows
    if how != "stretch":
        across = down = max(across, down) if how == "cover" else min(across, down)
    scaled_width = _scaled(columns * across, width)
    scaled_height = _scaled(rows * down, height)
    left, top = (scaled_width - width) // 2, (scaled_height - height) // 2
    across, down = min(scaled_width, width), min(scaled_height, height)
    spec = library.ImageSpec(across, down, channels, "float")
    spec.x, spec.y = max(left, 0), max(top, 0)
    spec.full_x, spec.full_y = 0, 0
    spec.full_width, spec.full_height = scaled_width, scaled_height
    target = library.ImageBuf(spec)
    region = library.ROI(spec.x, spec.x + across, spec.y, spec.y + down, 0, 1, 0, channels)
    if not library.ImageBufAlgo.resize(target, light.buffer, _FILTER, 0.0, region):
        words = last_error(target, light.buffer)
        if "allocate" in words:
            raise MemoryError(f"size {across} x {down}: {words}")
        raise RuntimeError(f"the picture could not be resized: {words}")
    pixels = np.asarray(target.get_pixels("float"), np.float32).reshape(down, across, channels)
    resized = np.clip(pixels, light.low, light.high)
    if (down, across) == (height, width):
        return resized
    framed = np.zeros((height, width, channels), np.float32)
    y, x = max(-top, 0), max(-left, 0)
    framed[y : y + down, x : x + across] = resized
    return framed


def _scaled(exact: float, wanted: int) -> int:
    """Return the scaled length that is nearest to the exact one and has the parity of `wanted`."""
    # The parity keeps the picture's middle in the frame's: half a pixel of drift would show.
    if math.isclose(exact, wanted, rel_tol=1e-9):
        return wanted
    scaled = wanted + 2 * round((exact - wanted) / 2)
    return scaled if scaled > 0 else 1 + (wanted + 1) % 2

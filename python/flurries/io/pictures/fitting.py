"""Fitting a picture into a frame of another size."""

import math
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np

from flurries._contract import Array, ArrayLike, choice, integer, is_pair, rectangular
from flurries.io.color import encoding_of, light_of, linear_to_srgb, planes_of, to_integer
from flurries.io.oiio import last_error, openimageio

_FILTER = "lanczos3"

# Pixels that are turned into light at a time.
_CHUNK = 1 << 20
Fit: TypeAlias = Literal["cover", "stretch"]


def fit(
    pixels: ArrayLike, size: Sequence[int], how: Fit = "cover", *, encoding: str | None = None
) -> Array:
    """Resize a picture to `size`, (width, height) px, through a Lanczos filter of three lobes.

    Filtering happens in linear light, in float32. Ringing is cut at the smallest and the largest
    value of each channel; a lamp of a single pixel gains light by that, up to a third. A picture
    that has the size already comes back as an unchanged copy.

    Parameters
    ----------
    pixels : array_like
        (H, W), (H, W, 1), (H, W, 3) or (H, W, 4); uint8, uint16 or float, kept. A fourth channel is
        alpha: the colors of floats are multiplied by it, those of integers are not.
    how : {"cover", "stretch"}
        Keep the aspect and fill the frame, cutting off both sides; or let both directions go their
        own way.
    encoding : {"display", "linear"}, optional
        What the numbers are; by default integers are display values and floats linear light.
    """
    planes = planes_of("pixels", pixels)
    width, height = checked_size(size)
    choice("how", how, Fit)
    encoding, shape = encoding_of(encoding, planes), (height, width, *np.shape(pixels)[2:])
    if planes.shape[:2] == (height, width):
        return np.array(planes).reshape(shape)
    integers = planes.dtype.kind == "u"
    light = _resize(*_lit(planes, encoding), width, height, how)
    color, alpha = light[..., :3], light[..., 3:]
    if alpha.shape[2] and integers:
        color = np.divide(color, alpha, out=color.copy(), where=alpha > 0)
    if encoding == "display":
        color = linear_to_srgb(color)
    values = np.concatenate([color, alpha], axis=-1)
    if integers:
        return to_integer(values, 8 * planes.dtype.itemsize).reshape(shape)
    return values.astype(planes.dtype).reshape(shape)


def fit_nearest(plane: ArrayLike, size: Sequence[int]) -> Array:
    """Scale data (h, w) to cover a frame as `fit` does, without values in between: by centres."""
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
        at = (np.arange(length) + (scaled - length) // 2 + 0.5) * (stored / scaled)
        places.append(np.clip(at.astype(np.int64), 0, stored - 1))
    return np.ascontiguousarray(array[np.ix_(*places)])


def checked_size(size: Sequence[int], most: int = 2**16) -> tuple[int, int]:
    if not is_pair(size):
        raise ValueError(f"size must be (width, height), got {size!r:.60}")
    width, height = (integer("size", side, low=1, high=most) for side in size)
    return width, height


def _lit(planes: Array, encoding: str) -> tuple[Any, Array, Array]:
    """Return a picture in linear light multiplied by alpha, its least and its largest values."""
    library = openimageio()
    rows, columns, channels = planes.shape
    buffer = library.ImageBuf(library.ImageSpec(columns, rows, channels, "float"))
    low, high = np.full((2, channels), np.nan, np.float32)
    step = max(_CHUNK // columns, 1)
    for top in range(0, rows, step):
        light = np.ascontiguousarray(light_of(planes[top : top + step], encoding), np.float32)
        buffer.set_pixels(library.ROI(0, columns, top, top + len(light), 0, 1, 0, channels), light)
        # One channel after the other: three numbers at a time take ten times as long.
        each = [light[..., channel].reshape(-1) for channel in range(channels)]
        low = np.fmin(low, [np.fmin.reduce(values) for values in each])
        high = np.fmax(high, [np.fmax.reduce(values) for values in each])
    return buffer, low, high


def _resize(buffer: Any, low: Array, high: Array, width: int, height: int, how: str) -> Array:
    """Scale the picture and take the central part."""
    library, stored = openimageio(), buffer.spec()
    across, down = width / stored.width, height / stored.height
    if how != "stretch":
        across = down = max(across, down)
    scaled_width = _scaled(stored.width * across, width)
    scaled_height = _scaled(stored.height * down, height)
    spec = library.ImageSpec(width, height, stored.nchannels, "float")
    # What the frame cuts off of the scaled picture.
    spec.x, spec.y = (scaled_width - width) // 2, (scaled_height - height) // 2
    spec.full_x, spec.full_y = 0, 0
    spec.full_width, spec.full_height = scaled_width, scaled_height
    target = library.ImageBuf(spec)
    if not library.ImageBufAlgo.resize(target, buffer, _FILTER, 0.0, spec.roi):
        words = last_error(target, buffer)
        if "allocate" in words:
            raise MemoryError(f"size {width} x {height}: {words}")
        raise RuntimeError(f"the picture could not be resized: {words}")
    pixels = np.asarray(target.get_pixels("float"), np.float32).reshape(height, width, -1)
    return np.clip(pixels, low, high, out=pixels)


def _scaled(exact: float, wanted: int) -> int:
    """Return the scaled length that is nearest to the exact one and has the parity of `wanted`."""
    # The parity keeps the picture's middle in the frame's: half a pixel of drift would show.
    if math.isclose(exact, wanted, rel_tol=1e-9):
        return wanted
    scaled = wanted + 2 * round((exact - wanted) / 2)
    return scaled if scaled > 0 else 1 + (wanted + 1) % 2

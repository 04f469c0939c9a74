"""Reading pictures: any format that OpenImageIO knows, as colors, alpha and an encoding."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from flurries.io.color import Array, Encoding, to_unit
from flurries.io.headers import Opened, open_picture

# What luminance is made of, Rec. 709.
_GREEN, _BLUE = 0.7152, 0.0722


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as it was read.

    Attributes
    ----------
    pixels : ndarray
        (H, W, 3), uint8, uint16 or float32. Grey pictures have three equal channels.
    alpha : ndarray or None
        (H, W) float32 from 0 to 1, or None if the picture has none.
    encoding : str
        ``"display"``: the numbers are what a screen is sent (sRGB). ``"linear"``: they are
        proportional to light.
    path : str
        The file that it came from.
    premultiplied : bool
        Whether `pixels` are multiplied by `alpha` already, as in EXR; PNG's are not.
    """

    pixels: Array
    alpha: Array | None
    encoding: Encoding
    path: str
    premultiplied: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.pixels.shape[1], self.pixels.shape[0]


def read_picture(path: str | os.PathLike[str]) -> Picture:
    """Read a picture.

    The display window of an EXR is what comes: stored pixels outside it are cut off, pixels of it
    that are not stored are black and transparent. Orientation marks, which telephones set, are
    honoured. Floats (EXR, HDR, float TIFF) are linear light, half becomes float32, and integers
    are display values: 8 and 16 bits stay as they are, other widths become float32 from 0 to 1. Of
    an EXR with layers the channels R, G, B and A come, or else those of its first layer.

    Parameters
    ----------
    path : str or path
        PNG, JPEG, EXR, TIFF, HDR, WebP, or what else OpenImageIO reads.

    Returns
    -------
    Picture
        All of it. A file that broke off is an error, never a half-grey picture.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    OSError
        If the file is empty, cut short or damaged. The message names it.
    ValueError
        If it is not a picture of a known format, or of a kind that is not supported (deep pixels,
        chroma subsampled EXR).
    """
    opened = open_picture(path)
    pixels, alpha = _decode(opened)
    opened.reader.close()
    return Picture(
        pixels=pixels,
        alpha=alpha,
        encoding=opened.encoding,
        path=str(opened.path),
        premultiplied=alpha is not None and opened.premultiplied,
    )


def read_mask(path: str | os.PathLike[str]) -> Array:
    """Read a mask: the alpha channel if the picture has one, else its luminance as stored.

    A mask is data, so display values are not decoded: the grey level 128 of 255 is 0.502.

    Returns
    -------
    ndarray
        (H, W) float32 from 0 to 1; values outside are clipped and NaN counts as 0.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `read_picture`.
    """
    picture = read_picture(path)
    if picture.alpha is None:
        return luminance(picture)
    mask: Array = np.clip(np.nan_to_num(picture.alpha, nan=0.0), 0.0, 1.0)
    return mask


def luminance(picture: Picture) -> Array:
    """Return (H, W) float32 from 0 to 1: the luminance of the numbers as stored."""
    values = np.clip(np.nan_to_num(to_unit(picture.pixels), nan=0.0), 0.0, 1.0)
    red, green, blue = np.moveaxis(values, -1, 0)
    # Written as differences, so that grey pictures give their grey level exactly.
    grey: Array = red + np.float32(_GREEN) * (green - red) + np.float32(_BLUE) * (blue - red)
    return grey


def _decode(opened: Opened) -> tuple[Array, Array | None]:
    """Return the colors (H, W, 3) and the alpha, window and orientation applied."""
    wanted = [*opened.color, *([] if opened.alpha is None else [opened.alpha])]
    first, last = min(wanted), max(wanted) + 1
    stored_type = opened.stored_type
    asked_type = stored_type if stored_type in ("uint8", "uint16") else "float"
    values = opened.reader.read_image(opened.part, 0, first, last, asked_type)
    if values is None:
        raise opened.failure("the picture is damaged or cut short")
    # libjpeg fills what is missing with grey, returns it as a success, and leaves a message.
    if opened.reader.has_error:
        raise opened.failure("the picture is damaged or cut short")
    values = values.reshape(*values.shape[:2], last - first)
    values = seen(values, opened)
    color = values[..., [place - first for place in opened.color]]
    pixels = np.repeat(color, 3, axis=-1) if color.shape[-1] == 1 else color
    if opened.alpha is None:
        return np.ascontiguousarray(pixels), None
    alpha = np.ascontiguousarray(to_unit(values[..., opened.alpha - first]))
    return np.ascontiguousarray(pixels), alpha


def seen(values: Array, opened: Opened, outside: float = 0.0) -> Array:
    """Return what the user sees of the stored values: the display window, upright.

    Pixels of the window that are not stored get the value `outside`.
    """
    left, top, width, height = opened.window
    stored_height, stored_width = values.shape[:2]
    if (left, top, width, height) != (0, 0, stored_width, stored_height):
        shown = np.full((height, width, values.shape[2]), outside, values.dtype)
        rows = slice(max(top, 0), max(min(top + height, stored_height), 0))
        columns = slice(max(left, 0), max(min(left + width, stored_width), 0))
        part = values[rows, columns]
        y, x = max(-top, 0), max(-left, 0)
        shown[y : y + part.shape[0], x : x + part.shape[1]] = part
        values = shown
    return upright(values, opened.orientation)


def upright(values: Array, orientation: int) -> Array:
    """Turn and mirror an array as its EXIF orientation asks."""
    if orientation in (5, 7):
        values = values.swapaxes(0, 1)
        return values if orientation == 5 else values[::-1, ::-1]
    if orientation in (2, 4):
        return values[:, ::-1] if orientation == 2 else values[::-1]
    return np.rot90(values, {3: 2, 6: -1, 8: 1}.get(orientation, 0))

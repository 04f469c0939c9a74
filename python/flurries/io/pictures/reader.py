"""Reading pictures: any format that OpenImageIO knows, as colors, alpha and an encoding."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import depths
from flurries._warnings import warn_of_units
from flurries.io.color import Array, Encoding, to_unit
from flurries.io.files import Budget
from flurries.io.pictures.header import Opened, opened_picture
from flurries.io.pictures.samples import two_depths

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
    display : (left, top, width, height) or None
        Where the display window lies in a picture that was read with its overscan.
    """

    pixels: Array
    alpha: Array | None
    encoding: Encoding
    path: str
    premultiplied: bool = False
    display: tuple[int, int, int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def rgba(self) -> Array:
        """Return (H, W, 4) in the pixels' dtype: floats multiplied by alpha, integers not.

        A picture without alpha is opaque.
        """
        result = np.empty((*self.pixels.shape[:2], 4), self.pixels.dtype)
        result[..., :3] = self.pixels
        opaque = np.iinfo(result.dtype).max if result.dtype.kind == "u" else 1
        if self.alpha is None:
            result[..., 3] = opaque
        elif result.dtype.kind == "u":
            np.rint(self.alpha * np.float32(opaque), out=result[..., 3], casting="unsafe")
        else:
            result[..., 3] = self.alpha
            if not self.premultiplied:
                result[..., :3] *= result[..., 3:]
        return result


def read_picture(
    path: str | os.PathLike[str], *, budget: Budget | None = None, overscan: bool = False
) -> Picture:
    """Read a picture.

    Of an EXR comes its display window: pixels outside it are cut off, pixels of it that are not
    stored are black and transparent; of its channels R, G, B and A, or else those of its first
    layer. Orientation marks are honoured. Floats are linear light, half becomes float32; integers
    are display values: 8 and 16 bits stay as they are, other widths become float32 from 0 to 1.

    Parameters
    ----------
    path : str or path
        PNG, JPEG, EXR, TIFF, HDR, WebP, or what else OpenImageIO reads.
    budget : Budget, optional
        How large it may be; ``Budget()`` if not given.
    overscan : bool
        All that is stored comes, and the display window is where `Picture.display` says.
    """
    with opened_picture(path, budget, overscan=overscan) as opened:
        pixels, alpha = _decode(opened)
        return Picture(
            pixels=pixels,
            alpha=alpha,
            encoding=opened.encoding,
            path=str(opened.path),
            premultiplied=alpha is not None and opened.premultiplied,
            display=opened.display,
        )


def luminance(picture: Picture) -> Array:
    """Return (H, W) float32 from 0 to 1: the luminance of the numbers as stored."""
    values = np.clip(np.nan_to_num(to_unit(picture.pixels), nan=0.0), 0.0, 1.0)
    red, green, blue = np.moveaxis(values, -1, 0)
    # Written as differences, so that grey pictures give their grey level exactly.
    grey: Array = red + np.float32(_GREEN) * (green - red) + np.float32(_BLUE) * (blue - red)
    return grey


def _decode(opened: Opened) -> tuple[Array, Array | None]:
    """Return the colors (H, W, 3) and the alpha, window and orientation applied."""
    stored = opened.stored_type
    # A grey picture gets its one channel three times.
    groups = [opened.color if len(opened.color) == 3 else opened.color * 3]
    if opened.alpha is not None:
        groups.append((opened.alpha,))
    kind = stored if stored in ("uint8", "uint16") else "float"
    pixels, *alpha = map(opened.shown, opened.read_groups(groups, kind))
    cover = np.ascontiguousarray(to_unit(alpha[0][..., 0])) if alpha else None
    return np.ascontiguousarray(pixels), cover


# What programs call the channel, alone or at the end of a layer's name.
_NAMES = ("Z", "z", "depth", "Depth", "DEPTH")


def read_depth(
    path: str | os.PathLike[str], *, budget: Budget | None = None, overscan: bool = False
) -> Array:
    """Read the depth channel of a picture, (H, W) float32.

    Outside an EXR's data window it is infinity. A deep EXR has two depths in a pixel: (H, W, 3), a
    near one, that of what is seen behind it, and the share of the pixel that the near one hides.

    Parameters
    ----------
    path : str or path
        EXR or TIFF with a float channel named "Z" or "depth", alone or at the end of a layer's name
        (``ViewLayer.Depth.Z``), in any part; or with a single float channel.
    budget, overscan
        As `read_picture`.
    """
    with opened_picture(path, budget, overscan=overscan, deep=True) as opened:
        part, channel = _channel_of(opened)
        if opened.reader.spec(part).deep:
            return two_depths(opened, part, channel)
        plane = opened.read([channel], "float", part=part)
        shown = np.ascontiguousarray(opened.shown(plane, np.inf)[..., 0])
    warn_of_units("depth", shown)
    return depths(f"{opened.path}: depth", shown)


def _channel_of(opened: Opened) -> tuple[int, int]:
    specs = opened.parts()
    for ending in (False, True):
        for wanted in _NAMES:
            for part, spec in enumerate(specs):
                for channel, name in enumerate(spec.channelnames):
                    short = name.rpartition(".")[2] if ending else name
                    if short == wanted and _is_float(spec, channel):
                        return part, channel
    if len(specs) == 1 and specs[0].nchannels == 1 and _is_float(specs[0], 0):
        return 0, 0
    names = ", ".join(name for spec in specs for name in spec.channelnames)
    raise ValueError(
        f"{opened.path}: no float channel 'Z' or 'depth' among {names}; a grey picture becomes "
        "depths through DepthMap"
    )


def _is_float(spec: Any, channel: int) -> bool:
    return str(spec.channelformat(channel)) in ("half", "float", "double")


def require_depth(path: Path, budget: Budget | None) -> None:
    """Refuse a file without depth, before any frame is asked for."""
    with opened_picture(path, budget, deep=True) as opened:
        _channel_of(opened)

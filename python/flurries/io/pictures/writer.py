"""Writing pictures: one call for every format, the colors encoded as the format wants them."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import choice, integer
from flurries.io.color import (
    Array,
    encoding_of,
    numbers,
    to_display,
    to_half,
    to_integer,
    to_linear,
    to_single,
    to_unit,
)
from flurries.io.oiio import openimageio
from flurries.io.pictures import metadata as header
from flurries.io.pictures.rows import Part, write_parts, write_whole
from flurries.io.pictures.slate import Slate


@dataclass(frozen=True)
class Format:
    """The bits, floats and alpha that a file format can hold."""

    name: str
    bits: tuple[int, ...] = ()
    floats: bool = False
    alpha: bool = True
    lossless: bool = True

    @property
    def kinds(self) -> tuple[int | str, ...]:
        """The kinds of a color: numbers of bits, or "half" and "float"."""
        floats = ("half", "float") if self.name == "openexr" else ("float",) * self.floats
        return (*self.bits, *floats)


FORMATS = {
    ".dpx": Format("dpx", bits=(8, 10, 16), alpha=False),
    ".exr": Format("openexr", floats=True),
    ".hdr": Format("hdr", floats=True, alpha=False, lossless=False),
    ".jpeg": Format("jpeg", bits=(8,), alpha=False, lossless=False),
    ".jpg": Format("jpeg", bits=(8,), alpha=False, lossless=False),
    ".png": Format("png", bits=(8, 16)),
    ".tif": Format("tiff", bits=(8, 16), floats=True),
    ".tiff": Format("tiff", bits=(8, 16), floats=True),
}

# PNG's filter that stores each pixel's difference from the one before, as libpng counts them.
_SUB = 0x10

# Tags of EXIF.
_DESCRIPTION, _ORIENTATION, _SOFTWARE, _MOMENT = 0x010E, 0x0112, 0x0131, 0x0132
_LONGEST_TEXT = 60_000

# How EXR packs pixels, and whether all bits survive it.
COMPRESSIONS = {
    "none": True,
    "rle": True,
    "zips": True,
    "zip": True,
    "piz": True,
    "dwaa": False,
    "dwab": False,
}


def packing(compression: str) -> str:
    """Return OpenImageIO's name of a compression with its level."""
    # Zip at level 1 takes two thirds of the time of OpenEXR's level 4, for 5 in 100 more bytes.
    return f"{compression}:1" if compression.startswith("zip") else compression


def write_picture(
    path: str | os.PathLike[str], pixels: npt.ArrayLike, *, alpha: npt.ArrayLike | None = None,
    encoding: str | None = None, premultiplied: bool | None = None, half: bool = True,
    bits: int | None = None, compression: str = "zip", quality: int = 95,
    metadata: Mapping[str, object] | None = None, slate: Slate | None = None,
) -> None:  # fmt: skip
    """Write a picture; the extension decides about the format.

    The file appears whole or not at all, after it was read back: same size, same channels and, in
    lossless formats, the same bits. The same arguments make the same bytes.

    EXR and HDR hold linear light, PNG and JPEG display values, TIFF either: pixels are converted if
    need be. EXR colors are multiplied by alpha, those of PNG and of integer TIFF are not. Floats
    keep NaN and values above 1 (a half at most 65504); integers clip them, and NaN becomes 0.

    Parameters
    ----------
    path : str or path
        Ends in .dpx, .exr, .hdr, .jpg, .jpeg, .png, .tif or .tiff.
    pixels : array_like
        (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) with alpha; uint8, uint16 or float.
    alpha : array_like, optional
        (H, W) opacity; integers over their maximum, floats from 0 to 1.
    encoding : {"display", "linear"}, optional
        What `pixels` are; by default integers are display values and floats linear light.
    premultiplied : bool, optional
        Whether the colors are multiplied by alpha; by default floats are, integers are not.
    half : bool, default True
        Store EXR as half, 16 bits; False stores 32.
    bits : {8, 10, 16}, optional
        Of integer formats; by default 16 for uint16, else 8. Given for TIFF it turns floats into
        integers. DPX alone has 10.
    compression : {"zip", "zips", "piz", "rle", "none", "dwaa", "dwab"}
        How EXR packs pixels; the last two are lossy.
    quality : int, default 95
        Of JPEG, 1 to 100; colors are not subsampled.
    metadata : mapping of str to str, int or float, optional
        Goes into the header under ``flurries:``; HDR holds none. ``DateTime``, as
        ``2000:01:01 00:00:00``, replaces that fixed moment.
    slate : Slate, optional
        What the plate that it was made of says of itself, see :func:`read_slate`.
    """
    form = format_of(path)
    strings, said = header.checked(metadata), Slate.of(slate)
    color, opacity = _checked_pixels(pixels, alpha)
    encoding = encoding_of(encoding, color)
    if premultiplied is None:
        premultiplied = color.dtype.kind == "f"
    if bits not in (None, 8, 10, 16):
        raise ValueError(f"bits must be 8, 10 or 16, got {bits!r}")
    choice("compression", compression, tuple(COMPRESSIONS))
    integer("quality", quality, low=1, high=100)
    if opacity is not None and not form.alpha:
        raise ValueError(f"{os.fspath(path)}: {form.name} holds no alpha; leave it out or use PNG")
    stored = _stored_type(form, color.dtype, half=half, bits=bits)
    if form.name in ("hdr", "dpx") and color.shape[2] == 1:
        color = np.broadcast_to(color, (*color.shape[:2], 3))

    def band(first: int, last: int) -> Array:
        rows = None if opacity is None else opacity[first:last]
        made = _converted(color[first:last], rows, encoding, premultiplied, stored)
        return _of_ten_bits(made) if bits == 10 else made

    specification = _specification(color.shape, stored, alpha=opacity is not None)
    if form.name == "jpeg":
        try:
            profile = said.profile if said.encoding == "display" else None
            turned = said.value("Orientation") or 1
            data = _encode_jpeg(band(0, color.shape[0]), int(quality), strings, profile, turned)
        except OSError as error:
            raise OSError(f"{os.fspath(path)}: cannot be encoded: {error}") from error
        write_whole(path, Part(specification, band), data)
        return
    floats = stored in ("half", "float")
    said.put(specification, form.name, "linear" if floats else "display", strings)
    if form.name == "openexr":
        specification.attribute("compression", packing(compression))
    elif form.name == "dpx" and bits == 10:
        specification.attribute("oiio:BitsPerSample", 10)
    elif form.name in ("png", "tiff") and stored in ("uint8", "uint16"):
        specification.attribute("oiio:UnassociatedAlpha", 1)
    if form.name == "png":
        # Flakes are noise: more effort takes four times as long for a tenth fewer bytes.
        specification.attribute("png:compressionLevel", 1)
        specification.attribute("png:filter", _SUB)
    lossless = form.lossless and (form.name != "openexr" or COMPRESSIONS[compression])
    write_parts(path, [Part(specification, band)], lossless=lossless)


def _encode_jpeg(
    pixels: Array, quality: int, strings: Mapping[str, str], profile: bytes | None, orientation: int
) -> bytes:
    """Return a baseline JPEG of (H, W, 1 or 3) uint8, colors not subsampled."""
    # OpenImageIO's writer leaves errors to libjpeg's own handler, and that one ends the process:
    # a full disk would take the whole program with it. Pillow encodes to memory and raises.
    from PIL import Image

    image = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    tags = Image.Exif()
    text = header.description(strings)
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"metadata of {len(text)} characters do not fit into a JPEG; use EXR")
    if text:
        tags[_DESCRIPTION] = text
    if orientation != 1:
        tags[_ORIENTATION] = orientation
    tags[_SOFTWARE], tags[_MOMENT] = "flurries", strings["DateTime"]
    buffer = io.BytesIO()
    image.save(
        buffer, "JPEG", quality=quality, subsampling=0, exif=tags.tobytes(), icc_profile=profile
    )
    return buffer.getvalue()


def format_of(path: str | os.PathLike[str]) -> Format:
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(
            f"{os.fspath(path)}: pictures are written as {', '.join(FORMATS)}, not as {suffix!r}"
        )
    return FORMATS[suffix]


def _checked_pixels(
    pixels: npt.ArrayLike, alpha: npt.ArrayLike | None
) -> tuple[Array, Array | None]:
    """Return colors (H, W, 1 or 3) and alpha (H, W) or None."""
    array = numbers("pixels", pixels)
    if array.ndim == 2:
        array = array[..., np.newaxis]
    if array.ndim != 3 or array.shape[2] not in (1, 3, 4) or 0 in array.shape:
        raise ValueError(
            f"pixels must be (H, W), (H, W, 1), (H, W, 3) or (H, W, 4), got {np.shape(pixels)}"
        )
    if array.shape[2] == 4:
        if alpha is not None:
            raise ValueError("alpha must be left out where pixels are (H, W, 4)")
        return array[..., :3], array[..., 3]
    if alpha is None:
        return array, None
    opacity = numbers("alpha", alpha)
    if opacity.shape != array.shape[:2]:
        raise ValueError(f"alpha must be {array.shape[:2]} like pixels, got {opacity.shape}")
    return array, opacity


def _stored_type(form: Format, dtype: np.dtype[Any], *, half: bool, bits: int | None) -> str:
    """Return the type in the file, as OpenImageIO calls it."""
    if not form.bits or (form.floats and dtype.kind == "f" and bits is None):
        return "half" if form.name == "openexr" and half else "float"
    if bits is None:
        bits = 16 if dtype == np.uint16 and 16 in form.bits else 8
    if bits not in form.bits:
        known = ", ".join(map(str, form.bits))
        raise ValueError(f"bits must be {known} for {form.name}, got {bits}")
    return "uint8" if bits == 8 else "uint16"


def _of_ten_bits(levels: Array) -> Array:
    """Return 16-bit levels rounded to 10 bits, and as a reader spreads these over 16."""
    ten = np.rint(levels * (1023.0 / 65535.0)).astype(np.uint16)
    return (ten << 6) | (ten >> 4)


def _converted(
    color: Array, alpha: Array | None, encoding: str, premultiplied: bool, stored: str
) -> Array:
    """Return rows of a picture as the file holds them, alpha as the last channel."""
    floats = stored in ("half", "float")
    wanted = "linear" if floats else "display"
    if encoding != wanted or (alpha is not None and premultiplied != floats):
        opacity = None if alpha is None else to_unit(alpha)[..., np.newaxis]
        if opacity is not None and premultiplied:
            # Light without opacity, a glow, has no straight color and is left as it is.
            color = to_unit(color)
            color = np.divide(color, opacity, out=color.copy(), where=opacity > 0)
        color = (to_linear if floats else to_display)(color, encoding)
        if opacity is not None and floats:
            color = color * opacity
    planes = [color] if alpha is None else [color, alpha[..., np.newaxis]]
    return np.concatenate([_stored(plane, stored) for plane in planes], axis=-1)


def _stored(values: Array, stored: str) -> Array:
    if values.dtype.name == stored:
        return values
    unit = to_unit(values)
    if stored == "half":
        return to_half(unit)
    if stored == "float":
        return to_single(unit)
    return to_integer(unit, 8 if stored == "uint8" else 16)


def _specification(shape: tuple[int, ...], stored: str, *, alpha: bool) -> Any:
    height, width, colors = shape
    specification = openimageio().ImageSpec(width, height, colors + alpha, stored)
    specification.channelnames = ("R", "G", "B")[:colors] if colors == 3 else ("Y",)
    if alpha:
        specification.channelnames = (*specification.channelnames, "A")
        specification.alpha_channel = colors
    return specification

"""Writing pictures: one call for every format, the colors encoded as the format wants them."""

import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array, ArrayLike, PathLike, choice, integer, naming, numbers
from flurries.io.color import encoding_of, in_file, planes_of
from flurries.io.files import given
from flurries.io.oiio import openimageio
from flurries.io.pictures.parts import Part, write_parts
from flurries.io.pictures.slate import Slate, checked_metadata, description


@dataclass(frozen=True)
class Format:
    """The bits, floats and alpha that a file format can hold."""

    name: str
    bits: tuple[int, ...] = ()
    floats: tuple[str, ...] = ()
    alpha: bool = True
    lossless: bool = True

    def stored(self, dtype: np.dtype[Any], *, half: bool, bits: int | None) -> str:
        """Return the type in the file, as OpenImageIO calls it."""
        if not self.bits or (self.floats and dtype.kind == "f" and bits is None):
            return self.floats[0] if half else "float"
        if bits is None:
            bits = 16 if dtype == np.uint16 and 16 in self.bits else 8
        if bits not in self.bits:
            known = ", ".join(map(str, self.bits))
            raise ValueError(f"bits must be {known} for {self.name}, got {bits}")
        return "uint8" if bits == 8 else "uint16"


FORMATS = {
    ".dpx": Format("dpx", bits=(8, 10, 16), alpha=False),
    ".exr": Format("openexr", floats=("half", "float")),
    ".hdr": Format("hdr", floats=("float",), alpha=False, lossless=False),
    **dict.fromkeys((".jpeg", ".jpg"), Format("jpeg", bits=(8,), alpha=False, lossless=False)),
    ".png": Format("png", bits=(8, 16)),
    **dict.fromkeys((".tif", ".tiff"), Format("tiff", bits=(8, 16), floats=("float",))),
}

# How EXR packs pixels, and whether all bits survive it.
COMPRESSIONS = {
    "none": True, "rle": True, "zips": True, "zip": True, "piz": True, "dwaa": False, "dwab": False,
}  # fmt: skip

_LONGEST_TEXT = 60_000


def write_picture(
    path: PathLike, pixels: ArrayLike, *, alpha: ArrayLike | None = None,
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
    pixels, alpha : array_like
        (H, W), (H, W, 1), (H, W, 3) or (H, W, 4) with alpha; uint8, uint16 or float. An opacity
        apart is (H, W); integers over their maximum, floats from 0 to 1.
    encoding, premultiplied : {"display", "linear"}, bool, optional
        What `pixels` are, and whether colors are multiplied by alpha; by default integers are
        display values and are not, floats are linear light and are.
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
        Goes into the header under ``flurries:``; HDR holds none. ``DateTime``, as ``2000:01:01
        00:00:00``, replaces that fixed moment.
    slate : flurries.io.pictures.slate.Slate, optional
        What the plate that it was made of says of itself.
    """
    form = format_of(path)
    strings, said = checked_metadata(metadata), given("slate", slate, Slate)
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
    stored = form.stored(color.dtype, half=half, bits=bits)
    if form.name in ("hdr", "dpx") and color.shape[2] == 1:
        color = np.broadcast_to(color, (*color.shape[:2], 3))

    def band(first: int, last: int) -> Array:
        rows = None if opacity is None else opacity[first:last]
        made = in_file(color[first:last], rows, encoding, premultiplied, stored)
        if bits == 10:
            # Rounded to 10 bits, and as a reader spreads these over 16.
            ten = np.rint(made * (1023.0 / 65535.0)).astype(np.uint16)
            made = (ten << 6) | (ten >> 4)
        return made

    height, width, colors = color.shape
    names = ("R", "G", "B")[:colors] if colors == 3 else ("Y",)
    specification = openimageio().ImageSpec(width, height, colors + (opacity is not None), stored)
    specification.channelnames = names if opacity is None else (*names, "A")
    if opacity is not None:
        specification.alpha_channel = colors
    whole = stored.startswith("uint")
    packed = form.name == "png" or (form.name == "tiff" and whole)
    packed |= form.name == "openexr" and compression == "zip"
    part = Part(specification, band)
    if form.name == "jpeg":
        with naming(f"{os.fspath(path)}: cannot be encoded", OSError, then=OSError):
            data = _encode_jpeg(band(0, height), int(quality), strings, said)
        write_parts(path, [part], packed=False, lossless=False, encoded=data)
        return
    said.put(specification, form.name, "display" if whole else "linear", strings)
    if form.name == "openexr":
        specification.attribute("compression", compression)
    elif form.name == "dpx" and bits == 10:
        specification.attribute("oiio:BitsPerSample", 10)
    elif form.name in ("png", "tiff") and whole:
        specification.attribute("oiio:UnassociatedAlpha", 1)
    lossless = form.lossless and (form.name != "openexr" or COMPRESSIONS[compression])
    write_parts(path, [part], packed=packed, lossless=lossless)


def format_of(path: PathLike) -> Format:
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(
            f"{os.fspath(path)}: pictures are written as {', '.join(FORMATS)}, not as {suffix!r}"
        )
    return FORMATS[suffix]


def _encode_jpeg(pixels: Array, quality: int, strings: Mapping[str, str], slate: Slate) -> bytes:
    """Return a baseline JPEG of (H, W, 1 or 3) uint8, colors not subsampled."""
    # OpenImageIO's writer leaves errors to libjpeg's own handler, and that one ends the process:
    # a full disk would take the whole program with it. Pillow encodes to memory and raises.
    from PIL import Image
    from PIL.ExifTags import Base

    image = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    tags, text = Image.Exif(), description(strings)
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"metadata of {len(text)} characters do not fit into a JPEG; use EXR")
    if text:
        tags[Base.ImageDescription] = text
    if (turned := slate.value("Orientation") or 1) != 1:
        tags[Base.Orientation] = turned
    tags[Base.Software], tags[Base.DateTime] = "flurries", strings["DateTime"]
    profile = slate.value("ICCProfile") if slate.colored and slate.encoding == "display" else None
    buffer = io.BytesIO()
    kept = {"exif": tags.tobytes(), "icc_profile": profile and bytes(profile)}
    image.save(buffer, "JPEG", quality=quality, subsampling=0, **kept)
    return buffer.getvalue()


def _checked_pixels(pixels: ArrayLike, alpha: ArrayLike | None) -> tuple[Array, Array | None]:
    """Return colors (H, W, 1 or 3) and alpha (H, W) or None."""
    array = planes_of("pixels", pixels)
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

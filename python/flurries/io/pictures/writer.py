"""Writing pictures: one call for every format, the colors encoded as the format wants them.

A picture is written in bands of rows, so that no second copy of 16384 x 16384 px in another type is
ever made, and it is read back before it takes its final name.
"""

from __future__ import annotations

import io
import mmap
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import choice, integer
from flurries.io.atomic import replacing
from flurries.io.color import (
    Array,
    encoding_of,
    numbers,
    planes_of,
    to_display,
    to_half,
    to_integer,
    to_linear,
    to_single,
    to_unit,
)
from flurries.io.files import Budget, given
from flurries.io.oiio import last_error, openimageio, packing_threads
from flurries.io.pictures.header import opened_picture
from flurries.io.pictures.slate import Slate, checked_metadata, description


@dataclass(frozen=True)
class Format:
    """The bits, floats and alpha that a file format can hold."""

    name: str
    bits: tuple[int, ...] = ()
    floats: tuple[str, ...] = ()
    alpha: bool = True
    lossless: bool = True

    @property
    def kinds(self) -> tuple[int | str, ...]:
        """The kinds of a color: numbers of bits, or "half" and "float"."""
        return (*self.bits, *self.floats)

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


_JPEG = Format("jpeg", bits=(8,), alpha=False, lossless=False)
_TIFF = Format("tiff", bits=(8, 16), floats=("float",))
FORMATS = {
    ".dpx": Format("dpx", bits=(8, 10, 16), alpha=False),
    ".exr": Format("openexr", floats=("half", "float")),
    ".hdr": Format("hdr", floats=("float",), alpha=False, lossless=False),
    ".jpeg": _JPEG,
    ".jpg": _JPEG,
    ".png": Format("png", bits=(8, 16)),
    ".tif": _TIFF,
    ".tiff": _TIFF,
}

# How EXR packs pixels, and whether all bits survive it.
COMPRESSIONS = {
    "none": True, "rle": True, "zips": True, "zip": True, "piz": True, "dwaa": False, "dwab": False,
}  # fmt: skip

# PNG's filter that stores each pixel's difference from the one before, as libpng counts them.
_SUB = 0x10

# Tags of EXIF.
_DESCRIPTION, _ORIENTATION, _SOFTWARE, _MOMENT = 0x010E, 0x0112, 0x0131, 0x0132
_LONGEST_TEXT = 60_000

# A whole number of the strips and blocks in which EXR and TIFF compress; of wide pictures, whose
# rows take much memory, fewer.
_ROWS = 64
_FEWER, _WIDE = 32, 4096

# The rows that an EXR packs together, of each of which a thread takes one.
_BLOCK_ROWS = 16

# A picture of fewer pixels is not worth threads.
_LARGE = 1 << 18

_SIZES = ("width", "height", "nchannels")

# Whole numbers of 32 bits beside halves and floats in an EXR. OpenImageIO turns what it writes to
# channels of several types into floats on the way, which know 24 bits. So whole numbers are written
# as floats of the same bits, and then the header is told what they are: EXR holds and packs both
# types alike, as four bytes, but for the compressions that round.
_UINT, _FLOAT = struct.pack("<i", 0), struct.pack("<i", 2)


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
        made = _converted(color[first:last], rows, encoding, premultiplied, stored)
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
    part = Part(specification, band)
    if form.name == "jpeg":
        try:
            data = _encode_jpeg(band(0, height), int(quality), strings, said)
        except OSError as error:
            raise OSError(f"{os.fspath(path)}: cannot be encoded: {error}") from error
        write_parts(path, [part], lossless=False, encoded=data)
        return
    whole = stored.startswith("uint")
    said.put(specification, form.name, "display" if whole else "linear", strings)
    if form.name == "openexr":
        specification.attribute("compression", packing(compression))
    elif form.name == "dpx" and bits == 10:
        specification.attribute("oiio:BitsPerSample", 10)
    elif form.name in ("png", "tiff") and whole:
        specification.attribute("oiio:UnassociatedAlpha", 1)
    if form.name == "png":
        # Flakes are noise: more effort takes four times as long for a tenth fewer bytes.
        specification.attribute("png:compressionLevel", 1)
        specification.attribute("png:filter", _SUB)
    lossless = form.lossless and (form.name != "openexr" or COMPRESSIONS[compression])
    write_parts(path, [part], lossless=lossless)


def format_of(path: str | os.PathLike[str]) -> Format:
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(
            f"{os.fspath(path)}: pictures are written as {', '.join(FORMATS)}, not as {suffix!r}"
        )
    return FORMATS[suffix]


def packing(compression: str) -> str:
    """Return OpenImageIO's name of a compression with its level."""
    # Zip at level 1 takes two thirds of the time of OpenEXR's level 4, for 5 in 100 more bytes.
    return f"{compression}:1" if compression.startswith("zip") else compression


def _encode_jpeg(pixels: Array, quality: int, strings: Mapping[str, str], slate: Slate) -> bytes:
    """Return a baseline JPEG of (H, W, 1 or 3) uint8, colors not subsampled."""
    # OpenImageIO's writer leaves errors to libjpeg's own handler, and that one ends the process:
    # a full disk would take the whole program with it. Pillow encodes to memory and raises.
    from PIL import Image

    image = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    tags, text = Image.Exif(), description(strings)
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"metadata of {len(text)} characters do not fit into a JPEG; use EXR")
    if text:
        tags[_DESCRIPTION] = text
    if (turned := slate.value("Orientation") or 1) != 1:
        tags[_ORIENTATION] = turned
    tags[_SOFTWARE], tags[_MOMENT] = "flurries", strings["DateTime"]
    profile = slate.value("ICCProfile") if slate.colored and slate.encoding == "display" else None
    buffer = io.BytesIO()
    image.save(
        buffer,
        "JPEG",
        quality=quality,
        subsampling=0,
        exif=tags.tobytes(),
        icc_profile=profile and bytes(profile),
    )
    return buffer.getvalue()


def _checked_pixels(
    pixels: npt.ArrayLike, alpha: npt.ArrayLike | None
) -> tuple[Array, Array | None]:
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


def _converted(
    color: Array, alpha: Array | None, encoding: str, premultiplied: bool, stored: str
) -> Array:
    """Return rows of a picture as the file holds them, alpha as the last channel."""
    floats = stored in ("half", "float")
    if encoding != ("linear" if floats else "display") or (
        alpha is not None and premultiplied != floats
    ):
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
    if stored.startswith("uint"):
        return to_integer(to_unit(values), int(stored[4:]))
    return (to_half if stored == "half" else to_single)(to_unit(values))


class Part(NamedTuple):
    """A part of a picture: what OpenImageIO is told of it, and its rows from one to another."""

    specification: Any
    band: Callable[[int, int], Array]
    integers: Sequence[str] = ()  # Channels of floats whose bits are whole numbers.


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[Part], *, lossless: bool = True,
    encoded: bytes = b"",
) -> None:  # fmt: skip
    """Write a picture of one or several parts atomically, and verify it."""
    target = os.fspath(path)
    with replacing(path) as temporary:
        sums = [("uint8", 0)]
        if encoded:
            temporary.write_bytes(encoded)
        else:
            sums = _write(target, temporary, parts)
        if temporary.suffix.lower() == ".dpx":
            # OpenImageIO puts the hidden name there, and the way to it.
            with temporary.open("r+b") as file:
                file.seek(36)
                file.write(bytes(100))
        _verify(target, temporary, parts, sums, lossless=lossless)
        if any(part.integers for part in parts):
            _declare_integers(temporary, parts)


def _write(target: str, temporary: Path, parts: Sequence[Part]) -> list[tuple[str, int]]:
    """Write all bands of all parts; return the type of each part's numbers and their checksum."""
    sums: list[tuple[str, int]] = []
    specs = tuple(part.specification for part in parts)
    large = temporary.suffix.lower() == ".exr" and specs[0].width * specs[0].height >= _LARGE
    threads = packing_threads() if large else nullcontext()
    with threads, output_of(target, temporary, specs) as output:
        for spec, band, _ in parts:
            if sums and not output.open(str(temporary), spec, "AppendSubimage"):
                raise unwritten(target, output)
            found, kind = 0, ""
            step = max(_ROWS if spec.width <= _WIDE else _FEWER, _BLOCK_ROWS * _core.threads())
            for top in range(0, spec.height, step):
                last = min(top + step, spec.height)
                rows = np.ascontiguousarray(band(top, last))
                found, kind = zlib.crc32(rows.data, found), rows.dtype.name
                if not output.write_scanlines(spec.y + top, spec.y + last, 0, rows):
                    raise unwritten(target, output)
            sums.append(({"float16": "half", "float32": "float"}.get(kind, kind), found))
    return sums


@contextmanager
def output_of(target: str, temporary: Path, wanted: Sequence[Any]) -> Iterator[Any]:
    """Open a file for a specification for each part, and close it."""
    output = openimageio().ImageOutput.create(str(temporary))
    if output is None:
        raise ValueError(f"{target}: cannot be written: {last_error()}")
    try:
        if not output.open(str(temporary), wanted):
            raise unwritten(target, output)
        yield output
    except BaseException:
        output.close()
        last_error(output)
        raise
    if not output.close():
        raise unwritten(target, output)


def unwritten(target: str, output: Any) -> OSError:
    return OSError(f"{target}: cannot be written: {last_error(output)}")


def _verify(
    target: str, temporary: Path, parts: Sequence[Part], sums: Sequence[tuple[str, int]], *,
    lossless: bool,
) -> None:  # fmt: skip
    """Read the picture back; a full disk or a faulty writer shows here and not next week."""
    wanted = [part.specification for part in parts]
    # Whatever was written may be read.
    most = max(
        16 * one.nchannels * max(one.width * one.height, one.full_width * one.full_height)
        for one in wanted
    )
    try:
        with opened_picture(temporary, Budget(2**62, most)) as opened:
            for number, (one, (kind, checksum)) in enumerate(zip(wanted, sums, strict=True)):
                part = opened.at(number)
                there, found = part.specification, 0
                if any(getattr(there, size) != getattr(one, size) for size in _SIZES):
                    raise OSError("it has another size or other channels")
                # EXR keeps channels in alphabetical order, whatever order they were given in.
                order = [there.channelindex(name) for name in one.channelnames]
                if sorted(order) != list(range(one.nchannels)):
                    order = sorted(range(one.nchannels))
                for _, rows in part.bands(order, kind, _ROWS):
                    found = zlib.crc32(np.ascontiguousarray(rows).data, found)
                if lossless and found != checksum:
                    raise OSError("its pixels are not those that were written")
    except (OSError, ValueError) as error:
        raise OSError(f"{target}: does not read back: {error}") from error


def _declare_integers(path: Path, parts: Sequence[Part]) -> None:
    """Say in the headers of an EXR's parts which channels are whole numbers."""
    with path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as data:
        at = 0
        for part in parts:
            # In a list of channels the type follows the name.
            for name in sorted(part.integers):
                entry = b"\0%s\0" % name.encode()
                if (at := data.find(entry + _FLOAT, at)) < 0:
                    raise OSError(f"{path}: does not say where its channel {name} is")
                at += len(entry)
                data[at : at + len(_UINT)] = _UINT

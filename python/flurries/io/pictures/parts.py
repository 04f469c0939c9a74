"""Parts of a picture as files have them: written in bands, and read back.

A picture is written in bands of rows, so that no second copy of 16384 x 16384 px in another type is
ever made, and it is read back before it takes its final name.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries.io.atomic import replacing
from flurries.io.color import Array
from flurries.io.files import Budget
from flurries.io.oiio import last_error, openimageio, packing_threads
from flurries.io.pictures.header import opened_picture

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

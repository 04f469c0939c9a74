"""Writing a picture in bands of rows, and reading it back before it takes its final name.

Bands keep memory at the size of the picture given: no second copy of 16384 x 16384 px in another
type is ever made.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

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

Band: TypeAlias = Callable[[int, int], Array]


class Part(NamedTuple):
    """A part of a picture: what OpenImageIO is told of it, and its rows from one to another."""

    specification: Any
    band: Band
    integers: Sequence[str] = ()  # Channels of floats whose bits are whole numbers.


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[Part], *, lossless: bool = True
) -> None:
    """Write a picture of one or several parts atomically, and verify it."""
    target = os.fspath(path)
    with replacing(path) as temporary:
        sums = _write(target, temporary, parts)
        if temporary.suffix.lower() == ".dpx":
            # OpenImageIO puts the hidden name there, and the way to it.
            with temporary.open("r+b") as file:
                file.seek(36)
                file.write(bytes(100))
        _verify(target, temporary, parts, sums, lossless=lossless)
        if any(part.integers for part in parts):
            _declare_integers(temporary, parts)


def write_whole(path: str | os.PathLike[str], part: Part, data: bytes) -> None:
    """Write a picture that is encoded already, atomically, and verify its size and channels."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)
        _verify(os.fspath(path), temporary, [part], [("uint8", 0)])


def _write(target: str, temporary: Path, parts: Sequence[Part]) -> list[tuple[str, int]]:
    """Write all bands of all parts; return the type of each part's numbers and their checksum."""
    sums = []
    first, *_ = specifications = tuple(part.specification for part in parts)
    large = temporary.suffix.lower() == ".exr" and first.width * first.height >= _LARGE
    threads = packing_threads() if large else nullcontext()
    with threads, output_of(target, temporary, specifications if parts[1:] else first) as output:
        for number, part in enumerate(parts):
            if number and not output.open(str(temporary), part.specification, "AppendSubimage"):
                raise OSError(f"{target}: cannot be written: {last_error(output)}")
            sums.append(_write_rows(target, output, part))
    return sums


@contextmanager
def output_of(target: str, temporary: Path, wanted: Any) -> Iterator[Any]:
    """Open a file for a specification, or one for each part, and close it."""
    output = openimageio().ImageOutput.create(str(temporary))
    if output is None:
        raise ValueError(f"{target}: cannot be written: {last_error()}")
    closed = False
    try:
        if not output.open(str(temporary), wanted):
            raise OSError(f"{target}: cannot be written: {last_error(output)}")
        yield output
        closed = True
        if not output.close():
            raise OSError(f"{target}: cannot be written: {last_error(output)}")
    finally:
        if not closed:
            output.close()
            last_error(output)


def _write_rows(target: str, output: Any, part: Part) -> tuple[str, int]:
    found, kind, specification = 0, "", part.specification
    step = max(_ROWS if specification.width <= _WIDE else _FEWER, _BLOCK_ROWS * _core.threads())
    for first in range(0, specification.height, step):
        last = min(first + step, specification.height)
        rows = np.ascontiguousarray(part.band(first, last))
        found, kind = zlib.crc32(rows.data, found), rows.dtype.name
        above = specification.y
        if not output.write_scanlines(above + first, above + last, 0, rows):
            raise OSError(f"{target}: cannot be written: {last_error(output)}")
    return {"float16": "half", "float32": "float"}.get(kind, kind), found


def _verify(
    target: str, temporary: Path, parts: Sequence[Part], sums: Sequence[tuple[str, int]], *,
    lossless: bool = False,
) -> None:  # fmt: skip
    """Read the picture back; a full disk or a faulty writer shows here and not next week."""
    wanted = [part.specification for part in parts]
    # Whatever was written may be read.
    most = max(
        16 * one.nchannels * max(one.width * one.height, one.full_width * one.full_height)
        for one in wanted
    )
    try:
        with opened_picture(temporary, Budget(2**62, most), deep=wanted[0].deep) as opened:
            for number, (one, (kind, checksum)) in enumerate(zip(wanted, sums, strict=True)):
                stored = opened.reader.spec(number)
                size = (stored.width, stored.height, stored.nchannels)
                if size != (one.width, one.height, one.nchannels):
                    raise OSError("it has another size or other channels")
                # EXR keeps channels in alphabetical order, whatever order they were given in.
                order = [stored.channelindex(name) for name in one.channelnames]
                if sorted(order) != list(range(one.nchannels)):
                    order = sorted(range(one.nchannels))
                found = 0
                for _, rows in opened.bands(order, kind, part=number, step=_ROWS):
                    found = zlib.crc32(np.ascontiguousarray(rows).data, found)
                if lossless and found != checksum:
                    raise OSError("its pixels are not those that were written")
    except (OSError, ValueError) as error:
        raise OSError(f"{target}: does not read back: {error}") from error


# Whole numbers of 32 bits beside halves and floats in an EXR. OpenImageIO turns what it writes to
# channels of several types into floats on the way, which know 24 bits. So whole numbers are written
# as floats of the same bits, and then the header is told what they are: EXR holds and packs both
# types alike, as four bytes, but for the compressions that round.
_UINT, _FLOAT = struct.pack("<i", 0), struct.pack("<i", 2)


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

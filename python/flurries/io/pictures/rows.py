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
from typing import Any, TypeAlias

import numpy as np

from flurries import _core
from flurries.io.atomic import replacing
from flurries.io.color import Array
from flurries.io.files import require_whole_png
from flurries.io.oiio import last_error, let_open, openimageio, packing_threads

# A whole number of the strips and blocks in which EXR and TIFF compress; of wide pictures, whose
# rows take much memory, fewer.
_ROWS = 64
_FEWER, _WIDE = 32, 4096

# The rows that an EXR packs together, of each of which a thread takes one.
_BLOCK_ROWS = 16

# A picture of fewer pixels is not worth threads.
_LARGE = 1 << 18

Band: TypeAlias = Callable[[int, int], Array]
Checksums: TypeAlias = list[tuple[np.dtype[Any], int]]


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[tuple[Any, Band]], *, lossless: bool = True
) -> None:
    """Write a picture of one or several parts atomically, and verify it."""
    target = os.fspath(path)
    plain = [(as_floats(specification), band) for specification, band in parts]
    with replacing(path) as temporary:
        checksums = _write(target, temporary, plain)
        if temporary.suffix.lower() == ".dpx":
            # OpenImageIO puts the hidden name there, and the way to it.
            with temporary.open("r+b") as file:
                file.seek(36)
                file.write(bytes(100))
        for number, ((specification, _), sums) in enumerate(zip(plain, checksums, strict=True)):
            _verify(target, temporary, specification, sums, lossless=lossless, part=number)
        declare_integers(temporary, [specification for specification, _ in parts])


def write_whole(path: str | os.PathLike[str], specification: Any, data: bytes) -> None:
    """Write a picture that is encoded already, atomically, and verify its size and channels."""
    unknown = [(np.dtype(np.uint8), 0)] * -(-specification.height // _rows(specification))
    with replacing(path) as temporary:
        temporary.write_bytes(data)
        _verify(os.fspath(path), temporary, specification, unknown, lossless=False)


def _write(target: str, temporary: Path, parts: Sequence[tuple[Any, Band]]) -> list[Checksums]:
    """Write all bands of all parts; return the type and the checksum of each."""
    checksums = []
    first, *_ = specifications = tuple(specification for specification, _ in parts)
    large = temporary.suffix.lower() == ".exr" and first.width * first.height >= _LARGE
    threads = packing_threads() if large else nullcontext()
    with threads, output_of(target, temporary, specifications if parts[1:] else first) as output:
        for number, (specification, band) in enumerate(parts):
            if number and not output.open(str(temporary), specification, "AppendSubimage"):
                raise OSError(f"{target}: cannot be written: {last_error(output)}")
            checksums.append(_write_rows(target, output, specification, band))
    return checksums


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


def _rows(specification: Any) -> int:
    rows = _ROWS if specification.width <= _WIDE else _FEWER
    return max(rows, _BLOCK_ROWS * _core.threads())


def _write_rows(target: str, output: Any, specification: Any, band: Band) -> Checksums:
    """Write the bands of one part; return the type and the checksum of each."""
    checksums = []
    step = _rows(specification)
    for first in range(0, specification.height, step):
        last = min(first + step, specification.height)
        rows = np.ascontiguousarray(band(first, last))
        checksums.append((rows.dtype, zlib.crc32(rows.data)))
        above = specification.y
        if not output.write_scanlines(above + first, above + last, 0, rows):
            raise OSError(f"{target}: cannot be written: {last_error(output)}")
    return checksums


def _verify(
    target: str, temporary: Path, specification: Any, checksums: Checksums, *, lossless: bool,
    part: int = 0,
) -> None:  # fmt: skip
    """Read the picture back; a full disk or a faulty writer shows here and not next week."""
    let_open(4 * specification.width * specification.height * specification.nchannels)
    step = _rows(specification)
    library = openimageio()
    wishes = library.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    require_whole_png(temporary, f"{target}: cannot be read back")
    reader = library.ImageInput.open(str(temporary), wishes)
    if reader is None:
        raise OSError(f"{target}: cannot be read back: {last_error()}")
    try:
        stored = reader.spec(part)
        wanted = (specification.width, specification.height, specification.nchannels)
        if (stored.width, stored.height, stored.nchannels) != wanted:
            raise OSError(f"{target}: reads back with another size or other channels")
        # EXR keeps channels in alphabetical order, whatever order they were given in.
        order = [stored.channelindex(name) for name in specification.channelnames]
        sorts = sorted(order) == list(range(stored.nchannels)) and order != sorted(order)
        for number, (dtype, checksum) in enumerate(checksums):
            first, last = number * step, min((number + 1) * step, stored.height)
            kind = {"float16": "half", "float32": "float"}.get(dtype.name, dtype.name)
            place = stored.y + first, stored.y + last
            rows = reader.read_scanlines(part, 0, *place, 0, 0, stored.nchannels, kind)
            if rows is None or reader.has_error:
                raise OSError(f"{target}: cannot be read back: {last_error(reader)}")
            if lossless:
                rows = np.ascontiguousarray(rows[..., order] if sorts else rows)
                if zlib.crc32(rows.data) != checksum:
                    raise OSError(f"{target}: does not read back as what was written")
    finally:
        reader.close()
        last_error(reader)


# Whole numbers of 32 bits beside halves and floats in an EXR. OpenImageIO turns what it writes to
# channels of several types into floats on the way, which know 24 bits. So whole numbers are written
# as floats of the same bits, and then the header is told what they are: EXR holds and packs both
# types alike, as four bytes, but for the compressions that round.
#
# OpenImageIO's name of the type, and its number in a list of channels.
UINT = "uint"
_NUMBER = struct.pack("<i", 0)

# Magic number and version come before the first header.
_FIRST = 8

# Of a channel in the list, after its name: type, four bytes, and how often it is sampled.
_CHANNEL = 16


def integers_of(specification: Any) -> dict[str, int]:
    """Return the channels that hold whole numbers of 32 bits, by name, with their places."""
    kind = openimageio().TypeDesc(UINT)
    names = enumerate(specification.channelnames)
    return {name: place for place, name in names if specification.channelformat(place) == kind}


def as_floats(specification: Any) -> Any:
    """Return a specification of the same picture with floats for whole numbers of 32 bits."""
    numbers = integers_of(specification).values()
    if not numbers:
        return specification
    library = openimageio()
    made = library.ImageSpec(specification)
    kinds = [specification.channelformat(place) for place in range(made.nchannels)]
    kinds = [
        library.TypeDesc("float") if place in numbers else kind for place, kind in enumerate(kinds)
    ]
    # Where all channels are alike the common type counts.
    made.set_format(max(kinds, key=[str(kind) for kind in kinds].count))
    made.channelformats = tuple(kinds) if len(set(map(str, kinds))) > 1 else ()
    return made


def declare_integers(path: Path, specifications: Sequence[Any]) -> None:
    """Say in the headers of an EXR's parts which channels are whole numbers."""
    wanted = [integers_of(specification) for specification in specifications]
    if not any(wanted):
        return
    with path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as data:
        at = _FIRST
        for names in wanted:
            while data[at]:
                _, at = _word(data, at)
                kind, at = _word(data, at)
                (size,) = struct.unpack_from("<i", data, at)
                at += 4
                if kind == "chlist":
                    _declare(data, at, names)
                at += size
            at += 1
    reader = openimageio().ImageInput.open(str(path))
    found = [] if reader is None else [reader.spec(part) for part in range(len(wanted))]
    if [set(integers_of(part)) for part in found] != [set(names) for names in wanted]:
        raise OSError(f"{path}: does not say which of its channels are whole numbers")


def _declare(data: mmap.mmap, at: int, names: dict[str, int]) -> None:
    """Change the type of channels in the list that begins at a byte."""
    while data[at]:
        name, at = _word(data, at)
        if name in names:
            data[at : at + len(_NUMBER)] = _NUMBER
        at += _CHANNEL


def _word(data: mmap.mmap, at: int) -> tuple[str, int]:
    """Return the name that begins at a byte, and where what follows it begins."""
    end = data.find(b"\0", at)
    return data[at:end].decode(), end + 1

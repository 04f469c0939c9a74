"""Parts of a picture as files have them: written in bands, and read back.

A picture is written in bands of rows, so that no second copy of 16384 x 16384 px in another type is
ever made, and it is read back before it takes its final name.
"""

import os
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

# OpenImageIO turns what it writes to channels of several types into floats and back, which takes
# longer than all else and knows 24 bits of a whole number. But zip packs bytes, rows of 4 bytes as
# two rows of halves. So such parts are written as halves, under headers of their own; then those
# that are meant take their place, with the table of where the packed rows are, 8 bytes each.
_PLACE = 8


class Part(NamedTuple):
    """A part of a picture: what OpenImageIO is told of it, and its rows from one to another."""

    specification: Any
    band: Callable[[int, int], Array]
    halves: bool = False  # Whether its rows are halves, a channel of 4 bytes two of them.


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[Part], *, lossless: bool = True,
    encoded: bytes = b"",
) -> None:  # fmt: skip
    """Write a picture of one or several parts atomically, and verify it."""
    target = os.fspath(path)
    with replacing(path) as temporary:
        sums, wanted, head, at = [("uint8", 0)], parts, b"", 0
        size = _PLACE * sum(-(-part.specification.height // _BLOCK_ROWS) for part in parts)
        if parts[0].halves:
            head = _header(target, temporary, parts)[:-size]
            wanted = [_in_halves(part, len(head)) for part in parts]
            at = len(_header(target, temporary, wanted)) - size
        if encoded:
            temporary.write_bytes(encoded)
        else:
            sums = _write(target, temporary, wanted)
        if temporary.suffix.lower() == ".dpx":
            # OpenImageIO puts the hidden name there, and the way to it.
            with temporary.open("r+b") as file:
                file.seek(36)
                file.write(bytes(100))
        _verify(target, temporary, wanted, sums, lossless=lossless)
        if head:
            with temporary.open("r+b") as file:
                file.seek(at)
                table = file.read(size)
                file.seek(0)
                file.write(head + table)


def _header(target: str, temporary: Path, parts: Sequence[Part]) -> bytes:
    """Return an EXR without pixels: headers, and the table of places."""
    with output_of(target, temporary, [part.specification for part in parts]):
        pass
    return temporary.read_bytes()


def _in_halves(part: Part, room: int) -> Part:
    """Return a part whose header has halves alone, and room for another."""
    spec = openimageio().ImageSpec(part.specification)
    spec.nchannels = spec.pixel_bytes(True) // 2
    spec.channelformats = ()
    spec.set_format("half")
    spec.channelnames = tuple(f"{number:04d}" for number in range(spec.nchannels))
    spec.attribute("Software", "-" * room)
    return Part(spec, part.band)


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

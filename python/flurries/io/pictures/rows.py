"""Writing a picture in bands of rows, and reading it back before it takes its final name.

Bands keep memory at the size of the picture given: no second copy of 16384 x 16384 px in another
type is ever made.
"""

from __future__ import annotations

import os
import shutil
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flurries import _core
from flurries.io.atomic import replacing
from flurries.io.color import Array
from flurries.io.oiio import last_error, let_open, openimageio, packing_threads
from flurries.io.pictures.integers import as_floats, declare_integers
from flurries.io.pictures.metadata import seal

# A whole number of the strips and blocks in which EXR and TIFF compress; of wide pictures, whose
# rows take much memory, fewer.
_ROWS = 64
_FEWER, _WIDE = 32, 4096

# The rows that an EXR packs together, of each of which a thread takes one.
_BLOCK_ROWS = 16

# A picture of fewer pixels is not worth threads.
_LARGE = 1 << 18

# Others write to the same disk meanwhile: room for several such files must be there.
_OTHERS = 8
_SPARE = 1 << 26

Band: TypeAlias = Callable[[int, int], Array]
Checksums: TypeAlias = list[tuple[np.dtype[Any], int]]


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[tuple[Any, Band]], *, lossless: bool = True
) -> None:
    """Write a picture of one or several parts atomically, and verify it.

    A part is its header and a function that gives rows [first, last) as an array (rows, W,
    channels) of one type; whole numbers of an EXR are floats of the same bits.
    """
    target = os.fspath(path)
    plain = [(as_floats(specification), band) for specification, band in parts]
    with replacing(path) as temporary:
        checksums = _write(target, temporary, plain)
        if temporary.suffix.lower() in (".tif", ".tiff"):
            seal(temporary)
        for number, ((specification, _), sums) in enumerate(zip(plain, checksums, strict=True)):
            _verify(target, temporary, specification, sums, lossless=lossless, part=number)
        declare_integers(temporary, [specification for specification, _ in parts])


def write_whole(path: str | os.PathLike[str], specification: Any, data: bytes) -> None:
    """Write a picture that is encoded already, atomically, and verify its size and channels."""
    unknown = [(np.dtype(np.uint8), 0)] * -(-specification.height // _rows(specification))
    with replacing(path) as temporary:
        temporary.write_bytes(data)
        seal(temporary)
        _verify(os.fspath(path), temporary, specification, unknown, lossless=False)


@contextmanager
def _roomy(file: Path, specification: Any) -> Iterator[str]:
    """Yield a name to write a picture to, which is then in the file.

    Where a disk is full, libpng prints words of its own and gives no reason. So where there may be
    too little room a PNG goes to memory first.
    """
    most = specification.image_bytes() * 17 // 16 + (1 << 16)
    room = _OTHERS * most + _SPARE <= shutil.disk_usage(file.parent).free
    if room or file.suffix.lower() != ".png" or not sys.platform.startswith("linux"):
        yield str(file)
        return
    memory = os.memfd_create("flurries")
    try:
        # Opened by its name, as any file, and gone with its descriptor.
        yield f"/proc/self/fd/{memory}"
        with Path(f"/proc/self/fd/{memory}").open("rb") as source, file.open("wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)
    finally:
        os.close(memory)


def _write(target: str, temporary: Path, parts: Sequence[tuple[Any, Band]]) -> list[Checksums]:
    """Write all bands of all parts; return the type and the checksum of each."""
    checksums = []
    first, *_ = specifications = tuple(specification for specification, _ in parts)
    large = temporary.suffix.lower() == ".exr" and first.width * first.height >= _LARGE
    threads = packing_threads() if large else nullcontext()
    with threads, _roomy(temporary, first) as name, _output(target, temporary) as output:
        for number, (specification, band) in enumerate(parts):
            if number:
                opened = output.open(name, specification, "AppendSubimage")
            else:
                opened = output.open(name, specifications if parts[1:] else first)
            if not opened:
                raise OSError(f"{target}: cannot be written: {last_error(output)}")
            checksums.append(_write_rows(target, output, specification, band))
    return checksums


@contextmanager
def _output(target: str, temporary: Path) -> Iterator[Any]:
    output = openimageio().ImageOutput.create(str(temporary))
    if output is None:
        raise ValueError(f"{target}: cannot be written: {last_error()}")
    closed = False
    try:
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
    target: str,
    temporary: Path,
    specification: Any,
    checksums: Checksums,
    *,
    lossless: bool,
    part: int = 0,
) -> None:
    """Read the picture back; a full disk or a faulty writer shows here and not next week."""
    let_open(4 * specification.width * specification.height * specification.nchannels)
    step = _rows(specification)
    library = openimageio()
    wishes = library.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
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

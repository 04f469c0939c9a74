"""PNG: the header is OpenImageIO's, the rows are deflated by our kernel.

Libpng deflates at its sixth level and takes many times as long for a tenth fewer bytes, since
flakes are noise (benches/history.md). What it writes before the pixels (names and
values, color, resolution, date) is asked of it by a picture of one pixel with the same header, so
that nothing that a header can hold is lost here.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from flurries import _core
from flurries.io.atomic import replacing
from flurries.io.color import Array
from flurries.io.oiio import last_error, openimageio
from flurries.io.roomy import roomy
from flurries.io.structure import check_structure

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_END = b"\0\0\0\0IEND\xaeB`\x82"
# PNG's kinds of pixels by their channels: grey, grey and alpha, color, color and alpha.
_KINDS = {1: 0, 2: 4, 3: 2, 4: 6}
# Bytes of pixels that become one chunk: enough for many threads, few beside a large picture.
_CHUNK = 1 << 20
_BLOCK = 1 << 20


def write_png(
    path: str | os.PathLike[str], specification: Any, band: Callable[[int, int], Array]
) -> None:
    """Write a PNG whose rows `band(first, last)` makes, atomically, and verify it."""
    target = os.fspath(path)
    with replacing(path) as temporary:
        before = _chunks_before_pixels(target, temporary, specification)
        size = 0
        with temporary.open("wb") as file:
            for piece in _pieces(specification, before, band):
                size += file.write(piece)
        try:
            # Each chunk ends with the checksum of what was handed over.
            check_structure(temporary)
            with temporary.open("rb") as file:
                whole = before in file.read(len(before) + _BLOCK)
            if not whole or temporary.stat().st_size != size:
                raise OSError("it is longer or shorter, or has another header")
        except OSError as error:
            raise OSError(f"{target}: does not read back as what was written") from error


def _pieces(
    specification: Any, before: bytes, band: Callable[[int, int], Array]
) -> Iterator[bytes]:
    """Yield the bytes of a PNG in order."""
    width, height = specification.width, specification.height
    channels, bits = specification.nchannels, 8 * specification.format.size()
    # Neither packed in another way nor interlaced.
    said = struct.pack(">IIBBBBB", width, height, bits, _KINDS[channels], 0, 0, 0)
    yield _SIGNATURE + _chunk(b"IHDR", said) + before
    length = width * channels * bits // 8
    above, checksum = np.zeros(length, np.uint8), 1
    step = max(_CHUNK // length, 1)
    for first in range(0, height, step):
        last = min(first + step, height)
        rows = np.ascontiguousarray(band(first, last)).view(np.uint8).reshape(last - first, length)
        data, checksum = _core.png_chunk(
            rows, above, channels * bits // 8, bits == 16, checksum, last == height
        )
        above = rows[-1].copy()
        yield data
    yield _END


def _chunk(name: bytes, data: bytes) -> bytes:
    named = name + data
    return struct.pack(">I", len(data)) + named + struct.pack(">I", zlib.crc32(named))


def _chunks_before_pixels(target: str, temporary: Path, specification: Any) -> bytes:
    """Return the chunks of a header in a PNG, without the first one, the size."""
    library = openimageio()
    one = library.ImageSpec(specification)
    one.width = one.height = one.full_width = one.full_height = 1
    pixel = np.zeros((1, 1, one.nchannels), f"uint{8 * one.format.size()}")
    # Libpng says on the terminal that a disk is full.
    with roomy(temporary, _BLOCK) as name:
        output = library.ImageOutput.create("one.png")
        try:
            written = output.open(name, one) and output.write_image(pixel)
        finally:
            closed = output.close()
        if not (written and closed):
            raise OSError(f"{target}: cannot be written: {last_error(output)}")
    data = temporary.read_bytes()
    place, found = len(_SIGNATURE), []
    while data[place + 4 : place + 8] not in (b"IDAT", b""):
        end = place + 12 + int.from_bytes(data[place : place + 4], "big")
        found.append(data[place:end])
        place = end
    return b"".join(found[1:])

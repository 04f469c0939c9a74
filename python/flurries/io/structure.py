"""Whether a file ends where its own structure says that it should.

Decoders are lenient: they fill the missing half of a picture with grey, stop a video early, or
print to the terminal. A copy that broke off is common, so containers whose structure can be walked
in a few reads are walked before anything is decoded.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

_PNG = b"\x89PNG\r\n\x1a\n"
_EBML = b"\x1a\x45\xdf\xa3"
_SEGMENT = b"\x18\x53\x80\x67"
_BLOCK = 2**20


def check_structure(path: Path) -> None:
    """Raise OSError if the file at `path` is empty, cut short, or, for PNG, damaged."""
    size = path.stat().st_size
    if size == 0:
        raise OSError(f"{path}: the file is empty")
    with path.open("rb") as stream:
        head = stream.read(12)
        stream.seek(0)
        if head.startswith(_PNG):
            _check_png(path, stream)
        elif head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
            _check_boxes(path, stream, size)
        elif head.startswith(_EBML):
            _check_matroska(path, stream, size)
        elif head.startswith(b"RIFF") and head[8:12] == b"AVI ":
            _check_end(path, 8 + struct.unpack("<I", head[4:8])[0], size)


def _check_png(path: Path, stream: BinaryIO) -> None:
    """Walk the chunks to the last one and compare the checksums of the critical ones."""
    stream.seek(len(_PNG))
    while True:
        header = stream.read(8)
        if len(header) < 8:
            raise OSError(f"{path}: the PNG is cut short: it lacks its last part")
        length, name = struct.unpack(">I4s", header)
        if not name.isalpha():
            raise OSError(f"{path}: the PNG is damaged: no chunk is called {name!r}")
        checksum, left = zlib.crc32(name), length
        while left:
            block = stream.read(min(left, _BLOCK))
            if not block:
                raise OSError(f"{path}: the PNG is cut short inside its {name.decode()} chunk")
            checksum, left = zlib.crc32(block, checksum), left - len(block)
        stored = stream.read(4)
        if len(stored) < 4:
            raise OSError(f"{path}: the PNG is cut short inside its {name.decode()} chunk")
        # Chunks with a small first letter are optional, and decoders skip the damaged ones.
        if name[:1].isupper() and struct.unpack(">I", stored)[0] != checksum:
            raise OSError(f"{path}: the PNG is damaged: its {name.decode()} chunk has changed")
        if name == b"IEND":
            return


def _check_boxes(path: Path, stream: BinaryIO, size: int) -> None:
    """Walk the outermost boxes of an MP4 or MOV file: each must end within the file."""
    position = 0
    while position < size:
        stream.seek(position)
        header = stream.read(16)
        if len(header) < 8:
            raise OSError(f"{path}: the video is cut short")
        length = struct.unpack(">I", header[:4])[0]
        if length == 0:
            return  # This box reaches to the end, wherever that is.
        if length == 1:
            if len(header) < 16:
                raise OSError(f"{path}: the video is cut short")
            length = struct.unpack(">Q", header[8:16])[0]
        if length < 8:
            raise OSError(f"{path}: the video is damaged: a part of it has an impossible length")
        position += length
    _check_end(path, position, size)


def _check_matroska(path: Path, stream: BinaryIO, size: int) -> None:
    """Compare the length that the outermost element of a WebM or Matroska file states."""
    position = len(_EBML)
    length, width = _variable_integer(stream, position)
    position += width + (length or 0)
    stream.seek(position)
    if stream.read(4) != _SEGMENT:
        raise OSError(f"{path}: the video is cut short or damaged: it has no segment")
    length, width = _variable_integer(stream, position + 4)
    if width == 0:
        raise OSError(f"{path}: the video is cut short")
    if length is not None:
        _check_end(path, position + 4 + width + length, size)


def _variable_integer(stream: BinaryIO, position: int) -> tuple[int | None, int]:
    """Read a length as Matroska writes it; None means that it is not stated, as in live streams."""
    stream.seek(position)
    data = stream.read(8)
    if not data or data[0] == 0:
        return None, 0
    width = 9 - data[0].bit_length()
    if len(data) < width:
        return None, 0
    largest = 2 ** (7 * width) - 1
    value = int.from_bytes(data[:width], "big") & largest
    return (None if value == largest else value), width


def _check_end(path: Path, stated: int, size: int) -> None:
    if stated > size:
        raise OSError(f"{path}: the video is cut short: {size} of {stated} bytes are there")

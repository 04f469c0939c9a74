"""Rows of EXR, PNG and TIFF packed, and read back, by all threads.

OpenImageIO, which does so in one thread, writes headers with one row at most.
"""

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TypeAlias

import deflate
import numpy as np

from flurries import _core
from flurries._contract import Array

# Flakes are noise: higher levels take up to three times as long for 1 to 4 bytes in 100.
LEVEL = 1

# An entry of a TIFF's table, in the machine's order of bytes, and tags of heights and of strips.
_ENTRY = np.dtype([("tag", "u2"), ("kind", "u2"), ("count", "u4"), ("value", "u4")])
_HEIGHT, _PLACES, _STRIP, _LENGTHS = 257, 273, 278, 279

_NOTHING = np.empty(0, np.uint8)

# Some rows as a file has them: packed, and before that.
Rows: TypeAlias = tuple[bytes, Array]

# Parts of the file, their first rows, and rows.
Pieces: TypeAlias = Iterable[tuple[int, int, Rows]]


class Place(NamedTuple):
    """Where rows are in a file, how many bytes, how many there were before, and their sum."""

    at: int
    length: int
    size: int
    crc: int


def each(work: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Any]:
    """Yield what is made of each item, in order, by as many threads as kernels use."""
    count = min(_core.threads(), len(items))
    if count < 2:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(count, "packer") as pool:
        yield from pool.map(work, items)


def is_whole(path: Path, place: Place) -> bool:
    """Whether rows in a file are those that were packed."""
    with path.open("rb") as file:
        file.seek(place.at)
        data = file.read(place.length)
    try:
        if path.suffix.lower() == ".png":
            data = zlib.decompressobj(-15).decompress(data)
        elif len(data) != place.size:
            data = bytes(deflate.zlib_decompress(data, place.size))
    except (zlib.error, deflate.DeflateError):
        return False
    return len(data) == place.size and deflate.crc32(data) == place.crc


def _put(file: BinaryIO, rows: Rows) -> Place:
    (data, raw), at = rows, file.tell()
    file.write(data)
    return Place(at, len(data), raw.nbytes, deflate.crc32(raw))


def _exr_rows(band: Array, names: Sequence[str]) -> Rows:
    """Of each row all of one channel, then all of the next, by their names."""
    if band.ndim == 3:
        band = np.stack([band[..., k] for k in np.argsort(names)], axis=1)
    raw, words = band.reshape(-1).view(np.uint8), band.reshape(-1).view(np.uint16)
    # Lower and upper bytes apart, each told by its difference from the one before.
    apart = np.concatenate([words.astype(np.uint8), (words >> 8).astype(np.uint8)])
    told = apart.copy()
    told[1:] -= apart[:-1] + np.uint8(128)
    data = bytes(deflate.zlib_compress(told, LEVEL))
    return (data, told) if len(data) < raw.size else (raw.tobytes(), raw)


def _write_exr(file: BinaryIO, told: bytes, specs: Sequence[Any], pieces: Pieces) -> list[Place]:
    places, starts = [], []
    file.write(told)
    for part, top, rows in pieces:
        starts.append(file.tell())
        head = (part,) * (len(specs) > 1) + (specs[part].y + top, len(rows[0]))
        file.write(struct.pack(f"<{len(head)}i", *head))
        places.append(_put(file, rows))
    # The table of where they are stands at the end of what was told.
    file.seek(len(told) - 8 * len(starts))
    file.write(np.array(starts, "<u8").tobytes())
    return places


def _png_rows(band: Array, names: Sequence[str]) -> Rows:
    """Of each row how it is told, then its differences from the row above."""
    values = band.astype(band.dtype.newbyteorder(">")).view(np.uint8).reshape(len(band), -1)
    raw = np.full((len(values), values.shape[1] + 1), 2, np.uint8)
    raw[0, 0], raw[0, 1:] = 0, values[0]
    np.subtract(values[1:], values[:-1], out=raw[1:, 1:])
    # Nothing repeats in differences of noise: without a search, half the time and as many bytes.
    packer = zlib.compressobj(LEVEL, zlib.DEFLATED, -15, 9, zlib.Z_HUFFMAN_ONLY)
    return packer.compress(raw.data) + packer.flush(zlib.Z_SYNC_FLUSH), raw


def _write_png(file: BinaryIO, told: bytes, specs: Sequence[Any], pieces: Pieces) -> list[Place]:
    def chunk(kind: bytes, data: bytes, raw: Array = _NOTHING) -> Place:
        file.write(struct.pack(">I4s", len(data), kind))
        place = _put(file, (data, raw))
        file.write(struct.pack(">I", deflate.crc32(data, zlib.crc32(kind))))
        return place

    at, total, places = told.rindex(b"IDAT") - 4, 1, []
    file.write(told[:8])
    size = told[16:20] + struct.pack(">I", specs[0].height)
    chunk(b"IHDR", size + told[24:29])
    file.write(told[33:at])
    # One stream in many chunks: how it begins, its pieces, and its end and sum.
    chunk(b"IDAT", b"\x78\x01")
    for _, _, rows in pieces:
        total = deflate.adler32(rows[1], total)
        places.append(chunk(b"IDAT", *rows))
    chunk(b"IDAT", b"\x03\0" + struct.pack(">I", total))
    file.write(told[at + 12 + int.from_bytes(told[at : at + 4], "big") :])
    return places


def _tiff_rows(band: Array, names: Sequence[str]) -> Rows:
    """Of each row the first pixel, then differences from the pixel to the left."""
    raw = np.array(band)
    raw[:, 1:] -= band[:, :-1]
    return bytes(deflate.zlib_compress(raw, LEVEL)), raw


def _write_tiff(file: BinaryIO, told: bytes, specs: Sequence[Any], pieces: Pieces) -> list[Place]:
    file.write(told)
    places = [_put(file, rows) for _, _, rows in pieces]
    (at,) = struct.unpack_from("=I", told, 4)
    (count,) = struct.unpack_from("=H", told, at)
    table = np.frombuffer(told, _ENTRY, count, at + 2).copy()
    said = {_HEIGHT: [specs[0].height], _STRIP: [WAYS[".tif"][0]]}
    said |= {_PLACES: [one.at for one in places], _LENGTHS: [one.length for one in places]}
    file.write(bytes(file.tell() % 2))
    for entry in table:
        if values := said.get(int(entry["tag"])):
            # One number stands in the entry itself, of several where they are.
            where = values[0] if len(values) == 1 else file.tell()
            entry["kind"], entry["count"], entry["value"] = 4, len(values), where
            file.write(np.array(values, "u4").tobytes())
    file.seek(at + 2)
    file.write(table.tobytes())
    return places


# How a format has rows: how many at a time; whether OpenImageIO writes its header with the first
# row, or with none; their bytes; and how these are written.
WAYS = {
    ".exr": (16, False, _exr_rows, _write_exr),
    ".png": (64, True, _png_rows, _write_png),
    **dict.fromkeys((".tif", ".tiff"), (32, True, _tiff_rows, _write_tiff)),
}

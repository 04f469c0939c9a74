"""Parts of a picture as files have them: written in bands, and read back."""

import os
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TypeAlias

import deflate
import numpy as np

from flurries import _core
from flurries._contract import Array, PathLike, naming
from flurries.io.atomic import replacing
from flurries.io.files import Budget
from flurries.io.oiio import last_error, openimageio
from flurries.io.pictures.header import opened_picture

LEVEL = 1  # Flakes are noise: higher levels take up to three times as long for 1 to 4 bytes in 100.

# An entry of a TIFF's table, in the machine's order of bytes, and tags of heights and of strips.
_ENTRY = np.dtype([("tag", "u2"), ("kind", "u2"), ("count", "u4"), ("value", "u4")])
_HEIGHT, _PLACES, _STRIP, _LENGTHS = 257, 273, 278, 279

_NOTHING = np.empty(0, np.uint8)

Rows: TypeAlias = tuple[bytes, Array]  # Some rows as a file has them: packed, and before that.

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
    # Without a wait for its threads: who drops this may be one that must not.
    made = map if count < 2 else ThreadPoolExecutor(count, "packer").map
    yield from made(work, items)


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

_ROWS = 64  # A whole number of the strips and blocks in which EXR and TIFF compress.


class Part(NamedTuple):
    """A part of a picture: what OpenImageIO is told of it, and its rows from one to another."""

    specification: Any
    band: Callable[[int, int], Array]


def write_parts(
    path: PathLike, parts: Sequence[Part], *, packed: bool = True,
    lossless: bool = True, encoded: bytes = b"",
) -> None:  # fmt: skip
    """Write a picture of one part, or if it is packed here of several, and verify it."""
    target = os.fspath(path)
    with replacing(path) as temporary:
        total, places = ("uint8", 0), list[Place]()
        if encoded:
            temporary.write_bytes(encoded)
        elif packed:
            places = _pack(target, temporary, parts)
        else:
            total = _write(target, temporary, *parts[0])
        if temporary.suffix.lower() == ".dpx":
            # OpenImageIO puts the hidden name there, and the way to it.
            with temporary.open("r+b") as file:
                file.seek(36)
                file.write(bytes(100))
        specs = [one.specification for one in parts]
        _verify(target, temporary, specs, places, total, lossless=lossless)


def _pack(target: str, temporary: Path, parts: Sequence[Part]) -> list[Place]:
    """Let OpenImageIO write headers, and the rows behind them; return where these are."""
    # It packs rows in one thread, and turns numbers over on the way, which takes longer.
    step, headed, pack, write = WAYS[temporary.suffix.lower()]
    specs, first = [part.specification for part in parts], parts[0].specification.copy()
    if headed:
        first.height = first.full_height = 1
    with output_of(target, temporary, [first] if headed else specs) as output:
        row = np.zeros((1, first.width, first.nchannels), str(first.format))
        if headed and not output.write_scanlines(first.y, first.y + 1, 0, row):
            raise unwritten(target, output)

    def packed(piece: tuple[int, int]) -> tuple[int, int, Rows]:
        (number, top), (spec, band) = piece, parts[piece[0]]
        return number, top, pack(band(top, min(top + step, spec.height)), spec.channelnames)

    pieces = [(n, top) for n, one in enumerate(specs) for top in range(0, one.height, step)]
    head = temporary.read_bytes()
    # Where a disk is full the library may write half a header, and not tell.
    refused = naming(f"{target}: cannot be written", ValueError, struct.error, then=OSError)
    with refused, temporary.open("wb") as file:
        return write(file, head, specs, each(packed, pieces))


def _write(
    target: str, temporary: Path, spec: Any, band: Callable[[int, int], Array]
) -> tuple[str, int]:
    """Let OpenImageIO write all rows; return the type of their numbers and the sum."""
    found, kind = 0, ""
    with output_of(target, temporary, [spec]) as output:
        for top in range(0, spec.height, _ROWS):
            last = min(top + _ROWS, spec.height)
            rows = np.ascontiguousarray(band(top, last))
            found, kind = zlib.crc32(rows.data, found), rows.dtype.name
            if not output.write_scanlines(spec.y + top, spec.y + last, 0, rows):
                raise unwritten(target, output)
    return {"float16": "half", "float32": "float"}.get(kind, kind), found


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
    target: str, temporary: Path, specs: Sequence[Any], places: Sequence[Place],
    total: tuple[str, int], *, lossless: bool,
) -> None:  # fmt: skip
    """Read the picture back; a full disk or a faulty writer shows here and not next week."""
    # Whatever was written may be read.
    most = max(
        16 * one.nchannels * max(one.width * one.height, one.full_width * one.full_height)
        for one in specs
    )
    try:
        with opened_picture(temporary, Budget(2**62, most)) as opened:
            for number, one in enumerate(specs):
                there = opened.at(number).specification
                sizes = [(spec.width, spec.height, spec.nchannels) for spec in (there, one)]
                if sizes[0] != sizes[1]:
                    raise OSError("it has another size or other channels")
            whole = all([*each(partial(is_whole, temporary), places)])
            if not places:
                # EXR keeps channels in alphabetical order, whatever order they were given in.
                order = [there.channelindex(name) for name in one.channelnames]
                if sorted(order) != list(range(one.nchannels)):
                    order = sorted(range(one.nchannels))
                (kind, wanted), found = total, 0
                for _, rows in opened.at(0).bands(order, kind, _ROWS):
                    found = zlib.crc32(np.ascontiguousarray(rows).data, found)
                whole = found == wanted or not lossless
            if not whole:
                raise OSError("its pixels are not those that were written")
    except (OSError, ValueError) as error:
        raise OSError(f"{target}: does not read back: {error}") from error

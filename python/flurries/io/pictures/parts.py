"""Parts of a picture as files have them: written in bands, and read back."""

import os
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, PathLike
from flurries.io.atomic import replacing
from flurries.io.files import Budget
from flurries.io.oiio import last_error, openimageio
from flurries.io.pictures.header import opened_picture
from flurries.io.pictures.packed import WAYS, Place, Rows, each, is_whole

# A whole number of the strips and blocks in which EXR and TIFF compress.
_ROWS = 64


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
    told = temporary.read_bytes()
    try:
        with temporary.open("wb") as file:
            return write(file, told, specs, each(packed, pieces))
    except (ValueError, struct.error) as error:
        # Where a disk is full the library may write half a header, and not tell.
        raise OSError(f"{target}: cannot be written: {error}") from error


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
            whole = all(each(partial(is_whole, temporary), places))
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

"""Whole numbers of 32 bits beside halves and floats in an EXR.

OpenImageIO turns what it writes to channels of several types into floats on the way, which know 24
bits. So whole numbers are written as floats of the same bits, and then the header is told what they
are: EXR holds and packs both types alike, as four bytes, but for the compressions that round.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flurries.io.oiio import openimageio

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

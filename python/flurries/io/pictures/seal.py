"""A hash of a picture's file inside the file, where the format has no checksums: JPEG and TIFF.

A flipped bit there gives other pixels and no error. The hash is that of all bytes of the file with
zeros in its own place.
"""

from __future__ import annotations

import hashlib
import mmap
from pathlib import Path

from flurries.io.pictures.metadata import PREFIX

# The metadata that holds it, and what stands there while a file is written.
KEY = "sha256"
PLACE = "0" * 64

_BEFORE = f'"{PREFIX}{KEY}": "'.encode()
# A header stands at the beginning of a JPEG, and wherever it likes in a TIFF.
_LENGTH = len(PLACE)


def seal(path: Path) -> None:
    """Write the hash into a file that has a place for it."""
    with path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as data:
        at = data.find(_BEFORE)
        if at >= 0:
            at += len(_BEFORE)
            data[at : at + _LENGTH] = _hash_without(data, at)


def is_broken(path: Path) -> bool:
    """Whether a file has a hash of itself that is not its own."""
    if path.stat().st_size == 0:
        return False
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(_BEFORE)
        if at < 0:
            return False
        at += len(_BEFORE)
        return data[at : at + _LENGTH] != _hash_without(data, at)


def _hash_without(data: mmap.mmap, at: int) -> bytes:
    digest = hashlib.sha256()
    with memoryview(data) as view, view[:at] as head, view[at + _LENGTH :] as tail:
        digest.update(head)
        digest.update(PLACE.encode())
        digest.update(tail)
    return digest.hexdigest().encode()

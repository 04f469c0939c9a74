"""Files that are read: plain ones only, and never more than fits into memory."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TypeVar

from flurries._contract import PathLike, _came, integer, naming

_Kind = TypeVar("_Kind")

_BLOCK = 1 << 20

_PIXELS_VARIABLE, _BYTES_VARIABLE = "FLURRIES_MAX_PIXELS", "FLURRIES_MAX_BYTES"
# A picture of 16384 x 16384 px with four floats a pixel: a frame over it still fits into 8 GiB.
_PIXELS, _BYTES = 2**28, 2**32


def _limit(variable: str, default: int) -> int:
    text = os.environ.get(variable, "").strip() or str(default)
    if not text.isascii() or not text.isdigit() or not 0 < len(text) <= 18 or int(text) == 0:
        raise ValueError(f"{variable} must be a whole number above 0, got {text[:40]!r}")
    return int(text)


@dataclass(frozen=True)
class Budget:
    """The largest size of a picture, or of a film's frame, that is read; by what headers claim.

    Parameters
    ----------
    pixels, bytes : int
        Of what is stored and of what is shown, and that the decoded numbers take; the environment
        variables FLURRIES_MAX_PIXELS and FLURRIES_MAX_BYTES if not given, or else 2^28, which is
        16384 x 16384, and 2^32.
    """

    pixels: int = field(default_factory=lambda: _limit(_PIXELS_VARIABLE, _PIXELS))
    bytes: int = field(default_factory=lambda: _limit(_BYTES_VARIABLE, _BYTES))

    def __post_init__(self) -> None:
        integer("pixels", self.pixels, low=1, high=2**62)
        integer("bytes", self.bytes, low=1, high=2**62)

    def admit(self, path: Path, size: tuple[int, int], pixel_bytes: int) -> None:
        """Raise OSError if a picture of (width, height) with so many bytes a pixel is too large."""
        width, height = size
        claims = f"{path}: the picture claims {width} x {height} px"
        if width <= 0 or height <= 0:
            raise OSError(f"{claims}, and has none")
        if width * height > self.pixels:
            raise OSError(
                f"{claims}, more than the {self.pixels} that are allowed; "
                f"{_PIXELS_VARIABLE} raises the limit"
            )
        needed = width * height * pixel_bytes
        if needed > self.bytes:
            raise OSError(
                f"{claims} of {pixel_bytes} bytes, {needed} in all and more than the {self.bytes} "
                f"that are allowed; {_BYTES_VARIABLE} raises the limit"
            )


def given(name: str, value: object, kind: type[_Kind]) -> _Kind:
    """Return an argument that must be of a class; the class's usual object for None."""
    if value is None:
        return kind()
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be a flurries.io {kind.__name__}, got {_came(value)}")
    return value


def path_text(name: str, path: PathLike) -> str:
    text = os.fspath(path)
    if not isinstance(text, str):
        raise TypeError(f"{name} must be a string or a path, got {type(path).__name__}")
    if not text or "\0" in text:
        raise ValueError(f"{name} must name a file, got {text!r:.60}")
    return text


@contextmanager
def file_of(name: str) -> Iterator[None]:
    """Say of a file that is missing or cannot be read which argument names it."""
    try:
        yield
    except OSError as error:
        if error.strerror:
            error.strerror = f"{name}: {error.strerror}"
        else:
            error.args = (f"{name}: {error}",)
        raise


def plain_file(path: PathLike) -> Path:
    """Return `path` as a Path if it can be read; links count as what they lead to."""
    found = Path(path_text("path", path))
    _require_plain(found.stat(), found)  # FileNotFoundError names the file by itself.
    if not os.access(found, os.R_OK):
        found.stat()  # It may be gone by now.
        raise PermissionError(errno.EACCES, "Cannot be read", str(found))
    return found


def _require_plain(status: os.stat_result, path: Path) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise OSError(errno.EISDIR, "Is a folder, not a file", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "Is not a plain file", str(path))


def read_bytes(path: PathLike, most: int, kind: str) -> bytes:
    found = plain_file(path)
    # The name may lead elsewhere by now: a FIFO must not be waited for, nor a device be read.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(found, flags | getattr(os, "O_CLOEXEC", 0)), "rb") as stream:  # noqa: PTH123
        status = os.fstat(stream.fileno())
        _require_plain(status, found)
        # Some files have more bytes than they say.
        blocks = islice(iter(partial(stream.read, _BLOCK), b""), most // _BLOCK + 1)
        data = b"" if status.st_size > most else b"".join(blocks)
    if max(status.st_size, len(data)) > most:
        raise ValueError(f"{found}: a {kind} has at most {most} bytes, got more")
    return data


def read_text(path: PathLike, most: int, kind: str) -> str:
    """Return the UTF-8 text of a file of at most `most` bytes, without a byte order mark."""
    with naming(f"{os.fspath(path)}: a {kind} is UTF-8 text", UnicodeDecodeError, then=ValueError):
        return read_bytes(path, most, kind).decode("utf-8-sig").replace("\r\n", "\n")


def hash_of(path: Path) -> str:
    with path.open("rb") as file:
        digest = hashlib.sha256()
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()

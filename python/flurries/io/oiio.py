"""The one gate to OpenImageIO: imported when first needed, its threads, limits and errors tamed."""

import ctypes
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flurries._kept import kept


@kept(1)
def openimageio() -> Any:
    """Import OpenImageIO and return the module, without its threads."""
    import OpenImageIO as library

    # A forked child inherits its global pools without the threads, and would wait for ever.
    library.attribute("threads", 1)
    library.attribute("exr_threads", -1)
    library.attribute(_LIMIT, 1)
    return library


# Who reads a picture now, and in which process: a fork has its parent's. Without a lock, which a
# fork in another thread would leave closed.
_reading: set[tuple[int, object]] = set()


@kept(1)
def _errors() -> tuple[ctypes.c_void_p, int | None, int] | None:
    """Return the C library's variable of the stream for errors, the stream, and one to nowhere."""
    name = "__stderrp" if sys.platform == "darwin" else "stderr"
    if sys.platform != "darwin" and platform.libc_ver()[0] != "glibc":
        return None  # It may be a constant there.
    library = ctypes.CDLL(None)
    library.fopen.restype = ctypes.c_void_p
    variable = ctypes.c_void_p.in_dll(library, name)
    return variable, variable.value, library.fopen(os.devnull.encode(), b"w")


@contextmanager
def libraries_silent() -> Iterator[None]:
    """Keep libpng, and nobody else, from the terminal: what it writes is said by our errors."""
    found, token = _errors(), (os.getpid(), object())
    if found is None:
        yield
        return
    variable, real, nowhere = found
    _reading.add(token)
    variable.value = nowhere
    try:
        yield
    finally:
        _reading.discard(token)
        others = (process == token[0] for process, _ in list(_reading))
        variable.value = nowhere if any(others) else real


_LIMIT, _LONGEST = "limits:imagesize_MB", 500


def let_open(size: int) -> None:
    # Some formats are decoded when they are opened, so its own limit must hold them back. It is one
    # for the whole process and only grows: a thread may be opening a larger picture.
    library, wanted = openimageio(), -(-size // 2**20)
    if wanted > library.get_int_attribute(_LIMIT):
        library.attribute(_LIMIT, min(wanted, 2**31 - 1))


def last_error(*holders: Any) -> str:
    """Return OpenImageIO's message about the last failure, on one line, and clear it."""
    # Messages pile up in the object that failed and in a global list, and an unread one would be
    # taken for the next file's.
    messages = []
    for holder in (*holders, openimageio()):
        try:
            messages.append(holder.geterror())
        except UnicodeDecodeError:
            # It quotes a damaged file.
            messages.append("no reason that could be put into words")
    words = "; ".join(" ".join(message.split()) for message in messages if message)
    # A damaged file may be complained of row by row.
    return words if len(words) <= _LONGEST else f"{words[:_LONGEST]}..."

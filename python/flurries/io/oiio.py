"""The one gate to OpenImageIO: imported when first needed, its threads, limits and errors tamed."""

import ctypes
import os
import platform
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from flurries import _core
from flurries._kept import kept


@kept(1)
def openimageio() -> Any:
    """Import OpenImageIO and return the module, without its threads."""
    import OpenImageIO as library

    # Its pools are global, and a forked child inherits them without the threads: writing an EXR
    # then waits for ever. So all happens in the calling thread, which lets go of the GIL; a large
    # EXR has threads while it is written, see `packing_threads`.
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
    """Keep libpng from the terminal: what it writes there is said by an error of ours.

    File descriptor 2 stays, and so do Python's words and those of other processes.
    """
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


# Held while OpenEXR has threads. A fork waits for it; the thread that forks may hold it itself.
_packing = threading.RLock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_packing.acquire, after_in_parent=_packing.release, after_in_child=_packing.release
    )


@contextmanager
def packing_threads() -> Iterator[None]:
    """Let EXR be packed by as many threads as kernels use, until the end of the block."""
    count = _core.threads()
    # OpenEXR has one pool, so one picture at a time has them; others are packed by their callers.
    if count == 1 or not _packing.acquire(blocking=False):
        yield
        return
    try:
        openimageio().attribute("exr_threads", count)
        yield
    finally:
        _let_threads_go()
        _packing.release()


def _let_threads_go() -> None:
    """Take OpenEXR its threads: it loses them when a file is opened to be written, no sooner."""
    library = openimageio()
    library.attribute("exr_threads", -1)
    nowhere = library.ImageOutput.create("nowhere.exr")
    if nowhere.open(os.devnull, library.ImageSpec(1, 1, 1, "half")):
        nowhere.write_image(np.zeros((1, 1, 1), np.float16))
    nowhere.close()
    last_error(nowhere)


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

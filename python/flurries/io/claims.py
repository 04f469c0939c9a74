"""Who makes which frame: several processes share a folder without a master.

A process that makes a file holds a lock on a hidden file beside it. The system lets go of the lock
when the process dies, so nothing has to be cleaned up before another takes over. Where a file
system has no locks two processes may make the same frame; each is renamed whole, with equal bits.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import time
from pathlib import Path

from flurries.io.atomic import PREFIX, TOKEN_LENGTH

if sys.platform != "win32":
    import fcntl

# How often a claim that another holds is asked for again, seconds.
_PAUSE = 0.05


class Claim:
    """The right to make a file; given back by `release`, or when the process ends."""

    def __init__(self, file: Path, descriptor: int | None) -> None:
        self._file = file
        self._descriptor = descriptor

    def release(self) -> None:
        """Let others have it."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            # Before the lock is gone: whoever gets it next must find the name free.
            with contextlib.suppress(OSError):
                self._file.unlink()
            os.close(descriptor)


def claimed(target: Path) -> Claim | None:
    """Return the right to make a file, or None if somebody is making it.

    Raises
    ------
    OSError
        If its folder cannot be written to.
    """
    token = hashlib.sha256(os.fsencode(target.name)).hexdigest()[:TOKEN_LENGTH]
    file = target.with_name(f"{PREFIX}{token}-claim")
    if sys.platform == "win32":
        return Claim(file, None)
    while True:
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        descriptor = os.open(file, flags, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError:
            # No locks here.
            os.close(descriptor)
            with contextlib.suppress(OSError):
                file.unlink()
            return Claim(file, None)
        # Whoever had it may have removed it between the opening and the locking.
        if os.fstat(descriptor).st_nlink:
            return Claim(file, descriptor)
        os.close(descriptor)


def awaited(target: Path) -> Claim:
    """Return the right to make a file as soon as nobody else is making it."""
    while (claim := claimed(target)) is None:
        time.sleep(_PAUSE)
    return claim

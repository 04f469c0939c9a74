"""Who makes which file: several processes share a folder without a master.

A process that makes a file holds a lock on a hidden file beside it. The system lets go of the lock
when the process dies, so nothing has to be cleaned up before another takes over. Where a file
system has no locks, or locks that only one machine sees, two processes may make the same file; each
is renamed whole, with equal bits.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import sys
import time
from pathlib import Path

from flurries.io.atomic import PREFIX, TOKEN_LENGTH, owner_of_new_files, remove_abandoned

if sys.platform != "win32":
    import fcntl

# How often a claim that another holds is asked for again, seconds.
_PAUSE = 0.05


class Claim:
    """The right to make a file; given back by `release`, or when the process ends."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._process = os.getpid()
        self._descriptor: int | None = None

    def take(self) -> bool | None:
        """Make the file and lock it: whether that worked, or None where there are no locks."""
        # Known before it is there: Ctrl-C can fall between any two of these steps.
        _claims.add(self)
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        try:
            self._descriptor = os.open(self._file, flags, 0o666)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._let_go()
            return False
        except OSError:
            if self._descriptor is None:
                _claims.discard(self)
                raise
            self.release()
            return None
        # Whoever had it may have removed it between the opening and the locking.
        if os.fstat(self._descriptor).st_nlink:
            # Whose it was, if this process is killed.
            with contextlib.suppress(OSError):
                os.pwrite(self._descriptor, owner_of_new_files().encode(), 0)
            return True
        self._let_go()
        return False

    def release(self) -> None:
        """Let others have it."""
        if self._descriptor is not None:
            # Before the lock is gone: whoever gets it next must find the name free.
            with contextlib.suppress(OSError):
                self._file.unlink()
        self._let_go()

    def _let_go(self) -> None:
        _claims.discard(self)
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def give_up(self) -> None:
        """Remove the file at the end of the process that made it, unless it is another's by now."""
        if self._process == os.getpid():
            self._let_go()
            remove_abandoned(self._file)


# Those that this process has, or was about to have.
_claims: set[Claim] = set()


@atexit.register
def _give_up_all() -> None:
    for claim in list(_claims):
        claim.give_up()


def claimed(target: Path) -> Claim | None:
    """Return the right to make a file, or None if somebody is making it.

    Raises
    ------
    OSError
        If its folder cannot be written to.
    """
    token = hashlib.sha256(os.fsencode(target.name)).hexdigest()[:TOKEN_LENGTH]
    file = target.with_name(f"{PREFIX}{token}-claim")
    claim = Claim(file)
    if sys.platform == "win32":
        return claim
    while not (taken := claim.take()):
        if taken is None:
            return claim
        if file.exists():
            return None
    return claim


def awaited(target: Path) -> Claim:
    """Return the right to make a file as soon as nobody else is making it."""
    while (claim := claimed(target)) is None:
        time.sleep(_PAUSE)
    return claim

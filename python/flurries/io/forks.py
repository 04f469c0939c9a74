"""What a forked child must leave alone.

Codecs have threads, locks and open files. A child inherits the memory of all three, but neither the
threads nor the right to move the parent's place in a file: closing or freeing a codec in a child
waits for threads that are not there, or writes into the parent's file.
"""

from __future__ import annotations

import ctypes
import os
import threading
from weakref import WeakSet

_holders: WeakSet[object] = WeakSet()

guard = threading.Lock()


def never_free_in_children(holder: object) -> None:
    """Make `holder`, and what it refers to, immortal in every child that is forked from now on."""
    _holders.add(holder)


def _after_fork() -> None:
    global guard
    # A thread that is gone may have held it.
    guard = threading.Lock()
    for holder in list(_holders):
        # A reference that is never given back keeps the garbage collector away.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(holder))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)

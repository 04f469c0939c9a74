"""Planes of a frame in memory that an earlier frame has given back.

The system hands out fresh memory page by page and clears it, which a frame with layers waits for.
What a dropped frame held is kept here, up to a limit, and used again once no array and no view of
it is left.
"""

from __future__ import annotations

import math
from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array

# Bytes: smaller arrays come from the heap anyway; what is more than the most goes to the system.
LEAST, MOST = 1 << 20, 1 << 28

# Memory is taken from the right, where the newest is; what does not fit goes to the left. There is
# no lock: `_Lent.__del__` may run in the middle of anything, and a deque's own steps are whole.
_free: deque[npt.NDArray[np.uint8]] = deque()


class _Lent:
    """The owner of an array's memory: it goes when the last view does."""

    def __init__(self, memory: npt.NDArray[np.uint8], shape: tuple[int, ...], kind: Any) -> None:
        place = (memory.ctypes.data, False)
        self.memory = memory
        self.__array_interface__ = {"shape": shape, "typestr": kind, "data": place, "version": 3}

    def __del__(self, free: deque[npt.NDArray[np.uint8]] = _free) -> None:
        # Ctrl-C may come before it has memory; other threads take and give at the same time.
        with suppress(AttributeError, IndexError):
            free.append(self.memory)
            while sum(one.nbytes for one in free.copy()) > MOST:
                free.popleft()


def plane(shape: tuple[int, ...], dtype: npt.DTypeLike = np.float32) -> Array:
    """Return a C-contiguous array of any values, as `np.empty` does."""
    kind = np.dtype(dtype)
    size = kind.itemsize * math.prod(shape)
    if size < LEAST:
        return np.empty(shape, kind)
    memory = _given_back(size)
    return np.asarray(
        _Lent(np.empty(size, np.uint8) if memory is None else memory, shape, kind.str)
    )


def forget() -> None:
    """Give the system what is kept."""
    _free.clear()


def _given_back(size: int) -> npt.NDArray[np.uint8] | None:
    """Return memory of a size that nobody holds any more, or None."""
    with suppress(IndexError):
        for _ in range(len(_free)):
            memory = _free.pop()
            if memory.nbytes == size:
                return memory
            _free.appendleft(memory)
    return None

"""Planes of a frame in memory that an earlier frame has given back: fresh memory is slow."""

import math
import sys
from collections import deque
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from flurries._contract import Array

# Bytes: smaller arrays come from the heap anyway; what is more than the most goes to the system.
LEAST, MOST = 1 << 20, 1 << 28

# Memory is taken from the right, where the newest is; what does not fit goes to the left. There is
# no lock: a deque's own steps are whole, and who has taken a memory out has it alone.
_kept: deque[npt.NDArray[np.uint8]] = deque()


def plane(shape: tuple[int, ...], dtype: npt.DTypeLike = np.float32) -> Array:
    """Return a C-contiguous array of any values, as `np.empty` does."""
    kind = np.dtype(dtype)
    size = kind.itemsize * math.prod(shape)
    if size < LEAST:
        return np.empty(shape, kind)
    # The list is the one holder of a memory that is free.
    one: list[npt.NDArray[np.uint8]] = []
    with suppress(IndexError):
        for _ in range(len(_kept)):
            one = [_kept.pop()]
            if one[0].nbytes == size and sys.getrefcount(one[0]) == _ALONE:
                break
            _kept.appendleft(one.pop())
    one = one or [np.empty(size, np.uint8)]
    result = one[0].view(kind).reshape(shape)
    _kept.append(one[0])
    with suppress(IndexError):
        while sum(memory.nbytes for memory in _kept.copy()) > MOST:
            _kept.popleft()
    return result


def blank(shape: tuple[int, ...]) -> Array:
    """Return a float32 plane of zeros."""
    result = plane(shape)
    result.fill(0.0)
    return result


def forget() -> None:
    """Give the system what is kept."""
    _kept.clear()


# What Python counts as the holders of what one list holds, which differs among its versions.
_ALONE = (lambda one: sys.getrefcount(one[0]))([np.empty(1, np.uint8)])

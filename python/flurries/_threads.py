"""How many threads the kernels use."""

from __future__ import annotations

from flurries import _core
from flurries._contract import integer

MOST_THREADS = 256


def set_threads(n: int) -> None:
    """Set the number of threads that the kernels use.

    The default is ``FLURRIES_NUM_THREADS``, or all cores. Results do not depend on it, bit for bit.

    Parameters
    ----------
    n : int
        1 to 256.

    Raises
    ------
    TypeError, ValueError
        If `n` is not such a number.
    """
    _core.set_threads(integer("n", n, low=1, high=MOST_THREADS))


def threads() -> int:
    """Return the number of threads that the kernels use."""
    return _core.threads()

"""How the kernels run: on how many threads, and whether with the same bits on every processor."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from flurries import _core
from flurries._contract import flag, integer
from flurries._core import reproducible as reproducible
from flurries._core import threads as threads

MOST_THREADS = 256


def set_threads(n: int) -> None:
    """Set the number of threads that the kernels use, 1 to 256; see :func:`settings`."""
    _core.set_threads(integer("n", n, low=1, high=MOST_THREADS))


class Settings:
    """Threads and mode of the kernels as they are; a context that gives back what was before."""

    def __init__(self, before: tuple[int, bool]) -> None:
        self._before = before

    @property
    def threads(self) -> int:
        """The number of threads that the kernels use."""
        return _core.threads()

    @property
    def reproducible(self) -> bool:
        """Whether the kernels give the same bits with all vector instructions."""
        return _core.reproducible()

    def __enter__(self) -> Settings:
        return self

    def __exit__(self, *_: object) -> None:
        settings(threads=self._before[0], reproducible=self._before[1])


def settings(*, threads: int | None = None, reproducible: bool | None = None) -> Settings:
    """Set how the kernels of this process run, and return it; in a ``with``, until it ends.

    Parameters
    ----------
    threads : int, optional
        1 to 256. The default is ``FLURRIES_NUM_THREADS``, or all cores. Results do not depend on
        it, bit for bit.
    reproducible : bool, optional
        Whether the kernels give the same bits whatever vector instructions the processor has. Off
        by default; ``FLURRIES_REPRODUCIBLE=1`` turns it on for a process and those that it starts.
        Without it AVX-512 and AVX2 agree with each other, and processors without either differ in
        the last bits. In float64 factors of a Fourier transform, and what NumPy prepares for a
        scene, may differ between processors all the same. ``python benches/accuracy.py precision``
        measures what it costs.
    """
    count = None if threads is None else integer("threads", threads, low=1, high=MOST_THREADS)
    mode = None if reproducible is None else flag("reproducible", reproducible)
    before = _core.threads(), _core.reproducible()
    if count is not None:
        _core.set_threads(count)
    if mode is not None:
        _core.set_reproducible(mode)
    return Settings(before)


@contextmanager
def scope(*, threads: int | None, reproducible: bool | None) -> Iterator[None]:
    """Give the calls of this thread a pool and a mode; None leaves them to the process."""
    before = _core.set_scope(threads, reproducible)
    try:
        yield
    finally:
        _core.set_scope(*before)

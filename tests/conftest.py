"""What the tests share: the default number of threads comes back after a test that changed it."""

import os
import signal
from collections.abc import Callable, Iterator

import pytest

# Threads of linear algebra that wait for work spin, beside the other workers and our own threads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A run that a script puts into the background ignores Ctrl-C, and so would all that tests start.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def threads() -> Iterator[Callable[[int], None]]:
    """`fl.set_threads`, undone at the end."""
    import flurries as fl  # not at the top: the twin's own tests must run without the kernels

    yield fl.set_threads
    fl.set_threads(max(1, min(os.cpu_count() or 1, 256)))

"""What the tests share: the default number of threads comes back after a test that changed it."""

import os
import signal
import sys
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


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Tell of a failure at once, for a run that is stopped before its end."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        print(f"\n{report.nodeid}\n{report.longreprtext[-4000:]}", file=sys.__stderr__, flush=True)

"""Calls timed in turns, so that a busy moment of the machine meets all of them."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

Calls = dict[str, Callable[[], object]]
# The minimum and the median of each, ms.
Times = dict[str, tuple[float, float]]


def timed(
    calls: Calls, runs: int, *, warm: int = 2, clock: Callable[[], float] = time.perf_counter
) -> Times:
    """Return the times of calls; the first turns warm caches and page in the outputs."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(runs + warm):
        for name, call in calls.items():
            start = clock()
            call()
            if turn >= warm:
                times[name].append(1e3 * (clock() - start))
    return {name: (min(values), statistics.median(values)) for name, values in times.items()}


def alone(code: str, *words: str, **environment: str) -> str:
    """Return what a program beside this file prints, run in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=Path(__file__).parent, check=True, text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment}, capture_output=True,
    )  # fmt: skip
    return done.stdout

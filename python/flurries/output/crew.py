"""Who makes many files: processes or a cluster's workers, to which groups of them are tasks."""

import os
import queue
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from flurries._threads import reproducible, scope
from flurries.io.stores import Line
from flurries.output import sequence
from flurries.output.journal import Journal
from flurries.output.sequence import Fates, Job, Progress

# Tasks that are under way for each thread, so that none waits and memory stays flat.
_AHEAD = 4

# How long a crew is not looked at, seconds.
_LOOK = 0.25

# How long a file that a worker has written may take to be seen here, seconds: folders on a network
# are not the same everywhere at once.
_LATE = 5.0


@dataclass(frozen=True)
class Crew:
    """Who does the work of one `shared` thing in tasks."""

    submit: Callable[..., Any]  # Takes a task and its arguments after the shared one.
    threads: Callable[[], int]  # Says how many tasks run at once; raises where none can any more.
    remote: bool  # Whether files that were written may be on another machine.


def make(
    crew: Crew, groups: list[list[int]], job: Job, indices: list[int], journal: Journal,
    progress: Progress, fates: Fates,
) -> None:  # fmt: skip
    """Make the files that are missing, as `flurries.output.sequence.make` does, by a crew."""

    def task(group: list[int]) -> Any:
        names = [journal.name_of(job.path_of(index)) for index in group]
        known = [line for name in names for line in journal.lines(name)]
        return crew.submit(_make, reproducible(), group, journal.run, known)

    ticks = iter(progress([number for index in indices for number in job.frames(index)]))
    for group, future in _ended(crew, task, groups):
        numbers = [number for index in group for number in job.frames(index)]
        fates.update(_result(crew, future, numbers))
        for _ in numbers:
            next(ticks, None)
    for _ in ticks:
        pass
    if crew.remote:
        here = set(fates.of("written", "held", "kept"))
        made = [index for index in indices if not here.isdisjoint(job.frames(index))]
        _require_here(job, made)


def _make(job: Job, plain: bool, group: list[int], run: str, known: list[Line]) -> Fates:
    fates, journal = Fates(), Journal(job.store, job.folder, run=run, known=known)
    with on_one_core(plain):
        sequence.make(job, group, journal, lambda frames: frames, fates)
    return fates


def _require_here(job: Job, indices: list[int]) -> None:
    last = time.monotonic() + _LATE
    while missing := job.store.missing([job.path_of(index) for index in indices]):
        if time.monotonic() > last:
            raise OSError(
                f"{job.store.name_of(missing[0])}: a worker has written it, but here it is not: "
                "the folder must be one that all machines see"
            )
        time.sleep(0.05)


def _ended(
    crew: Crew, task: Callable[[list[int]], Any], groups: list[list[int]]
) -> Iterator[tuple[list[int], Any]]:
    """Begin a task for each group, not too many at once; yield groups and futures as they end."""
    waiting = iter(groups)
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    pending: dict[Any, list[int]] = {}
    looked, most = -1e9, 0
    try:
        while True:
            if time.monotonic() - looked > _LOOK:
                most, looked = _AHEAD * max(crew.threads(), 2), time.monotonic()
            while len(pending) < most and (group := next(waiting, None)) is not None:
                future = task(group)
                pending[future] = group
                future.add_done_callback(ended.put)
            if not pending:
                return
            try:
                future = ended.get(timeout=_LOOK)
            except queue.Empty:
                continue
            yield pending.pop(future), future
    finally:
        for future in pending:
            future.cancel()


def _result(crew: Crew, future: Any, numbers: list[int]) -> Any:
    try:
        return future.result()
    except Exception as error:
        if isinstance(error, (CancelledError, BrokenExecutor)):
            crew.threads()
            why = "their worker ended"
        elif type(error).__name__ == "KilledWorker":
            why = "every worker that took them died, perhaps for want of memory"
        else:
            raise
        named = f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
        raise RuntimeError(f"frames {named}: {why}") from error


@contextmanager
def on_one_core(plain: bool) -> Iterator[None]:
    """One thread to a file: where there are many files that wastes none. In the client's mode."""
    with scope(threads=None if "FLURRIES_NUM_THREADS" in os.environ else 1, reproducible=plain):
        yield

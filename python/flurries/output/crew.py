"""Who makes many files: processes or a cluster's workers, to which groups of them are tasks."""

from __future__ import annotations

import multiprocessing
import os
import queue
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from flurries._threads import reproducible, scope
from flurries.output import sequence
from flurries.output.journal import Entry, Journal
from flurries.output.sequence import Done, Job, Progress

# Tasks that are under way for each thread, so that none waits and memory stays flat.
_AHEAD = 4

# How long a file that a worker has written may take to be seen here, seconds: folders on a network
# are not the same everywhere at once.
_LATE = 5.0


@dataclass(frozen=True)
class Crew:
    """Who does the work of one `shared` thing in tasks."""

    submit: Callable[..., Any]  # Takes a task and its arguments after the shared one.
    threads: Callable[[], int]  # Says how many tasks run at once.
    look: Callable[[], None]  # Is called while no task ends; raises where none can end any more.
    remote: bool  # Whether files that were written may be on another machine.


def make(
    crew: Crew, groups: list[list[int]], job: Job, indices: list[int], journal: Journal,
    progress: Progress, done: Done,
) -> None:  # fmt: skip
    """Make the files that are missing, as `flurries.output.sequence.make` does, by a crew."""

    class Arriving:
        """The indices, each when its file is made."""

        def __len__(self) -> int:
            return len(indices)

        def __iter__(self) -> Iterator[int]:
            def task(numbers: list[int]) -> Any:
                names = [journal.name_of(job.path_of(number)) for number in numbers]
                known = [line for name in names for line in journal.lines(name)]
                return crew.submit(_make, reproducible(), numbers, journal.run, known)

            for numbers, result in results(crew, task, groups):
                done.add(result)
                yield from numbers

    for _ in progress(Arriving()):
        pass
    if crew.remote:
        _require_here(job, [*done.written, *done.kept])


def _make(job: Job, plain: bool, numbers: list[int], run: str, known: list[Entry]) -> Done:
    done, journal = Done(), Journal(job.store, job.folder, run=run, known=known)
    with on_one_core(plain):
        sequence.make(job, numbers, journal, lambda frames: frames, done)
    return done


def _require_here(job: Job, indices: list[int]) -> None:
    """Refuse to count files that workers have written but that are not here."""
    last = time.monotonic() + _LATE
    while missing := job.store.missing([job.path_of(index) for index in indices]):
        if time.monotonic() > last:
            raise OSError(
                f"{job.store.name_of(missing[0])}: a worker has written it, but here it is not: "
                "the folder must be one that all machines see"
            )
        time.sleep(0.05)


def results(
    crew: Crew, task: Callable[[list[int]], Any], groups: list[list[int]], *, in_order: bool = False
) -> Iterator[tuple[list[int], Any]]:
    """Do a task for each group; yield groups and results as they come, or in order."""
    waiting = iter(groups)
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    pending: dict[Any, list[int]] = {}
    early: set[Any] = set()
    try:
        while True:
            while len(pending) < _AHEAD * max(crew.threads(), 2):
                numbers = next(waiting, None)
                if numbers is None:
                    break
                future = task(numbers)
                pending[future] = numbers
                future.add_done_callback(ended.put)
            if not pending:
                return
            future = next(iter(pending))
            while not in_order or future not in early:
                try:
                    one = ended.get(timeout=1.0)
                except queue.Empty:
                    crew.look()
                    continue
                early.add(one)
                if not in_order:
                    future = one
                    break
            early.discard(future)
            yield pending[future], _result(crew, future, pending[future])
            del pending[future]
    finally:
        for future in pending:
            future.cancel()


def _result(crew: Crew, future: Any, numbers: list[int]) -> Any:
    try:
        return future.result()
    except (CancelledError, BrokenExecutor) as error:
        crew.look()
        raise RuntimeError(f"files {_named(numbers)}: their worker ended") from error
    except Exception as error:
        if type(error).__name__ != "KilledWorker":
            raise
        raise RuntimeError(
            f"frames {_named(numbers)}: every worker that took them died, "
            "perhaps for want of memory"
        ) from error


def _named(numbers: list[int]) -> str:
    return f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"


@contextmanager
def on_one_core(plain: bool) -> Iterator[None]:
    """One thread to a file: where there are many files that wastes none. In the client's mode."""
    with scope(threads=None if "FLURRIES_NUM_THREADS" in os.environ else 1, reproducible=plain):
        yield


# Processes of this machine ------------------------------------------------------------------------

# What the tasks of a process share.
_shared: list[Any] = []


def _begin(shared: Any) -> None:
    _shared[:] = [shared]


def _with_shared(task: Callable[..., Any], *arguments: Any) -> Any:
    return task(_shared[0], *arguments)


@contextmanager
def processes(shared: Any, count: int) -> Iterator[Crew]:
    # Spawned, not forked: what the caller's threads hold is not carried along.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, context, _begin, (shared,)) as pool:
        yield Crew(
            lambda *task: pool.submit(_with_shared, *task), lambda: count, lambda: None, False
        )

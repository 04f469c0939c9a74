"""Many files on many cores: processes of this machine, or the workers of a Dask cluster.

Workers make whole groups of files and write them where the client would have: the folder must be
one that all of them see. Whichever worker makes a file makes the same bits, and what a worker takes
with it when it dies is made again.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import queue
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from flurries._contract import real
from flurries._threads import reproducible, scope
from flurries.output import sequence
from flurries.output.sequence import Done, Entries, Job, Progress, name_of
from flurries.scene.fingerprint import hash_of

# Tasks that are under way for each thread, so that none waits and memory stays flat.
_AHEAD = 4

# How long a file that a worker has written may take to be seen here, seconds: folders on a network
# are not the same everywhere at once.
_LATE = 5.0

# How long a scheduler may take to answer, seconds.
_GREETING = 10.0

# After how long without workers it is said what is waited for, seconds.
_QUIET = 2.0


@dataclass(frozen=True)
class Crew:
    """Who does the work of one `shared` thing in tasks.

    Attributes
    ----------
    submit : callable
        Takes a task and its arguments after the shared one; returns a future.
    threads : callable
        Says how many tasks run at once.
    look : callable
        Is called while no task ends; raises where none can end any more.
    remote : bool
        Whether files that were written may be on another machine.
    """

    submit: Callable[..., Any]
    threads: Callable[[], int]
    look: Callable[[], None]
    remote: bool


def make(
    crew: Crew,
    groups: list[list[int]],
    job: Job,
    indices: list[int],
    known: Entries,
    progress: Progress,
    done: Done,
) -> None:
    """Make the files that are missing, as `flurries.output.sequence.make` does, by a crew."""
    arrived: list[Done] = []

    class Arriving:
        """The indices, each when its file is there."""

        def __len__(self) -> int:
            return len(indices)

        def __iter__(self) -> Iterator[int]:
            def task(numbers: list[int]) -> Any:
                named = [name_of(job, number) for number in numbers]
                said = {name: known[name] for name in named if name in known}
                return crew.submit(_make, reproducible(), numbers, said)

            for numbers, result in results(crew, task, groups):
                if crew.remote:
                    _require_here(job, result)
                arrived.append(result)
                yield from numbers

    try:
        for _ in progress(Arriving()):
            pass
    finally:
        for part in arrived:
            done.add(part)


def _make(job: Job, plain: bool, numbers: list[int], known: Entries) -> Done:
    done = Done()
    with on_one_core(plain):
        sequence.make(job, numbers, known, lambda frames: frames, done)
    return done


def _require_here(job: Job, done: Done) -> None:
    """Refuse to count files that a worker has written but that are not here."""
    last = time.monotonic() + _LATE
    for index in [*done.written, *done.kept]:
        path = job.path_of(index)
        while not path.is_file() or hash_of(path) != done.entries[index]["sha256"]:
            if time.monotonic() > last:
                raise OSError(
                    f"{path}: a worker has written it, but here it is not: "
                    "the folder must be one that all machines see"
                )
            time.sleep(0.05)


def results(
    crew: Crew,
    task: Callable[[list[int]], Any],
    groups: list[list[int]],
    *,
    in_order: bool = False,
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


# Processes of this machine ------------------------------------------------------------------------

# What the tasks of a process share.
_shared: list[Any] = []


def _begin(shared: Any) -> None:
    _shared[:] = [shared]


def _with_shared(task: Callable[..., Any], *arguments: Any) -> Any:
    return task(_shared[0], *arguments)


@contextmanager
def processes(shared: Any, count: int) -> Iterator[Crew]:
    """Yield a crew of processes."""
    # Spawned, not forked: what the caller's threads hold is not carried along.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, context, _begin, (shared,)) as pool:
        yield Crew(
            lambda *task: pool.submit(_with_shared, *task), lambda: count, lambda: None, False
        )


# Dask ---------------------------------------------------------------------------------------------


@contextmanager
def cluster(
    shared: Any, where: Any, patience: float = 60.0, count: int | None = None
) -> Iterator[Crew]:
    """Yield a crew of Dask's workers.

    Parameters
    ----------
    shared : object
        What tasks share; sent once.
    where : True, "", str or distributed.Client
        A cluster made on this machine, a scheduler's address, or a client.
    patience : float
        How long to wait while there are no workers, seconds.
    count : int, optional
        Workers of a cluster made here; as many as there are cores if not given.
    """
    patience = real("patience", patience, low=0.0)
    with _client(where, count) as client:
        # A task that makes it again if its worker dies, as data sent to a worker would not be.
        given = client.submit(_same, shared, pure=False)
        watch = _Watch(client, patience)

        def submit(task: Callable[..., Any], *arguments: Any) -> Any:
            with watch.told():
                return client.submit(task, given, *arguments, pure=False)

        yield Crew(submit, watch.threads, watch.look, remote=True)


def _same(shared: Any) -> Any:
    return shared


@dataclass
class _Watch:
    """Looks whether a cluster can still do anything."""

    client: Any
    patience: float
    _looked: float = -1e9
    _threads: int = 0
    _alone: float | None = None
    _said: bool = field(default=False)

    def threads(self) -> int:
        """Return how many tasks run at once, asked for once a second."""
        if time.monotonic() - self._looked > 1.0:
            self.look()
        return self._threads

    def look(self) -> None:
        """Raise an error if the scheduler is gone, or no worker has been there for too long."""
        with self.told():
            there = self.client.sync(self.client.scheduler.ncores, callback_timeout=10)
        now = self._looked = time.monotonic()
        self._threads = sum(there.values())
        if there:
            self._alone = None
            return
        self._alone = now if self._alone is None else self._alone
        waited = now - self._alone
        address = self.client.scheduler.address
        if waited >= self.patience:
            raise TimeoutError(
                f"dask: no worker at {address} for {waited:.0f} s; start one, or wait longer"
            )
        if waited >= min(_QUIET, self.patience / 2) and not self._said:
            self._said = True
            warnings.warn(
                f"dask: waiting for a worker at {address}, {self.patience:g} s at most",
                stacklevel=2,
            )

    @contextmanager
    def told(self) -> Iterator[None]:
        """Say so where the scheduler is gone."""
        try:
            yield
        except Exception as error:
            if self.client.status == "running" and not isinstance(error, (OSError, TimeoutError)):
                raise
            raise OSError(
                "dask: the scheduler is gone; finished files stay, run again to go on"
            ) from error


@contextmanager
def _client(where: Any, count: int | None) -> Iterator[Any]:
    """Yield a client: one that was given, one of an address, or one of a cluster made for it."""
    distributed = required("distributed")
    if isinstance(where, distributed.Client):
        yield where
        return
    if isinstance(where, str) and where:
        try:
            # In a thread: the caller may have a loop of its own. A client that finds nobody is long
            # in giving up.
            with ThreadPoolExecutor(1) as aside:
                aside.submit(asyncio.run, _greet(where)).result()
            client = distributed.Client(where, timeout="10s", set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise OSError(f"dask: no scheduler answers at {where}") from error
        log = logging.getLogger("distributed.client")
        level = log.level
        # What it has to say of a scheduler that is gone is said by an error.
        log.setLevel(logging.CRITICAL)
        try:
            with client:
                yield client
        finally:
            log.setLevel(level)
        return
    if where is not True and where != "":
        raise TypeError(f"dask must be True, an address or a Client, got {where!r}")
    # Any free port: two runs at once, on one machine, must not want the same.
    with distributed.LocalCluster(
        n_workers=count or _cores(), threads_per_worker=1, dashboard_address=":0",
        silence_logs=logging.CRITICAL,
    ) as own, distributed.Client(own, set_as_default=False) as client:  # fmt: skip
        yield client


async def _greet(address: str) -> None:
    """Raise an error if nobody is there."""
    distributed = required("distributed")
    arguments = distributed.Security().get_connection_args("client")
    comm = await distributed.comm.connect(address, timeout=_GREETING, **arguments)
    await comm.close()


def _cores() -> int:
    with suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def on_one_core(plain: bool) -> Iterator[None]:
    """One thread to a file: where there are many files that wastes none. In the client's mode."""
    with scope(threads=None if "FLURRIES_NUM_THREADS" in os.environ else 1, reproducible=plain):
        yield


def required(name: str) -> Any:
    """Return a module of Dask's."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"Dask is not here; install flurries[dask] ({error})") from error

"""Dask's workers as a crew, on this machine or on many that see one folder; its arrays."""

from __future__ import annotations

import logging
import math
import os
import socket
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Future, InvalidStateError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from flurries._contract import Array, integer, library, real
from flurries._kept import kept
from flurries._threads import reproducible
from flurries.output.crew import Crew, make, on_one_core
from flurries.output.sequence import Fates, Job, Progress, run
from flurries.scene.files import frames_of
from flurries.scene.fingerprint import terms_of
from flurries.scene.rendering import Rendering
from flurries.scene.scene import Scene, expect_scene

__all__ = ["grouped", "to_dask"]

# How long a scheduler may take to answer, and workers to come before it is said, seconds.
_GREETING, _QUIET = 10.0, 10.0

# After how long it is said that a worker is silent, seconds, and in how many of its heartbeats: it
# was heard a look of a crew later, and is missed at the next one.
_SILENT, _BEATS = 1.5, 2

_GONE = "dask: the scheduler is gone; finished files stay, run again to go on"

required = partial(library, need="Dask is not here; install flurries[dask]")

_PICKLE = "distributed.protocol.pickle"

# Pixels of layers in a task: of most weather half a second's work. A scheduler takes 2 to 10 ms for
# a task, below 2 % of it.
PIXELS_OF_A_TASK = 1 << 23

_MOST_BYTES = 1 << 28  # Frames that a task may give back as arrays, in bytes.

Terms = tuple[tuple[str, str], ...]


def run_on(
    where: Any, patience: float, job: Job, groups: list[list[int]], progress: Progress
) -> Fates:
    indices = [index for group in groups for index in group]
    if where is None:
        return run(job, indices, progress)
    with cluster(job, where, patience) as crew:
        return run(job, indices, progress, partial(make, crew, groups))


@contextmanager
def cluster(
    shared: Any, where: Any, patience: float = 60.0, count: int | None = None
) -> Iterator[Crew]:
    from asyncio import CancelledError

    patience = real("patience", patience, low=0.0)
    with _client(where, count) as client:
        plain = reproducible()
        terms = terms_of(plain)
        # Packed, so that a worker of another version says so and does not fail to unpack. A task
        # makes it again if its worker dies, as data sent to a worker would not be.
        packed = required(_PICKLE).dumps((os.urandom(8), shared))

        async def fetch(future: Any, done: Future[Any]) -> None:
            with suppress(InvalidStateError):  # Nobody waits for it any more.
                try:
                    done.set_result(await client.gather(future, asynchronous=True))
                except CancelledError:
                    done.cancel()
                except Exception as error:
                    done.set_exception(error)

        def submit(*task: Any) -> Any:
            # What a worker has made is fetched aside, too: it may have stopped since.
            done: Future[Any] = Future()
            future = client.submit(agreed, terms, plain, given, *task, pure=False)
            done.add_done_callback(lambda one: future.cancel() if one.cancelled() else None)
            client.loop.add_callback(fetch, future, done)
            return done

        try:
            given = client.submit(bytes, packed, pure=False)
            yield Crew(submit, _Watch(client, patience).threads, remote=True)
        except Exception as error:
            if client.status == "running":
                raise
            raise OSError(_GONE) from error


@dataclass
class _Watch:
    """Looks whether a cluster can still do anything."""

    client: Any
    patience: float
    _heard: dict[str, tuple[float, float]] = field(default_factory=dict)  # The last beat, and when.
    _silent: set[str] = field(default_factory=set)  # Of which it was said.
    _alone: float | None = None
    _said: bool = False

    def threads(self) -> int:
        """Return the number of tasks that run at once, or raise if there is none for too long."""
        there = self._ask("identity")["workers"]
        awake = [address for address in there if self._hears(address, there)]
        if awake:
            self._alone = None
            for address in there:
                if time.monotonic() - self._heard[address][1] >= self.patience:
                    # What it had to do goes to the others; no task is to blame.
                    self._ask("unregister", address=address, stimulus_id="silent", expected=True)
            return sum(there[address]["nthreads"] for address in awake)
        self._alone = self._alone or time.monotonic()
        waited = time.monotonic() - self._alone
        address = self.client.scheduler.address
        if not there and waited >= min(_QUIET, self.patience / 2) and not self._said:
            self._said = True
            waiting = f"dask: waiting for a worker at {address}, {self.patience:g} s at most"
            warnings.warn(waiting, stacklevel=2)
        if waited >= self.patience:
            raise TimeoutError(
                f"dask: no worker at {address} for {waited:.0f} s; start one, or wait longer"
            )
        return 0

    def _ask(self, what: str, **arguments: Any) -> Any:
        try:
            ask = getattr(self.client.scheduler, what)
            return self.client.sync(ask, callback_timeout=_GREETING, **arguments)
        except Exception as error:
            raise OSError(_GONE) from error

    def _hears(self, address: str, there: dict[str, Any]) -> bool:
        """Whether a worker lives, by its last heartbeat; say so if it was not heard for long."""
        now, beat = time.monotonic(), there[address]["last_seen"]
        if self._heard.get(address, (None, 0.0))[0] != beat:
            self._heard[address] = beat, now
            self._silent.discard(address)
        most = _BEATS * required("distributed.scheduler").heartbeat_interval(len(there))
        awake = bool(now - self._heard[address][1] < max(_SILENT, most))
        if not awake and address not in self._silent:
            self._silent.add(address)
            warnings.warn(
                f"dask: the worker at {address} is silent; the others go on, and make its files, "
                f"too, if it stays so for {self.patience:g} s",
                stacklevel=2,
            )
        return awake


@contextmanager
def _client(where: Any, count: int | None) -> Iterator[Any]:
    """Yield a client: one that was given, one of an address, or one of a cluster made for it."""
    import asyncio

    distributed = required("distributed")
    if isinstance(where, distributed.Client):
        yield where
        return
    if isinstance(where, str) and where:
        try:
            # In a thread: the caller may have a loop of its own.
            with ThreadPoolExecutor(1) as aside:
                aside.submit(asyncio.run, _greet(where)).result()
            client = distributed.Client(where, timeout=_GREETING, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise OSError(f"dask: no scheduler answers at {where}") from error
        # What Dask has to say of a scheduler that is gone is said by an error.
        levels = {n: logging.getLogger(n).level for n in ("distributed", "distributed.client")}
        try:
            for log in levels:
                logging.getLogger(log).setLevel(logging.CRITICAL)
            with client:
                yield client
        finally:
            for log, level in levels.items():
                logging.getLogger(log).setLevel(level)
        return
    if where is not True and where != "":
        raise TypeError(f"dask must be True, an address or a Client, got {where!r}")
    # Any free port, since two runs at once must not want the same; and for this machine alone.
    with distributed.LocalCluster(
        n_workers=count, threads_per_worker=1, dashboard_address="127.0.0.1:0",
        worker_dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
    ) as own, distributed.Client(own, set_as_default=False) as client:  # fmt: skip
        yield client


async def _greet(address: str) -> None:
    """Raise an error if nobody is there, sooner than a client would."""
    distributed = required("distributed")
    arguments = distributed.Security().get_connection_args("client")
    comm = await distributed.comm.connect(address, timeout=_GREETING, **arguments)
    await comm.close()


def agreed(terms: Terms, plain: bool, packed: bytes, task: Callable[..., Any], *more: Any) -> Any:
    """Do a task with what is packed, if this process meets the client's terms."""
    return task(_unpacked(terms, plain, packed), *more)


@kept(4)
def _unpacked(terms: Terms, plain: bool, packed: bytes) -> Any:
    own = dict(terms_of(plain))
    wrong = [f"{name} {own[name]} and not {said}" for name, said in terms if own[name] != said]
    if wrong:
        raise RuntimeError(
            f"a worker on {socket.gethostname()} has {' and '.join(wrong)}, so its frames would "
            "differ; it needs the same software, and for vector instructions reproducible=True"
        )
    # Unpacked once a run: what a store knows of its folders grows old.
    return required(_PICKLE).loads(packed)[1]


def grouped(scene: Scene, frames: Any) -> list[list[int]]:
    """Return frames in groups of half a second's work or so each, by their pixels."""
    scene = expect_scene(scene)
    wanted = frames_of(scene, frames)
    pixels = scene._shape[0] * scene._shape[1] * max(len(scene.effects), 1)
    size = math.ceil(PIXELS_OF_A_TASK / pixels)
    return [wanted[first : first + size] for first in range(0, len(wanted), size)]


def to_dask(scene: Rendering, frames: Any = None, *, group: int | None = None) -> Any:
    """Return the frames of a scene as a lazy array, see :meth:`flurries.Scene.to_dask`."""
    dask = required("dask")
    array = required("dask.array")
    scene = expect_scene(scene)
    wanted = frames_of(scene, frames)
    height, width = scene._shape
    # The background decides.
    dtype = scene.replace(effects=()).render(wanted[0], region=np.s_[:1, :1]).dtype
    if group is None:
        most = max(_MOST_BYTES // (height * width * 3 * dtype.itemsize), 1)
        size = min(len(grouped(scene, wanted)[0]), most)
    else:
        size = int(integer("group", group, low=1, high=2**31))
    # Files that the scene reads may change: what one array has found is not another's.
    name, plain = uuid.uuid4().hex, reproducible()
    # One node of the graph, not a copy in each of its tasks.
    shared = dask.delayed(scene, name=f"scene-{name}", pure=True, traverse=False)
    block = dask.delayed(_block, pure=True)
    parts = []
    for first in range(0, len(wanted), size):
        numbers = wanted[first : first + size]
        part = block(shared, plain, numbers, dask_key_name=f"frames-{name}-{first}")
        parts.append(array.from_delayed(part, (len(numbers), height, width, 3), dtype=dtype))
    return array.concatenate(parts, axis=0)


def _block(scene: Scene, plain: bool, numbers: list[int]) -> Array:
    with on_one_core(plain):
        return np.stack([scene.render(number) for number in numbers])

"""Dask's workers as a crew, on this machine or on many that see one folder."""

from __future__ import annotations

import asyncio
import importlib
import logging
import os
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from flurries._contract import real
from flurries._threads import reproducible
from flurries.output.crew import Crew
from flurries.output.handshake import agreed, terms_of

# How long a scheduler may take to answer, seconds.
_GREETING = 10.0

# After how long without workers it is said what is waited for, seconds.
_QUIET = 10.0


@contextmanager
def cluster(
    shared: Any, where: Any, patience: float = 60.0, count: int | None = None
) -> Iterator[Crew]:
    patience = real("patience", patience, low=0.0)
    with _client(where, count) as client:
        # Packed, so that a worker of another version says so and does not fail to unpack. A task
        # makes it again if its worker dies, as data sent to a worker would not be.
        packed = required("distributed.protocol.pickle").dumps((os.urandom(8), shared))
        given = client.submit(bytes, packed, pure=False)
        watch, plain = _Watch(client, patience), reproducible()
        terms = terms_of(plain)

        def submit(task: Callable[..., Any], *arguments: Any) -> Any:
            with watch.told():
                return client.submit(agreed, terms, plain, given, task, *arguments, pure=False)

        yield Crew(submit, watch.threads, watch.look, remote=True)


@dataclass
class _Watch:
    """Looks whether a cluster can still do anything."""

    client: Any
    patience: float
    _looked: float = -1e9
    _threads: int = 0
    _alone: float | None = None
    _said: bool = False

    def threads(self) -> int:
        """Return the number of tasks that run at once, asked for once a second."""
        if time.monotonic() - self._looked > 1.0:
            self.look()
        return self._threads

    def look(self) -> None:
        """Raise an error if the scheduler is gone, or no worker has been there for too long."""
        with self.told():
            there = self.client.sync(self.client.scheduler.ncores, callback_timeout=_GREETING)
        now = self._looked = time.monotonic()
        self._threads = sum(there.values())
        if there:
            self._alone = None
            return
        self._alone = now if self._alone is None else self._alone
        waited = now - self._alone
        address = self.client.scheduler.address
        if waited >= min(_QUIET, self.patience / 2) and not self._said:
            self._said = True
            warnings.warn(
                f"dask: waiting for a worker at {address}, {self.patience:g} s at most",
                stacklevel=2,
            )
        if waited >= self.patience:
            raise TimeoutError(
                f"dask: no worker at {address} for {waited:.0f} s; start one, or wait longer"
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
            client = distributed.Client(where, timeout=_GREETING, set_as_default=False)
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
    # Any free port, since two runs at once must not want the same; and for this machine alone.
    with distributed.LocalCluster(
        n_workers=count or _cores(), threads_per_worker=1, dashboard_address="127.0.0.1:0",
        worker_dashboard_address="127.0.0.1:0",
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


def required(name: str) -> Any:
    """Return a module of Dask's."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"Dask is not here; install flurries[dask] ({error})") from error

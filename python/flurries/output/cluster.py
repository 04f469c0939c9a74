"""Many frames on many machines: scenes on Dask.

Workers render whole groups of frames and write them where the client would have: the folder must
be one that all of them see. A frame is a pure function of its scene and number, so whichever
worker makes it makes the same bits, and what a worker takes with it when it dies is made again.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import Array, integer
from flurries._threads import reproducible, set_reproducible, set_threads
from flurries.frame import estimate
from flurries.scene.numbers import frames_of

if TYPE_CHECKING:
    from flurries.output.sequence import Progress, Sequence
    from flurries.scene.scene import Scene

__all__ = ["grouped", "to_dask"]

# A scheduler takes 2 to 10 ms for a task; with this much work in one that is below 2 %.
SECONDS_OF_A_TASK = 0.5

# Seconds for each pixel that is read and written, beside what rendering takes.
_FILE = 15e-9

# Frames that a task may give back as arrays, in bytes.
_MOST_BYTES = 1 << 28

# Tasks that are under way for each thread of the cluster, so that none waits and memory stays flat.
_AHEAD = 4


def grouped(scene: Scene, frames: Any) -> list[list[int]]:
    """Return frames in groups of half a second's work or more each, by a fixed cost.

    Parameters
    ----------
    scene : Scene
    frames : str, int or iterable of int
        As `flurries.output.write.write`.

    Returns
    -------
    list of lists of int
        In the order asked for.

    Raises
    ------
    TypeError, ValueError
        For what is no scene, or names no frames.
    """
    from flurries.scene.scene import expect_scene

    expect_scene(scene)
    wanted = frames_of(scene, frames)
    files = _FILE * scene.shape[0] * scene.shape[1]
    cost = estimate.seconds(scene.program, wanted, scene.tolerance) + files
    size = max(math.ceil(SECONDS_OF_A_TASK / cost), 1)
    return [wanted[first : first + size] for first in range(0, len(wanted), size)]


def to_dask(scene: Scene, frames: Any = None, *, group: int | None = None) -> Any:
    """Return the frames of a scene as a lazy array.

    Parameters
    ----------
    scene : Scene
        What to render.
    frames : str, int or iterable of int, optional
        As `flurries.output.write.write`.
    group : int, optional
        Frames to a chunk; half a second's work if not given.

    Returns
    -------
    dask.array.Array (T, H, W, 3)
        Of the dtype that `Scene.render` gives, with its bits. It is rendered where and when Dask
        computes it, a chunk of frames at a time.

    Raises
    ------
    ImportError
        Without Dask; it comes with ``flurries[dask]``.

    Examples
    --------
    >>> import flurries as fl
    >>> film = fl.Scene((64, 48), effects=fl.Snow(flakes=20)).to_dask("0-9")  # doctest: +SKIP
    >>> film.shape, film[3].compute().shape  # doctest: +SKIP
    ((10, 48, 64, 3), (48, 64, 3))
    """
    dask = _required("dask")
    array = _required("dask.array")
    from flurries.scene.fingerprint import fingerprint
    from flurries.scene.scene import expect_scene

    expect_scene(scene)
    wanted = frames_of(scene, frames)
    height, width = scene.shape
    # The background decides.
    dtype = scene.replace(effects=()).render(wanted[0], region=np.s_[:1, :1]).dtype
    if group is None:
        groups = grouped(scene, wanted)
        most = max(_MOST_BYTES // (height * width * 3 * dtype.itemsize), 1)
        size = min(len(groups[0]), most)
    else:
        size = int(integer("group", group, low=1, high=2**31))
    plain = reproducible()
    mark = fingerprint(scene) + ("-reproducible" if plain else "")
    # One node of the graph, not a copy in each of its tasks.
    shared = dask.delayed(scene, name=f"scene-{mark}", pure=True, traverse=False)
    parts = []
    for first in range(0, len(wanted), size):
        numbers = wanted[first : first + size]
        name = f"frames-{mark}-{numbers[0]}-{hash(tuple(numbers)) & (2**63 - 1):x}"
        block = dask.delayed(_block, pure=True)(shared, numbers, plain, dask_key_name=name)
        parts.append(array.from_delayed(block, (len(numbers), height, width, 3), dtype=dtype))
    return array.concatenate(parts, axis=0)


def _block(scene: Scene, numbers: list[int], plain: bool) -> Array:
    with _one_core(plain):
        return np.stack([scene.render(number) for number in numbers])


@dataclass(frozen=True)
class _Done:
    """What a worker says of a group of frames."""

    written: list[int]
    kept: list[int]
    skipped: list[int]
    held: list[int]
    entries: dict[str, dict[str, Any]]


def make(job: Sequence, frames: list[int], progress: Progress, where: Any) -> set[int]:
    """Make the frames of a sequence that are missing, on a cluster; return those that hold."""
    from flurries.io.atomic import checked_target, remove_leftovers
    from flurries.io.pictures.writer import format_of
    from flurries.output import manifest

    first = job.path_of(frames[0])
    format_of(first)
    folder = checked_target(first).parent
    if job.listed:
        manifest.read(folder)
    remove_leftovers(folder)
    held: set[int] = set()
    # Workers stand in folders of their own.
    part = replace(job, pattern=str(Path(job.pattern).absolute()), listed=False, tidy=False)
    with _client(where) as client:
        try:
            for done in progress_of(client, _make, part, grouped(job.scene, frames), progress):
                job.written += done.written
                job.kept += done.kept
                job.skipped += done.skipped
                held.update(done.held)
                job.entries.update(done.entries)
        finally:
            job.settle(folder, frames)
            remove_leftovers(folder)
    return held


def _make(job: Sequence, numbers: list[int]) -> _Done:
    # A task that comes again after its worker died finds what was done: lists of its own.
    own = replace(job, written=[], kept=[], skipped=[], entries={})
    with _one_core(job.plain):
        own.make(numbers, lambda frames: frames)
    folder = own.path_of(numbers[0]).parent
    from flurries.output import manifest

    done = [*own.written, *own.kept]
    entries = {
        own.path_of(n).name: manifest.entry(folder / own.path_of(n).name, n, own.mark) for n in done
    }
    held = [n for n in own.written if n in own.scene.held]
    return _Done(own.written, own.kept, own.skipped, held, entries)


def images(scene: Scene, frames: list[int], where: Any) -> Iterator[tuple[list[int], Array]]:
    """Yield groups of frames and their images, in order, rendered on a cluster."""
    with _client(where) as client:
        groups = grouped(scene, frames)
        yield from zip(
            groups,
            _in_order(client, partial(_block, plain=reproducible()), scene, groups),
            strict=True,
        )


def progress_of(
    client: Any, task: Callable[..., Any], shared: Any, groups: list[list[int]], progress: Progress
) -> Iterator[Any]:
    """Run a task for each group and yield the results as they come, telling progress by frames."""
    results: list[Any] = []

    class Arriving:
        """The frames, each when it is done."""

        def __len__(self) -> int:
            return sum(map(len, groups))

        def __iter__(self) -> Iterator[int]:
            for numbers, result in _as_they_come(client, task, shared, groups):
                results.append(result)
                yield from numbers

    for _ in progress(Arriving()):
        while results:
            yield results.pop(0)
    yield from results


def _as_they_come(
    client: Any, task: Callable[..., Any], shared: Any, groups: list[list[int]]
) -> Iterator[tuple[list[int], Any]]:
    distributed = _required("distributed")
    given = client.submit(_same, shared, pure=False)
    waiting = iter(groups)
    pending: dict[Any, list[int]] = {}
    coming = distributed.as_completed(loop=client.loop)
    try:
        for _ in range(_window(client)):
            _submit(client, task, given, next(waiting, None), pending, coming)
        for future in coming:
            numbers = pending.pop(future)
            result = _result(future, numbers)
            _submit(client, task, given, next(waiting, None), pending, coming)
            yield numbers, result
    finally:
        client.cancel(list(pending))


def _in_order(
    client: Any, task: Callable[..., Any], shared: Any, groups: list[list[int]]
) -> Iterator[Any]:
    given = client.submit(_same, shared, pure=False)
    waiting = iter(groups)
    pending: list[tuple[Any, list[int]]] = []
    try:
        while True:
            while len(pending) < _window(client) and (numbers := next(waiting, None)) is not None:
                pending.append((client.submit(task, given, numbers, pure=False), numbers))
            if not pending:
                return
            yield _result(*pending[0])
            pending.pop(0)
    finally:
        client.cancel([future for future, _ in pending])


def _submit(
    client: Any,
    task: Callable[..., Any],
    given: Any,
    numbers: list[int] | None,
    pending: dict[Any, list[int]],
    coming: Any,
) -> None:
    if numbers is not None:
        future = client.submit(task, given, numbers, pure=False)
        pending[future] = numbers
        coming.add(future)


def _same(shared: Any) -> Any:
    """A task that makes it again if its worker dies, as data sent to a worker would not be."""
    return shared


def _window(client: Any) -> int:
    threads: int = sum(client.nthreads().values())
    return _AHEAD * max(threads, 2)


def _result(future: Any, numbers: list[int]) -> Any:
    distributed = _required("distributed")
    try:
        return future.result()
    except distributed.KilledWorker as error:
        named = f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
        raise RuntimeError(
            f"frames {named}: every worker that took them died, perhaps for want of memory"
        ) from error


@contextmanager
def _client(where: Any) -> Iterator[Any]:
    """Yield a client: one that was given, one of an address, or one of a cluster made for it."""
    distributed = _required("distributed")
    if isinstance(where, distributed.Client):
        yield where
        return
    if isinstance(where, str) and where:
        try:
            client = distributed.Client(where, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise OSError(f"dask: no scheduler answers at {where}: {error}") from error
        with client:
            yield client
        return
    if where is not True and where != "":
        raise TypeError(f"dask must be True, an address or a Client, got {where!r}")
    import logging

    # Any free port: two runs at once, on one machine, must not want the same.
    with distributed.LocalCluster(
        n_workers=_cores(), threads_per_worker=1, dashboard_address=":0",
        silence_logs=logging.CRITICAL,
    ) as cluster, distributed.Client(cluster, set_as_default=False) as client:  # fmt: skip
        yield client


def _cores() -> int:
    with suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def _one_core(plain: bool) -> Iterator[None]:
    """One thread to a frame: where there are many frames that wastes none. In the client's mode."""
    if _on_a_worker():
        if "FLURRIES_NUM_THREADS" not in os.environ:
            set_threads(1)
        set_reproducible(plain)
    yield


def _on_a_worker() -> bool:
    import sys

    if "distributed" not in sys.modules:
        return False
    with suppress(ValueError):
        sys.modules["distributed"].get_worker()
        return True
    return False


def _required(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"Dask is not here; install flurries[dask] ({error})") from error

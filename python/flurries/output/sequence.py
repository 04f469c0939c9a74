"""Files that are made one by one: what is there and right stays, what is another's is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from flurries import __version__, _core
from flurries._threads import reproducible, threads
from flurries.io.pictures.writer import format_of
from flurries.output.folder import Store
from flurries.output.journal import Entry, Journal, Mark, Refused

# Files that are encoded while the next is made, at most; each holds a picture in memory.
MOST_WRITERS = 8

Progress: TypeAlias = Callable[[Iterable[int]], Iterable[int]]


class Job(Protocol):
    """Files that can be made in any order, by anybody: frames of a scene, or a set of pictures."""

    store: Store  # Where they are kept.
    folder: Path  # In which, or below which, all of them lie; it gets the journal.
    overwrite: bool  # Whether files that are there are made again.
    tolerant: bool  # Whether a file that fails is left out, or stops the others.

    def path_of(self, index: int) -> Path: ...

    def mark_of(self, index: int) -> Mark: ...

    def make(self, index: int) -> Any:
        """Return the contents of a file; None if it is left out."""

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None: ...

    def notes(self, index: int) -> dict[str, Any]:
        """Return the journal's further notes of a file."""
        return {}

    def stands_in(self, index: int) -> bool:
        """Whether what a file was made of is that of an earlier one."""
        return False


@dataclass
class Done:
    """The files made, kept and left out, by their indices."""

    written: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    skipped: list[int] = field(default_factory=list)
    held: list[int] = field(default_factory=list)
    failed: dict[int, str] = field(default_factory=dict)

    def add(self, other: Done) -> None:
        for name in ("written", "kept", "skipped", "held"):
            getattr(self, name).extend(getattr(other, name))
        self.failed.update(other.failed)

    def sort(self, indices: list[int]) -> None:
        order = {index: place for place, index in enumerate(indices)}
        for numbers in (self.written, self.kept, self.skipped, self.held):
            numbers.sort(key=order.__getitem__)


Spread: TypeAlias = "Callable[[Job, list[int], Journal, Progress, Done], None]"


def run(job: Job, indices: list[int], progress: Progress, spread: Spread | None = None) -> Done:
    """Make the files that are missing."""
    first = job.path_of(indices[0])
    # Before anything is made: a format that can be written, in a place that can be.
    format_of(first)
    store = job.store
    store.require_usable(first)
    journal = Journal(store, job.folder)
    if not job.overwrite:
        with suppress(OSError):
            journal.require_bits(job.mark_of(indices[0]))
    folders = {job.path_of(index).parent for index in indices}
    # What a killed run left under temporary names.
    for folder in folders:
        store.tidy(folder)
    done = Done()
    try:
        (spread or make)(job, indices, journal, progress, done)
        journal.join(all_of_run=True)
    except BaseException:
        # Others of this run may still be writing. What hinders this has been told.
        with suppress(OSError):
            journal.join()
        raise
    finally:
        done.sort(indices)
        for folder in folders:
            store.tidy(folder)
    return done


def make(job: Job, indices: list[int], journal: Journal, progress: Progress, done: Done) -> None:
    """Make the files that are missing in this process."""
    work = _Work(job, journal, done)
    work.make(progress(work.missing(indices)))
    done.held += [index for index in done.written if job.stands_in(index)]


@dataclass(frozen=True)
class _Work:
    job: Job
    journal: Journal
    done: Done
    _sent: dict[str, int] = field(default_factory=dict)

    def missing(self, indices: list[int]) -> list[int]:
        """Return what is to be made; refuse all that is in the way before anything is."""
        missing, refused = [], []
        for index in indices:
            with self._excused(index):
                try:
                    if not self._is_kept(index, self.job.mark_of(index)):
                        missing.append(index)
                except Refused as error:
                    refused.append(error)
        if refused:
            raise Refused(refused[0].path, refused[0].why, len(refused) - 1)
        return missing

    def _is_kept(self, index: int, mark: Mark) -> bool:
        path = self.job.path_of(index)
        if self.job.overwrite or self.journal.settled(path, mark) is None:
            return False
        self.done.kept.append(index)
        return True

    @contextmanager
    def _excused(self, index: int) -> Iterator[None]:
        """Let a file fail alone where the job is tolerant."""
        try:
            yield
        except Refused:
            raise
        except (OSError, ValueError, TypeError, MemoryError) as error:
            if not self.job.tolerant:
                raise
            self.done.failed[index] = f"{type(error).__name__}: {error}"

    def make(self, indices: Iterable[int]) -> None:
        """Make files; while one is written, the next is made."""
        # Writers work as this thread does.
        setting = threads(), reproducible()
        count = min(max(threads(), 2), MOST_WRITERS)
        try:
            with ThreadPoolExecutor(count, "writer", _core.set_scope, setting) as writers:
                pending: list[Future[None]] = []
                for index in indices:
                    made: tuple[Mark, Any] | None = None
                    with self._excused(index):
                        made = self._made(index)
                    while len(pending) >= count:
                        pending.pop(0).result()
                    if made is not None:
                        pending.append(writers.submit(self._save, index, *made))
                for written in pending:
                    written.result()
        finally:
            # What is made is sent, whatever has come of the others.
            self._arrived(self.job.store.finish(self.journal))

    def _made(self, index: int) -> tuple[Mark, Any] | None:
        """Return a file's contents and its mark; None if there is nothing to be done."""
        mark = self.job.mark_of(index)
        if self._is_kept(index, mark):
            # Made by another since we looked.
            return None
        made = self.job.make(index)
        if made is None:
            self.done.skipped.append(index)
            return None
        if self.job.mark_of(index) != mark:
            name = self.job.store.name_of(self.job.path_of(index))
            raise OSError(f"{name}: what it is made of changed meanwhile; run again")
        return mark, made

    def _save(self, index: int, mark: Mark, made: Any) -> None:
        path = self.job.path_of(index)
        header = {**mark.facts, "version": __version__}
        with self._excused(index):
            if self._is_kept(index, mark):
                # Made by another meanwhile; what a stranger has put there is refused.
                return
            self._sent[self.journal.name_of(path)] = index
            save = partial(self.job.save, made=made, header=header)
            facts = {**mark.facts, **self.job.notes(index)}
            self._arrived(self.job.store.send(self.journal, path, facts, save))

    def _arrived(self, entries: list[Entry]) -> None:
        self.done.written += [self._sent[entry["file"]] for entry in entries]

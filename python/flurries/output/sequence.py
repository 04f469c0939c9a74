"""Files that are made one by one: what is there and right stays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from flurries import __version__, _core
from flurries._threads import reproducible, threads
from flurries.io.pictures.writer import format_of
from flurries.output import manifest
from flurries.output.manifest import Mark, Refused
from flurries.output.store import Store

# Files that are encoded while the next is made, at most; each holds a picture in memory.
MOST_WRITERS = 8

Progress: TypeAlias = Callable[[Iterable[int]], Iterable[int]]
Entries: TypeAlias = dict[str, dict[str, Any]]


class Job(Protocol):
    """Files that can be made in any order, by anybody: frames of a scene, or a set of pictures."""

    store: Store  # Where they are kept.
    folder: Path  # In which, or below which, all of them lie; it gets the manifest.
    overwrite: bool  # Whether files that are there are made again.
    listed: bool  # Whether the folder gets a manifest.
    tolerant: bool  # Whether a file that fails is left out, or stops the others.

    def path_of(self, index: int) -> Path:
        """Return the file of an index."""

    def mark_of(self, index: int) -> Mark:
        """Return the mark that the file must bear."""

    def make(self, index: int) -> Any:
        """Return the contents of the file; None if it is left out."""

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        """Write it."""

    def notes(self, index: int) -> dict[str, Any]:
        """Return the manifest's further notes of the file."""

    def stands_in(self, index: int) -> bool:
        """Whether what it was made of is that of an earlier one."""


@dataclass
class Done:
    """The files made, kept and left out, by their indices."""

    written: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    skipped: list[int] = field(default_factory=list)
    held: list[int] = field(default_factory=list)
    failed: dict[int, str] = field(default_factory=dict)
    entries: dict[int, dict[str, Any]] = field(default_factory=dict)

    def add(self, other: Done) -> None:
        for name in ("written", "kept", "skipped", "held"):
            getattr(self, name).extend(getattr(other, name))
        self.failed.update(other.failed)
        self.entries.update(other.entries)

    def sort(self, indices: list[int]) -> None:
        order = {index: place for place, index in enumerate(indices)}
        for numbers in (self.written, self.kept, self.skipped, self.held):
            numbers.sort(key=order.__getitem__)


Spread: TypeAlias = "Callable[[Job, list[int], Entries, Progress, Done], None]"


def name_of(job: Job, index: int) -> str:
    """Return a file's name in the manifest: its way from the folder."""
    return job.path_of(index).relative_to(job.folder).as_posix()


def run(job: Job, indices: list[int], progress: Progress, spread: Spread | None = None) -> Done:
    """Make the files that are missing, and list them."""
    first = job.path_of(indices[0])
    # Before anything is made: a format that can be written, in a place that can be.
    format_of(first)
    store = job.store
    store.require_usable(first)
    known = store.read_list(job.folder) if job.listed else {}
    folders = {job.path_of(index).parent for index in indices}
    # What a killed run left under temporary names.
    for folder in folders:
        store.tidy(folder)
    done = Done()
    try:
        (spread or make)(job, indices, known, progress, done)
    finally:
        done.sort(indices)
        if job.listed and done.entries:
            listed = {name_of(job, index): entry for index, entry in done.entries.items()}
            store.add_to_list(job.folder, listed)
        for folder in folders:
            store.tidy(folder)
    return done


def make(job: Job, indices: list[int], known: Entries, progress: Progress, done: Done) -> None:
    """Make the files that are missing in this process; `known` is what the manifest says."""
    work = _Work(job, known, done)
    work.make(progress([index for index in indices if not work.is_settled(index)]))
    done.held += [index for index in done.written if job.stands_in(index)]


@dataclass(frozen=True)
class _Work:
    job: Job
    known: Entries
    done: Done

    def is_settled(self, index: int) -> bool:
        """Whether there is nothing to be made, as a file is there or cannot be made."""
        with self._excused(index):
            return self._is_kept(index, self.job.mark_of(index))
        return True

    def _is_kept(self, index: int, mark: Mark) -> bool:
        if self.job.overwrite:
            return False
        said = self.known.get(name_of(self.job, index)) if self.known else None
        entry = self.job.store.settled(mark, self.job.path_of(index), said)
        if entry is None:
            return False
        self.done.kept.append(index)
        self.done.entries[index] = {**entry, **self.job.notes(index)}
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
        with self._excused(index):
            with self.job.store.placing(self.job.path_of(index)) as place:
                self.job.save(place, made, {**mark.header, "version": __version__})
                entry = manifest.entry(place, mark.header)
            self.done.entries[index] = {**entry, **self.job.notes(index)}
            self.done.written.append(index)

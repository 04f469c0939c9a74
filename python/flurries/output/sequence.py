"""Files that are made one by one: what is there and right stays, what is another's is refused."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias

from flurries import __version__, _core
from flurries._threads import reproducible, threads
from flurries.io.stores import Store
from flurries.output.journal import Journal, Mark, Refused

# Files that are encoded while the next is made, at most; each holds a picture in memory.
MOST_WRITERS = 8

Progress: TypeAlias = Callable[[Iterable[int]], Iterable[int]]


class Job(ABC):
    """Files that can be made in any order, by anybody: frames of a scene, or a set of pictures."""

    folder: Path  # In which, or below which, all of them lie; it gets the journal.
    store: Store = Store()  # Where they are kept.
    overwrite: bool = False  # Whether files that are there are made again.
    tolerant: bool = False  # Whether a file that fails is left out, or stops the others.
    scratch: bool = False  # Whether nobody else wants them: those that are not right go.

    def frames(self, index: int) -> list[int]:
        """Return the frames of a file, for its progress and its fate."""
        return [index]

    @abstractmethod
    def path_of(self, index: int) -> Path: ...

    @abstractmethod
    def mark_of(self, index: int) -> Mark: ...

    @abstractmethod
    def make(self, index: int, numbers: Iterable[int]) -> Any:
        """Return the contents of a file of these frames; None if it is left out."""

    @abstractmethod
    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None: ...

    def notes(self, index: int, made: Any) -> dict[str, Any]:
        """Return the journal's further notes of a file, such as the frames that it lacks."""
        return {}

    def stands_in(self, number: int) -> bool:
        """Whether what a frame was made of is that of an earlier one."""
        return False


class Fates(dict[int, str]):
    """What became of frames: "written", "held" (written, too), "kept", "skipped", or why not."""

    def of(self, *fates: str) -> list[int]:
        return [number for number, fate in self.items() if fate in fates]


Spread: TypeAlias = Callable[[Job, list[int], Journal, Progress, Fates], None]


def run(job: Job, indices: list[int], progress: Progress, spread: Spread | None = None) -> Fates:
    store, first = job.store, job.path_of(indices[0])
    # Before anything is made: in a place that can be written to.
    store.require_usable(first)
    journal = Journal(store, job.folder)
    if not job.overwrite:
        with suppress(OSError):
            journal.require_bits(job.mark_of(indices[0]))
    folders = {job.folder, *(job.path_of(index).parent for index in indices)}
    # What a killed run left under temporary names.
    for folder in folders:
        store.tidy(folder)
    fates = Fates()
    try:
        (spread or make)(job, indices, journal, progress, fates)
        journal.join(all_of_run=True)
    except BaseException:
        # Others of this run may still be writing. What hinders this has been told.
        with suppress(OSError):
            journal.join()
        raise
    finally:
        for folder in folders:
            store.tidy(folder)
    numbers = (number for index in indices for number in job.frames(index))
    return Fates((number, fates[number]) for number in numbers if number in fates)


def make(job: Job, indices: list[int], journal: Journal, progress: Progress, fates: Fates) -> None:
    """Make the files that are missing in this process."""
    work = _Work(job, journal, fates)
    missing = work.missing(indices)
    work.make(missing, iter(progress([n for index in missing for n in job.frames(index)])))


@dataclass(frozen=True)
class _Work:
    job: Job
    journal: Journal
    fates: Fates

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
        if self.job.overwrite:
            return False
        line = self.journal.settled(self.job.path_of(index), mark, scratch=self.job.scratch)
        if line is not None:
            self._note(index, "kept", line)
        return line is not None

    def _note(self, index: int, fate: str, facts: dict[str, Any]) -> None:
        skipped = facts.get("skipped", ())
        for number in self.job.frames(index):
            self.fates[number] = "skipped" if number in skipped else fate
            if self.fates[number] == "written" and self.job.stands_in(number):
                self.fates[number] = "held"

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
            self.fates[index] = f"{type(error).__name__}: {error}"

    def make(self, indices: Iterable[int], ticks: Iterator[int]) -> None:
        """Make files, each when its first frame comes; while one is written, the next is made."""
        # Writers work as this thread does.
        setting = threads(), reproducible()
        count = min(max(threads(), 2), MOST_WRITERS)
        try:
            with ThreadPoolExecutor(count, "writer", _core.set_scope, setting) as writers:
                pending: deque[Future[None]] = deque()
                for index in indices:
                    rest = _counted(self.job.frames(index), ticks)
                    numbers = chain([next(rest)], rest)
                    made: tuple[Mark, Any] | None = None
                    with self._excused(index):
                        made = self._made(index, numbers)
                    deque(numbers, 0)
                    while len(pending) >= count:
                        pending.popleft().result()
                    if made is not None:
                        pending.append(writers.submit(self._save, index, *made))
                for written in pending:
                    written.result()
                deque(ticks, 0)
        finally:
            # What is made is sent, whatever has come of the others.
            self.journal.send()

    def _made(self, index: int, numbers: Iterable[int]) -> tuple[Mark, Any] | None:
        """Return a file's contents and its mark; None if there is nothing to be done."""
        mark = self.job.mark_of(index)
        if self._is_kept(index, mark):
            # Made by another since we looked.
            return None
        made = self.job.make(index, numbers)
        if made is None:
            self._note(index, "skipped", {})
            return None
        if self.job.mark_of(index) != mark:
            name = self.job.store.name_of(self.job.path_of(index))
            raise OSError(f"{name}: what it is made of changed meanwhile; run again")
        return mark, made

    def _save(self, index: int, mark: Mark, made: Any) -> None:
        job, path = self.job, self.job.path_of(index)
        facts = {**mark.facts, **job.notes(index, made)}
        save = partial(job.save, made=made, header={**mark.facts, "version": __version__})
        with self._excused(index):
            if self._is_kept(index, mark):
                # Made by another meanwhile; what a stranger has put there is refused.
                return
            try:
                self.journal.write(path, facts, save)
            except FileNotFoundError:
                # Another process may have made it meanwhile, and removed what it is made of.
                if not self._is_kept(index, mark):
                    raise
            else:
                self._note(index, "written", facts)


def _counted(numbers: list[int], ticks: Iterator[int]) -> Iterator[int]:
    for number in numbers:
        next(ticks, None)
        yield number

"""Where files are kept: folders of this machine, or a store behind a url.

`flurries.output.sequence` makes files and asks a store the same few things wherever they go: what
is there, who makes it, and that it appears whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from flurries.io import remove_leftovers
from flurries.io.atomic import checked_target
from flurries.output import manifest
from flurries.output.claims import awaited, claimed
from flurries.output.mark import Mark
from flurries.scene.fingerprint import hash_of

Entry: TypeAlias = "dict[str, Any]"


class Held(Protocol):
    """The right to make a file."""

    def release(self) -> None:
        """Let others have it."""


class Store(Protocol):
    """A place where files are kept; a path is the file's way in it."""

    def name_of(self, path: Path) -> Path | str:
        """Return the user's name for the file."""

    def require_usable(self, path: Path) -> None:
        """Raise OSError where no such file can be written."""

    def settled(self, mark: Mark, path: Path, said: Entry | None) -> Entry | None:
        """Return the entry of a file that is there and right, see `Mark.settled`."""

    def claimed(self, path: Path) -> Held | None:
        """Return the right to make a file, or None if somebody is making it."""

    def awaited(self, path: Path) -> Held:
        """Return the right to make a file as soon as nobody else is making it."""

    def placing(self, path: Path) -> AbstractContextManager[Path]:
        """Yield where to write a file; at the end it is in the store, whole."""

    def hash_of(self, path: Path) -> str | None:
        """Return the SHA-256 of a file, or None where there is none."""

    def read_list(self, folder: Path) -> dict[str, Entry]:
        """Return the entries of a folder's manifest."""

    def add_to_list(self, folder: Path, entries: dict[str, Entry]) -> None:
        """Add entries to a folder's manifest."""

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""


class Disk:
    """Folders of this machine, or mounted in it."""

    def name_of(self, path: Path) -> Path:
        """Return the path."""
        return path

    def require_usable(self, path: Path) -> None:
        """Raise OSError where no such file can be written; make its folder if need be."""
        checked_target(path)

    def settled(self, mark: Mark, path: Path, said: Entry | None) -> Entry | None:
        """Return the entry of a file that is there and right, see `Mark.settled`."""
        return mark.settled(path, said)

    def claimed(self, path: Path) -> Held | None:
        """Return the right to make a file, or None if somebody is making it."""
        return claimed(path)

    def awaited(self, path: Path) -> Held:
        """Return the right to make a file as soon as nobody else is making it."""
        return awaited(path)

    @contextmanager
    def placing(self, path: Path) -> Iterator[Path]:
        """Yield the path itself: writers of pictures see to it that files appear whole."""
        yield path

    def hash_of(self, path: Path) -> str | None:
        """Return the SHA-256 of a file, or None where there is none."""
        return hash_of(path) if path.is_file() else None

    def read_list(self, folder: Path) -> dict[str, Entry]:
        """Return the entries of a folder's manifest."""
        return manifest.read(folder)

    def add_to_list(self, folder: Path, entries: dict[str, Entry]) -> None:
        """Add entries to a folder's manifest."""
        manifest.update(folder, entries)

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        remove_leftovers(folder)

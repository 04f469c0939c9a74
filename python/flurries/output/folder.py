"""Where files are kept: folders of this machine; `flurries.output.bucket` is another place."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from flurries.io import remove_leftovers, replacing
from flurries.io.atomic import checked_target, flush_folder, is_left
from flurries.io.files import read_bytes
from flurries.output.journal import NAME, PART, Entry, Journal, is_journal, part_name
from flurries.scene.fingerprint import hash_of

Save = Callable[[Path], None]
Lines = Callable[[list[str]], bytes]


class Store:
    """A place where files are kept; a path is the file's way in it. This one is this machine."""

    local = True

    def name_of(self, path: Path) -> Path | str:
        """Return the user's name for the file."""
        return path

    def require_usable(self, path: Path) -> None:
        """Raise OSError where no such file can be written; make its folder if need be."""
        checked_target(path)

    def exists(self, path: Path) -> bool:
        return os.path.lexists(path)

    def missing(self, paths: list[Path]) -> list[Path]:
        """Return those that are not there now."""
        return [path for path in paths if not self.exists(path)]

    def holds(self, path: Path, line: Entry) -> bool:
        """Whether a file is what its line says."""
        try:
            return path.stat().st_size == line.get("bytes") and hash_of(path) == line["sha256"]
        except FileNotFoundError:
            return False

    def send(
        self, journal: Journal, path: Path, facts: Mapping[str, Any], save: Save
    ) -> list[Entry]:
        """Write a file; return the lines of all that have come to the store by that."""
        with journal.recording(path, facts) as entry:
            save(path)
        return [entry]

    def finish(self, journal: Journal) -> list[Entry]:
        """Send what waits for others; return its lines."""
        return []

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        remove_leftovers(folder)

    def journals(self, folder: Path) -> dict[str, Any]:
        """Return the files of a folder's journal, and what changes where they do."""
        found: dict[str, Any] = {}
        with suppress(FileNotFoundError):
            for entry in os.scandir(folder):
                if is_journal(entry.name):
                    found[entry.name] = None  # It may be joined by now.
                    with suppress(FileNotFoundError):
                        now = entry.stat()
                        found[entry.name] = now.st_size, now.st_mtime_ns, now.st_ino
        return found

    def read(self, path: Path, most: int) -> bytes | None:
        try:
            return read_bytes(path, most, "journal")
        except FileNotFoundError:
            return None

    def append(self, folder: Path, run: str, data: bytes) -> str:
        """Put lines on the disk; return the name of the file that holds them."""
        path = folder / part_name(run)
        new = not path.exists()
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            if os.write(descriptor, data) != len(data):
                # What comes next must not hang on half a line.
                os.write(descriptor, b"\n")
                raise OSError(28, os.strerror(28), str(path))
            os.fsync(descriptor)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from error
        finally:
            os.close(descriptor)
        if new:
            flush_folder(folder)
        return path.name

    def is_left(self, folder: Path, name: str) -> bool:
        """Whether a file of a journal is one that nobody writes to any more."""
        found = PART.fullmatch(name)
        return found is not None and is_left(folder / name, found[1])

    def join(self, folder: Path, names: Iterable[str], run: str, lines: Lines) -> bool:
        """Put the lines of a journal's files into one; whether there were any."""
        joined, target = list(names), folder / NAME
        if not joined:
            return False
        flush_folder(folder)
        while True:
            # Whoever gives the last one another name has it to himself.
            own, part = (folder / part_name(run, unique=True) for _ in "ab")
            with suppress(FileNotFoundError):
                target.rename(own)
                joined.append(own.name)
            with replacing(part) as temporary:
                temporary.write_bytes(lines(joined) or b"\n")
            try:
                os.link(part, target)
            except FileExistsError:
                # Somebody else has joined, too.
                joined.append(part.name)
                continue
            except OSError:
                break  # No links here: it stays under its own name.
            joined.append(part.name)
            break
        flush_folder(folder)
        for name in joined:
            (folder / name).unlink(missing_ok=True)
        return True

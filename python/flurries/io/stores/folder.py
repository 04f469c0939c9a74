"""Folders of this machine as a store of files; `flurries.io.stores.bucket` is another."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

from flurries.io.atomic import checked_target, flush_folder, is_left, remove_leftovers, replacing
from flurries.io.files import hash_of, read_bytes

# What is known of a file: its "bytes", their "sha256", and more.
Line: TypeAlias = "dict[str, Any]"


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

    def held(self, path: Path, lines: list[Line]) -> list[Line]:
        """Return the lines that say what a file is."""
        with suppress(FileNotFoundError):
            size = path.stat().st_size
            if lines := [line for line in lines if line.get("bytes") == size]:
                told = hash_of(path)
                return [line for line in lines if line["sha256"] == told]
        return []

    def stamps(self, folder: Path, wanted: Callable[[str], bool]) -> dict[str, Any]:
        """Return files of a folder by their names, and what changes where they do."""
        found: dict[str, Any] = {}
        with suppress(FileNotFoundError):
            for entry in os.scandir(folder):
                if wanted(entry.name):
                    found[entry.name] = None  # It may be gone by now.
                    with suppress(FileNotFoundError):
                        now = entry.stat()
                        found[entry.name] = now.st_size, now.st_mtime_ns, now.st_ino
        return found

    def read(self, path: Path, most: int) -> bytes | None:
        """Return what is in a file; None if there is none."""
        try:
            return read_bytes(path, most, "journal")
        except FileNotFoundError:
            return None

    def append(self, path: Path, data: bytes) -> str:
        """Put lines on the disk; return the name of the file that holds them."""
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
            flush_folder(path.parent)
        return path.name

    def join(
        self, names: list[str], target: Path, own: Path, made: Callable[[list[str]], bytes]
    ) -> bool:
        """Put what is made of files into one, in their place; whether there was anything to do."""
        joined, folder = list(names), target.parent
        if not joined:
            return False
        flush_folder(folder)
        while True:
            # Whoever gives the last one another name has it to himself.
            last, part = unique(own), unique(own)
            with suppress(FileNotFoundError):
                target.rename(last)
                joined.append(last.name)
            with replacing(part) as temporary:
                temporary.write_bytes(made(joined))
            joined.append(part.name)
            try:
                os.link(part, target)
            except FileExistsError:
                continue  # Somebody else has joined, too.
            except OSError:
                joined.pop()  # No links here: it stays under its own name.
            break
        flush_folder(folder)
        for name in joined:
            (folder / name).unlink(missing_ok=True)
        return True

    def is_left(self, path: Path, owner: str) -> bool:
        """Whether nobody writes to a file of somebody any more."""
        return is_left(path, owner)

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        remove_leftovers(folder)


def unique(path: Path) -> Path:
    """Return a name like this which nothing else has or will have."""
    return path.with_name(f"{path.stem}.{os.urandom(4).hex()}{path.suffix}")

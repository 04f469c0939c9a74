"""Where files are kept: folders of this machine, or a store behind a url, through fsspec.

`flurries.output.sequence` asks a store the same few things wherever files go: what is there, and
that a file appears whole. A file for a url is written on this machine, checked there, sent whole,
and read back. Two processes may make the same file: both write the same bits, and either stays.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from flurries.io import remove_leftovers, replacing
from flurries.io.atomic import PREFIX, checked_target, has_ended, hidden_name
from flurries.output import manifest
from flurries.output.manifest import Mark
from flurries.scene.fingerprint import hash_of

if sys.platform != "win32":
    import fcntl

__all__ = ["check"]

Entry: TypeAlias = "dict[str, Any]"

# Stores in which an object appears whole or not at all, whatever becomes of the sender; elsewhere
# it is sent under a hidden name and renamed.
_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az"}

_LOCAL = ("file", "local")


class Store:
    """A place where files are kept; a path is the file's way in it. This one is this machine."""

    def name_of(self, path: Path) -> Path | str:
        """Return the user's name for the file."""
        return path

    def require_usable(self, path: Path) -> None:
        """Raise OSError where no such file can be written; make its folder if need be."""
        checked_target(path)

    @contextmanager
    def fetched(self, path: Path) -> Iterator[Path]:
        """Yield where the file can be read, if it is there."""
        yield path

    def settled(self, mark: Mark, path: Path, said: Entry | None) -> Entry | None:
        """Return the entry of a file that is there and right, see `Mark.settled`."""
        with self.fetched(path) as local:
            return mark.settled(local, said, self.name_of(path))

    @contextmanager
    def placing(self, path: Path) -> Iterator[Path]:
        """Yield where to write a file; at the end it is in the store, whole."""
        # Writers of pictures see to it that files appear whole.
        yield path

    def hash_of(self, path: Path) -> str | None:
        return hash_of(path) if path.is_file() else None

    def read_list(self, folder: Path) -> dict[str, Entry]:
        return manifest.read(folder)

    def add_to_list(self, folder: Path, entries: dict[str, Entry]) -> None:
        """Add entries to a folder's manifest, beside other processes that do so too."""
        with _locked(folder):
            text = manifest.text_of({**self.read_list(folder), **entries})
            with replacing(folder / manifest.NAME) as temporary:
                temporary.write_text(text, encoding="utf-8")

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        remove_leftovers(folder)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let one process at a time go on, where the folder's file system has locks."""
    if sys.platform == "win32":
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


@dataclass(frozen=True)
class Bucket(Store):
    """A store behind fsspec."""

    system: Any  # fsspec's driver.
    protocol: str  # "s3", "memory", ...

    def name_of(self, path: Path) -> str:
        return str(self.system.unstrip_protocol(path.as_posix()))

    @contextmanager
    def _named(self, path: Path) -> Iterator[None]:
        """Let an error of the store name the file; drivers raise errors of all kinds."""
        try:
            yield
        except Exception as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            said = f"{self.name_of(path)}: {reason or type(error).__name__}"
            if isinstance(error, PermissionError):
                raise PermissionError(said) from error
            raise OSError(said) from error

    def require_usable(self, path: Path) -> None:
        with self._named(path):
            if self.protocol not in _WHOLE:
                self.system.makedirs(path.parent.as_posix(), exist_ok=True)

    @contextmanager
    def fetched(self, path: Path) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="flurries-") as room:
            local = Path(room) / path.name
            with self._named(path), suppress(FileNotFoundError):
                # Whole: of a store in memory threads share the place in an open file.
                local.write_bytes(self.system.cat_file(path.as_posix()))
            yield local

    @contextmanager
    def placing(self, path: Path) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="flurries-") as room:
            local = Path(room) / path.name
            try:
                yield local
            except OSError as error:
                if error.filename is None:
                    raise
                # The name on this machine helps nobody.
                raise OSError(error.errno, error.strerror, self.name_of(path)) from error
            with self._named(path):
                self._send(local, path)
                if self.hash_of(path) != hash_of(local):
                    raise OSError("does not read back as what was written")

    def _send(self, local: Path, path: Path) -> None:
        key = path.as_posix()
        if self.protocol in _WHOLE:
            self.system.put_file(str(local), key)
            return
        hidden = path.with_name(hidden_name(path.suffix)).as_posix()
        try:
            self.system.put_file(str(local), hidden)
            self.system.mv(hidden, key)
        except BaseException:
            with suppress(Exception):
                self.system.rm_file(hidden)
            raise

    def hash_of(self, path: Path) -> str | None:
        with self._named(path):
            try:
                return hashlib.sha256(self.system.cat_file(path.as_posix())).hexdigest()
            except FileNotFoundError:
                return None

    def tidy(self, folder: Path) -> None:
        with self._named(folder), suppress(FileNotFoundError):
            for key in self.system.ls(folder.as_posix(), detail=False):
                name = Path(key).name
                if name.startswith(PREFIX) and has_ended(name):
                    with suppress(FileNotFoundError):
                        self.system.rm_file(key)

    def read_list(self, folder: Path) -> dict[str, Entry]:
        path = folder / manifest.NAME
        with self._named(path):
            try:
                if self.system.info(path.as_posix())["size"] > manifest.MOST_BYTES:
                    raise OSError(f"a manifest has at most {manifest.MOST_BYTES} bytes")
                text = self.system.cat_file(path.as_posix()).decode()
            except FileNotFoundError:
                return {}
        found = manifest.parse(text, self.name_of(path))
        if found is None:
            with self._named(folder):
                keys = self.system.ls(folder.as_posix(), detail=False)
            found = {}
            for key in sorted(keys):
                with self.fetched(Path(key)) as local:
                    found.update(manifest.entries_of([local]))
        return found

    def add_to_list(self, folder: Path, entries: dict[str, Entry]) -> None:
        text = manifest.text_of({**self.read_list(folder), **entries})
        with self.placing(folder / manifest.NAME) as local:
            local.write_text(text, encoding="utf-8")


def store_of(place: str) -> tuple[Store, str]:
    if "://" not in place:
        return Store(), place
    if "::" in place:
        raise ValueError(f"{place}: name the store itself, without a layer over it")
    try:
        core: Any = importlib.import_module("fsspec.core")
    except ImportError as error:
        raise ImportError(f"urls need fsspec; install flurries[stores] ({error})") from error
    try:
        # Listings that are kept would hide what others write.
        system, key = core.url_to_fs(place, use_listings_cache=False)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from error
    except ImportError as error:
        raise ImportError(f"{place}: {error}") from error
    protocol = system.protocol if isinstance(system.protocol, str) else system.protocol[0]
    if protocol in _LOCAL:
        return Store(), key
    if not Path(key).name:
        raise ValueError(f"{place} must name files in a bucket or a folder")
    return Bucket(system, protocol), key


def check(place: str | os.PathLike[str]) -> tuple[int, list[str]]:
    """Compare the files of a folder or url with its manifest: their number, and what is wrong."""
    store, folder = store_of(os.fspath(place))
    entries = store.read_list(Path(folder))
    if not entries and store.hash_of(Path(folder) / manifest.NAME) is None:
        raise FileNotFoundError(f"{place}/{manifest.NAME}: no manifest is there")
    wrong = []
    for name, said in entries.items():
        # Whoever made the list cannot have other files looked at.
        path = Path(folder) / name
        inside = not Path(name).is_absolute() and ".." not in Path(name).parts
        found = store.hash_of(path) if inside else None
        if found is None:
            wrong.append(f"{str(place).rstrip('/')}/{name} is missing")
        elif found != said.get("sha256"):
            wrong.append(f"{str(place).rstrip('/')}/{name} has changed")
    return len(entries), wrong

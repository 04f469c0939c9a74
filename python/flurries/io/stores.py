"""Where files are kept: the store that a path or a url names, this machine's or a bucket."""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from flurries._contract import library, naming
from flurries.io import atomic
from flurries.io.files import hash_of, read_bytes

# Stores in which an object appears whole or not at all, whatever becomes of the sender; elsewhere
# it is sent under a hidden name and renamed.
_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az"}

_LARGE = 1 << 26  # What S3 takes in parts, without a hash of the whole, bytes.

# What is known of a file: its "bytes", their "sha256", and more.
Line: TypeAlias = dict[str, Any]


def store_of(place: str) -> tuple[Store, str]:
    if "://" not in place:
        return Store(), place
    if "::" in place:
        raise ValueError(f"{place}: name the store itself, without a layer over it")
    core = library("fsspec.core", "urls need fsspec; install flurries[stores]")
    with naming(place, ValueError, ImportError):
        # Listings that are kept would hide what others write.
        system, key = core.url_to_fs(place, use_listings_cache=False)
    protocol = system.protocol if isinstance(system.protocol, str) else system.protocol[0]
    if protocol in ("file", "local"):
        return Store(), key
    if not Path(key).name:
        raise ValueError(f"{place} must name files in a bucket or a folder")
    return Bucket(system, protocol), key


class Store:
    """A place where files are kept; a path is the file's way in it. This one is this machine."""

    local = True

    def name_of(self, path: Path) -> Path | str:
        """Return the user's name for the file."""
        return path

    def require_usable(self, path: Path) -> None:
        """Raise OSError where no such file can be written; make its folder if need be."""
        atomic.checked_target(path)

    def exists(self, path: Path) -> bool:
        return os.path.lexists(path)

    def missing(self, paths: list[Path]) -> list[Path]:
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
        with suppress(FileNotFoundError):
            return read_bytes(path, most, "journal")
        return None

    def append(self, path: Path, data: bytes) -> str:
        """Put lines on the disk; return the name of the file that holds them."""
        new = not path.exists()
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            if os.write(descriptor, data) != len(data):
                # What comes next must not hang on half a line.
                os.write(descriptor, b"\n")
                raise OSError(28, os.strerror(28))
            os.fsync(descriptor)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from error
        finally:
            os.close(descriptor)
        if new:
            atomic.flush_folder(path.parent)
        return path.name

    def join(
        self, names: list[str], target: Path, own: Path, made: Callable[[list[str]], bytes]
    ) -> bool:
        """Put what is made of files into one, in their place; whether there was anything to do."""
        joined, folder = list(names), target.parent
        if not joined:
            return False
        atomic.flush_folder(folder)
        while True:
            # Whoever gives the last one another name has it to himself.
            last, part = _unique(own), _unique(own)
            with suppress(FileNotFoundError):
                target.rename(last)
                joined.append(last.name)
            with atomic.replacing(part) as temporary:
                temporary.write_bytes(made(joined))
            joined.append(part.name)
            try:
                os.link(part, target)
            except FileExistsError:
                continue  # Somebody else has joined, too.
            except OSError:
                joined.pop()  # No links here: it stays under its own name.
            break
        atomic.flush_folder(folder)
        for name in joined:
            (folder / name).unlink(missing_ok=True)
        return True

    def is_left(self, path: Path, owner: str) -> bool:
        """Whether nobody writes to a file of somebody any more."""
        return atomic.is_left(path, owner)

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        atomic.remove_leftovers(folder)


def _unique(path: Path) -> Path:
    """Return a name like this which nothing else has or will have."""
    return path.with_name(f"{path.stem}.{os.urandom(4).hex()}{path.suffix}")


@dataclass(frozen=True)
class Bucket(Store):
    """A bucket behind a url, or another store that fsspec knows."""

    system: Any  # fsspec's driver.
    protocol: str  # "s3", "memory", ...
    local = False
    # What is known of the objects of folders, by their names.
    _listed: dict[Path, dict[str, Any]] = field(default_factory=dict, compare=False)

    def __reduce__(self) -> Any:
        return Bucket, (self.system, self.protocol)

    def name_of(self, path: Path) -> str:
        return str(self.system.unstrip_protocol(path.as_posix()))

    @contextmanager
    def _named(self, path: Path) -> Iterator[None]:
        """Let an error of the store name the file; drivers raise errors of all kinds."""
        try:
            yield
        except Exception as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            kind = PermissionError if isinstance(error, PermissionError) else OSError
            said = f"{self.name_of(path)}: {reason or type(error).__name__}"
            raise kind(said) from error

    def require_usable(self, path: Path) -> None:
        with self._named(path):
            if self.protocol not in _WHOLE:
                self.system.makedirs(path.parent.as_posix(), exist_ok=True)

    def _objects(self, folder: Path, *, anew: bool = False) -> dict[str, Any]:
        if anew or folder not in self._listed:
            found = []
            with self._named(folder), suppress(FileNotFoundError):
                found = self.system.ls(folder.as_posix(), detail=True)
            self._listed[folder] = {Path(one["name"]).name: one for one in found}
        return self._listed[folder]

    def exists(self, path: Path) -> bool:
        return path.name in self._objects(path.parent)

    def missing(self, paths: list[Path]) -> list[Path]:
        self._listed.clear()
        return super().missing(paths)

    def held(self, path: Path, lines: list[Line]) -> list[Line]:
        found = self._objects(path.parent).get(path.name, {})
        if not (lines := [line for line in lines if line.get("bytes") == found.get("size")]):
            return []
        # The MD5 that the store says of an object; with it, it need not be read.
        told = str(found.get("ETag", "")).strip('"')
        if "md5Hash" in found:
            told = base64.b64decode(found["md5Hash"]).hex()
        if same := [line for line in lines if line.get("md5", "") == told]:
            return same
        read = hashlib.sha256(self.read(path) or b"").hexdigest()
        return [line for line in lines if line["sha256"] == read]

    def read(self, path: Path, most: int | None = None) -> bytes | None:
        with self._named(path), suppress(FileNotFoundError):
            if most is not None and self._objects(path.parent)[path.name]["size"] > most:
                raise OSError(f"a journal has at most {most} bytes")
            return bytes(self.system.cat_file(path.as_posix()))
        return None

    def put(self, data: bytes, path: Path) -> None:
        """Send a file, whole, and see that it is there."""
        # S3 itself refuses what is not these bytes.
        checked = self.protocol in ("s3", "s3a") and len(data) < _LARGE
        more = {"ContentMD5": base64.b64encode(md5(data)).decode()} if checked else {}
        target = (
            path if self.protocol in _WHOLE else path.with_name(atomic.hidden_name(path.suffix))
        )
        with self._named(path):
            try:
                self.system.pipe_file(target.as_posix(), data, **more)
                if target != path:
                    self.system.mv(target.as_posix(), path.as_posix())
            except BaseException:
                if target != path:
                    with suppress(Exception):
                        self.system.rm_file(target.as_posix())
                raise
            if not checked and self.read(path) != data:
                raise OSError("does not read back as what was written")

    @contextmanager
    def elsewhere(self, path: Path) -> Iterator[Path]:
        """Give a place on this machine for a file that is sent later."""
        own = atomic.PREFIX + atomic.owner_of_new_files()
        with tempfile.TemporaryDirectory(prefix=own) as room:
            try:
                yield Path(room) / path.name
            except OSError as error:
                if error.filename is None:
                    raise
                # The name on this machine helps nobody.
                raise OSError(error.errno, error.strerror, self.name_of(path)) from error

    def tidy(self, folder: Path) -> None:
        left = [name for name in self._objects(folder) if name.startswith(atomic.PREFIX)]
        self._remove(folder, [name for name in left if atomic.has_ended(atomic.owner_in(name))])
        # What they had on this machine.
        for room in Path(tempfile.gettempdir()).glob(f"{atomic.PREFIX}*"):
            if atomic.has_ended(atomic.owner_in(room.name)):
                shutil.rmtree(room, ignore_errors=True)

    def _remove(self, folder: Path, names: list[str]) -> None:
        with self._named(folder), suppress(FileNotFoundError):
            if names:
                self.system.rm([(folder / name).as_posix() for name in names])

    def stamps(self, folder: Path, wanted: Callable[[str], bool]) -> dict[str, Any]:
        found = self._objects(folder, anew=True).items()
        return {name: one["size"] for name, one in found if wanted(name)}

    def append(self, path: Path, data: bytes) -> str:
        # Objects do not grow: each batch of lines has its own.
        own = _unique(path)
        self.put(data, own)
        return own.name

    def is_left(self, path: Path, owner: str) -> bool:
        return True

    def join(
        self, names: list[str], target: Path, own: Path, made: Callable[[list[str]], bytes]
    ) -> bool:
        if len(names) < 2:
            return False
        self.append(own, made(names))
        self._remove(target.parent, names)
        return True


def md5(data: bytes) -> bytes:
    return hashlib.md5(data, usedforsecurity=False).digest()

"""A bucket behind a url, or another store that fsspec knows."""

from __future__ import annotations

import base64
import hashlib
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flurries.io.atomic import PREFIX, has_ended, hidden_name, owner_of_new_files
from flurries.io.stores.folder import Line, Store, unique

# Stores in which an object appears whole or not at all, whatever becomes of the sender; elsewhere
# it is sent under a hidden name and renamed.
_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az"}

# What S3 takes in parts, without a hash of the whole, bytes.
_LARGE = 1 << 26

Objects = dict[str, Any]


@dataclass(frozen=True)
class Bucket(Store):
    """A store behind fsspec."""

    system: Any  # fsspec's driver.
    protocol: str  # "s3", "memory", ...
    local = False
    _listed: dict[str, Objects] = field(default_factory=dict, compare=False)

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
            said = f"{self.name_of(path)}: {reason or type(error).__name__}"
            if isinstance(error, PermissionError):
                raise PermissionError(said) from error
            raise OSError(said) from error

    def require_usable(self, path: Path) -> None:
        with self._named(path):
            if self.protocol not in _WHOLE:
                self.system.makedirs(path.parent.as_posix(), exist_ok=True)

    def _objects(self, folder: Path, *, anew: bool = False) -> Objects:
        """Return what is known of the objects of a folder, by their names."""
        key, found = folder.as_posix(), []
        if anew or key not in self._listed:
            with self._named(folder), suppress(FileNotFoundError):
                found = self.system.ls(key, detail=True)
            self._listed[key] = {Path(one["name"]).name: one for one in found}
        return self._listed[key]

    def exists(self, path: Path) -> bool:
        return path.name in self._objects(path.parent)

    def missing(self, paths: list[Path]) -> list[Path]:
        self._listed.clear()
        return super().missing(paths)

    def held(self, path: Path, lines: list[Line]) -> list[Line]:
        found = self._objects(path.parent).get(path.name, {})
        if not (lines := [line for line in lines if line.get("bytes") == found.get("size")]):
            return []
        # What the store says of an object need not be read in it.
        if told := [line for line in lines if line.get("md5", "") == _told(found)]:
            return told
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
        target = path if self.protocol in _WHOLE else path.with_name(hidden_name(path.suffix))
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
        with tempfile.TemporaryDirectory(prefix=PREFIX + owner_of_new_files()) as room:
            try:
                yield Path(room) / path.name
            except OSError as error:
                if error.filename is None:
                    raise
                # The name on this machine helps nobody.
                raise OSError(error.errno, error.strerror, self.name_of(path)) from error

    def tidy(self, folder: Path) -> None:
        left = [name for name in self._objects(folder) if name.startswith(PREFIX)]
        self._remove(folder, [name for name in left if has_ended(name[len(PREFIX) :][:16])])
        # What they had on this machine.
        for room in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            if has_ended(room.name[len(PREFIX) :][:16]):
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
        own = unique(path)
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


def _told(found: Mapping[str, Any]) -> str:
    """Return the MD5 of an object, in hexadecimal, where its store says it."""
    if "md5Hash" in found:
        return base64.b64decode(found["md5Hash"]).hex()
    return str(found.get("ETag", "")).strip('"')

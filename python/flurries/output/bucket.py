"""Files behind a url, through fsspec: s3, gs, memory, sftp and whatever else has a driver.

A frame is written to a file of this machine, checked there, sent whole, and read back. Who makes
which frame is settled by a small object that only one process can create, where the store has such
conditional writes; where it has none, two processes may make the same frame, each with equal bits.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flurries.io.atomic import HOUR, PREFIX, TOKEN_LENGTH, has_ended, owner_of_new_files
from flurries.output import manifest
from flurries.output.mark import Mark, Refused
from flurries.output.store import Disk, Entry, Held, Store

# Stores in which an object appears whole or not at all, whatever becomes of the sender; elsewhere
# it is sent under a hidden name and renamed.
_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "memory"}

_LOCAL = ("file", "local")

# How often a claim that another holds is asked for again, seconds.
_PAUSE = 0.5


def store_of(place: str) -> tuple[Store, str]:
    """Return the store of a path or url, and the way in it.

    Raises
    ------
    ValueError
        If the url is none, or names a cache or another layer over a store.
    ImportError
        Without fsspec, or without the store's own driver.
    """
    if "://" not in place:
        return Disk(), place
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
        return Disk(), key
    if not Path(key).name:
        raise ValueError(f"{place} must name files in a bucket or a folder")
    return Bucket(system, protocol), key


def check(place: str) -> list[str]:
    """Compare the files of a folder or url with its manifest, see `manifest.check`."""
    store, folder = store_of(place)
    if isinstance(store, Disk):
        return manifest.check(folder)
    entries = store.read_list(Path(folder))
    if not entries:
        raise FileNotFoundError(f"{place}/{manifest.NAME}: no manifest is there")
    return manifest.differences(
        entries, place.rstrip("/"), lambda name: store.hash_of(Path(folder) / name)
    )


@dataclass
class _Claim:
    """The right to make a file, while a small object is there; without one where none can be."""

    bucket: Bucket
    key: str | None
    content: bytes = b""

    def release(self) -> None:
        """Let others have it."""
        key, self.key = self.key, None
        if key is not None:
            with suppress(Exception):
                # Not another's, who took it over after an hour.
                if self.bucket.system.cat_file(key) == self.content:
                    self.bucket.system.rm_file(key)


@dataclass(frozen=True)
class Bucket:
    """A `Store` behind fsspec.

    Attributes
    ----------
    system : fsspec.AbstractFileSystem
        The store's driver.
    protocol : str
        "s3", "memory", ...
    """

    system: Any
    protocol: str

    @property
    def is_conditional(self) -> bool:
        """Whether the store lets only one process create an object."""
        # What all drivers inherit looks first and writes then.
        general: Any = importlib.import_module("fsspec").AbstractFileSystem
        asynchronous: Any = importlib.import_module("fsspec.asyn").AsyncFileSystem
        own = type(self.system)
        if issubclass(own, asynchronous):
            return own._pipe_file is not asynchronous._pipe_file
        return own.pipe_file is not general.pipe_file

    def name_of(self, path: Path) -> str:
        """Return the url of a file."""
        return str(self.system.unstrip_protocol(path.as_posix()))

    @contextmanager
    def _named(self, path: Path) -> Iterator[None]:
        """Let an error of the store name the file; drivers raise errors of all kinds."""
        try:
            yield
        except Refused:
            raise
        except Exception as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            said = f"{self.name_of(path)}: {reason or type(error).__name__}"
            if isinstance(error, PermissionError):
                raise PermissionError(said) from error
            raise OSError(said) from error

    def require_usable(self, path: Path) -> None:
        """Make the folder where the store has folders; say if claims cannot be relied on."""
        with self._named(path):
            if self.protocol not in _WHOLE:
                self.system.makedirs(path.parent.as_posix(), exist_ok=True)
        if not self.is_conditional:
            warnings.warn(
                f"{self.protocol}:// has no conditional writes: where several processes write at "
                "once, a frame may be made more than once, each time with the same bits",
                stacklevel=2,
            )

    # Frames ---------------------------------------------------------------------------------------

    def settled(self, mark: Mark, path: Path, said: Entry | None) -> Entry | None:
        """Return the entry of a file that is there and right, see `Mark.settled`."""
        with self._fetched(path) as local:
            return None if local is None else mark.settled(local, said, self.name_of(path))

    @contextmanager
    def _fetched(self, path: Path) -> Iterator[Path | None]:
        """Yield a copy of a file on this machine, or None where there is none."""
        with tempfile.TemporaryDirectory(prefix="flurries-") as room:
            local = Path(room) / path.name
            with self._named(path):
                try:
                    self.system.get_file(path.as_posix(), str(local))
                except FileNotFoundError:
                    local = Path()
            yield local if local.name else None

    @contextmanager
    def placing(self, path: Path) -> Iterator[Path]:
        """Yield where to write a file; at the end it is sent, and read back."""
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
                if self.hash_of(path) != _hash_of(local):
                    raise OSError("does not read back as what was written")

    def _send(self, local: Path, path: Path) -> None:
        key = path.as_posix()
        if self.protocol in _WHOLE:
            self.system.put_file(str(local), key)
            return
        token = owner_of_new_files() + os.urandom((TOKEN_LENGTH - 16) // 2).hex()
        hidden = path.with_name(f"{PREFIX}{token}{path.suffix}").as_posix()
        try:
            self.system.put_file(str(local), hidden)
            self.system.mv(hidden, key)
        except BaseException:
            with suppress(Exception):
                self.system.rm_file(hidden)
            raise

    def hash_of(self, path: Path) -> str | None:
        """Return the SHA-256 of a file, or None where there is none."""
        with self._named(path):
            try:
                return hashlib.sha256(self.system.cat_file(path.as_posix())).hexdigest()
            except FileNotFoundError:
                return None

    # Claims ---------------------------------------------------------------------------------------

    def claimed(self, path: Path) -> Held | None:
        """Return the right to make a file, or None if somebody is making it."""
        if not self.is_conditional:
            return _Claim(self, None)
        token = hashlib.sha256(path.name.encode()).hexdigest()[:TOKEN_LENGTH]
        key = path.with_name(f"{PREFIX}{token}-claim").as_posix()
        with self._named(path):
            while True:
                content = f"{owner_of_new_files()} {time.time():.0f} {os.urandom(4).hex()}".encode()
                try:
                    self.system.pipe_file(key, content, mode="create")
                except Exception as error:
                    # Drivers raise errors of all kinds where it is there already.
                    try:
                        there = self.system.cat_file(key)
                    except FileNotFoundError:
                        if isinstance(error, FileExistsError):
                            continue
                        raise error from None
                    if there == content:
                        # The answer was lost, not the object.
                        return _Claim(self, key, content)
                    if not _is_left(there):
                        return None
                    with suppress(FileNotFoundError):
                        self.system.rm_file(key)
                else:
                    return _Claim(self, key, content)

    def awaited(self, path: Path) -> Held:
        """Return the right to make a file as soon as nobody else is making it."""
        while (claim := self.claimed(path)) is None:
            time.sleep(_PAUSE)
        return claim

    def tidy(self, folder: Path) -> None:
        """Remove what processes that have ended left under hidden names."""
        with self._named(folder):
            try:
                keys = self.system.ls(folder.as_posix(), detail=False)
            except FileNotFoundError:
                return
            for key in keys:
                name = Path(key).name
                if not name.startswith(PREFIX):
                    continue
                with suppress(FileNotFoundError):
                    if name.endswith("-claim"):
                        left = _is_left(self.system.cat_file(key))
                    else:
                        # Of another machine's it is not known how old they are.
                        left = bool(has_ended(name[len(PREFIX) :][:16]))
                    if left:
                        self.system.rm_file(key)

    # The manifest ---------------------------------------------------------------------------------

    def read_list(self, folder: Path) -> dict[str, Entry]:
        """Return the entries of a folder's manifest."""
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
                with self._fetched(Path(key)) as local:
                    if local is not None:
                        found.update(manifest.entries_of([local]))
        return found

    def add_to_list(self, folder: Path, entries: dict[str, Entry]) -> None:
        """Add entries to a folder's manifest; safe beside others where claims are."""
        path = folder / manifest.NAME
        claim = self.awaited(path)
        try:
            text = manifest.text_of({**self.read_list(folder), **entries})
            with self.placing(path) as local:
                local.write_text(text, encoding="utf-8")
        finally:
            claim.release()


def _is_left(said: bytes) -> bool:
    """Whether whoever made a hidden object is gone: a dead process here, or silent for an hour."""
    owner, _, rest = said.decode(errors="replace").partition(" ")
    ended = has_ended(owner)
    if ended is not None:
        return ended
    moment = rest.split(" ")[0]
    return moment.isdigit() and time.time() - int(moment) > HOUR


def _hash_of(local: Path) -> str:
    return hashlib.sha256(local.read_bytes()).hexdigest()

"""Files that appear whole or not at all: under a hidden name first, flushed, then renamed."""

import atexit
import errno
import hashlib
import os
import socket
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from flurries._contract import PathLike
from flurries.io.files import path_text

PREFIX = ".flurries-"

_OWNER = 16  # Of a token: the machine and the process.

# A hidden file of another machine that has not changed for so many seconds was left behind.
HOUR = 3600.0

# The temporary files of this process, and which process that is. Ctrl-C can fall between the making
# of a file and the block that guards it, so the end of the process looks once more.
_unfinished: dict[Path, int] = {}

# What is done with a file of `replacing` that is whole and on the disk, before it takes its name.
before_renaming: ContextVar[Callable[[Path], None] | None] = ContextVar("renaming", default=None)


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary file with the same extension, which replaces `path` on success."""
    target = checked_target(path)
    temporary = _reserve(target)
    owner, note = os.getpid(), before_renaming.get()
    try:
        yield temporary
        if temporary.stat().st_size == 0:
            raise OSError(f"{target}: nothing was written")
        flush(temporary)
        if note is not None:
            note(temporary)
        temporary.replace(target)
        _unfinished.pop(temporary, None)
    except BaseException as error:
        reason: Any = error
        if isinstance(error, OSError) and error.errno is None:
            # Other libraries' writers do not say why they failed; the disk does.
            reason = _why_full(temporary) or error
        _remove(temporary, owner)
        # A message about the hidden name, or about none, helps nobody: name the file itself.
        known = isinstance(reason, OSError) and reason.errno is not None
        if known and reason.filename in (None, str(temporary), temporary):
            raise OSError(reason.errno, reason.strerror, str(target)) from error
        raise
    # The rename itself shall last. Whoever notes files flushes the folder once, for all of them.
    if note is None:
        flush_folder(target.parent)


def checked_target(path: PathLike) -> Path:
    """Return `path` as a Path that a plain file can be written to, its folder made if need be."""
    text = path_text("path", path)
    target = Path(text)
    if text.endswith(("/", os.sep)) or not target.name or target.name == "..":
        raise OSError(errno.EISDIR, "This names a folder, not a file", text)
    if not target.parent.exists():
        # Only the last folder is made: a mistyped path must not grow a whole tree.
        try:
            target.parent.mkdir(exist_ok=True)
        except OSError as error:
            reason = f"Its folder is missing and cannot be made ({error.strerror})"
            raise OSError(error.errno, reason, text) from error
    if not target.parent.is_dir():
        raise OSError(errno.ENOTDIR, "The folder of this file is not a folder", text)
    try:
        mode = target.lstat().st_mode
    except FileNotFoundError:
        return target
    if stat.S_ISDIR(mode):
        raise OSError(errno.EISDIR, "Is a folder and cannot become a file", text)
    if stat.S_ISLNK(mode):
        # The rename would replace the link and leave the file it points to as it was.
        raise OSError(errno.EINVAL, "Is a symbolic link; name the file that it points to", text)
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "Is not a plain file and cannot be replaced", text)
    if not os.access(target, os.W_OK):
        raise OSError(errno.EACCES, "Is read-only", text)
    return target


def remove_leftovers(folder: PathLike) -> list[Path]:
    """Remove the temporary files of killed writers from a folder; return what was removed."""
    removed = []
    for found in sorted(Path(folder).glob(f"{PREFIX}{'?' * _OWNER}*")):
        if is_left(found, owner_in(found.name)):
            # Another process may be tidying up too.
            with suppress(OSError):
                found.unlink()
                removed.append(found)
    return removed


def owner_of_new_files() -> str:
    """Return this process and its machine, as the names of its hidden files begin."""
    # Containers may share a name but not their numbers of processes.
    parts = [socket.gethostname()]
    with suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text())
        parts.append(str(Path("/proc/self/ns/pid").stat().st_ino))
    machine = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    pid = f"{os.getpid():06x}"
    return machine[: _OWNER - len(pid)] + pid


def hidden_name(suffix: str) -> str:
    """Return a name for a file that is being written: whose it is, and a random part."""
    return f"{PREFIX}{owner_of_new_files()}{os.urandom(4).hex()}{suffix}"


def owner_in(name: str) -> str:
    return name.removeprefix(PREFIX)[:_OWNER]


def has_ended(owner: str) -> bool | None:
    """Return whether a process of `owner_of_new_files` has ended, or None of another machine's."""
    own = owner_of_new_files()
    if sys.platform == "win32" or len(owner) != _OWNER or owner[:-6] != own[:-6]:
        return None
    try:
        os.kill(int(owner[-6:], 16), 0)
    except ValueError:
        return None
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False


def is_left(file: Path, owner: str) -> bool:
    try:
        found, left = file.lstat(), has_ended(owner)
        if left is None:
            # By the folder's own clock: that of this machine may have jumped.
            probe = _reserve(file.parent / "now")
            left = probe.stat().st_mtime - found.st_mtime > HOUR
            _remove(probe, os.getpid())
    except OSError:
        return False
    return left and stat.S_ISREG(found.st_mode)


def _why_full(temporary: Path) -> OSError | None:
    """Return why no more can be written to a file, or None if it can."""
    try:
        with temporary.open("ab") as file:
            file.write(bytes(1 << 20))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return error
    return None


def _reserve(target: Path) -> Path:
    # The name does not grow with the target's, so a name at the length limit still has room.
    suffix = target.suffix if len(target.suffix) <= 16 else ""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0)
    while True:
        temporary = target.with_name(hidden_name(suffix))
        _unfinished[temporary] = os.getpid()
        try:
            # Mode 0o666 less the umask: what any program gives a new file. A private temporary
            # file would become a private picture.
            os.close(os.open(temporary, flags, 0o666))
            return temporary
        except OSError as error:
            del _unfinished[temporary]
            if not isinstance(error, FileExistsError):
                raise OSError(error.errno, error.strerror, str(target)) from error


def flush_folder(folder: Path) -> None:
    """Wait until names are on the disk, where the file system can."""
    if sys.platform != "win32":
        with suppress(OSError):
            flush(folder, os.O_RDONLY)


def flush(path: Path, flags: int = os.O_RDWR) -> None:
    """Wait until the bytes are on the disk, so that the new name never shows less."""
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove(temporary: Path, owner: int) -> None:
    # A forked child that ends unwinds the same block: the file is its parent's, not its own.
    if os.getpid() == owner:
        with suppress(OSError):
            temporary.unlink()
    _unfinished.pop(temporary, None)


@atexit.register
def _remove_unfinished() -> None:
    for temporary, owner in list(_unfinished.items()):
        _remove(temporary, owner)

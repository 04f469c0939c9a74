"""The journal of a folder: what each file is, on the disk before the file has its name."""

import json
import os
import re
import socket
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import RLock
from typing import Any

from flurries import __version__
from flurries._contract import PathLike
from flurries.io.atomic import before_renaming, owner_of_new_files
from flurries.io.files import hash_of
from flurries.io.stores import Bucket, Line, Store, md5, store_of
from flurries.scene.fingerprint import BITS

__all__ = ["check"]

NAME = "flurries.jsonl"

# A process's own, joined when its run ends, so that none waits: who owns it, and which run.
PART = re.compile(r"flurries\.([0-9a-f]{16})([0-9a-f]{8})(\.[0-9a-f]{8})?\.jsonl")

MOST_BYTES = 1 << 28

# Files that are sent to a bucket together: a kill loses no more, and an object of lines for each
# would be dear.
BATCH = 8


def is_journal(name: str) -> bool:
    return name == NAME or PART.fullmatch(name) is not None


class Refused(ValueError):
    """A file that is in the way and that is not to be replaced unasked."""

    def __init__(self, path: Path | str, why: str, others: int = 0) -> None:
        self.path, self.why = path, why
        more = f" (so with {others} more)" if others else ""
        super().__init__(
            f"{path} is there already and {why}{more}; overwrite=True (--overwrite) replaces it"
        )


@dataclass(frozen=True)
class Mark:
    """All that a file depends on."""

    scene: str  # A hash of the scene, of what is in a file, and of the mode.
    frame: int  # Which of them it is.
    inputs: str = ""  # A hash of what the files hold that it was made of.
    bits: int = BITS  # See :data:`flurries.scene.fingerprint.BITS`.

    @property
    def facts(self) -> Line:
        """The values of a line, and of a header for people."""
        return {key: value for key, value in asdict(self).items() if value != ""}

    def differs(self, line: Mapping[str, Any]) -> str:
        """Return how the file of a line is another one than this; nothing if it is not."""
        if line.get("bits") != self.bits:
            version = line.get("version", "of an unknown version")
            return f"was made by flurries {version}, whose frames have other bits"
        if (line.get("scene"), line.get("frame")) != (self.scene, self.frame):
            return "is of another scene, of another frame, or written in another way"
        if line.get("inputs", "") != self.inputs:
            return "was made over other pictures: a background or depth has changed since"
        return ""


class Journal:
    """Lines about files by their names, the ways from the folder."""

    def __init__(
        self, store: Store, folder: Path, *, run: str = "", known: Iterable[Line] | None = None
    ) -> None:
        self._store, self._folder = store, folder
        self.run = run or os.urandom(4).hex()  # A token in the names of this run's own files.
        self._lines: dict[str, dict[bytes, Line]] = {}
        self._stamps: dict[str, Any] = {}  # Of the files that were read.
        self._lock = RLock()
        # Files that are to be sent with others: their bytes and lines.
        self._waiting: list[tuple[Path, bytes, Line]] = []
        # Lines of what the files that this run has written have replaced.
        self._old: set[bytes] = set()
        if known is None:
            self.refresh()
        for line in known or ():
            self._take(_bytes(line))

    @property
    def _own(self) -> Path:
        """The file of this process and run."""
        return self._folder / f"flurries.{owner_of_new_files()}{self.run}.jsonl"

    def names(self) -> list[str]:
        return sorted(self._lines)

    def lines(self, name: str) -> list[Line]:
        return list(self._lines.get(name, {}).values())

    def last(self) -> dict[str, Line]:
        return {name: self.lines(name)[-1] for name in self.names()}

    def refresh(self) -> list[str]:
        """Read what others have written; return the journal's files."""
        with self._lock:
            before: Any = None
            while True:
                listed = self._store.stamps(self._folder, is_journal)
                for name, stamp in listed.items():
                    if name not in self._stamps or self._stamps[name] != stamp:
                        self._read(name)
                        self._stamps[name] = stamp
                # What was joined between two looks is in a file that the second one sees.
                now = listed.get(NAME), set(listed)
                if now == before:
                    return list(listed)
                before = now

    def _read(self, name: str) -> None:
        data = self._store.read(self._folder / name, MOST_BYTES) or b""
        ours = sum(self._take(line) for line in data.split(b"\n"))
        if name == NAME and not ours and data.strip(b"\0\n "):
            path = self._store.name_of(self._folder / name)
            raise ValueError(f"{path} is there already and is no journal; move it away")

    def _take(self, line: bytes) -> bool:
        """Take a line; one that is damaged or cut short says nothing."""
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            return False
        name = said.get("file") if isinstance(said, dict) else None
        if not isinstance(name, str) or not isinstance(said.get("sha256"), str):
            return False
        if line not in self._old:
            self._lines.setdefault(name, {})[line] = said
        return True

    def name_of(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()

    def entry(self, path: Path, local: Path, facts: Mapping[str, Any]) -> Line:
        """Return the line of a file that is still elsewhere."""
        who = f"{socket.gethostname()} {os.getpid()}"
        said = {"bytes": local.stat().st_size, "sha256": hash_of(local)}
        return {"file": self.name_of(path), **facts, **said, "version": __version__, "by": who}

    def append(self, *entries: Line) -> None:
        """Write lines; when this returns they are on the disk."""
        lines = [_bytes(entry) for entry in entries]
        with self._lock:
            data = b"".join(b"%s\n" % line for line in lines)
            self._stamps[self._store.append(self._own, data)] = len(data)
            for line in lines:
                self._take(line)

    def write(self, path: Path, facts: Mapping[str, Any], save: Callable[[Path], None]) -> None:
        """Write a file after its line; into a bucket when several are waiting for it."""
        store = self._store
        if isinstance(store, Bucket):
            with store.elsewhere(path) as local:
                save(local)
                data = local.read_bytes()
                entry = self.entry(path, local, {**facts, "md5": md5(data).hex()})
            self._waiting.append((path, data, entry))
            self.send(BATCH)
            return
        written: list[Line] = []

        def note(temporary: Path) -> None:
            written.append(self.entry(path, temporary, facts))
            self.append(*written)

        token = before_renaming.set(note)
        try:
            save(path)
        finally:
            before_renaming.reset(token)
        self._place(*written)

    def send(self, least: int = 1) -> None:
        store = self._store
        with self._lock:
            if len(self._waiting) < least or not isinstance(store, Bucket):
                return
            batch, self._waiting = self._waiting, []
        self.append(*(entry for _, _, entry in batch))
        for path, data, entry in batch:
            store.put(data, path)
            self._place(entry)

    def _place(self, entry: Line) -> None:
        """Note that a file has its name: lines about what was there before are done with."""
        with self._lock:
            lines = self._lines[entry["file"]]
            old = {line for line, said in lines.items() if said["sha256"] != entry["sha256"]}
            self._old |= old
            for line in old:
                del lines[line]

    def settled(self, path: Path, mark: Mark, *, scratch: bool = False) -> Line | None:
        """Return the line of a file that is there and right, None if it is to be made."""
        if not self._store.exists(path):
            return None
        name = self.name_of(path)
        for again in (False, True):
            if again:
                # Somebody may have made it since.
                self.refresh()
            lines = self.lines(name)
            held = self._store.held(path, lines)
            for line in held:
                if not mark.differs(line):
                    return line
        if scratch and lines:
            # Ours, and nobody else wants it.
            return None
        if held:
            why = mark.differs(held[-1])
        elif lines:
            why = "has been changed since it was written"
        else:
            old = self._store.exists(self._folder / "flurries.json")
            earlier = "; frames of flurries 0.2 are not gone on from" if old else ""
            why = f"no journal ({NAME}) says that it is ours{earlier}"
        raise Refused(self._store.name_of(path), why)

    def require_bits(self, mark: Mark) -> None:
        """Refuse a folder with files of the same scene that have other bits."""
        # All frames of a scene have that part of its hash.
        common = mark.scene.partition("+")[0]
        for name in self.names():
            for line in self.lines(name):
                own = str(line.get("scene")).partition("+")[0]
                other = line.get("bits") != mark.bits and own == common
                if other and self._store.exists(self._folder / name):
                    raise Refused(self._store.name_of(self._folder / name), mark.differs(line))

    def join(self, *, all_of_run: bool = False) -> None:
        """Put all lines into one file, in place of those to which nobody writes any more."""
        with self._lock:
            listed = [name for name in self.refresh() if name != NAME]
            names = [name for name in listed if self._has_ended(name, all_of_run)]
            if self._store.join(names, self._folder / NAME, self._own, self._joined):
                self._stamps.clear()

    def _has_ended(self, name: str, all_of_run: bool) -> bool:
        """Whether nobody writes to a file of the journal any more."""
        found = PART.fullmatch(name)
        assert found is not None
        if found[2] == self.run and (all_of_run or found[1] == owner_of_new_files()):
            return True
        return self._store.is_left(self._folder / name, found[1])

    def _joined(self, names: Iterable[str]) -> bytes:
        """Return all lines, those of files that were not read yet too."""
        for name in names:
            if name not in self._stamps:
                self._read(name)
        lines = {line for found in self._lines.values() for line in found}
        return b"".join(b"%s\n" % line for line in sorted(lines)) or b"\n"


def _bytes(entry: Line) -> bytes:
    return json.dumps(entry).encode()


def check(place: PathLike) -> tuple[int, list[str]]:
    """Compare the files of a folder or url with its journal: their number, and what is wrong."""
    store, folder = store_of(os.fspath(place))
    found = Journal(store, Path(folder))
    if not found.names():
        raise FileNotFoundError(f"{place}: no journal ({NAME}) is there")
    made: dict[Any, Any] = {}
    wrong, here = [], str(place).rstrip("/")
    for name in found.names():
        # Whoever made the list cannot have other files looked at.
        path, inside = Path(folder) / name, not Path(name).is_absolute()
        if not inside or ".." in Path(name).parts or not store.exists(path):
            wrong.append(f"{here}/{name} is missing")
            continue
        good = store.held(path, found.lines(name))
        if not good:
            wrong.append(f"{here}/{name} has changed")
        made |= {line.get("bits"): line.get("version") for line in good}
    if len(made) > 1:
        versions = " and ".join(sorted(map(str, made.values())))
        wrong.append(f"{here} has frames of flurries {versions}, which differ in their bits")
    return len(found.names()), wrong

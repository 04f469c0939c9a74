"""The journal of a folder: what each file is, on the disk before the file has its name.

A process writes lines to a file of its own beside the frames, and joins them to ``flurries.jsonl``
when its run ends. All are read together, so nobody waits for a lock: a line is never in no file. A
line without its file is a file not made; a file without a line is not ours.
"""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeAlias

from flurries import __version__
from flurries.io.atomic import before_renaming, owner_of_new_files
from flurries.scene.fingerprint import BITS, hash_of

if TYPE_CHECKING:
    from flurries.output.folder import Store

NAME = "flurries.jsonl"

# A process's own: who owns it, and which of its runs.
PART = re.compile(r"flurries\.([0-9a-f]{16})[0-9a-f]{8}(\.[0-9a-f]{8})?\.jsonl")

MOST_BYTES = 1 << 28


def is_journal(name: str) -> bool:
    return name == NAME or PART.fullmatch(name) is not None


def part_name(run: str, *, unique: bool = False) -> str:
    """Return the name of this process's own file; a unique one nothing else has or will have."""
    own = f".{os.urandom(4).hex()}" if unique else ""
    return f"flurries.{owner_of_new_files()}{run}{own}.jsonl"


Entry: TypeAlias = "dict[str, Any]"


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
    def facts(self) -> Entry:
        """The values of a line, and of a header for people."""
        return {key: value for key, value in asdict(self).items() if value != ""}

    def is_of(self, line: Mapping[str, Any]) -> bool:
        return all(line.get(key, "") == value for key, value in asdict(self).items())

    def differs(self, line: Mapping[str, Any]) -> str:
        """Return how the file of a line is another one than this."""
        if line.get("bits") != self.bits:
            version = line.get("version", "of an unknown version")
            return f"was made by flurries {version}, whose frames have other bits"
        if (line.get("scene"), line.get("frame")) != (self.scene, self.frame):
            return "is of another scene, of another frame, or written in another way"
        return "was made over other pictures: a background or depth has changed since"


class Journal:
    """Lines about files by their names, the ways from the folder."""

    def __init__(
        self, store: Store, folder: Path, *, run: str | None = None,
        known: Iterable[Entry] | None = None,
    ) -> None:  # fmt: skip
        self._store, self._folder = store, folder
        self.run = run or os.urandom(4).hex()  # A token in the names of this run's own files.
        self._lines: dict[str, dict[bytes, Entry]] = {}
        self._texts: dict[str, tuple[Any, list[bytes]]] = {}
        self.lock = RLock()
        # Files that are to be sent with others: their bytes and lines.
        self.waiting: list[tuple[Path, bytes, Entry]] = []
        # What the files that this run has written have replaced.
        self._old: set[bytes] = set()
        if known is None:
            self.refresh()
        for line in known or ():
            self._take(_bytes(line))

    def names(self) -> list[str]:
        return sorted(self._lines)

    def lines(self, name: str) -> list[Entry]:
        return list(self._lines.get(name, {}).values())

    def refresh(self) -> None:
        """Read what others have written."""
        with self.lock:
            listed: dict[str, Any] | None = None
            while True:
                before, listed = listed, self._store.journals(self._folder)
                # What was joined between two looks is in a file that the second one sees.
                same = before is not None and before.get(NAME) == listed.get(NAME)
                if same and set(before or ()) == set(listed):
                    return
                for name, stamp in listed.items():
                    if name not in self._texts or self._texts[name][0] != stamp:
                        self._texts[name] = stamp, self._read(name)

    def _read(self, name: str) -> list[bytes]:
        data = self._store.read(self._folder / name, MOST_BYTES) or b""
        lines = data.split(b"\n")
        ours = [line for line in lines if self._take(line)]
        if name == NAME and not ours and data.strip(b"\0\n "):
            path = self._store.name_of(self._folder / name)
            raise ValueError(f"{path} is there already and is no journal; move it away")
        return ours

    def _take(self, line: bytes) -> bool:
        """Take a line; one that is damaged or cut short says nothing."""
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            return False
        name = said.get("file") if isinstance(said, dict) else None
        if not isinstance(name, str) or not isinstance(said.get("sha256"), str):
            return False
        self._lines.setdefault(name, {})[line] = said
        return True

    def name_of(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()

    def entry(self, path: Path, local: Path, facts: Mapping[str, Any]) -> Entry:
        """Return the line of a file that is still elsewhere."""
        who = f"{socket.gethostname()} {os.getpid()}"
        said = {"bytes": local.stat().st_size, "sha256": hash_of(local)}
        return {"file": self.name_of(path), **facts, **said, "version": __version__, "by": who}

    def append(self, *entries: Entry) -> None:
        """Write lines; when this returns they are on the disk."""
        lines = [_bytes(entry) for entry in entries]
        with self.lock:
            data = b"".join(b"%s\n" % line for line in lines)
            name = self._store.append(self._folder, self.run, data)
            self._texts.setdefault(name, (len(data), []))[1].extend(lines)
            for line in lines:
                self._take(line)

    def placed(self, entry: Entry) -> None:
        """Note that a file has its name: lines about what was there before are done with."""
        with self.lock:
            self._old |= {
                line
                for line, said in self._lines[entry["file"]].items()
                if said["sha256"] != entry["sha256"]
            }

    @contextmanager
    def recording(self, path: Path, facts: Mapping[str, Any]) -> Iterator[Entry]:
        """Give the file that is written inside its line before it takes its name."""
        entry: Entry = {}

        def note(temporary: Path) -> None:
            entry.update(self.entry(path, temporary, facts))
            self.append(entry)

        token = before_renaming.set(note)
        try:
            yield entry
        finally:
            before_renaming.reset(token)
        self.placed(entry)

    def settled(self, path: Path, mark: Mark) -> Entry | None:
        """Return the line of a file that is there and right, None if it is to be made."""
        if not self._store.exists(path):
            return None
        name = self.name_of(path)
        for again in (False, True):
            if again:
                # Somebody may have made it since.
                self.refresh()
            for line in reversed(self.lines(name)):
                if mark.is_of(line) and self._store.holds(path, line):
                    return line
        raise Refused(self._store.name_of(path), self._why(path, mark))

    def require_bits(self, mark: Mark) -> None:
        """Refuse a folder with files of the same scene that have other bits."""
        common = _common(mark.scene)
        for name, lines in self._lines.items():
            for line in lines.values():
                other = line.get("bits") != mark.bits and _common(line.get("scene")) == common
                if other and self._store.exists(self._folder / name):
                    raise Refused(self._store.name_of(self._folder / name), mark.differs(line))

    def _why(self, path: Path, mark: Mark) -> str:
        lines = self.lines(self.name_of(path))
        if not lines:
            old = self._store.exists(self._folder / "flurries.json")
            earlier = "; frames of flurries 0.2 are not gone on from" if old else ""
            return f"no journal ({NAME}) says that it is ours{earlier}"
        for line in reversed(lines):
            if self._store.holds(path, line):
                return mark.differs(line)
        return "has been changed since it was written"

    def join(self, *, all_of_run: bool = False) -> None:
        """Put the lines of this run, and of processes that have ended, into one file."""
        with self.lock:
            self.refresh()
            names = [name for name in self._texts if name != NAME and self._ends(name, all_of_run)]
            if self._store.join(self._folder, names, self.run, self._joined):
                self._texts.clear()

    def _ends(self, name: str, all_of_run: bool) -> bool:
        """Whether nobody writes to a file of the journal any more."""
        own = part_name(self.run)[:33]
        mine = name[25:33] == self.run if all_of_run else name.startswith(own)
        return mine or self._store.is_left(self._folder, name)

    def _joined(self, names: Iterable[str]) -> bytes:
        """Return the lines of files, but for those of what this run has replaced."""
        lines: dict[bytes, None] = {}
        for name in names:
            found = self._texts[name][1] if name in self._texts else self._read(name)
            lines.update(dict.fromkeys(found))
        return b"".join(b"%s\n" % line for line in sorted(lines.keys() - self._old))


def _common(scene: object) -> str:
    """Return the part of a scene's hash that all its frames have."""
    return str(scene).partition("+")[0]


def _bytes(entry: Entry) -> bytes:
    return json.dumps(entry).encode()

"""A power cut at any moment: what is left is known from the flushes of a recorded run.

After each flush the run's folder is looked at: which file has which name, and what is in it. On the
disk is for certain the content that a file had at its own last flush. Of names there are two laws:

- as file systems with a journal keep them: all names up to the last flush of anything;
- anyhow: those that a folder had at its own last flush.

What came after may be there or not, each name and each content alone.
"""

from __future__ import annotations

import itertools
import os
import random
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from threading import RLock
from typing import Any

from faults.shot import LAST, Shot

# Cuts at each flush: with nothing but what is certain, and with what chance adds.
CUTS = 3

# Frames that are written at once: two writers' in a sequence, a group of a film.
IN_HAND = {True: 48, False: 2}

Names = dict[str, int]  # Ways from the room to what is there.


@dataclass
class Moment:
    """What is on the disk for certain, and what else programs see."""

    names: Names  # Seen.
    kept: dict[str, Names]  # Of each folder, those at its last flush.
    seen: dict[int, bytes | None]  # Contents; a folder has none.
    flushed: dict[int, bytes]  # Contents at a file's last flush.


@dataclass
class Recorder:
    """Looks at a room at each flush."""

    room: Path
    moments: list[Moment] = field(default_factory=list)
    kept: dict[str, Names] = field(default_factory=dict)
    flushed: dict[int, bytes] = field(default_factory=dict)
    held: dict[int, int] = field(
        default_factory=dict
    )  # Open, so that no other file gets its number.

    def look(self, flushed: int | None = None) -> None:
        names: Names = {}
        seen: dict[int, bytes | None] = {}
        for path in sorted(self.room.rglob("*")):
            # What another thread takes away meanwhile is not there.
            try:
                number = path.stat().st_ino
                if number not in self.held:
                    self.held[number] = os.open(path, os.O_RDONLY)
                seen[number] = path.read_bytes() if path.is_file() else None
            except FileNotFoundError:
                continue
            names[path.relative_to(self.room).as_posix()] = number
        places = {names[name]: name for name in names} | {self.room.stat().st_ino: "."}
        if flushed in places:
            if flushed in seen and seen[flushed] is not None:
                self.flushed[flushed] = seen[flushed] or b""
            else:
                place = places[flushed]
                self.kept[place] = {n: i for n, i in names.items() if _folder(n) == place}
        self.moments.append(Moment(names, dict(self.kept), seen, dict(self.flushed)))


def _folder(name: str) -> str:
    return Path(name).parent.as_posix()


def _record(shot: Shot, words: Any, lying: bool) -> None:
    out, flush, lock = Path(shot.way), os.fsync, RLock()
    out.rmdir()
    recorder = Recorder(shot.room)
    recorder.look()

    def fsync(descriptor: int) -> None:
        with lock:
            flush(descriptor)
            # A disk that lies says so and has nothing.
            recorder.look(None if lying else os.fstat(descriptor).st_ino)

    os.fsync = fsync
    said = shot.write()
    recorder.look()
    words.send((said, recorder.moments))


def cut(
    before: Moment, after: Moment, room: Path, chance: random.Random | None, *, anyhow: bool
) -> None:
    """Put into a room what a cut between two moments leaves; without chance what is certain."""
    shutil.rmtree(room)
    room.mkdir()
    names = dict(before.names)
    if anyhow:
        names = {name: number for kept in before.kept.values() for name, number in kept.items()}
    if chance is not None:
        _change(names, after.names, chance)
    for name, number in sorted(names.items()):
        path = room / name
        if not path.parent.is_dir():
            continue  # What is in a folder that is lost is lost, too.
        seen = after.seen.get(number, before.seen.get(number, b""))
        if seen is None:
            path.mkdir()
            continue
        data = before.flushed.get(number, b"")
        if chance is not None:
            # Of what was not flushed nothing, a part, zeros in its place, or all.
            rest = seen[len(data) :]
            part = rest[: chance.randrange(len(rest) + 1)]
            data = chance.choice([data, data + part, data + bytes(len(rest)), seen])
        path.write_bytes(data)


def _change(names: Names, after: Names, chance: random.Random) -> None:
    """Let some of the changes of names happen."""
    there = set(names.values())
    for name in sorted({*names, *after}):
        number = after.get(name)
        if number is not None and number != names.get(name) and chance.random() < 0.5:
            names[name] = number
    for name in sorted(names):
        # A name goes by itself, or after its file has another.
        moved = names[name] in after.values() and list(names.values()).count(names[name]) == 1
        gone = name not in after and names[name] in there and not moved
        if gone and chance.random() < 0.5:
            del names[name]


def _there(moment: Moment, shot: Shot) -> int:
    """Return how many frames have their names."""
    names = {name.removeprefix("out/") for name in moment.names}
    if not shot.film:
        return sum(re.fullmatch(r"(\d|still)\.\w+", name) is not None for name in names)
    groups = {"0000.npz": 48, "0001.npz": LAST - 48}
    made = sum(count for name, count in groups.items() if f"{shot.name}.parts/{name}" in names)
    return LAST if shot.name in names else made


def power_cut(
    shot: Shot, whole: dict[str, bytes], children: Any, part: tuple[int, int] = (0, 1), *,
    anyhow: bool, lying: bool = False,
) -> str:  # fmt: skip
    """Return what was seen of the runs after cuts at all moments of a run, or after a part."""
    here, there = children.Pipe()
    child = children.Process(target=_record, args=(shot, there, lying))
    child.start()
    there.close()
    said, moments = here.recv()
    child.join()
    plate = shot.plate.read_bytes()
    if said[:4] != "made" or len(moments) < 5:
        return f"not recorded: {said}"
    chance = random.Random(1)
    for number, (before, after) in enumerate(itertools.pairwise(moments)):
        for attempt in range(CUTS):
            cut(before, after, shot.room, chance if attempt else None, anyhow=anyhow)
            if (CUTS * number + attempt) % part[1] != part[0]:
                continue
            shot.plate.write_bytes(plate)
            words = shot.write()
            found = re.fullmatch(r"made (\d+), kept (\d+)", words)
            if found is None or not shot.is_as(whole):
                return f"cut {attempt} at flush {number}: {words}"
            least = _there(after, shot) - IN_HAND[shot.film]
            if not anyhow and int(found[2]) < least:
                return f"cut {attempt} at flush {number}: {least} frames were there; {words}"
    return "goes on"

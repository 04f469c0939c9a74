"""What befalls a file, or what it is made of, between two runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import flurries as fl
from faults.shot import LAST, PLATE, STORES, Shot

Fault = Callable[[Shot], object]
Cell = tuple[str, str, Callable[[], str]]


def _flipped(data: bytes) -> bytes:
    at = 2 * len(data) // 3
    return data[:at] + bytes([data[at] ^ 4]) + data[at + 1 :]


def _paged(data: bytes) -> bytes:
    half = len(data) // 2
    return data[:half] + bytes(min(4096, len(data) - half)) + data[half + 4096 :]


def _inverted(data: bytes) -> bytes:
    half = len(data) // 2
    return data[:half] + bytes(255 - byte for byte in data[half:])


def _other_plate(shot: Shot) -> None:
    before = shot.plate.stat()
    fl.io.write_picture(shot.plate, 255 - PLATE)
    os.utime(shot.plate, ns=(before.st_atime_ns, before.st_mtime_ns))


def _dead_machine(shot: Shot) -> None:
    """Leave what a machine that is gone was at: half a file, a line of it, half a line."""
    shot.system.pipe_file(f"{shot.way}/.flurries-{'0' * 24}.png", b"half")
    line = b'{"file": "9.png", "frame": 9, "bytes": 4, "sha256": "0"}\n{"file": "8.p'
    shot.system.pipe_file(f"{shot.way}/flurries.{'0' * 24}.jsonl", line)


def _from_tomorrow(shot: Shot) -> None:
    """Give all files a time that has not come yet, as a clock that was wrong does."""
    for path in Path(shot.way).iterdir():
        later = path.stat().st_mtime_ns + 86_400 * 10**9
        os.utime(path, ns=(later, later))


def _linked_folder(shot: Shot) -> None:
    Path(shot.way).rename(shot.room / "elsewhere")
    Path(shot.way).symlink_to("elsewhere")


def _link(path: Path) -> None:
    (path.parent.parent / "mine").write_bytes(b"mine")
    path.symlink_to("../mine")


# What is no plain file: made where one was, or is to be.
ODD: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo, "a link to nowhere": lambda path: path.symlink_to("nowhere"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a link to a stranger's file": _link, "a folder": Path.mkdir,
}  # fmt: skip


def _instead(make: Callable[[Path], object]) -> Fault:
    def put(shot: Shot) -> None:
        Path(shot.victim).unlink()
        make(Path(shot.victim))

    return put


SPOILT: dict[str, Callable[[bytes], bytes]] = {
    "emptied": lambda data: b"", "truncated": lambda data: data[: len(data) // 2],
    "one bit": _flipped, "a zeroed page": _paged, "header kept, content changed": _inverted,
    "retouched, some bytes longer": lambda data: data + b"more",
}  # fmt: skip

# Answers with a journal and without.
BETWEEN: dict[str, tuple[Fault, str, str]] = {
    "nothing": (lambda shot: None, "kept", "refused"),
    "deleted": (lambda shot: shot.system.rm_file(f"{shot.way}/{shot.name}"),
                "made again", "refused"),
    **{name: (lambda shot, spoil=spoil: shot.put(spoil(shot.contents()[shot.name])),
              "refused", "refused") for name, spoil in SPOILT.items()},
    "another scene": (lambda shot: None, "refused", "refused"),
    "another plate of its name": (_other_plate, "refused", "refused"),
    "a dead machine's leftovers": (_dead_machine, "kept", "refused"),
    **{f"{name} in its place": (_instead(make), "refused", "refused")
       for name, make in ODD.items()},
    "its folder moved, and a link to it": (_linked_folder, "kept", "refused"),
    "its time is tomorrow": (_from_tomorrow, "kept", "refused"),
}  # fmt: skip
LOCAL = (*list(BETWEEN)[-2:], *(f"{name} in its place" for name in ODD))


def between(fault: str, shot: Shot, whole: dict[str, bytes], *, journal: bool) -> str:
    """Return what the second run did about a fault."""
    shot.write()
    BETWEEN[fault][0](shot)
    if not journal:
        shot.drop_journal()
    before = shot.contents()
    words = shot.write(seed=5 if fault == "another scene" else 0)
    after = shot.contents()
    failed = not words.startswith("made ")
    if failed and after == before and shot.way in words:
        return "refused"
    if failed or any(after.get(name) != data for name, data in whole.items()):
        return f"silent or unclear: {words}"
    return "kept" if words.startswith("made 0") else "made again"


def stranger(make: Callable[[Path], object] | None, shot: Shot) -> str:
    """Return what a run does about something that was there before."""
    if make is None:
        shot.put(b"mine")
    else:
        make(Path(shot.victim))
    before = shot.contents()
    words = shot.write()
    mine = shot.room / "mine"
    theirs = shot.contents() == before and (not mine.exists() or mine.read_bytes() == b"mine")
    return "refused" if theirs and shot.name in words and words[:4] != "made" else words


def _late(shot: Shot) -> None:
    """Stop a run before a group, which is noted, has its name; its writer goes on alone."""

    def stop(numbers: Iterable[int]) -> Iterable[int]:
        raise KeyboardInterrupt

    data = _group(shot).read_bytes()
    _group(shot).unlink()
    shot.write(progress=stop)
    _group(shot).write_bytes(data)


# What befalls a film's first group where a run was stopped in the second: answers, as above. Group
# files are nobody's work: what is not what is wanted is made again.
GROUPS: dict[str, tuple[Fault, str, str]] = {
    "nothing": (lambda shot: None, "kept", "refused"),
    "deleted": (lambda shot: _group(shot).unlink(), "made again", "made again"),
    **{name: (lambda shot, spoil=spoil: _spoil(_group(shot), spoil), "made again", "refused")
       for name, spoil in SPOILT.items()},
    "another scene": (lambda shot: None, "made again", "refused"),
    "another plate of its name": (_other_plate, "made again", "refused"),
    "its name comes after Ctrl-C": (_late, "kept", "refused"),
}  # fmt: skip


def _group(shot: Shot) -> Path:
    return Path(f"{shot.victim}.parts") / "0000.npz"


def _spoil(path: Path, spoil: Callable[[bytes], bytes]) -> None:
    path.write_bytes(spoil(path.read_bytes()))


def in_a_group(fault: str, shot: Shot, *, journal: bool) -> str:
    """Return what a run that goes on with a film did about a fault in a group."""

    def stop(numbers: Iterable[int]) -> Iterator[int]:
        for number in numbers:
            if number == LAST:
                raise KeyboardInterrupt
            yield number

    shot.write(progress=stop)
    GROUPS[fault][0](shot)
    if not journal:
        shot.drop_journal(f"/{shot.name}.parts")
    seed, before = 5 if fault == "another scene" else 0, shot.contents(f"/{shot.name}.parts")
    words = shot.write(seed)
    if words[:4] != "made" and _group(shot).name in words:
        return "refused" if shot.contents(f"/{shot.name}.parts") == before else "refused and lost"
    film = shot.contents()
    again = Shot(shot.kind, shot.room / "again")
    again.plate.write_bytes(shot.plate.read_bytes())
    again.write(seed)
    if film != again.contents():
        return f"another film: {words}"
    return "made again" if words == f"made {LAST}, kept 0" else "kept"


def cells(kind: str, shots: Iterator[Shot], whole: dict[str, bytes]) -> Iterator[Cell]:
    """Yield fault, expected answer, and what sees the answer."""
    for fault, (_, with_it, without) in BETWEEN.items():
        if kind in STORES and fault in LOCAL:
            continue
        for journal in (True, False):
            shot = next(shots)
            want = with_it if journal else without
            if fault == "deleted" and not journal and shot.alone:
                want = "made again"
            name = fault if journal else f"{fault}; without a journal"
            yield name, want, partial(between, fault, shot, whole, journal=journal)
    yield "a stranger's file", "refused", partial(stranger, None, next(shots))
    if kind in STORES:
        return
    for fault, make in ODD.items():
        yield f"{fault} that was there", "refused", partial(stranger, make, next(shots))
    for fault, (_, with_it, without) in GROUPS.items() if next(shots).film else ():
        for journal, want in ((True, with_it), (False, without)):
            name = f"a group: {fault}" if journal else f"a group: {fault}; without a journal"
            yield name, want, partial(in_a_group, fault, next(shots), journal=journal)

"""The matrix of faults: every format and store, each fault, with a journal and without.

`python docs/make_faults.py` writes docs/internals/faults.md; tests/test_faults.py asks for all.
"""

from __future__ import annotations

import errno
import itertools
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import fsspec
import numpy as np
from moto.server import ThreadedMotoServer

import flurries as fl
from flurries.io.pictures.writer import FORMATS
from flurries.io.sequences import VIDEO_EXTENSIONS
from flurries.output.journal import is_journal

PAGE = Path(__file__).parent / "internals" / "faults.md"
STORES = ("memory", "s3")
KINDS = [*(suffix[1:] for suffix in FORMATS), "still", *STORES]
PLATE = np.random.default_rng(7).integers(0, 200, (24, 32, 3)).astype(np.uint8)


class Shot:
    """Three frames of a scene over a plate, as files of one kind."""

    def __init__(self, kind: str, room: Path) -> None:
        self.kind, self.room = kind, room
        self.alone = kind == "still" or f".{kind}" in VIDEO_EXTENSIONS
        self.plate = room / "plate.png"
        fl.io.write_picture(self.plate, PLATE)
        (room / "out").mkdir()
        name = {"still": "still.png"}.get(kind, f"film.{kind}" if self.alone else f"%d.{kind}")
        self.folder, self.count = str(room / "out"), 1 if kind == "still" else 3
        if kind in STORES:
            name, own = "%d.png", uuid.uuid4().hex
            self.folder = f"s3://films/{own}" if kind == "s3" else f"memory://{own}"
        self.pattern = f"{self.folder}/{name}"
        self.victim = self.pattern.replace("%d", "2")
        self.system, self.way = fsspec.core.url_to_fs(self.folder, use_listings_cache=False)

    def scene(self, seed: int = 0) -> fl.Scene:
        return fl.Scene(self.plate, effects=fl.effects.TentSnow("heavy", flakes=20), seed=seed)

    def write(self, seed: int = 0, **more: Any) -> str:
        """Return what a run says: how many it made and kept, or its refusal."""
        frames = 2 if self.kind == "still" else "1-3"
        try:
            done = self.scene(seed).write(self.pattern, frames, **more)
        except (ValueError, OSError, RuntimeError) as error:
            return f"{type(error).__name__}: {error}"
        return f"made {len(done.written)}, kept {len(done.kept)}"

    def contents(self) -> dict[str, bytes]:
        """Return all files but those of the journal, hidden ones too."""
        found = {}
        for key in self.system.ls(self.way, detail=False):
            name = Path(key).name
            if not is_journal(name):
                plain = self.kind in STORES or Path(key).is_file()
                found[name] = self.system.cat_file(key) if plain else b"no plain file"
        return found

    def put(self, data: bytes) -> None:
        self.system.pipe_file(f"{self.way}/{Path(self.victim).name}", data)

    def drop_journal(self) -> None:
        for key in self.system.ls(self.way, detail=False):
            if is_journal(Path(key).name):
                self.system.rm_file(key)


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


def _instead(make: Callable[[Path], None]) -> Callable[[Shot], None]:
    def put(shot: Shot) -> None:
        Path(shot.victim).unlink()
        make(Path(shot.victim))

    return put


def _dead_machine(shot: Shot) -> None:
    """Leave what a machine that is gone was at: half a file, a line of it, half a line."""
    shot.system.pipe_file(f"{shot.way}/.flurries-{'0' * 24}.png", b"half")
    line = b'{"file": "9.png", "frame": 9, "bytes": 4, "sha256": "0"}\n{"file": "8.p'
    shot.system.pipe_file(f"{shot.way}/flurries.{'0' * 24}.jsonl", line)


# What befalls a file, or what it is made of, between two runs: answers with a journal and without.
BETWEEN: dict[str, tuple[Callable[[Shot], object], str, str]] = {
    "nothing": (lambda shot: None, "kept", "refused"),
    "deleted": (lambda shot: shot.system.rm_file(f"{shot.way}/{Path(shot.victim).name}"),
                "made again", "refused"),
    "emptied": (lambda shot: shot.put(b""), "refused", "refused"),
    **{name: (lambda shot, spoil=spoil: shot.put(spoil(shot.contents()[Path(shot.victim).name])),
              "refused", "refused")
       for name, spoil in {
           "truncated": lambda data: data[: len(data) // 2], "one bit": _flipped,
           "a zeroed page": _paged, "header kept, pixels changed": _inverted,
           "retouched, some bytes longer": lambda data: data + b"more",
       }.items()},
    "another scene": (lambda shot: None, "refused", "refused"),
    "another plate of its name": (_other_plate, "refused", "refused"),
    "a dead machine's leftovers": (_dead_machine, "kept", "refused"),
    "a FIFO in its place": (_instead(os.mkfifo), "refused", "refused"),
    "a link to nowhere": (_instead(lambda path: path.symlink_to("nowhere")), "refused", "refused"),
    "a folder in its place": (_instead(Path.mkdir), "refused", "refused"),
}  # fmt: skip
ODD = ("a FIFO in its place", "a link to nowhere", "a folder in its place")

# Children come from a process without threads.
CLEAN = multiprocessing.get_context("forkserver")
CLEAN.set_forkserver_preload(["make_faults"])

# What befalls a run in its second file; then another run goes on.
GOES_ON, NAMED = "goes on", "named; goes on"
WITHIN = {
    "killed before the line": GOES_ON, "killed after the line": GOES_ON, "killed later": GOES_ON,
    "disk full at byte 0": NAMED, "disk full halfway": NAMED, "EIO": NAMED,
    "permission lost": NAMED, "read-only folder": NAMED, "clock jumps back a day": GOES_ON,
    "two at once": GOES_ON, "a stopped neighbour": GOES_ON,
}  # fmt: skip


def befall(fault: str, shot: Shot, size: int) -> None:
    """Let the fault come over this process, which is a child that is about to write."""
    out, flush, calls = shot.room / "out", os.fsync, itertools.count(1)
    # Of the second file: its bytes are flushed third or so, then its line.
    last = {"killed before the line": 1, "killed after the line": 2, "killed later": 5}.get(fault)

    def fsync(descriptor: int) -> None:
        number = next(calls)
        if fault == "EIO":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if fault == "permission lost":
            out.chmod(0o555)
        flush(descriptor)
        if number == last or (fault == "a stopped neighbour" and number == 3):
            os.kill(os.getpid(), signal.SIGKILL if last else signal.SIGSTOP)

    os.fsync = fsync
    if fault.startswith("disk full"):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        most = 0 if fault.endswith("0") else size // 2
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    if fault == "clock jumps back a day":
        now = time.time
        time.time = lambda: now() - 86_400.0
        time.time_ns = lambda: int(1e9 * time.time())
    if fault in ("permission lost", "read-only folder"):
        os.chown(out, 65534, 65534)
        if fault == "read-only folder":
            out.chmod(0o555)
        shot.room.parent.chmod(0o755)
        shot.room.chmod(0o755)
        os.setuid(65534)


def _work(fault: str, shot: Shot, size: int, words: Any) -> None:
    # What a run loads is loaded before an ordinary user may not read it.
    warm = shot.room / "warm"
    warm.mkdir()
    Shot(shot.kind, warm).write()
    befall(fault, shot, size)
    words.send(shot.write())


def within(fault: str, shot: Shot, whole: dict[str, bytes]) -> str:
    """Return what was seen of a fault in a run, and of the run after it."""
    here, there = CLEAN.Pipe()
    child = CLEAN.Process(target=_work, args=(fault, shot, len(min(whole.values())), there))
    child.start()
    there.close()
    if fault == "a stopped neighbour":
        while "State:\tT" not in Path(f"/proc/{child.pid}/status").read_text():
            time.sleep(0.002)
        other = shot.write()
        os.kill(child.pid or 0, signal.SIGCONT)
        if "Error" in other:
            return other
    if fault == "two at once":
        shot.write()
    words = ""
    with suppress(EOFError):
        words = here.recv()
    child.join()
    (shot.room / "out").chmod(0o777)
    found = {name: data for name, data in shot.contents().items() if name[0] != "."}
    if not found.items() <= whole.items():
        return "a file that is not whole has its name"
    again = shot.write()
    if shot.contents() != whole or "Error" in again:
        return f"other files than those of a run without a fault: {again}"
    if WITHIN[fault] == GOES_ON:
        return GOES_ON if "Error" not in words else words
    return NAMED if "Error: " in words and str(shot.room) in words else f"not named: {words}"


def between(fault: str, shot: Shot, whole: dict[str, bytes], *, journal: bool) -> str:
    """Return what the second run did about a fault."""
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


def cells(kind: str, room: Path) -> Iterator[tuple[str, str, str]]:
    """Yield fault, expected and seen answer of each cell of a format or a store."""
    rooms = iter(range(10**6))

    def shot() -> Shot:
        place = room / f"{kind}{next(rooms)}"
        place.mkdir()
        return Shot(kind, place)

    first = shot()
    first.write()
    whole = first.contents()
    assert len(whole) == (1 if first.alone else 3)
    for fault, (_, with_it, without) in BETWEEN.items():
        if kind in STORES and fault in ODD:
            continue
        for journal in (True, False):
            one = shot()
            one.write()
            want = with_it if journal else without
            if fault == "deleted" and not journal and one.alone:
                want = "made again"
            name = fault if journal else f"{fault}; without a journal"
            yield name, want, between(fault, one, whole, journal=journal)
    stranger = shot()
    stranger.put(b"mine")
    words = stranger.write()
    theirs = stranger.contents() == {Path(stranger.victim).name: b"mine"}
    yield "a stranger's file", "refused", "refused" if theirs and "no journal" in words else words
    for fault, want in WITHIN.items():
        if kind not in STORES:
            yield fault, want, within(fault, shot(), whole)


@contextmanager
def s3() -> Iterator[ThreadedMotoServer]:
    """Serve a bucket on this machine."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    os.environ |= {"AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "NO_PROXY": "*",
                   "AWS_DEFAULT_REGION": "us-east-1"}  # fmt: skip
    fsspec.config.conf["s3"] = {"endpoint_url": f"http://{host}:{port}"}
    fsspec.filesystem("s3").makedirs("films", exist_ok=True)
    yield server
    server.stop()


def main() -> None:
    """Write the page."""
    found = {}
    with tempfile.TemporaryDirectory() as room:
        Path(room).chmod(0o755)
        for kind in KINDS:
            # A server's threads must not be there where children are made.
            with s3() if kind == "s3" else nullcontext():
                found[kind] = {f: (want, seen) for f, want, seen in cells(kind, Path(room))}
    faults = list(dict.fromkeys(fault for cell in found.values() for fault in cell))
    wrong = sum(want != seen for cell in found.values() for want, seen in cell.values())
    count = sum(map(len, found.values()))
    lines = [
        "# The matrix of faults",
        "",
        f"Printed by `python docs/make_faults.py`: {count} cells, {wrong} with another answer than "
        "the expected one. `tests/test_faults.py` asks for each.",
        "",
        f"| fault | expected | {' | '.join(found)} |",
        f"|{' --- |' * (len(found) + 2)}",
    ]
    for fault in faults:
        row = [found[kind].get(fault) for kind in found]
        want = " or ".join(dict.fromkeys(cell[0] for cell in row if cell))
        seen = ["-" if c is None else "yes" if c[0] == c[1] else c[1] for c in row]
        lines.append(f"| {fault} | {want} | {' | '.join(seen)} |")
    PAGE.write_text("\n".join(lines) + "\n")
    print(f"{count} cells, {wrong} wrong")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()

"""What befalls a run while it writes, and the run after it."""

from __future__ import annotations

import errno
import itertools
import multiprocessing
import os
import resource
import signal
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from faults.between import Cell
from faults.power import power_cut
from faults.shot import FILMS, STORES, Shot

# Children come from a process without threads, which has loaded what they need.
CLEAN = multiprocessing.get_context("forkserver")
CLEAN.set_forkserver_preload(["faults.within", "flurries.output.write", "OpenImageIO"])

# The forkserver is not told where modules are; who starts it anew finds them in this.
os.environ["PYTHONPATH"] = str(Path(__file__).parents[1])

# A run waits for the disk when a file's bytes are written, and when its line is. Flushes 1 and 2
# are those of the first frame or group, 4 and 5 those of the second; the last are the journal's.
FLUSHES, OF_A_STILL = range(1, 11), 7

GOES_ON, NAMED = "goes on", "named; goes on"
WITHIN = {
    **{f"killed at flush {number}": GOES_ON for number in FLUSHES},
    "Ctrl-C": GOES_ON, "SIGTERM": GOES_ON, "SIGHUP": GOES_ON,
    "disk full at byte 0": NAMED, "disk full halfway": NAMED, "disk full at the last byte": NAMED,
    "EIO": NAMED, "half of a line written": NAMED,
    "permission lost": NAMED, "read-only folder": NAMED,
    "clock jumps back a day": GOES_ON, "clock jumps ahead a day": GOES_ON,
    "two at once": GOES_ON, "two machines at once": GOES_ON, "the other machine dies": GOES_ON,
    **{f"a neighbour stopped at flush {number}": GOES_ON for number in FLUSHES},
    "its codec is killed": NAMED,
}  # fmt: skip

# After these hidden files are gone before there is another run.
TIDY = ("Ctrl-C", "SIGTERM", "SIGHUP", "disk full", "EIO", "half of a line", "its codec")


def befall(fault: str, shot: Shot, size: int) -> None:
    """Let the fault come over this process, which is a child that is about to write."""
    out, flush, put, calls = Path(shot.way), os.fsync, os.write, itertools.count(1)
    at = _flush_of(fault)
    killed = fault.startswith("killed") or fault == "the other machine dies"
    stop = {"Ctrl-C": signal.SIGINT, "SIGTERM": signal.SIGTERM, "SIGHUP": signal.SIGHUP}

    def fsync(descriptor: int) -> None:
        number = next(calls)
        if fault == "EIO":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if fault == "permission lost":
            out.chmod(0o555)
        flush(descriptor)
        if number == at and killed:
            os.kill(os.getpid(), signal.SIGKILL)
        if number == at and fault.startswith("a neighbour"):
            os.kill(os.getpid(), signal.SIGSTOP)
        if number == at and fault in stop:
            os.kill(os.getpid(), stop[fault])
        if number == at and fault == "its codec is killed":
            for child in _children():
                os.kill(child, signal.SIGKILL)

    os.fsync = fsync
    if fault.startswith("half of a line"):
        os.write = lambda descriptor, data: put(descriptor, data[: len(data) // 2])
    if fault.startswith("disk full"):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        most = {"0": 0, "halfway": size // 2, "byte": size - 1}[fault.split()[-1]]
        for process in (0, *_children()):
            resource.prlimit(process, resource.RLIMIT_FSIZE, (most, most))
    if fault.startswith("clock"):
        now, jump = time.time, -86_400.0 if "back" in fault else 86_400.0
        time.time = lambda: now() + jump
        time.time_ns = lambda: int(1e9 * time.time())
    if "machine" in fault:
        socket.gethostname = lambda: "elsewhere"
    if fault in ("SIGTERM", "SIGHUP"):
        # As the command line does.
        signal.signal(stop[fault], lambda *_: sys.exit(1))
    if fault in ("permission lost", "read-only folder"):
        os.chown(out, 65534, 65534)
        if fault == "read-only folder":
            out.chmod(0o555)
        shot.room.parent.chmod(0o755)
        shot.room.chmod(0o755)
        os.setuid(65534)


def _flush_of(fault: str) -> int:
    return int(fault.rpartition(" ")[2]) if "at flush" in fault else 1


def _children() -> list[int]:
    """Return this process's children: the codecs'."""
    return [
        int(one)
        for thread in Path("/proc/self/task").iterdir()
        for one in (thread / "children").read_text().split()
    ]


def _work(fault: str, shot: Shot, size: int, words: Any) -> None:
    if fault.startswith(("disk full", "permission", "read-only")):
        # What a run loads and starts is there before an ordinary user may not, or the disk is full.
        Shot(shot.kind, shot.room / "warm").write()
    befall(fault, shot, size)
    words.send(shot.write())


def within(fault: str, shot: Shot, whole: dict[str, bytes]) -> str:
    """Return what was seen of a fault in a run, and of the run after it."""
    here, there = CLEAN.Pipe()
    child = CLEAN.Process(target=_work, args=(fault, shot, len(min(whole.values())), there))
    child.start()
    there.close()
    if fault.startswith("a neighbour"):
        status = Path(f"/proc/{child.pid}/status")
        while "State:\tT" not in status.read_text():
            assert child.is_alive()
            time.sleep(0.002)
        # It is stopped until this run has ended: whoever waited for it would wait for ever.
        other = shot.write()
        os.kill(child.pid or 0, signal.SIGCONT)
        if "Error" in other:
            return other
    if fault.startswith("two"):
        shot.write()
    words = ""
    with suppress(EOFError):
        words = here.recv()
    child.join()
    if words and fault.startswith("killed"):
        return "not killed"
    Path(shot.way).chmod(0o777)
    if fault == "the other machine dies":
        # Nobody waits for it; what it has left goes when it is old.
        if "Error" in (other := shot.write()):
            return other
        _age(Path(shot.way))
    found = {name: data for name, data in shot.contents().items() if not name.endswith(".parts")}
    shown = {name: data for name, data in found.items() if name[0] != "."}
    if not shown.items() <= whole.items():
        return "a file that is not whole has its name"
    if shown != found and fault.startswith(TIDY):
        return "a hidden file is left"
    again = shot.write()
    if not shot.is_as(whole) or "Error" in again:
        return f"other files than those of a run without a fault: {again}"
    if fault == "its codec is killed" and "Error" not in words:
        return NAMED  # It was at rest: another took its place.
    if WITHIN[fault] == GOES_ON:
        return GOES_ON if "Error" not in words else words
    return NAMED if "Error: " in words and str(shot.room) in words else f"not named: {words}"


def _age(folder: Path) -> None:
    """Let two hours pass."""
    for found in folder.rglob("*"):
        then = found.stat().st_mtime - 7200.0
        os.utime(found, (then, then))


def cells(
    kind: str, shots: Iterator[Shot], whole: dict[str, bytes], part: tuple[int, int]
) -> Iterator[Cell]:
    """Yield fault, expected answer, and what sees the answer; of power cuts those of a part."""
    if kind in STORES:
        return
    for fault, want in WITHIN.items():
        late = kind == "still" and _flush_of(fault) > OF_A_STILL
        if not late and (kind in FILMS or "codec" not in fault):
            yield fault, want, partial(within, fault, next(shots), whole)
    for fault, anyhow in (("power cut", False), ("power cut, names in any order", True)):
        yield fault, GOES_ON, partial(power_cut, next(shots), whole, CLEAN, part, anyhow=anyhow)

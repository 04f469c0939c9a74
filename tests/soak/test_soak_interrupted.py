"""Runs that are killed or interrupted at random times, and go on: the same bits, nothing left."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pytest
from length import times

import flurries as fl
from flurries.output import manifest
from flurries.output.store import check
from workers import group, workers

FRAMES = "1-24"
SCENE = fl.Scene((96, 64), "#304050", effects=fl.TentSnow.preset("heavy", flakes=100))
# Imports once and forks for each run: the time goes into what is stopped. A run that
# is interrupted leaves the loop and the program as any other does.
PROGRAM = """
import os, sys
import flurries as fl
import OpenImageIO
for line in sys.stdin:
    pid = os.fork()
    if pid == 0:
        break
    print(pid, flush=True)
    print(os.waitpid(pid, 0)[1], flush=True)
else:
    sys.exit()
place, pattern, frames = line.split()
os.chdir(place)
sys.stderr = open(os.devnull, "w")
fl.Scene.load("scene.toml").write(pattern, frames)
"""


class Runs:
    """Runs of the program, one at a time."""

    def __init__(self) -> None:
        self.parent = subprocess.Popen(
            [sys.executable, "-c", PROGRAM], text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, env={**os.environ, "FLURRIES_NUM_THREADS": "1"},
        )  # fmt: skip

    def start(self, place: Path, pattern: str) -> int:
        """Return the process of a new run."""
        assert self.parent.stdin is not None and self.parent.stdout is not None
        print(place, pattern, FRAMES, file=self.parent.stdin, flush=True)
        return int(self.parent.stdout.readline())

    def end(self) -> int:
        """Wait for it; return its status."""
        assert self.parent.stdout is not None
        return int(self.parent.stdout.readline())


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def stopped(
    how: signal.Signals, count: int, folder: Path
) -> tuple[dict[str, int], list[dict[str, bytes]]]:
    """Stop `count` runs at random times, go on with each; return what was seen and all results."""
    random, runs = np.random.default_rng(count), Runs()
    kinds = [("out/%04d.png", 0.0), ("out/%04d.exr", 0.0)]
    whole = []
    for number, (pattern, _) in enumerate(kinds):
        # The first is slower, and a neighbour may be in the way of another.
        spent = []
        for turn in range(3):
            place = folder / f"whole{number}{turn}"
            place.mkdir()
            SCENE.save(place / "scene.toml")
            begun = time.monotonic()
            runs.start(place, pattern)
            assert runs.end() == 0
            spent.append(time.monotonic() - begun)
        kinds[number] = pattern, min(spent)
        whole.append(contents(place / "out"))
        assert len(whole[-1]) == 25
    seen = {"runs": 0, "in the middle": 0, "leftovers": 0, "partial": 0, "different": 0, "stay": 0}
    for number in range(count):
        pattern, seconds = kinds[number % 2]
        want = whole[number % 2]
        place = folder / str(number)
        place.mkdir()
        SCENE.save(place / "scene.toml")
        pid = runs.start(place, pattern)
        wait = random.uniform(0.0, 1.05 * seconds)
        end = time.monotonic() + 60
        # Half of them at any time, half among the frames.
        while number % 4 >= 2 and not list(place.glob("out/*.*")) and time.monotonic() < end:
            wait = random.uniform(0.0, 0.3 * seconds)
            time.sleep(0.001)
        time.sleep(wait)
        # Its parent has reaped it if it has ended already.
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, how)
        runs.end()
        left = contents(place / "out") if (place / "out").exists() else {}
        final = {n: data for n, data in left.items() if not n.startswith(".")}
        seen["runs"] += 1
        seen["in the middle"] += 0 < len(final) < len(want)
        seen["leftovers"] += len(left) - len(final)
        seen["partial"] += sum(
            want.get(n) != data for n, data in final.items() if n != manifest.NAME
        )
        runs.start(place, pattern)
        assert runs.end() == 0
        again = contents(place / "out")
        seen["different"] += sum(again.get(n) != data for n, data in want.items())
        seen["stay"] += len(set(again) - set(want))
    assert runs.parent.stdin is not None
    runs.parent.communicate(timeout=60)
    return seen, whole


def test_killed_and_resumed(tmp_path: Path):
    seen, _ = stopped(signal.SIGKILL, times(500), tmp_path)
    assert seen["partial"] == seen["different"] == seen["stay"] == 0
    # The control: kills do come in the middle, and do leave something to tidy up.
    assert seen["in the middle"] > 0.1 * seen["runs"] and seen["leftovers"] > 0


def test_ctrl_c_and_resumed(tmp_path: Path):
    seen, _ = stopped(signal.SIGINT, times(300), tmp_path)
    assert seen["partial"] == seen["different"] == seen["stay"] == seen["leftovers"] == 0
    assert seen["in the middle"] > 0.1 * seen["runs"]


@pytest.mark.parametrize("locks", ["locks", "lockless"])
def test_16_hundred_rounds_of_four_processes(locks: str, tmp_path: Path):
    from test_nothing_wrong import killed

    killed(locks, times(100), tmp_path)


# A Dask worker ------------------------------------------------------------------------------------


def test_dask_workers_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from test_cluster import SLOW  # its effect takes a while, so that kills come in between

    count, random = times(50), np.random.default_rng(2)
    group(4, monkeypatch)
    SLOW.write(tmp_path / "whole" / "%04d.png", "1-32")
    want, during = contents(tmp_path / "whole"), 0
    for number in range(count):
        # A cluster for each: one that has lost many workers is slow to replace them.
        with dask.config.set({"distributed.scheduler.allowed-failures": 5}), workers(2) as client:
            client.wait_for_workers(2, timeout=120)
            client.run(sys.path.insert, 0, str(Path(__file__).parents[1]))
            pids = list(client.run(os.getpid).values())
            out, result = tmp_path / str(number), []

            def work(out: Path = out, result: list[Any] = result, client: Any = client) -> None:
                result.append(SLOW.write(out / "%04d.png", "1-32", dask=client))

            thread = threading.Thread(target=work)
            thread.start()
            time.sleep(random.uniform(0.05, 1.0))
            during += thread.is_alive()
            os.kill(pids[int(random.integers(len(pids)))], signal.SIGKILL)
            thread.join(120)
            assert result and sorted(result[0].written + result[0].kept) == list(range(1, 33))
            assert contents(out) == want and check(out)[1] == []
    assert during > 0

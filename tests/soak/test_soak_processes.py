"""Forks, memory, processes and workers that are killed, many times."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pytest
from length import times

import test_gate
from flurries.output.journal import check
from test_cluster import SLOW
from test_nothing_wrong import contents
from workers import group, workers


def test_hundred_forks():
    each = times(50)
    scene = "scene = fl.Scene(size=(200, 150), effects=[fl.effects.TentSnow(flakes=200)])"
    program = test_gate.FORKS.replace("range(10)", f"range({each})").format(scene=scene)
    assert test_gate.python(program) == ["{0}", "0", "True", "True"]


def test_memory_over_ten_thousand_frames():
    # A list of 10,000 empty byte strings is 80 KiB of it.
    last = 300 + times(10_000)
    program = test_gate.MEMORY.replace("LEAK", "0").replace(
        "range(300, 600)", f"range(300, {last})"
    )
    assert int(*test_gate.python(program, FLURRIES_NUM_THREADS="2")) <= 1024


PEAK = """
import resource, sys
import numpy as np
import flurries as fl
kind, size = sys.argv[1], int(sys.argv[2])
light = kind != "bytes in linear light"
plate = np.full((size, size, 3), 0.2 if light else 60, np.float16 if light else np.uint8)
snow = fl.effects.TentSnow(flakes=500) if kind == "light snow" else fl.effects.TentSnow("heavy")
effects = [snow, fl.effects.TentSnow("light", seed=2)] if kind == "two" else [snow]
scene = fl.Scene(plate, effects=effects, space="linear")
# The libraries that a small frame loads are no part of a large one.
small = fl.Scene(plate[:64, :64], effects=effects, space="linear")
small.write(sys.argv[3], "1")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
scene.write(sys.argv[3], "2", overwrite=True)
more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(more // 1024 - size * size * (12 if light else 3) // 2**20)
"""


@pytest.mark.parametrize("size", [4096, 8192])
@pytest.mark.parametrize("kind", ["light snow", "heavy snow", "two", "bytes in linear light"])
def test_peak_memory_of_a_large_frame(kind: str, size: int, tmp_path: Any):
    name = "a.png" if kind == "bytes in linear light" else "a.exr"
    done = subprocess.run(
        [sys.executable, "-c", PEAK, kind, str(size), str(tmp_path / name)],
        text=True, capture_output=True, timeout=600,
        # Each thread has tiles of its own, some 8 MiB at 8192 px.
        env={**os.environ, "FLURRIES_NUM_THREADS": "2"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    # A second texture's rows wait until a band asks for them, as high as a tile.
    most = 80 if kind == "two" else 64
    assert int(done.stdout) <= most


def test_dask_workers_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # Its effect takes a while, so that kills come in between.
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
            out = tmp_path / str(number)
            with ThreadPoolExecutor(1) as aside:
                writing = aside.submit(SLOW.write, out / "%04d.png", "1-32", dask=client)
                time.sleep(random.uniform(0.05, 1.0))
                during += writing.running()
                os.kill(pids[int(random.integers(len(pids)))], signal.SIGKILL)
                result = writing.result(120)
            assert sorted(result.written + result.kept) == list(range(1, 33))
            assert contents(out) == want and check(out)[1] == []
    assert during > 0

"""Forks, exits, memory and interruptions, many times."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest
from length import times

import test_gate


def test_hundred_forks():
    each = times(50)
    scene = "scene = fl.Scene((200, 150), effects=[fl.TentSnow(flakes=200)])"
    program = test_gate.FORKS.replace("range(10)", f"range({each})").format(scene=scene)
    assert test_gate.python(program) == ["{0}", "0", "True", "True"]


def test_hundred_exits_while_daemon_threads_render():
    count, ends = times(100), []
    code = """
import threading
import flurries as fl
scene = fl.Scene((300, 300), effects=[fl.TentSnow(flakes=200)])
started = threading.Event()
def work():
    while True:
        scene.render(1)
        started.set()
for _ in range(2):
    threading.Thread(target=work, daemon=True).start()
started.wait()
"""
    for _ in range(0, count, 4):
        running = [test_gate.launch(code, FLURRIES_NUM_THREADS="2") for _ in range(4)]
        ends += [(process.communicate(timeout=100), process.returncode) for process in running]
    bad = [end for end in ends if end != (("", ""), 0)]
    assert bad == []


def test_memory_over_ten_thousand_frames():
    frames = times(10_000)
    # A list of 10,000 empty byte strings is 80 KiB of it.
    growth = test_gate.grown(frames, 0)
    assert growth <= 1024


def test_a_leak_is_seen():
    frames = times(2000, 300)
    growth = test_gate.grown(frames, 8192)
    assert growth > 1024


LATENCY = """
import os, signal, threading, time
import numpy as np
import flurries as fl
sent = 0.0
out = np.full((16384, 16384), np.nan, np.float32)
def watch():
    global sent
    while np.isnan(out[::64, ::64]).all():
        time.sleep(0.001)
    time.sleep(0.2)
    sent = time.perf_counter()
    os.kill(os.getpid(), signal.SIGINT)
for _ in range(COUNT):
    out.fill(np.nan)
    threading.Thread(target=watch).start()
    try:
        fl.spectral.field(out.shape, drift=(1, 9), seed=1, overlap=48, out=out)
        print("finished")
    except KeyboardInterrupt:
        print(time.perf_counter() - sent, bool(np.isnan(out).any()))
"""


def test_ctrl_c_in_a_frame_of_16k():
    got = test_gate.python(LATENCY.replace("COUNT", str(times(5))), FLURRIES_NUM_THREADS="2")
    delays, given_up = [float(word) for word in got[::2]], got[1::2]
    assert set(given_up) == {"True"} and max(delays) <= 0.5


PEAK = """
import resource, sys
import numpy as np
import flurries as fl
from flurries.frame import bands
kind, size = sys.argv[1], int(sys.argv[2])
if "without bands" in sys.argv:
    bands.WHOLE = 1 << 40
light = kind != "bytes in linear light"
plate = np.full((size, size, 3), 0.2 if light else 60, np.float16 if light else np.uint8)
snow = fl.TentSnow(flakes=500) if kind == "light snow" else fl.TentSnow.preset("heavy")
effects = [snow, fl.TentSnow.preset("light", seed=2)] if kind == "two" else [snow]
scene = fl.Scene(None, plate, effects=effects, space="linear")
# The libraries that a small frame loads are no part of a large one.
small = fl.Scene(None, plate[:64, :64], effects=effects, space="linear")
small.write(sys.argv[3], "1")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
scene.write(sys.argv[3], "2", overwrite=True)
more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(more // 1024 - size * size * (12 if light else 3) // 2**20)
"""


def beyond_the_frame(kind: str, size: int, path: Any, *options: str) -> int:
    """Return the MiB that making and writing a frame takes beyond the frame itself."""
    done = subprocess.run(
        [sys.executable, "-c", PEAK, kind, str(size), str(path), *options],
        text=True, capture_output=True, timeout=600,
        # Each thread has tiles of its own, some 8 MiB at 8192 px.
        env={**os.environ, "FLURRIES_NUM_THREADS": "2"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


@pytest.mark.parametrize("size", [4096, 8192])
@pytest.mark.parametrize("kind", ["light snow", "heavy snow", "two", "bytes in linear light"])
def test_peak_memory_of_a_large_frame(kind: str, size: int, tmp_path: Any):
    name = "a.png" if kind == "bytes in linear light" else "a.exr"
    more = beyond_the_frame(kind, size, tmp_path / name)
    # A second texture's rows wait until a band asks for them, as high as a tile.
    most = 80 if kind == "two" else 64
    assert more <= most

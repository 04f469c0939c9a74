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


def test_memory_over_ten_thousand_frames():
    frames = times(10_000)
    # A list of 10,000 empty byte strings is 80 KiB of it.
    growth = test_gate.grown(frames, 0)
    assert growth <= 1024


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

"""The speeds in the README: ratios within one run, 1024 x 1024 unless a row says otherwise.

    python benches/speed.py [--runs N]

Variants take turns, so that a busy moment of the machine meets all of them. A row says the minimum
and the median in milliseconds, and the minimum against that of copying the alpha (4 MiB) in the
same run. Each instruction set of the machine runs in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl

sys.path.insert(0, str(Path(__file__).parent))
import flakes
import rivals

SIZE = 1024
SHAPE = (SIZE, SIZE)
COPY = "copy of the alpha"
COLD = "copy of an alpha that is in no cache"
Calls = dict[str, Callable[[], object]]


def texture(shape: tuple[int, int], dtype: Any = np.float32) -> Callable[[], object]:
    """Return a call that makes a texture's alpha, every tile with a drift of its own."""
    rows, cols = (len(fl.spectral.tile_starts(length)) for length in shape)
    # As before a camera that flies forward.
    drift = np.random.default_rng(3).normal(0.0, 5.0, (rows, cols, 2))
    out = np.empty(shape, dtype)
    return lambda: fl.spectral.alpha(shape, drift=drift, seed=1, dtype=dtype, out=out)


def scenes() -> Calls:
    """Return frames of whole scenes over a uint8 photograph."""
    picture = np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), np.uint8)
    sheet = fl.TentSnow.preset("heavy", flakes=0)
    forward = fl.CameraPath(fl.Camera(1.2 * SIZE), velocity=(0.0, 0.0, 3.0))
    plain = fl.TentSnow(flakes=0, alias="keep", shutter=0.0)
    found = {
        "scene: plain texture, uint8 RGB": fl.Scene(None, picture, effects=[plain]),
        "scene: heavy snow, texture alone": fl.Scene(None, picture, effects=[sheet]),
        "scene: heavy snow, texture, flying forward": fl.Scene(
            None, picture, camera=forward, effects=[sheet]
        ),
        "scene: heavy snow, 20,000 flakes and texture": fl.Scene(
            None, picture, effects=[fl.TentSnow.preset("heavy")]
        ),
        "scene: heavy snow, 64 x 64": fl.Scene((64, 64), picture[:64, :64], effects=[sheet]),
    }
    return {name: lambda scene=scene: scene.render(17) for name, scene in found.items()}


def hybrid() -> Callable[[], object]:
    """Return a call for 30,000 discs of 1-4 px and a texture over a uint8 picture, as arrays."""
    picture = np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), np.uint8)
    points, radius = flakes.cloud(30_000, SIZE, 1000.0)
    camera = fl.Camera(1000.0)
    discs, both, out = np.empty(SHAPE, np.float32), np.empty(SHAPE, np.float32), picture.copy()
    back = texture(SHAPE)

    def frame() -> object:
        sheet = back()
        fl.particles.splat(SHAPE, points, radius, camera, opacity=0.5, out=discs)
        fl.composite.join([sheet, discs], out=both)
        return fl.composite.snow(picture, both, out=out)

    return frame


def variants() -> Calls:
    """Return what is timed, by the name in the table."""
    source = np.random.default_rng(0).random(SHAPE, np.float32)
    target = np.empty_like(source)
    points, radius = flakes.cloud(150_000, SIZE, 1000.0)
    camera, discs = fl.Camera(1000.0), np.empty(SHAPE, np.float32)
    torus = np.empty((512, 512), np.float32)
    wheel = {"tile": 512, "overlap": 0, "drift": (3.0, 9.0), "seed": 1, "out": torus}
    return {
        COPY: lambda: np.copyto(target, source),
        COLD: cold_copy(),
        "texture": texture(SHAPE),
        "texture, float64": texture(SHAPE, np.float64),
        "texture, 1920 x 1080": texture((1080, 1920)),
        "texture, 3840 x 2160": texture((2160, 3840)),
        "texture, 512 x 512, one tile": lambda: fl.spectral.alpha((512, 512), **wheel),
        "150,000 discs of 1-4 px": lambda: fl.particles.splat(
            SHAPE, points, radius, camera, opacity=0.5, out=discs
        ),
        "30,000 discs, texture and uint8 composite": hybrid(),
        **scenes(),
    }


def rivals_of() -> Calls:
    """Return what others do, by the name of the row that it stands beside."""
    points, radius = flakes.cloud(150_000, SIZE, 1000.0)
    return {
        "texture, plain NumPy": rivals.straightforward,
        "texture, tuned SciPy, 2 workers": rivals.Tuned(),
        "texture, 512 x 512, one tile, NumPy": rivals.torus,
        "150,000 discs, np.bincount": lambda: flakes.bincount(points, radius, SIZE, 1000.0),
    }


def cold_copy() -> Callable[[], object]:
    """Return a call that copies an alpha that is in no cache to a place that is in none.

    A copy of the same two arrays again and again is no floor: they stay in the third-level cache,
    where a picture that a program goes on with is not. So copies go round through half a gigabyte.
    """
    planes = np.ones((128, *SHAPE), np.float32)
    turn = iter(range(0, 1 << 62, 2))

    def copy() -> None:
        place = next(turn) % len(planes)
        np.copyto(planes[place + 1], planes[place])

    return copy


def timed(calls: Calls, runs: int, *, warm: int = 2) -> dict[str, tuple[float, float]]:
    """Return the minimum and the median of each call, ms, the calls in turns."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(runs + warm):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            # The first turns warm caches and page in the outputs.
            if turn >= warm:
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: (min(values), statistics.median(values)) for name, values in times.items()}


def measured(level: str, threads: int, runs: int, tree: str = "") -> dict[str, tuple[float, float]]:
    """Return the times of one instruction set, from a process that has only that.

    Of another tree, by its own bench, if its root is given.
    """
    script = f"{tree}/benches/speed.py" if tree else __file__
    command = [sys.executable, script, "--one", str(threads), "--runs", str(runs)]
    environment = {**os.environ, "FLURRIES_SIMD": level, "OPENBLAS_NUM_THREADS": "1"}
    if tree:
        environment["PYTHONPATH"] = f"{tree}/python"
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    found: dict[str, tuple[float, float]] = json.loads(done.stdout)
    return found


def levels() -> list[str]:
    """Return the machine's instruction sets by the names that FLURRIES_SIMD knows, best first."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return ["avx512", "avx2"] if "avx512dq" in flags else ["avx2"]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        fl.set_threads(options.one)
        others = timed(rivals_of(), max(options.runs // 8, 2), warm=1) if options.one == 1 else {}
        print(json.dumps({**timed(variants(), options.runs), **others}))
        return
    for level in levels():
        for threads in (1, 2):
            times = measured(level, threads, options.runs)
            floor = times[COPY][0]
            print(f"{level}, {threads} thread{'s' if threads > 1 else ''}, {options.runs} runs")
            print(f"{'':<46}{'min ms':>9}{'median':>9}{'/ copy':>9}")
            for name, (least, middle) in times.items():
                print(f"{name:<46}{least:>9.2f}{middle:>9.2f}{least / floor:>9.1f}")
            print()


if __name__ == "__main__":
    main()

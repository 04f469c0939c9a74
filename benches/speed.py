"""The speeds in the README: ratios within one run, 1024 x 1024 unless a row says otherwise.

    python benches/speed.py [--runs N]

Variants take turns, so that a busy moment of the machine meets all of them. A row says the minimum
and the median in milliseconds, and the minimum against that of copying the alpha (4 MiB) in the
same run. Each instruction set of the machine runs in a process of its own.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rivals
from timing import Calls, Times, alone, timed

import flurries as fl

Call = Callable[[], object]
SIZE = 1024
SHAPE = (SIZE, SIZE)
COPY = "copy of the alpha"


def texture(shape: tuple[int, int], dtype: Any = np.float32) -> Call:
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


def hybrid() -> Call:
    """Return a call for 30,000 discs of 1-4 px and a texture over a uint8 picture, as arrays."""
    picture = np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), np.uint8)
    points, radius = rivals.cloud(30_000, SIZE, 1000.0)
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
    points, radius = rivals.cloud(150_000, SIZE, 1000.0)
    camera, discs = fl.Camera(1000.0), np.empty(SHAPE, np.float32)
    torus = np.empty((512, 512), np.float32)
    wheel = {"tile": 512, "overlap": 0, "drift": (3.0, 9.0), "seed": 1, "out": torus}
    return {
        COPY: lambda: np.copyto(target, source),
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
    points, radius = rivals.cloud(150_000, SIZE, 1000.0)
    return {
        "texture, plain NumPy": rivals.straightforward,
        "texture, tuned SciPy, 2 workers": rivals.Tuned(),
        "texture, 512 x 512, one tile, NumPy": rivals.torus,
        "150,000 discs, np.bincount": lambda: rivals.bincount(points, radius, SIZE, 1000.0),
    }


def measured(level: str, threads: int, runs: int) -> Times:
    """Return the times of one instruction set, from a process that has only that."""
    code = "import sys, speed; speed.one(*map(int, sys.argv[1:]))"
    found: Times = json.loads(alone(code, str(threads), str(runs), FLURRIES_SIMD=level))
    return found


def one(threads: int, runs: int) -> None:
    """Print the times of this process as JSON."""
    fl.set_threads(threads)
    others = timed(rivals_of(), max(runs // 8, 2), warm=1) if threads == 1 else {}
    print(json.dumps({**timed(variants(), runs), **others}))


def levels() -> list[str]:
    """Return the machine's instruction sets by the names that FLURRIES_SIMD knows, best first."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return ["avx512", "avx2"] if "avx512dq" in flags else ["avx2"]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    options = parser.parse_args()
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

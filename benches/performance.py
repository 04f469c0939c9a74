"""Writes docs/internals/performance.md: what a frame costs, by size and by what a machine can do.

    python benches/performance.py [--runs N] [--page PAGE]

Each instruction set runs in a process of its own; rows of one table come from one run.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import layers
import numpy as np
import rivals
import speed
from timing import Calls, Times, alone, timed

import flurries as fl


def rows(one: Times, two: Times) -> list[tuple[str, float]]:
    """Return the ratios of one instruction set, by name."""

    def ratio(name: str, other: str, times: Times = one) -> float:
        return times[name][0] / times[other][0]

    texture, discs = "texture", "150,000 discs of 1-4 px"
    per_pixel = {
        size: ratio(f"texture, {size}", texture) * speed.SIZE**2 / np.prod(shape)
        for size, shape in (("1920 x 1080", (1080, 1920)), ("3840 x 2160", (2160, 3840)))
    }
    one_tile = "texture, 512 x 512, one tile"
    hybrid = "30,000 discs, texture and uint8 composite"
    return [
        *((f"{name}, ms", one[name][0]) for name in (texture, discs, hybrid)),
        ("texture, two threads, ms", two[texture][0]),
        ("texture / copy of the alpha, warm", ratio(texture, speed.COPY)),
        ("plain NumPy / texture", ratio("texture, plain NumPy", texture)),
        ("tuned SciPy, 2 workers / texture", ratio("texture, tuned SciPy, 2 workers", texture)),
        ("NumPy / texture of one tile, 512 x 512", ratio(f"{one_tile}, NumPy", one_tile)),
        *((f"a pixel at {size} / 1024 x 1024", value) for size, value in per_pixel.items()),
        ("np.bincount / 150,000 discs", ratio("150,000 discs, np.bincount", discs)),
        ("frames a second, 30,000 discs, two threads", 1e3 / two[hybrid][0]),
        ("texture, one thread / two", one[texture][0] / two[texture][0]),
        ("150,000 discs, one thread / two", one[discs][0] / two[discs][0]),
        ("texture, float64 / float32", ratio("texture, float64", texture)),
    ]


def layer_cost() -> float:
    """Return what the scene adds to its kernels, microseconds: a small frame, less its texture."""
    picture = np.zeros((64, 64, 3), np.uint8)
    shown = fl.Scene(None, picture, effects=[fl.TentSnow(flakes=0, alias="keep", shutter=0.0)])
    bare = fl.Scene(None, picture)
    sheet = np.empty((64, 64), np.float32)
    times = timed(
        {
            "scene": lambda: shown.render(17),
            "empty": lambda: bare.render(17),
            "kernels": lambda: fl.composite.snow(
                picture, fl.spectral.alpha((64, 64), drift=(1.0, 9.0), seed=1, out=sheet)
            ),
        },
        400,
    )
    return 1e3 * (times["scene"][0] - times["kernels"][0])


def imports(runs: int = 12) -> float:
    """Return the least time of importing flurries over that of importing NumPy, in turns."""
    clock = "time.perf_counter()"
    times: dict[str, list[float]] = {"flurries": [], "numpy": []}
    for _ in range(runs):
        for name, values in times.items():
            values.append(
                float(alone(f"import time; t = {clock}; import {name}; print({clock} - t)"))
            )
    return min(times["flurries"]) / min(times["numpy"])


MEMORY = """
import sys, numpy as np, flurries as fl
def status(name):
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(name))
fl.set_threads(1)
picture = np.zeros((1024, 1024, 3), np.uint8)
scenes = {
    "texture": lambda: fl.spectral.alpha((1024, 1024), drift=(1.0, 9.0), seed=1),
    "scene": fl.Scene(None, picture, effects=[fl.TentSnow.preset("heavy")]).render,
}
make = scenes[sys.argv[1]]
frame = make() if sys.argv[1] == "texture" else make(1)
bytes_, frame = frame.nbytes, None
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
frame = make() if sys.argv[1] == "texture" else make(2)
print((status("VmHWM") - before) / 1024 - bytes_ / 2**20)
"""


def memory(name: str) -> float:
    """Return the peak of a second frame over the array that it returns, MiB."""
    return float(alone(MEMORY, name))


def sizes(runs: int) -> dict[str, Times]:
    """Return the times against pixels, discs and threads: ours, and the rivals'."""
    fl.set_threads(1)
    sides, counts = (256, 512, 1024, 2048), (100, 1000, 10_000, 100_000)
    camera, out = fl.Camera(1000.0), np.empty(speed.SHAPE, np.float32)
    clouds = {f"{n:,}": rivals.cloud(n, speed.SIZE, 1000.0) for n in counts}
    frame = speed.texture(speed.SHAPE)

    def discs(points: np.ndarray, radius: np.ndarray) -> object:
        return fl.particles.splat(speed.SHAPE, points, radius, camera, opacity=0.5, out=out)

    def threaded(count: int) -> None:
        fl.set_threads(count)
        frame()

    ours: dict[str, Calls] = {
        "pixels along a side, ours": {str(n): speed.texture((n, n)) for n in (128, *sides, 4096)},
        "discs of 1-4 px, ours": {n: lambda c=cloud: discs(*c) for n, cloud in clouds.items()},
        "threads, ours": {
            str(n): lambda n=n: threaded(n) for n in range(1, (os.cpu_count() or 1) + 1)
        },
    }
    others: dict[str, Calls] = {
        "pixels along a side, NumPy": {
            str(n): lambda n=n: rivals.straightforward(n) for n in sides[:3]
        },
        "pixels along a side, SciPy, tuned": {str(n): rivals.Tuned(n) for n in sides},
        "discs of 1-4 px, np.bincount": {
            n: lambda c=cloud: rivals.bincount(*c, speed.SIZE, 1000.0)
            for n, cloud in clouds.items()
        },
    }
    found = {name: timed(calls, runs) for name, calls in ours.items()}
    fl.set_threads(1)
    return found | {name: timed(calls, 2) for name, calls in others.items()}


def table(found: list[tuple[str, float]]) -> list[str]:
    """Return the lines of a table."""
    head = ["", "| what | measured |", "| --- | --- |"]
    return [*head, *(f"| {name} | {value:.2f} |" for name, value in found)]


PAGE = """# Speed

<!-- python benches/performance.py --page docs/internals/performance.md -->

Measured on a machine of {cores} cores, load {load:.1f} at the
start. Times are the least of {runs} runs in turns; ratios are within one run.
[benches/history.md](../../benches/history.md) says what was tried.

## Ratios
1024 x 1024 float32 on one thread unless a row says otherwise, tiles of 64 px that share
10, every tile with its own drift, outputs reused. A warm copy copies the same two arrays
again, out of the third-level cache.
{ratios}

### Around the kernels
{around}

## Whole frames
1024 x 768 over uint8, one thread, processor time: a frame in milliseconds, and over it
the same with layers, before a depth, and for both eyes (`python benches/layers.py`).

{frames}

## Against size

{sizes}
"""


def page(runs: int) -> str:
    """Return the page, measured now."""
    ratios = []
    for level in speed.levels():
        one, two = (speed.measured(level, threads, runs) for threads in (1, 2))
        ratios += ["", f"### {level}", *table(rows(one, two))]
    fl.set_threads(1)
    around = [
        ("what a scene adds to its kernels, microseconds", layer_cost()),
        ("`import flurries` / `import numpy`", imports()),
        ("peak memory of a texture over its array, MiB", memory("texture")),
        ("peak memory of heavy snow over its array, MiB", memory("scene")),
    ]
    against = []
    for name, times in sizes(max(runs // 3, 3)).items():
        pairs = (f"{x}: {least:.2f}" for x, (least, _) in times.items())
        against.append(f"- {name}, ms: {', '.join(pairs)}")
    return PAGE.format(
        cores=os.cpu_count(), load=os.getloadavg()[0], runs=runs, ratios="\n".join(ratios),
        around="\n".join(table(around)), frames="\n".join(layers.table(max(runs // 3, 3))),
        sizes="\n".join(against),
    )  # fmt: skip


def main() -> None:
    """Print the page, or write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    text = page(options.runs)
    if options.page:
        options.page.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()

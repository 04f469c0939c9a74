"""The speeds on their page, ratios in one run: ``python benches/speed.py [--page FILE]``."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import layers
import numpy as np
import rivals
from timing import Calls, alone, timed

import flurries as fl

SIZE, RUNS = 1024, 25
SHAPE = (SIZE, SIZE)
COPY, TEXTURE, DISCS = "copy of the alpha", "texture", "150,000 discs of 1-4 px"
ONE_TILE, AGAIN = "texture of one tile, 512 x 512", "texture, again and again"
NUMPY, SCIPY = "texture, plain NumPy", "texture, tuned SciPy, 2 workers"
BINCOUNT = "150,000 discs, NumPy's bincount"
ASKED = [
    (AGAIN, COPY, "at most 2.4; 1.6"),
    (NUMPY, AGAIN, "at least 60"),
    (SCIPY, AGAIN, "at least 12"),
    (BINCOUNT, DISCS, "at least 40"),
]
LARGER = {"1920 x 1080": (1080, 1920), "3840 x 2160": (2160, 3840)}


def texture(shape: tuple[int, int], dtype: Any = np.float32) -> Callable[[], object]:
    """Return a call that makes a texture's alpha, every tile with a drift of its own."""
    rows, cols = (len(fl.spectral.tile_starts(length)) for length in shape)
    drift = np.random.default_rng(3).normal(0.0, 5.0, (rows, cols, 2))
    out = np.empty(shape, dtype)
    return lambda: fl.spectral.alpha(shape, drift=drift, seed=1, dtype=dtype, out=out)


def scenes(shape: tuple[int, int] = SHAPE) -> Calls:
    """Return frames of whole scenes over a uint8 photograph, each at the next time."""
    picture = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    forward = fl.CameraPath(fl.Camera(1.2 * shape[1]), velocity=(0.0, 0.0, 1.0))
    effects = {
        "light snow": fl.Snow("light"),
        "heavy snow": fl.Snow("heavy"),
        "rain": fl.Rain(),
        "the paper's heavy snow": fl.effects.TentSnow("heavy"),
    }
    found: Calls = {}
    for name, effect in effects.items():
        for about, camera in (("still", None), ("flying", forward)):
            scene = fl.Scene(picture, camera=camera, effects=[effect])
            frame = iter(range(1_000_000))
            found[f"scene: {name}, {about}"] = lambda s=scene, f=frame: s.render(next(f))
    for side in (64, 224):
        tent = fl.Scene(picture[:side, :side], effects=[fl.effects.TentSnow()])
        frame = iter(range(1_000_000))
        found[f"scene: the paper's snow, {side} px"] = lambda s=tent, f=frame: s.render(next(f))
    return found


def variants() -> Calls:
    source = np.random.default_rng(0).random(SHAPE, np.float32)
    target = np.empty_like(source)
    points, radius = rivals.cloud(150_000, SIZE, 1000.0)
    camera, discs = fl.Camera(1000.0), np.empty(SHAPE, np.float32)
    wheel = {"drift": (3.0, 9.0), "seed": 1, "out": np.empty((512, 512), np.float32)}
    wheel["texture"] = fl.spectral.Texture(tile=512, overlap=0)
    return {
        COPY: lambda: np.copyto(target, source),
        TEXTURE: texture(SHAPE),
        "texture, float64": texture(SHAPE, np.float64),
        **{f"texture, {name}": texture(shape) for name, shape in LARGER.items()},
        ONE_TILE: lambda: fl.spectral.alpha((512, 512), **wheel),
        DISCS: lambda: fl.particles.splat(SHAPE, points, radius, camera, opacity=0.5, out=discs),
        **scenes(),
    }


def rivals_of() -> Calls:
    """Return what others do, by the name of the row that it stands beside."""
    return {
        NUMPY: rivals.straightforward,
        SCIPY: rivals.Tuned(),
        BINCOUNT: lambda: rivals.discs(*rivals.cloud(150_000, SIZE, 1000.0), SIZE, 1000.0),
    }


def one(threads: int, runs: int) -> None:
    fl.set_threads(threads)
    others = timed(rivals_of(), max(runs // 8, 2), warm=1) if threads == 1 else {}
    # Nothing else takes turns with it: tables and output stay in the caches.
    again = timed({AGAIN: texture(SHAPE)}, 8 * runs)
    print(json.dumps({**again, **timed(variants(), runs), **others}))


def levels() -> list[str]:
    """Return the machine's instruction sets by the names that FLURRIES_SIMD knows, best first."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return ["avx512", "avx2"] if "avx512dq" in flags else ["avx2"]


def table(level: str, runs: int) -> list[str]:
    """Return the lines of one instruction set: least and median ms, over a copy, and threads."""
    code = "import sys, speed; speed.one(*map(int, sys.argv[1:]))"
    single, double = (
        json.loads(alone(code, threads, str(runs), FLURRIES_SIMD=level)) for threads in "12"
    )
    lines = [
        f"### {level}\n",
        "| what | least, ms | median, ms | over a copy | one thread over two |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, (least, median) in single.items():
        gain = f"{least / double[name][0]:.2f}" if name in double else ""
        copies = least / single[COPY][0]
        lines.append(f"| {name} | {least:.2f} | {median:.2f} | {copies:.1f} | {gain} |")
    least = {name: pair[0] for name, pair in single.items()}
    two = {name: pair[0] for name, pair in double.items()}
    return [
        *lines,
        "\nWhat is asked, as the ratio of two rows of one run:\n",
        "| ratio | asked | one thread | two |",
        "| --- | --- | --- | --- |",
        *(
            f"| {above} / {below} | {asked} | {least[above] / least[below]:.2f} "
            f"| {two.get(above, least[above]) / two[below]:.2f} |"
            for above, below, asked in ASKED
        ),
    ]


def imports(runs: int = 12) -> float:
    """Return the least time of importing flurries over that of importing NumPy, in turns."""
    code = "import time; t = time.perf_counter(); import {0}; print(time.perf_counter() - t)"
    names = "flurries", "numpy"
    turns = [[float(alone(code.format(name))) for name in names] for _ in range(runs)]
    own, numpy = map(min, zip(*turns, strict=True))
    return own / numpy


MEMORY = """
import numpy as np, flurries as fl
def status(name):
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(name))
fl.set_threads(1)
picture = np.zeros((1024, 1024, 3), np.uint8)
scene = fl.Scene(picture, effects=[fl.Snow("heavy")])
scene.render(1)
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
frame = scene.render(2)
print((status("VmHWM") - before) / 1024 - frame.nbytes / 2**20)
"""

PAGE = """# Speed

Made by `python benches/speed.py --page docs/internals/performance.md` on a machine of {cores}
cores, load {load:.1f} at the start. Times are the least of {runs} runs in turns; read ratios.
`python benches/files.py` has files and a first picture;
[history.md](history.md) says what was tried.

## Ratios
1024 x 1024 float32 on one thread unless a row says otherwise, tiles of 64 px that share
10, every tile with its own drift, outputs reused. Rows take turns, so that each finds its
tables and its output outside the caches, the copy too; one row is made again and again. Scenes
are at the first frames of a film, which read their sheets for the first time: later ones take less.

{ratios}

`import flurries` takes {imports:.2f} of `import numpy`. A second frame of heavy snow takes
{memory:.1f} MiB over its array.

## Whole frames
1024 x 768 over uint8, one thread, processor time: a frame in milliseconds, and over it
the same with layers, before a depth, for both eyes, and with four lamps and a lens
(`python benches/layers.py`). Asked: at most 2.5, 1.3, 1.6 and 1.5.

{frames}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    load = os.getloadavg()[0]
    ratios = "\n\n".join("\n".join(table(level, RUNS)) for level in levels())
    if not options.page:
        print(ratios)
        return
    text = PAGE.format(
        cores=os.cpu_count(), load=load, runs=RUNS, ratios=ratios,
        imports=imports(), memory=float(alone(MEMORY)),
        frames="\n".join(layers.table(RUNS // 3)),
    )  # fmt: skip
    options.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

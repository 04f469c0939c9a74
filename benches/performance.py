"""Writes docs/internals/performance.md: what a frame costs, by size and by what a machine can do.

    python benches/performance.py [--runs N] [--against TREE] [--native] [--page PAGE]

Each instruction set runs in a process of its own; rows of one table come from one run. `--against`
measures another tree, by its own bench, and prints its figures in brackets.
`--native` also builds the kernels for this processor alone and compares: three minutes more.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import flurries as fl

sys.path.insert(0, str(Path(__file__).parent))
import flakes
import layers
import rivals
import speed

ROOT = Path(__file__).parents[1]
Times = dict[str, tuple[float, float]]


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
    plain = "scene: plain texture, uint8 RGB"
    return [
        *((f"{name}, ms", one[name][0]) for name in (texture, discs, hybrid)),
        ("texture, two threads, ms", two[texture][0]),
        ("texture / copy of the alpha, warm", ratio(texture, speed.COPY)),
        ("texture / copy of the alpha, warm, two threads", ratio(texture, speed.COPY, two)),
        ("texture / copy of the alpha, cold", ratio(texture, speed.COLD)),
        ("texture / copy of the alpha, cold, two threads", two[texture][0] / one[speed.COLD][0]),
        ("plain NumPy / texture", ratio("texture, plain NumPy", texture)),
        ("tuned SciPy, 2 workers / texture", ratio("texture, tuned SciPy, 2 workers", texture)),
        ("uint8 scene, plain texture / copy of the alpha, warm", ratio(plain, speed.COPY)),
        ("NumPy / texture of one tile, 512 x 512", ratio(f"{one_tile}, NumPy", one_tile)),
        ("a pixel at 1920 x 1080 / 1024 x 1024", per_pixel["1920 x 1080"]),
        ("a pixel at 3840 x 2160 / 1024 x 1024", per_pixel["3840 x 2160"]),
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
    times = speed.timed(
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
    times: dict[str, list[float]] = {"flurries": [], "numpy": []}
    for _ in range(runs):
        for name, values in times.items():
            clock = "time.perf_counter()"
            code = f"import time; t = {clock}; import {name}; print({clock} - t)"
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
            values.append(float(done.stdout))
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
    done = subprocess.run(
        [sys.executable, "-c", MEMORY, name], capture_output=True, text=True, check=True
    )
    return float(done.stdout)


Series = dict[str, list[float]]


def sweeps(runs: int) -> dict[str, dict[str, Series]]:
    """Return ms against pixels, tile size, discs, octaves and threads: ours, and the rivals'."""

    def series(calls: dict[str, Callable[[], object]], runs: int = runs) -> Series:
        times = speed.timed(calls, runs)
        return {"x": [float(x) for x in times], "ms": [least for least, _ in times.values()]}

    fl.set_threads(1)
    sizes = (256, 512, 1024, 2048)
    found = {
        "pixels along a side": {
            "ours": series({str(n): speed.texture((n, n)) for n in (128, *sizes, 4096)}),
            "NumPy": series({str(n): lambda n=n: rivals.straightforward(n) for n in sizes[:3]}, 2),
            "SciPy, tuned": series({str(n): rivals.Tuned(n) for n in sizes}, 2),
        }
    }

    def tiled(tile: int) -> Callable[[], object]:
        out = np.empty(speed.SHAPE, np.float32)
        waves = {"tile": tile, "overlap": tile // 6, "wavelengths": (tile / 16, tile / 2)}
        return lambda: fl.spectral.alpha(speed.SHAPE, drift=(2.0, 9.0), seed=1, out=out, **waves)

    tiles = {str(n): tiled(n) for n in (32, 64, 128, 256, 512)}
    found["pixels along a tile"] = {"ours": series(tiles)}

    def discs(count: int) -> Callable[[], object]:
        points, radius = flakes.cloud(count, speed.SIZE, 1000.0)
        out = np.empty(speed.SHAPE, np.float32)
        camera = fl.Camera(1000.0)
        return lambda: fl.particles.splat(speed.SHAPE, points, radius, camera, opacity=0.5, out=out)

    def scattered(count: int) -> Callable[[], object]:
        points, radius = flakes.cloud(count, speed.SIZE, 1000.0)
        return lambda: flakes.bincount(points, radius, speed.SIZE, 1000.0)

    counts = (100, 1000, 10_000, 100_000)
    found["discs of 1-4 px"] = {
        "ours": series({str(n): discs(n) for n in (*counts, 300_000)}),
        "np.bincount": series({str(n): scattered(n) for n in counts}, 2),
    }

    def octaves(count: int) -> Callable[[], object]:
        out = np.empty(speed.SHAPE, np.float32)
        waves = (32.0 / 2**count, 32.0)
        return lambda: fl.spectral.alpha(
            speed.SHAPE, drift=(2.0, 9.0), seed=1, wavelengths=waves, out=out
        )

    found["octaves of waves"] = {"ours": series({str(n): octaves(n) for n in (1, 2, 3, 4)})}
    calls: dict[str, Callable[[], object]] = {}
    frame = speed.texture(speed.SHAPE)
    for count in range(1, (os.cpu_count() or 1) + 1):
        calls[str(count)] = lambda count=count: (fl.set_threads(count), frame())
    found["threads"] = {"ours": series(calls)}
    fl.set_threads(1)
    return found


COLORS = ("#20639b", "#c8553d", "#d9a441")


def plotted(found: dict[str, dict[str, Series]], path: Path) -> None:
    """Draw the sweeps, ours and the rivals'."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, places = pyplot.subplots(2, 3, figsize=(11, 6.4))
    for axis in places.flat[len(found) :]:
        axis.axis("off")
    for axis, (name, lines) in zip(places.flat, found.items(), strict=False):
        for (who, values), color in zip(lines.items(), COLORS, strict=False):
            axis.loglog(values["x"], values["ms"], "o-", color=color, markersize=4, label=who)
        ours = lines["ours"]["x"]
        axis.set_xlabel(name, fontsize=10)
        axis.set_xticks(ours, [f"{x:,.0f}" for x in ours], rotation=30, fontsize=9)
        axis.set_xticks([], minor=True)
        low, high = axis.get_ylim()
        axis.set_ylim(min(low, high / 12.0), high)
        axis.yaxis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
        axis.yaxis.set_major_formatter(ticker.FuncFormatter(lambda y, _: f"{y:g}"))
        axis.yaxis.set_minor_locator(ticker.NullLocator())
        axis.tick_params(axis="y", labelsize=9)
        axis.grid(alpha=0.3)
        axis.set_ylabel("ms a frame", fontsize=10)
        if len(lines) > 1:
            axis.legend(fontsize=9)
    figure.tight_layout()
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


PEAK = """
import time, numpy as np
rng = np.random.default_rng(0)
def best(dtype):
    a, b = (rng.random((1024, 1024)).astype(dtype) for _ in range(2))
    out, least = np.empty_like(a), 1e9
    for _ in range(12):
        start = time.perf_counter(); np.matmul(a, b, out=out)
        least = min(least, time.perf_counter() - start)
    return 1024**3 / least / 1e9
print(best(np.float32), best(np.float64))
"""


def roofline(times: Times) -> list[tuple[str, float, float, float, float]]:
    """Return for each kernel: multiply-adds (1e6), megabytes, least ms by both, measured ms."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PEAK], env=environment, capture_output=True, text=True, check=True
    )
    single, double = (float(value) for value in done.stdout.split())
    copied = 2 * 4 * speed.SIZE**2 / (1e-3 * times[speed.COPY][0]) / 1e9
    tiles = len(fl.spectral.tile_starts(speed.SIZE)) ** 2
    # 16 columns, 16 rows of either sign, 16 sums for 64 pixels; cosines and sines, even and odd.
    transform = 2 * 2 * 16 * 16 * 16 + 2 * 16 * 64 * 16
    # A phase takes a hash, a reduction and two polynomials; a pixel a weight and the map.
    others = 512 * 30 + 64 * 64 * 2 + 54 * 54 * 4
    work = 1e-6 * tiles * (transform + others)
    alpha = 4e-6 * speed.SIZE**2
    points, radius = flakes.cloud(150_000, speed.SIZE, 1000.0)
    sigma = np.sqrt(np.maximum((1000.0 * radius / points[:, 2] / 3) ** 2 + 1 / 12, 0.38))
    # Rows of eights of pixels, and two profiles of 16 by polynomials.
    blends = float((8 * sigma * np.ceil(8 * sigma / 8) * 8 * 2 + 32 * 12).sum())
    found = []
    for name, operations, peak, megabytes in (
        ("texture", work, single, alpha),
        ("texture, float64", work, double, 2 * alpha),
        ("150,000 discs of 1-4 px", 1e-6 * blends, double, alpha + 150_000 * 200e-6),
    ):
        least = max(1e-3 * operations / peak * 1e3, megabytes / copied)
        found.append((name, operations, megabytes, least, times[name][0]))
    return [("the machine: 1e9 a second, GB/s", single, copied, 0.0, 0.0), *found]


def native(runs: int) -> float:
    """Return the texture's time of a build for this processor over the portable build's."""
    target = ROOT / "target" / "native"
    command = [
        "cargo",
        "build",
        "--release",
        "--quiet",
        "--features",
        "python",
        "--target-dir",
        str(target),
    ]
    flags = {**os.environ, "RUSTFLAGS": "-C target-cpu=native"}
    subprocess.run(command, cwd=ROOT, env=flags, check=True)
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "flurries"
        shutil.copytree(ROOT / "python" / "flurries", package)
        shutil.copy(target / "release" / "lib_core.so", package / "_core.abi3.so")
        code = (
            "import sys; sys.path.insert(0, sys.argv[1]); sys.path.insert(0, sys.argv[2])\n"
            "import speed, json, flurries as fl\nfl.set_threads(1)\n"
            "print(json.dumps(speed.timed({'texture': speed.texture(speed.SHAPE)}, 60)))"
        )
        best = {}
        for _ in range(3):
            for name, first in (("native", folder), ("portable", str(ROOT / "python"))):
                done = subprocess.run(
                    [sys.executable, "-c", code, first, str(ROOT / "benches")],
                    capture_output=True, text=True, check=True,
                )  # fmt: skip
                least = json.loads(done.stdout)["texture"][0]
                best[name] = min(best.get(name, least), least)
    return best["native"] / best["portable"]


def page(options: argparse.Namespace) -> str:
    """Return the page, measured now."""
    lines = [
        "# Speed",
        "",
        "<!-- python benches/performance.py --page docs/internals/performance.md -->",
        "",
        f"Measured on a machine of {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the",
        f"start. Times are the least of {options.runs} runs in turns; ratios are within one run.",
        "[benches/history.md](../../benches/history.md) says what was tried.",
        "",
        "## Ratios",
        "1024 x 1024 float32 on one thread unless a row says otherwise, tiles of 64 px that share",
        "10, every tile with its own drift, outputs reused. A warm copy copies the same two arrays",
        "again, out of the third-level cache; a cold one goes round through half a gigabyte: the",
        "floor of a picture that is in no cache.",
    ]
    if options.against:
        lines.append("In brackets: the release before.")
    measured: Times = {}
    for level in speed.levels():
        one, two = (speed.measured(level, threads, options.runs) for threads in (1, 2))
        measured = measured or one
        old = {}
        if options.against:
            given = options.runs, options.against
            before, both = (speed.measured(level, threads, *given) for threads in (1, 2))
            # One floor for both.
            old = dict(rows({**before, speed.COLD: one[speed.COLD]}, both))
        lines += [
            "",
            f"### {level}",
            "",
            "| what | measured |",
            "| --- | --- |",
            *(
                f"| {name} | {value:.2f}{f' ({old[name]:.2f})' if name in old else ''} |"
                for name, value in rows(one, two)
            ),
        ]
    lines += [
        "",
        "### Around the kernels",
        "",
        "| what | measured |",
        "| --- | --- |",
    ]
    fl.set_threads(1)
    around = [
        ("what a scene adds to its kernels, microseconds", layer_cost()),
        ("`import flurries` / `import numpy`", imports()),
        ("peak memory of a texture over its array, MiB", memory("texture")),
        ("peak memory of heavy snow over its array, MiB", memory("scene")),
    ]
    if options.native:
        name = "texture: build for this processor / portable build"
        around.append((name, native(options.runs)))
    lines += [f"| {name} | {value:.2f} |" for name, value in around]
    lines += [
        "",
        "## Whole frames",
        "1024 x 768 over uint8, one thread, processor time: a frame in milliseconds, and over it",
        "the same with layers, before a depth, and for both eyes (`python benches/layers.py`).",
        "",
        *layers.table(max(options.runs // 3, 3)),
    ]
    found = sweeps(max(options.runs // 3, 3))
    picture = ROOT / "docs" / "images" / "performance.png" if options.page else None
    if picture is not None:
        plotted(found, picture)
    lines += [
        "",
        "## Against size",
        "",
        "![Milliseconds against pixels, tiles, discs, octaves, threads](../images/performance.png)",
        "",
    ]
    for name, kinds in found.items():
        for who, values in kinds.items():
            pairs = ", ".join(
                f"{x:,.0f}: {ms:.2f}" for x, ms in zip(values["x"], values["ms"], strict=True)
            )
            lines.append(f"- {name}, {who}, ms: {pairs}")
    lines += [
        "",
        "## Against the machine",
        "What a kernel must compute and move at least, the time that the machine needs for the",
        "larger of the two, and where we stand. The machine's multiply-adds are those of NumPy's",
        "matrix product on one thread, its bytes those of the copy.",
        "",
        "| kernel | 1e6 multiply-adds | MB | least ms | measured ms | share |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, operations, megabytes, least, took in roofline(measured):
        if took:
            numbers = f"{operations:.1f} | {megabytes:.1f} | {least:.2f} | {took:.2f}"
            lines.append(f"| {name} | {numbers} | {100 * least / took:.0f} % |")
        else:
            lines.append(f"| {name} | {operations:.0f} | {megabytes:.0f} | | | |")
    lines += [
        "",
        "The count of the texture holds no loads and no stores: each product of the transform",
        "reads a factor, and blending is loads and stores alone: half of the time is phases,",
        "borders and the map. Passes with a quarter fewer products were slower",
        "(benches/history.md). Small discs are bound by what is done once for each of them,",
        "placing, sorting and the two profiles, not by their pixels.",
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Print the page, or write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--native", action="store_true")
    parser.add_argument("--against")
    parser.add_argument("--page")
    options = parser.parse_args()
    start = time.perf_counter()
    text = page(options)
    if options.page:
        Path(options.page).write_text(text)
        print(f"{options.page}: {time.perf_counter() - start:.0f} s")
    else:
        print(text)


if __name__ == "__main__":
    main()

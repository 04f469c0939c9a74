"""Time our weather for data sets against that of the usual libraries, all in one run.

    python benches/peers.py [--here] [--page docs/internals/peers.md]

Makes .venv-peers, installs everyone and us and measures there; `--here` in the environment that
runs it. How it measures says the page. Whoever cannot be installed or run is reported.
"""

from __future__ import annotations

import argparse
import os
import platform
import random
import statistics
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOME = ROOT / ".venv-peers"
# imagecorruptions asks setuptools for pkg_resources, which newer ones do not have.
PEERS = ["opencv-python-headless", "albumentationsx", "imgaug", "imagecorruptions", "kornia",
         "setuptools<81"]  # fmt: skip
# With the number of pictures that loaders take.
SIZES = {128: 200, 224: 150, 512: 60, 1024: 24}
ALONE, LOADER = "in single calls", "in a DataLoader of 2 workers"

# Calls of ours before the first that is timed.
WARM = 64

# It draws no flakes, so it does not count as snow.
WHITENS = "(no flakes: it whitens)"

Call = Callable[[], Any]
# What kind of weather, by what name, and the call.
Peers = Iterator[tuple[str, str, Call]]

# Milliseconds of every call, by kind, size and way of running.
Times = dict[tuple[str, int, str], dict[str, list[float]]]


def main() -> None:
    parser = argparse.ArgumentParser(description="Weather of the usual libraries, and ours.")
    parser.add_argument("--here", action="store_true", help="measure in this environment")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--page", type=Path, help="Markdown to write")
    options = parser.parse_args()
    if options.here:
        times, failures = measure(options.runs)
        lines = verdict(times)
        text = page(times, failures, lines, options.runs)
        print(text)
        if options.page:
            options.page.write_text(text, encoding="utf-8")
        return
    python = environment()
    threads = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "FLURRIES_NUM_THREADS"), "1"
    )
    command = [str(python), __file__, "--here", "--runs", str(options.runs)]
    if options.page:
        command += ["--page", str(options.page)]
    sys.exit(subprocess.run(command, env={**os.environ, **threads}, check=False).returncode)


def environment() -> Path:
    """Make the environment once, each peer by itself, and put this checkout into it."""
    python = HOME / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(HOME)], check=True)
        for name in PEERS:
            done = subprocess.run([*pip, name], check=False)
            if done.returncode:
                print(f"{name} cannot be installed here", flush=True)
    subprocess.run([*pip, "--upgrade", str(ROOT)], check=True)
    return python


def measure(runs: int) -> tuple[Times, list[str]]:
    warnings.simplefilter("ignore")
    one_thread()
    found: Times = {}
    failures: list[str] = []
    for size, count in SIZES.items():
        for kind, calls in classes(size, failures).items():
            times: dict[str, list[float]] = {name: [] for name in calls}
            # Ours as often as fills the sheets that it keeps: as a training's first batches do.
            for name, call in calls.items():
                for _ in range(WARM if name.startswith("flurries") else 0):
                    call()
            # Each once to warm up; then in turns, so that a slow moment is everybody's, and in
            # another order each time: after a peer of much memory the caches are empty.
            for turn in range(runs + 1):
                order = list(calls.items())
                random.Random(turn).shuffle(order)
                for name, call in order:
                    start = time.process_time()
                    call()
                    if turn:
                        times[name].append(1e3 * (time.process_time() - start))
            found[kind, size, ALONE] = times
            times = {
                name: [in_loader(lambda _, c=call: c(), count)[1] for _ in range(2)]  # type: ignore[misc]
                for name, call in calls.items()
            }
            found[kind, size, LOADER] = times
    return found, failures


class Pictures:
    """A data set whose every item is a call."""

    def __init__(self, call: Callable[[int], Any], count: int) -> None:
        self.call, self.count = call, count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> int:
        self.call(index)
        return index


def in_loader(call: Callable[[int], Any], count: int) -> tuple[float, float]:
    """Return the milliseconds a picture takes in a loader of two workers: by the clock, and of
    the workers' processors, which other work on the machine does not lengthen."""
    from torch.utils.data import DataLoader

    before, start = os.times(), time.perf_counter()
    loader = DataLoader(Pictures(call, count), batch_size=16, num_workers=2)  # type: ignore[arg-type]
    seen = sum(len(batch) for batch in loader)
    assert seen == count
    del loader
    clock, after = time.perf_counter() - start, os.times()
    busy = after.children_user + after.children_system
    busy -= before.children_user + before.children_system
    return 1e3 * clock / count, 1e3 * busy / count


def ranked(times: dict[str, list[float]]) -> list[tuple[str, list[float]]]:
    return sorted(times.items(), key=lambda item: min(item[1]))


def verdict(times: Times) -> list[str]:
    """Say of each kind and size how our slower setting does against the fastest of the others.

    Twice: by the fastest of all runs, which is that of the cheapest draw where a transform draws
    its own parameters, and by the median, which a busy machine moves.
    """
    lines = []
    for (kind, size, way), calls in times.items():
        others = [name for name in calls if not name.startswith("flurries") and WHITENS not in name]
        if not others:
            lines.append(f"{kind}, {size} x {size}, {way}: nobody else ran")
            continue
        ratios = []
        for law in (min, statistics.median):
            ours = max(law(v) for name, v in calls.items() if name.startswith("flurries"))
            ratios.append({name: law(calls[name]) / ours for name in others})
        words = [f"{min(r.values()):.2f} ({min(r, key=lambda n, r=r: r[n])})" for r in ratios]
        met = all(min(r.values()) > 1.0 for r in ratios)
        lines.append(
            f"{kind}, {size} x {size}, {way}: "
            f"{'faster than all' if met else 'NOT faster than all'}; the "
            f"fastest other takes this much of our time, by the fastest run {words[0]}, by the "
            f"median {words[1]}"
        )
    return lines


def page(times: Times, failures: list[str], lines: list[str], runs: int) -> str:
    """Return the page."""
    parts = [
        "# Weather for data sets, beside that of other libraries\n",
        "Made by `make peers` (`python benches/peers.py --page docs/internals/peers.md`), which"
        " installs all libraries into an environment of its own. uint8 RGB in and out, for kornia"
        f" the float tensor that it wants, made beforehand; one thread each; {runs} runs in turns,"
        " the fastest and the median in milliseconds of processor time; in loaders the workers'"
        " processor time over the number of pictures, of two runs, with what a worker costs to"
        " start. Read them as ratios: they are of one run on one machine.\n",
        "Ours at two severities; the verdict takes the slower one. A transform that only brightens"
        " the picture draws no snow and is listed, but does not count.\n",
        "Every peer that draws anything counts: rain of albumentations is a few hundred straight"
        " lines of one grey and slant over a blurred picture. Ours is called 64 times before it is"
        " timed: it keeps sheets of far flakes, and pictures whose sheet is not there yet take"
        " longer. In a loop by itself a call of rain at 128 px takes half of its time here: in"
        " turns with other libraries, which empty the caches, its many small steps in Python are"
        " cold.\n",
        "## Verdict\n",
        *(f"- {line}" for line in lines),
    ]
    parts += [f"\n{installed()}; {platform.machine()}, {os.cpu_count()} cores, "
              f"load {os.getloadavg()[0]:.1f}."]  # fmt: skip
    parts += ["\n## What did not run\n", *(f"- {f}" for f in failures or ["Everything ran."])]
    for (kind, size, way), calls in times.items():
        ours = min(next(iter(calls.values())))
        parts += [
            f"\n## {kind.capitalize()}, {size} x {size}, {way}\n",
            "| transform | fastest, ms | median, ms | / ours |",
            "| --- | --- | --- | --- |",
        ]
        parts += [
            f"| {name} | {min(v):.2f} | {statistics.median(v):.2f} | {min(v) / ours:.2f} |"
            for name, v in ranked(calls)
        ]  # fmt: skip
    return "\n".join(parts) + "\n"


def installed() -> str:
    found = []
    for name in ("albumentationsx", "imgaug", "imagecorruptions", "kornia", "torch", "numpy"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} not here")
    return ", ".join(found)


def one_thread() -> None:
    import flurries as fl

    fl.set_threads(1)
    for module, name in (("cv2", "setNumThreads"), ("torch", "set_num_threads")):
        try:
            getattr(__import__(module), name)(1)
        except ImportError:
            print(f"no {module} here")


def classes(size: int, failures: list[str]) -> dict[str, dict[str, Call]]:
    """Return the calls to be timed, ours first."""
    from skimage import data

    import flurries as fl
    from flurries.io import fit

    picture = fit(data.coffee(), (size, size))
    found: dict[str, dict[str, Call]] = {}
    for kind, ours in (("snow", "Snowfall"), ("rain", "Rainfall"), ("fog", "Fog")):
        found[kind] = {}
        for severity in (3, 5):
            transform = getattr(fl.augment, ours)(severity=severity)
            found[kind][f"flurries {ours}(severity={severity})"] = lambda t=transform: t(picture)
    for peer in (albumentations, imgaug, imagecorruptions, kornia):
        try:
            for kind, name, call in peer(picture):
                try:
                    call()
                except Exception as error:
                    failed(failures, size, f"{name}: {type(error).__name__}: {error}")
                    continue
                found[kind][name] = call
        except Exception as error:
            line = traceback.extract_tb(error.__traceback__)[-1]
            words = f"{peer.__name__}: {type(error).__name__}: {error} ({line.name})"
            failed(failures, size, words)
    return found


def failed(failures: list[str], size: int, words: str) -> None:
    if size == min(SIZES):
        line = " ".join(words.split())[:160]
        print(f"fails: {line}", flush=True)
        failures.append(line)


def named(name: str, options: dict[str, str]) -> str:
    return name + "(" + ", ".join(f'{key}="{value}"' for key, value in options.items()) + ")"


def albumentations(picture: Any) -> Peers:
    import albumentations as A

    kinds = ("drizzle", "heavy", "torrential")
    for kind, name, options in (
        ("snow", "RandomSnow", {"method": "texture"}), ("snow", "RandomSnow", {}),
        ("rain", "RandomRain", {}), *(("rain", "RandomRain", {"rain_type": k}) for k in kinds),
        ("fog", "RandomFog", {}), ("fog", "AtmosphericFog", {}),
    ):  # fmt: skip
        made = getattr(A, name)(**options, p=1.0)
        whitens = f" {WHITENS}" if kind == "snow" and not options else ""
        shown = f"albumentationsX {named(name, options)}{whitens}"
        yield kind, shown, lambda t=made: t(image=picture)


def imgaug(picture: Any) -> Peers:
    import numpy as np

    if "sctypes" not in vars(np):
        # NumPy 2 took away what it is imported with; put back so that it can be timed at all.
        vars(np)["sctypes"] = {
            "float": [np.float16, np.float32, np.float64],
            "int": [np.int8, np.int16, np.int32, np.int64],
            "uint": [np.uint8, np.uint16, np.uint32, np.uint64],
        }
        print("imgaug: runs with np.sctypes put back, which NumPy 2 does not have")
    import imgaug.augmenters as iaa

    for kind, name in (("snow", "Snowflakes"), ("rain", "Rain"), ("fog", "Fog")):
        made = getattr(iaa, name)()
        yield kind, f"imgaug {name}()", lambda t=made: t(image=picture)


def imagecorruptions(picture: Any) -> Peers:
    from imagecorruptions import corrupt

    for kind in ("snow", "fog"):
        call = partial(corrupt, picture, corruption_name=kind, severity=3)
        yield kind, f"imagecorruptions {kind}, severity 3", call


def kornia(picture: Any) -> Peers:
    import kornia.augmentation as K
    import torch

    batch = torch.from_numpy(picture).permute(2, 0, 1)[None].float() / 255.0
    yield "snow", f"kornia RandomSnow() {WHITENS}", partial(K.RandomSnow(p=1.0), batch)
    yield "rain", "kornia RandomRain()", partial(K.RandomRain(p=1.0), batch)


if __name__ == "__main__":
    main()

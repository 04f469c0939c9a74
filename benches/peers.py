"""Time our weather for data sets against that of the usual libraries, all in one run.

    python benches/peers.py [--here | --labels] [--page docs/internals/peers.md]

Makes .venv-peers, installs everyone and us and measures there; `--here` in this environment, and
`--labels` ours with boxes and depths alone.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import random
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOME = ROOT / ".venv-peers"
PEERS = ["opencv-python-headless", "albumentationsx", "imgaug", "kornia"]
# Shapes of the pictures, and the number that loaders take.
MIXED = ((128, 128), (480, 640), (224, 224), (427, 640), (1024, 768), (333, 500), (512, 512))
SIZES = {
    "128 px": (((128, 128),), 200), "224 px": (((224, 224),), 150), "512 px": (((512, 512),), 60),
    "1024 px": (((1024, 1024),), 24), "mixed sizes": (MIXED, 60),
}  # fmt: skip
ALONE, COLD = "warm, in single calls", "the first 20 pictures of a process"
LOADER, LABELS = "in a DataLoader of 2 workers", "with labels"
FIRST, RUNS = 20, 15
OURS, PROFILES = {"snow": "Snowfall", "rain": "Rainfall", "fog": "Fog"}, ("natural", "hard")
# Rounds of ours before the first that is timed.
WARM = 300
# It draws no flakes, so it does not count as snow.
WHITENS = "(no flakes: it whitens)"

Call = Callable[[], Any]
# Kind, name, and a call for each picture.
Peers = Iterator[tuple[str, str, list[Call]]]
# Milliseconds of a picture in every round, by kind, size and way of running.
Times = dict[tuple[str, str, str], dict[str, list[float]]]


def main() -> None:
    parser = argparse.ArgumentParser(description="Weather of the usual libraries, and ours.")
    parser.add_argument("--here", action="store_true", help="measure in this environment")
    parser.add_argument("--labels", action="store_true", help="ours with labels, nobody else")
    parser.add_argument("--page", type=Path, help="Markdown to write")
    options = parser.parse_args()
    if options.labels:
        for size in SIZES:
            for kind in OURS:
                print(*tables(labels(kind, size)), sep="\n", flush=True)
        return
    if options.here:
        text = page(*measure())
        print(text)
        if options.page:
            options.page.write_text(text, encoding="utf-8")
        return
    threads = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "FLURRIES_NUM_THREADS"), "1"
    )
    command = [str(environment()), __file__, "--here"]
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
            if subprocess.run([*pip, name], check=False).returncode:
                print(f"{name} cannot be installed here", flush=True)
    subprocess.run([*pip, "--upgrade", str(ROOT)], check=True)
    return python


def measure() -> tuple[Times, list[str]]:
    warnings.simplefilter("ignore")
    import cv2
    import torch

    import flurries as fl

    fl.set_threads(1)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    found: Times = {}
    failures: list[str] = []
    for size, (shapes, count) in SIZES.items():
        for kind, calls in classes(shapes, failures).items():
            found[kind, size, COLD] = {
                name: [in_child(call) for _ in range(2)] for name, call in calls.items()
            }
            # Ours as often as fills the sheets that it keeps: as a training's first batches do.
            for name, call in calls.items():
                for number in range(WARM if name.startswith("flurries") else 0):
                    call[number % len(call)]()
            found[kind, size, ALONE] = in_turns(calls, RUNS)
            found[kind, size, LOADER] = {
                name: [in_loader(call, count) for _ in range(2)] for name, call in calls.items()
            }
            found |= labels(kind, size)
    return found, failures


def in_turns(calls: dict[str, list[Call]], runs: int) -> dict[str, list[float]]:
    """Return the milliseconds of a picture, where a slow moment is everybody's."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    # Each once to warm up; then in another order each time: after a peer of much memory the caches
    # are empty.
    for turn in range(runs + 1):
        order = list(calls.items())
        random.Random(turn).shuffle(order)
        for name, call in order:
            start = time.process_time()
            for one in call:
                one()
            if turn:
                times[name].append(1e3 * (time.process_time() - start) / len(call))
    return times


def in_child(calls: list[Call]) -> float:
    """Return the milliseconds of a picture among the first ones of a process that is forked."""
    from flurries._kept import ALL

    context = multiprocessing.get_context("fork")
    ours, other = context.Pipe()

    def first() -> None:
        # What this process has kept since.
        ALL["flurries.augment.sheets"].clear()
        start = time.process_time()
        for number in range(FIRST):
            calls[number % len(calls)]()
        other.send(1e3 * (time.process_time() - start) / FIRST)

    child = context.Process(target=first)
    child.start()
    spent: float = ours.recv()
    child.join()
    return spent


def labels(kind: str, size: str) -> Times:
    """Return what boxes and depths cost of ours, which no peer has, in turns with the picture."""
    import numpy as np
    from skimage import data

    import flurries as fl
    from flurries.io import fit

    fl.set_threads(1)
    shape = SIZES[size][0][-1]
    picture = fit(data.coffee(), shape)
    # As files hold them; float64 takes a copy more.
    depth = np.ones(shape, np.float32) * np.geomspace(2.0, 90.0, shape[0], dtype="f4")[:, None]
    rows = np.arange(20.0)[:, None]
    boxes = np.hstack([rows, rows, rows + 40.0, rows + 60.0]) * (shape[0] / 128)
    found: Times = {}
    for profile in PROFILES:
        made = getattr(fl.augment, OURS[kind])(severity=3, profile=profile)
        labelled = partial(made.apply, picture, boxes=boxes, index=1)
        calls: dict[str, list[Call]] = {
            "picture": [partial(made, picture, index=1)],
            "depth": [partial(made, picture, depth=depth, index=1)],
            "20 boxes": [labelled], "20 boxes and depth": [partial(labelled, depth=depth)],
        }  # fmt: skip
        found[kind, size, f"{LABELS}, {profile}"] = in_turns(calls, 40)
    return found


def in_loader(calls: list[Call], count: int) -> float:
    """Return the milliseconds of the workers' processors for a picture in a loader of two."""
    from torch.utils.data import DataLoader

    def made(batch: list[int]) -> int:
        for number in batch:
            calls[number % len(calls)]()
        return len(batch)

    before = sum(os.times()[2:4])
    loader = DataLoader(range(count), batch_size=16, num_workers=2, collate_fn=made)  # type: ignore[arg-type]
    assert sum(loader) == count
    del loader
    return 1e3 * (sum(os.times()[2:4]) - before) / count


def verdict(times: Times) -> list[str]:
    """Say of each kind and size how our slower setting does against the fastest of the others.

    Twice: by the fastest of all runs, which is that of the cheapest draw where a transform draws
    its own parameters, and by the median, which a busy machine moves.
    """
    lines = []
    for (kind, size, way), calls in times.items():
        if way.startswith(LABELS):
            continue
        own = [name for name in calls if name.startswith("flurries")]
        others = [name for name in calls if name not in own and WHITENS not in name]
        said, least = [], []
        for law in (min, statistics.median):
            first = min(others, key=lambda name, law=law: law(calls[name]))
            least.append(law(calls[first]) / max(law(calls[name]) for name in own))
            said.append(f"{least[-1]:.2f} ({first})")
        lines.append(
            f"{kind}, {size}, {way}: {'' if min(least) > 1.0 else 'NOT '}faster than all;"
            f" the fastest other takes this much of our time, by the fastest run {said[0]}, by the"
            f" median {said[1]}"
        )
    return lines


def page(times: Times, failures: list[str]) -> str:
    parts = [
        "# Weather for data sets, beside that of other libraries\n",
        "Made by `make peers` (`python benches/peers.py --page docs/internals/peers.md`), which"
        " installs all libraries into an environment of its own. uint8 RGB in and out, for kornia"
        f" the float tensor that it wants, made beforehand; one thread each; {RUNS} rounds in"
        " turns, the fastest and the median in milliseconds of processor time for a picture; in"
        " loaders the workers' processor time over the number of pictures, of two runs, with what"
        " a worker costs to start. Read them as ratios: they are of one run on one machine.\n",
        "Ours draws severity, wind, fall and exposure anew for each picture, natural and hard; the"
        " verdict takes the slower one. A transform that only brightens the picture draws no snow"
        " and is listed, but does not count. Mixed sizes are seven of 128 to 1024 px, in turn.\n",
        f"Ours keeps sheets of far flakes: warm is after {WARM} pictures, which fill them, and"
        f" cold are the first {FIRST} pictures of a process that is forked, two such. A DataLoader"
        " here has between both: its workers begin with what this process keeps. Pictures of all"
        " sizes and severities share sheets by what their flakes look like in pixels.\n",
        "## Verdict\n",
        *(f"- {line}" for line in verdict(times)),
    ]
    known = {str(d.metadata["Name"]).lower(): d.version for d in distributions()}
    names = ("albumentationsx", "imgaug", "kornia", "torch", "numpy")
    installed = ", ".join(f"{name} {known.get(name, 'not here')}" for name in names)
    parts += [f"\n{installed}; {platform.machine()}, {os.cpu_count()} cores, "
              f"load {os.getloadavg()[0]:.1f}."]  # fmt: skip
    parts += ["\n## What did not run\n", *(f"- {f}" for f in failures or ["Everything ran."])]
    return "\n".join([*parts, *tables(times)]) + "\n"


def tables(times: Times) -> list[str]:
    parts = []
    for (kind, size, way), calls in times.items():
        ours = min(next(iter(calls.values())))
        parts += [
            f"\n## {kind.capitalize()}, {size}, {way}\n",
            "| transform | fastest, ms | median, ms | / ours |",
            "| --- | --- | --- | --- |",
        ]
        parts += [
            f"| {name} | {min(v):.2f} | {statistics.median(v):.2f} | {min(v) / ours:.2f} |"
            for name, v in sorted(calls.items(), key=lambda item: min(item[1]))
        ]  # fmt: skip
    return parts


def classes(shapes: Any, failures: list[str]) -> dict[str, dict[str, list[Call]]]:
    from skimage import data

    import flurries as fl
    from flurries.io import fit

    pictures = [fit(data.coffee(), shape) for shape in shapes]
    found: dict[str, dict[str, list[Call]]] = {kind: {} for kind in OURS}
    for kind, ours in OURS.items():
        for profile in PROFILES:
            made = getattr(fl.augment, ours)(severity=(1, 5), profile=profile)
            name = f'flurries {ours}(severity=(1, 5), profile="{profile}")'
            found[kind][name] = [partial(made, picture) for picture in pictures]
    for peer in (albumentations, imgaug, kornia):
        try:
            for kind, name, calls in peer(pictures):
                calls[0]()
                found[kind][name] = calls
        except Exception as error:
            words = " ".join(f"{peer.__name__}: {type(error).__name__}: {error}".split())[:160]
            if words not in failures:
                print(f"fails: {words}", flush=True)
                failures.append(words)
    return found


def albumentations(pictures: list[Any]) -> Peers:
    import albumentations as A

    kinds = ("drizzle", "heavy", "torrential")
    for kind, name, options in (
        ("snow", "RandomSnow", {"method": "texture"}), ("snow", "RandomSnow", {}),
        ("rain", "RandomRain", {}), *(("rain", "RandomRain", {"rain_type": k}) for k in kinds),
        ("fog", "RandomFog", {}), ("fog", "AtmosphericFog", {}),
    ):  # fmt: skip
        made = getattr(A, name)(**options, p=1.0)
        whitens = f" {WHITENS}" if kind == "snow" and not options else ""
        words = ", ".join(f'{key}="{value}"' for key, value in options.items())
        calls = [partial(made, image=picture) for picture in pictures]
        yield kind, f"albumentationsX {name}({words}){whitens}", calls


def imgaug(pictures: list[Any]) -> Peers:
    import numpy as np

    if "sctypes" not in vars(np):
        # NumPy 2 took away what it is imported with; put back so that it can be timed at all.
        vars(np)["sctypes"] = {
            "float": [np.float16, np.float32, np.float64],
            "int": [np.int8, np.int16, np.int32, np.int64],
            "uint": [np.uint8, np.uint16, np.uint32, np.uint64],
        }
    import imgaug.augmenters as iaa

    # Its fog wants an older NumPy still.
    for kind, name in (("snow", "Snowflakes"), ("rain", "Rain")):
        made = getattr(iaa, name)()
        yield kind, f"imgaug {name}()", [partial(made, image=picture) for picture in pictures]


def kornia(pictures: list[Any]) -> Peers:
    import kornia.augmentation as K
    import torch

    batches = [torch.from_numpy(p).permute(2, 0, 1)[None].float() / 255.0 for p in pictures]
    for kind, made, words in (("snow", K.RandomSnow(p=1.0), f" {WHITENS}"),
                              ("rain", K.RandomRain(p=1.0), "")):  # fmt: skip
        yield kind, f"kornia Random{kind.title()}(){words}", [partial(made, b) for b in batches]


if __name__ == "__main__":
    main()

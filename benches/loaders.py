"""Time our weather for data sets in DataLoaders of two workers.

    python benches/loaders.py           # in an environment that has torch
    python benches/loaders.py --page docs/internals/peers.md   # replaces the section on this

Each weather at its default settings over 2,000 pictures of 224 px, in a process of its own whose
BLAS has all the threads that it takes by default, and in one whose BLAS has a single thread; in
turns, the best of three. What called BLAS would be slower with many threads, since each worker
starts as many. :func:`in_loader` is what `peers.py` times everybody with.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

KINDS = ("Snowfall", "Rainfall", "Fog")
PICTURES, SIZE, RUNS, WORKERS = 2000, 224, 3, 2
BLAS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
TITLE = "## Threads of BLAS in a DataLoader"


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
    loader = DataLoader(Pictures(call, count), batch_size=16, num_workers=WORKERS)  # type: ignore[arg-type]
    seen = sum(len(batch) for batch in loader)
    assert seen == count
    del loader
    clock, after = time.perf_counter() - start, os.times()
    busy = after.children_user + after.children_system
    busy -= before.children_user + before.children_system
    return 1e3 * clock / count, 1e3 * busy / count


def one(kind: str) -> None:
    """Print the milliseconds a picture takes by the clock, in the settings of this process."""
    import flurries as fl

    picture = fl.io.fit(fl.io.photograph("coffee"), (SIZE, SIZE))
    weather = getattr(fl.augment, kind)(seed=1)
    print(in_loader(lambda index: weather(picture, index=index), PICTURES)[0])


def ratios() -> dict[str, tuple[float, float]]:
    """Return of each weather the milliseconds with default settings and with one BLAS thread."""
    single = {**os.environ, **dict.fromkeys(BLAS, "1")}
    default = {key: value for key, value in os.environ.items() if key not in BLAS}
    found: dict[str, list[list[float]]] = {kind: [[], []] for kind in KINDS}
    for _ in range(RUNS):
        for kind in KINDS:
            for times, settings in zip(found[kind], (default, single), strict=True):
                command = [sys.executable, __file__, "--one", kind]
                done = subprocess.run(
                    command, env=settings, check=True, capture_output=True, text=True
                )
                times.append(float(done.stdout))
    return {kind: (min(several[0]), min(several[1])) for kind, several in found.items()}


def section(found: dict[str, tuple[float, float]]) -> str:
    """Return the page's section."""
    lines = [
        TITLE + "\n",
        f"{PICTURES} pictures of {SIZE} px, {WORKERS} workers, milliseconds a picture by the clock,"
        f" best of {RUNS} in turns (`python benches/loaders.py`).\n",
        "| weather | default settings | one BLAS thread | ratio |",
        "| --- | --- | --- | --- |",
    ]
    lines += [f"| {kind} | {a:.2f} | {b:.2f} | {a / b:.2f} |" for kind, (a, b) in found.items()]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="Our weather in DataLoaders of two workers.")
    parser.add_argument("--one", choices=KINDS, help=argparse.SUPPRESS)
    parser.add_argument("--page", type=Path, help="Markdown whose section is replaced")
    options = parser.parse_args()
    if options.one:
        one(options.one)
        return
    text = section(ratios())
    print(text)
    if options.page:
        page = options.page.read_text(encoding="utf-8")
        page = re.sub(rf"\n{TITLE}\n.*?(?=\n## |\Z)", "", page, flags=re.DOTALL)
        options.page.write_text(page.rstrip() + "\n\n" + text, encoding="utf-8")


if __name__ == "__main__":
    main()

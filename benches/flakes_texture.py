"""The texture of flakes against the paper's: ratios within one run, 1024 x 1024.

    python benches/flakes_texture.py [--runs N]

Variants take turns, so that a busy moment of the machine meets all of them. A row says the
minimum and the median in milliseconds of the thread's own time, and the minimum against that of
`spectral.alpha` at the same tiles. Every tile has a drift of its own. "prepared" is what a film
pays for a frame; the others prepare the patterns in every call.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import flurries as fl
from flurries.spectral import flake_frames

SHAPE = (1024, 1024)
SHEAR = 0.382
TILES = (19, 19)
PAPER = "spectral.alpha"


def population(layers: int, flakes_per_tile: float = 3300.0) -> dict[str, Any]:
    """Return the layers of snow between 8 and 60 m, far ones with most and smallest flakes."""
    edges = 8.0 * (60.0 / 8.0) ** (np.arange(layers + 1) / layers)
    volume = edges[1:] ** 3 - edges[:-1] ** 3
    diameters = 1200.0 * 0.01 / np.stack([edges[1:], edges[:-1]], 1)
    return {
        "counts": flakes_per_tile * volume / volume.sum(),
        "diameters": diameters,
        "shear": SHEAR,
    }


def frame(layers: int, *, blurred: bool = False, flakes_per_tile: float = 3300.0):
    """Return calls of the public function and of a prepared frame's opacity."""
    law = population(layers, flakes_per_tile)
    found = fl.spectral.flake_patterns(64, **law, seed=1)
    rng = np.random.default_rng(3)
    drift = rng.normal(0.0, 50.0, (*TILES, layers, 2))
    streak = rng.normal(0.0, 1.5, drift.shape) if blurred else None
    out = np.empty(SHAPE, np.float32)
    ready = flake_frames.prepare(found, shear=SHEAR, dtype=np.float32)
    chosen = flake_frames.choices(1, TILES, layers=layers, patterns=8, tile=64)
    request = flake_frames.Request(
        shape=SHAPE, overlap=10, pattern=chosen.pattern, gain=np.ones((1, 1, layers)),
        shift=chosen.shift + drift, streak=streak,
        mean=np.array([[float(found[:, 0, 0, 0].real.sum()) / 64**2]]),
        window=(0, SHAPE[0], 0, SHAPE[1]),
    )  # fmt: skip
    shutter = {} if streak is None else {"velocity": 2.0 * streak, "shutter": 0.5}

    def public() -> object:
        return fl.spectral.optical_depth(
            SHAPE, found, drift=drift, **shutter, shear=SHEAR, seed=1, out=out
        )

    return public, lambda: flake_frames.frame_of(ready, request, opacity=True, out=out)


def paper() -> Callable[[], object]:
    drift = np.random.default_rng(3).normal(0.0, 5.0, (*TILES, 2))
    out = np.empty(SHAPE, np.float32)
    return lambda: fl.spectral.alpha(SHAPE, drift=drift, seed=1, out=out)


def calls() -> dict[str, Callable[[], object]]:
    """Return what is measured."""
    found = {PAPER: paper()}
    for layers in (4, 6, 8, 12, 18):
        public, ready = frame(layers)
        found[f"{layers} layers, to opacity, prepared"] = ready
        if layers == 6:
            found["6 layers, optical_depth"] = public
    found["6 layers, streaks, to opacity, prepared"] = frame(6, blurred=True)[1]
    for count in (10_000, 10_000_000):
        found[f"6 layers, {count:,} flakes"] = frame(6, flakes_per_tile=count / 361.0)[1]
    return found


def measured(
    found: dict[str, Callable[[], object]],
    runs: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, list[float]]:
    """Return milliseconds by a clock; that of the thread does not mind who else is at work."""
    times: dict[str, list[float]] = {name: [] for name in found}
    for turn in range(runs + 2):
        for name, call in found.items():
            start = clock()
            call()
            if turn > 1:
                times[name].append(1e3 * (clock() - start))
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=60)
    runs = parser.parse_args().runs
    fl.set_threads(1)
    found = calls()
    one = measured(found, runs, time.thread_time)
    base = min(one[PAPER])
    print(f"{'one thread':45} {'min ms':>8} {'median':>8} {'ratio':>7}")
    for name, times in one.items():
        print(
            f"{name:45} {min(times):8.3f} {statistics.median(times):8.3f} {min(times) / base:7.2f}"
        )
    name = "6 layers, to opacity, prepared"
    alone = measured({name: found[name]}, runs)[name]
    fl.set_threads(2)
    two = measured({name: found[name]}, runs)[name]
    print(f"two threads / one: {min(two) / min(alone):.2f}")
    law = population(6)
    for threads in (1, 2):
        fl.set_threads(threads)
        made = measured({"": lambda: fl.spectral.flake_patterns(64, **law, seed=1)}, 3)[""]
        print(f"patterns of 6 layers, {threads} threads: {min(made):.1f} ms")


if __name__ == "__main__":
    main()

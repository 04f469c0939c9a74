"""How fast this machine is against the cost model: measured once, kept in the user's cache folder.

It scales displayed times and nothing else: no choice that a frame depends on may follow a clock.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from flurries._threads import threads
from flurries.camera.lens import Camera
from flurries.frame.costs import nanoseconds
from flurries.particles import splat
from flurries.spectral import alpha
from flurries.spectral.operations import tile_work

# A file of another form is measured again; so are kernels that have become faster.
FORM = 2
# Seconds for each kernel: the least time of that long is one when nobody else was in the way.
SECONDS = 0.15


def _file() -> Path:
    """Return where the factors are kept: ``FLURRIES_CACHE``, or as the system has it."""
    folder = Path.home() / ".cache"
    if sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        folder = Path.home() / "Library" / "Caches"
    folder = Path(os.environ.get("XDG_CACHE_HOME") or folder) / "flurries"
    return Path(os.environ.get("FLURRIES_CACHE") or folder) / "calibration.json"


def scales(*, again: bool = False) -> Mapping[str, float]:
    """Return factors on the model's times by kind of work, for the threads that are set.

    Measured the first time, in a few tenths of a second, then read from the cache; a cache that
    cannot be read or written is done without.
    """
    if again:
        _scales.cache_clear()
    return _scales(_file(), threads(), again)


@lru_cache(maxsize=16)
def _scales(file: Path, count: int, again: bool) -> Mapping[str, float]:
    level = os.environ.get("FLURRIES_SIMD", "")
    machine = f"{FORM} {platform.machine()} {platform.processor()} {level}".strip()
    known: dict[str, dict[str, float]] = {}
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
        if stored["machine"] == machine:
            known = dict(stored["threads"])
        found = {kind: float(known[str(count)][kind]) for kind in ("kernel", "array")}
        if not again and all(1e-3 < value < 1e3 for value in found.values()):
            return found
    except (OSError, ValueError, KeyError, TypeError):
        pass
    found = measure()
    text = json.dumps({"machine": machine, "threads": {**known, str(count): found}})
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary = file.with_name(f"{file.name}.{os.getpid()}")
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(file)
    except OSError:
        pass
    return found


def measure() -> dict[str, float]:
    """Return the factors, measured now."""
    return factors({name: _least(call) for name, (call, _) in samples().items()})


def factors(nanoseconds_each: Mapping[str, float]) -> dict[str, float]:
    """Return the factors from the times of the samples."""
    ratio = {name: nanoseconds_each[name] / model for name, (_, model) in samples().items()}
    return {"kernel": (ratio["texture"] * ratio["flakes"]) ** 0.5, "array": ratio["array"]}


def samples() -> dict[str, tuple[Callable[[], object], float]]:
    """Return what is timed, each with its nanoseconds by the model."""
    shape, camera, count, band = (512, 512), Camera(500.0), 4000, (3.0, 24.0)
    pixels, each = 512.0 * 512.0, tile_work((64, 64), band)
    # Tiles of 64 px that share 10.
    tiles = len(range(0, 512 - 10, 54)) ** 2
    work = {"tile bin": each.bins, "tile multiply-add": each.dense, "tile pixel": each.pixels}
    texture = {name: tiles * number for name, number in work.items()} | {"texture pixel": pixels}
    drops = np.random.default_rng(1).uniform((-2.5, -2.5, 5.0), (2.5, 2.5, 5.001), (count, 3))
    # A radius of 0.03 is a standard deviation of 1 px there: 8 rows of one run each.
    flakes = {"flake listed": count, "disc": count, "disc run": 8.3 * count, "mask pixel": pixels}
    values = np.linspace(0.5, 1.5, 1 << 16)
    roots = np.empty_like(values)

    def waves() -> object:
        return alpha(
            shape, drift=(3.0, 9.0), velocity=(2.0, 6.0), seed=1, wavelengths=band, alias="soft",
            shutter=0.5, preserve_mean=True,
        )  # fmt: skip

    return {
        "texture": (waves, nanoseconds(texture)),
        "flakes": (lambda: splat(shape, drops, 0.03, camera, opacity=0.5), nanoseconds(flakes)),
        "array": (
            lambda: np.sqrt(values, out=roots),
            nanoseconds({"array number": float(values.size)}),
        ),
    }


def _least(call: Callable[[], object]) -> float:
    """Return the least nanoseconds of some runs."""
    # Of one thread what it computed counts, not what else the machine did meanwhile.
    clock = time.process_time_ns if threads() == 1 else time.perf_counter_ns
    call()
    least, end = float("inf"), time.perf_counter() + SECONDS
    while time.perf_counter() < end:
        start = clock()
        call()
        least = min(least, clock() - start)
    return max(least, 1.0)

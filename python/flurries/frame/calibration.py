"""How fast this machine is against the cost model: measured once, kept in the user's cache folder.

It scales displayed times and nothing else: no choice that a frame depends on may follow a clock.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from timeit import repeat

import numpy as np

from flurries._threads import threads
from flurries.camera.lens import Camera
from flurries.frame.costs import milliseconds
from flurries.particles import splat
from flurries.spectral import alpha

# A file of another form is measured again; so are kernels that have become faster.
FORM = 3
# Of this many times the least is one when nobody else was in the way.
RUNS = 150


def _file() -> Path:
    """Return the file of the factors: in ``FLURRIES_CACHE``, or where the system keeps caches."""
    places = {"win32": "~/AppData/Local", "darwin": "~/Library/Caches"}
    folder = os.environ.get("XDG_CACHE_HOME") or places.get(sys.platform, "~/.cache")
    own = os.environ.get("FLURRIES_CACHE") or Path(folder).expanduser() / "flurries"
    return Path(own) / "calibration.json"


def scales(*, again: bool = False) -> Mapping[str, float]:
    """Return factors on the model's times by kind of work, for the threads that are set.

    Measured the first time, in a few tenths of a second, then read from the cache; a cache that
    cannot be read or written is done without.
    """
    level = os.environ.get("FLURRIES_SIMD", "")
    machine = f"{FORM} {platform.machine()} {platform.processor()} {level} {threads()} threads"
    if again:
        _scales.cache_clear()
    return _scales(_file(), machine, again)


@lru_cache(maxsize=16)
def _scales(file: Path, machine: str, again: bool) -> Mapping[str, float]:
    known = {}
    with suppress(OSError, ValueError, KeyError, TypeError):
        known = dict(json.loads(file.read_text(encoding="utf-8")))
        found = {kind: float(known[machine][kind]) for kind in ("kernel", "array")}
        if not again and all(1e-3 < value < 1e3 for value in found.values()):
            return found
    found = measure()
    # Another process that reads half of it measures for itself.
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({**known, machine: found}), encoding="utf-8")
    return found


def measure() -> dict[str, float]:
    """Return the factors, measured now."""
    return {
        kind: 1e3 * min(repeat(call, number=1, repeat=RUNS)) / model
        for kind, (call, model) in samples().items()
    }


def samples() -> dict[str, tuple[Callable[[], object], float]]:
    """Return the samples of each kind of work to be timed, with their milliseconds by the model."""
    drops = np.random.default_rng(1).uniform((-2.5, -2.5, 5.0), (2.5, 2.5, 5.001), (4000, 3))
    values = np.linspace(0.5, 1.5, 1 << 16)
    roots = np.empty_like(values)

    def weather() -> None:
        alpha(
            (512, 512), drift=(3.0, 9.0), velocity=(2.0, 6.0), seed=1, wavelengths=(3.0, 24.0),
            alias="soft", shutter=0.5, preserve_mean=True,
        )  # fmt: skip
        splat((512, 512), drops, 0.03, Camera(500.0), opacity=0.5)

    return {
        "kernel": (weather, milliseconds({"weather": 1})),
        "array": (
            lambda: np.sqrt(values, out=roots), milliseconds({"array number": values.size})
        ),
    }  # fmt: skip

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
from pathlib import Path

import numpy as np

from flurries._threads import threads
from flurries.costs import nanoseconds

# A file of another form is measured again.
FORM = 1
RUNS = 31

_known: dict[int, dict[str, float]] = {}


def folder() -> Path:
    """Return the folder for caches of this package, as the system has it.

    ``FLURRIES_CACHE`` names another one.
    """
    given = os.environ.get("FLURRIES_CACHE")
    if given:
        return Path(given)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "flurries"


def machine() -> str:
    """Return what a calibration belongs to."""
    from flurries import __version__

    level = os.environ.get("FLURRIES_SIMD", "")
    return f"{FORM} {__version__} {platform.machine()} {platform.processor()} {level}".strip()


def scales(*, again: bool = False) -> Mapping[str, float]:
    """Return factors on the model's times by kind of work, for the threads that are set.

    Measured the first time, in a few tenths of a second, then read from the cache; a cache that
    cannot be read or written is done without.
    """
    count = threads()
    if again:
        _known.pop(count, None)
    if count not in _known:
        found = None if again else _read(count)
        if found is None:
            found = measure()
            _write(count, found)
        _known[count] = found
    return _known[count]


def measure() -> dict[str, float]:
    """Return the factors, measured now."""
    from flurries.effects.tiling import Tiling, operations
    from flurries.spectral import alpha

    shape, tiling, band = (512, 512), Tiling((64, 64), 10), (3.0, 24.0)
    work = operations(shape, (0, 512, 0, 512), tiling, band)
    kernel = _best(
        lambda: alpha(
            shape,
            drift=(3.0, 9.0),
            seed=1,
            tile=64,
            overlap=10,
            wavelengths=band,
            velocity=(2.0, 6.0),
            alias="soft",
            shutter=0.5,
            preserve_mean=True,
        )
    )
    values = np.linspace(0.5, 1.5, 1 << 16)
    roots = np.empty_like(values)
    array = _best(lambda: np.sqrt(values, out=roots))
    return {
        "kernel": kernel / nanoseconds(work),
        "array": array / nanoseconds({"array number": float(values.size)}),
    }


def _best(call: Callable[[], object]) -> float:
    """Return the least nanoseconds of some runs."""
    # Of one thread what it computed counts, not what else the machine did meanwhile.
    clock = time.process_time_ns if threads() == 1 else time.perf_counter_ns
    call()
    least = float("inf")
    # In a film other steps come between, and take the caches.
    between = np.zeros(1 << 21)
    for _ in range(RUNS):
        between += 1.0
        start = clock()
        call()
        least = min(least, clock() - start)
    return max(least, 1.0)


def _file() -> Path:
    return folder() / "calibration.json"


def _load() -> dict[str, dict[str, float]]:
    try:
        stored = json.loads(_file().read_text(encoding="utf-8"))
        if stored.get("machine") == machine():
            return dict(stored["threads"])
    except (OSError, ValueError, AttributeError, KeyError, TypeError):
        pass
    return {}


def _read(count: int) -> dict[str, float] | None:
    stored = _load().get(str(count))
    try:
        found = {kind: float(stored[kind]) for kind in ("kernel", "array")}  # type: ignore[index]
    except (KeyError, TypeError, ValueError):
        return None
    return found if all(1e-3 < value < 1e3 for value in found.values()) else None


def _write(count: int, found: Mapping[str, float]) -> None:
    kept = {**_load(), str(count): dict(found)}
    file = _file()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary = file.with_name(f"{file.name}.{os.getpid()}")
        text = json.dumps({"machine": machine(), "threads": kept})
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(file)
    except OSError:
        pass

"""How fast this machine is against the cost model: measured once, kept in the user's cache folder.

It scales displayed times and nothing else: no choice that a frame depends on may follow a clock.
"""

from __future__ import annotations

import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from flurries._threads import threads
from flurries.frame.costs import nanoseconds

# A file of another form is measured again.
FORM = 1
# Seconds for each kernel: the least time of that long is one when nobody else was in the way.
SECONDS = 0.15

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
    return factors({name: _best(call) for name, (call, _) in samples().items()})


def factors(nanoseconds_each: Mapping[str, float]) -> dict[str, float]:
    """Return the factors from the times of the samples."""
    ratios = {name: nanoseconds_each[name] / model for name, (_, model) in samples().items()}
    kernel = math.sqrt(ratios["texture"] * ratios["flakes"])
    return {"kernel": kernel, "array": ratios["array"]}


def samples() -> dict[str, tuple[Callable[[], object], float]]:
    """Return what is timed, each with its nanoseconds by the model."""
    from flurries.effects import Snow
    from flurries.scene.scene import Scene

    window = (0, 512, 0, 512)
    texture = Snow(flakes=0, haze=0.0, wavelengths=(3.0, 24.0), tile=64, overlap=10)
    flakes = Snow(texture=0.0, haze=0.0, flakes=1000)
    scene = Scene((512, 512), effects=[texture, flakes])
    (_, first), (_, second) = scene._asks(3.0, None, window, None)
    waves, points = texture.parts.texture, flakes.parts.flakes
    assert points is not None
    values = np.linspace(0.5, 1.5, 1 << 16)
    roots = np.empty_like(values)
    return {
        "texture": (
            lambda: waves.alpha(first, 1.0, waves.field.motion.way(first)),
            nanoseconds(texture.needs(first).steps[0].cost().work),
        ),
        "flakes": (
            lambda: points.alpha(second, 1.0, points.motion.way(second)),
            nanoseconds(flakes.needs(second).steps[0].cost().work),
        ),
        "array": (
            lambda: np.sqrt(values, out=roots),
            nanoseconds({"array number": float(values.size)}),
        ),
    }


def _best(call: Callable[[], object]) -> float:
    """Return the least nanoseconds of some runs."""
    # Of one thread what it computed counts, not what else the machine did meanwhile.
    clock = time.process_time_ns if threads() == 1 else time.perf_counter_ns
    call()
    least = float("inf")
    end = time.perf_counter() + SECONDS
    while time.perf_counter() < end:
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

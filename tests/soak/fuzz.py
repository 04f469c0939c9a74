"""Read damaged pictures, or fuzzed scene files, in a process of its own; print what came of it."""

from __future__ import annotations

import json
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
from flurries.io import read_header, read_picture

# One that takes longer hangs: the alarm ends the process.
LONGEST = 20
MOST_MEMORY = 4 << 30


def damaged(data: bytes, random: Any) -> bytes:
    """Cut, or with a few bits, bytes or runs changed."""
    kind = int(random.integers(5))
    if kind == 0:
        return data[: int(random.integers(1, len(data)))]
    bad = bytearray(data)
    # Half of the changes where formats keep what they say about themselves.
    room = len(data) if random.integers(2) else min(len(data), 400)
    for _ in range(int(random.integers(1, 6))):
        place = int(random.integers(room))
        if kind in (1, 2):
            bad[place] ^= 1 << int(random.integers(8))
        elif kind == 3:
            bad[place] = int(random.choice([0, 255, 127, 128]))
        else:
            bad[place : place + 4] = random.bytes(4)
    return bytes(bad)


def pictures(folder: Path, count: int, *names: str) -> Iterator[Callable[[], Any]]:
    random = np.random.default_rng(5)
    originals = [(folder / name).read_bytes() for name in names]
    for number in range(count):
        name = names[number % len(names)]
        path = folder / f"damaged{Path(name).suffix}"
        path.write_bytes(damaged(originals[number % len(names)], random))

        def read(path: Path = path) -> None:
            try:
                picture = read_picture(path)
                read_header(path)
            except (OSError, ValueError) as error:
                assert path.name in str(error), error
                raise
            assert picture.pixels.shape == (*picture.size[::-1], 3), picture.pixels.shape

        yield read


def scenes(folder: Path, count: int) -> Iterator[Callable[[], Any]]:
    random = np.random.default_rng(6)
    path = folder / "scene.toml"
    camera = fl.CameraPath(fl.Camera(80.0), velocity=(0.0, 0.0, 1.0))
    wind = fl.Wind((1.0, 0.0, 0.3), gusts=0.6)
    effects = [fl.Snow(wind=wind), fl.Rain(), fl.Mist(count=40), fl.ConeSnow(), fl.ConeRain()]
    fl.Scene((96, 64), "#304050", camera, effects, sun=fl.Sun()).save(path)
    text = path.read_bytes()
    words = [b"nan", b"inf", b"1e999", b"-1", b"9" * 30, b"[[", b"]", b'"', b"'''", b"=", b"\n[",
             b"{", b"true", b"\xff", b"\0", b"../../x.png", b"#" * 50, b"0x7fffffff"]  # fmt: skip
    for _ in range(count):
        if random.integers(2):
            bad = bytearray(text)
            for _ in range(int(random.integers(1, 4))):
                place = int(random.integers(len(bad)))
                width = int(random.integers(0, 8))
                bad[place : place + width] = words[int(random.integers(len(words)))]
            path.write_bytes(bytes(bad))
        else:
            path.write_bytes(damaged(text, random))
        yield lambda: fl.Scene.load(path)


def main(what: str, folder: str, count: str, *names: str) -> None:
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    tried = errors = 0
    slowest, complaints = 0.0, []
    jobs = {"pictures": pictures, "scenes": scenes}[what](Path(folder), int(count), *names)
    before = 0
    for job in jobs:
        signal.alarm(LONGEST)
        started = time.process_time()
        try:
            job()
        except (OSError, ValueError, TypeError) as error:
            errors += 1
            if len(str(error)) > 2000:
                complaints.append(f"{len(str(error))} letters")
        except BaseException as error:
            complaints.append(f"{type(error).__name__}: {error}"[:300])
        slowest = max(slowest, time.process_time() - started)
        tried += 1
        if tried == 20:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.alarm(0)
    growth = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    for line in complaints[:20]:
        print(line)
    print(json.dumps({"tried": tried, "errors": errors, "slowest": slowest, "growth": growth,
                      "complaints": len(complaints)}))  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])

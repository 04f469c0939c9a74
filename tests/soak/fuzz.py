"""Read damaged files of every kind in a process of its own; print what came of it."""

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
from flurries.io import (
    VideoWriter,
    open_background,
    read_depth,
    read_header,
    read_layers,
    read_picture,
    read_views,
    write_layer_views,
    write_layers,
    write_picture,
)
from flurries.io.stores import Store
from flurries.output.journal import NAME, Journal

# One that takes longer hangs: the alarm ends the process.
LONGEST = 20
MOST_MEMORY = 2 << 30


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


# What is written over a part of a scene file.
WORDS = [b"nan", b"inf", b"1e999", b"-1", b"9" * 30, b"[[", b"]", b'"', b"'''", b"=", b"\n[",
         b"{", b"true", b"\xff", b"\0", b"../../x.png", b"#" * 50, b"0x7fffffff",
         b"9" * 400, b"0x" + b"f" * 400, b"a." * 200, b"[" * 2000]  # fmt: skip


def misspelt(text: bytes, random: Any) -> bytes:
    """With a few words in place of others."""
    bad = bytearray(text)
    for _ in range(int(random.integers(1, 4))):
        place, width = int(random.integers(len(bad))), int(random.integers(0, 8))
        bad[place : place + width] = WORDS[int(random.integers(len(WORDS)))]
    return bytes(bad)


def picture(path: Path) -> None:
    try:
        found = read_picture(path)
        read_header(path)
    except (OSError, ValueError) as error:
        assert path.name in str(error), error
        raise
    assert found.pixels.shape == (*found.size[::-1], 3), found.pixels.shape


def films(path: Path) -> None:
    source = open_background(path)
    for number in (0, (source.count or 1) - 1):
        source.frame(number)
    source.close()


def jobs(folder: Path, count: int) -> Iterator[Callable[[], Any]]:
    """Yield jobs for mutants of every kind of file that is read, each in turn."""
    random = np.random.default_rng(7)
    light = random.random((40, 56, 4)).astype(np.float32)
    levels = (255 * light[..., :3]).astype(np.uint8)
    for name, pixels in {
        "a.exr": light, "a.hdr": light[..., :3], "a.tif": light, "a.png": levels, "a.jpg": levels,
    }.items():  # fmt: skip
        write_picture(folder / name, pixels)
    write_layers(folder / "depth.exr", {"rgba": light, "depth": light[..., 0] + 1.0})
    write_layer_views(folder / "views.exr", {"left": {"rgba": light}, "right": {"rgba": light}})
    for name in ("a.mp4", "a.mkv", "a.webm"):
        with VideoWriter(folder / name, (56, 40), 24) as film:
            for shift in range(6):
                film.write(np.roll(levels, shift, axis=1))
    camera = fl.CameraPath(fl.Camera(80.0), velocity=(0.0, 0.0, 1.0))
    wind = fl.Wind((1.0, 0.0, 0.3), gusts=0.6)
    effects = [
        fl.effects.TentSnow(wind=wind), fl.effects.TentRain(), fl.Mist(count=40),
        fl.effects.ConeSnow(), fl.effects.ConeRain(),
    ]  # fmt: skip
    scene = fl.Scene("#304050", size=(56, 40), camera=camera, effects=effects, sun=fl.scene.Sun())
    scene.save(folder / "a.toml")
    scene.write(folder / "out" / "%d.png", "1-3")
    (folder / "out" / NAME).rename(folder / "a.json")
    kinds: list[tuple[str, str, Callable[[Path], Any]]] = [
        ("a.exr", "bad.exr", picture), ("a.png", "bad.png", picture),
        ("a.jpg", "bad.jpg", picture), ("a.tif", "bad.tif", picture),
        ("a.hdr", "bad.hdr", picture), ("a.exr", "bad.exr", picture),
        ("depth.exr", "bad.exr", read_depth), ("depth.exr", "bad.exr", read_layers),
        ("views.exr", "bad.exr", read_views), ("a.mp4", "bad.mp4", films),
        ("a.mkv", "bad.mkv", films), ("a.webm", "bad.webm", films),
        ("a.toml", "bad.toml", fl.open), ("a.json", NAME, journal_of),
    ]  # fmt: skip
    originals = [(folder / name).read_bytes() for name, _, _ in kinds]
    # The control: what is not damaged is read.
    for original, (_, name, read) in zip(originals, kinds, strict=True):
        (folder / name).write_bytes(original)
        read(folder / name)
    for number in range(count):
        _, name, read = kinds[number % len(kinds)]
        spoil = misspelt if name == "bad.toml" and random.integers(2) else damaged
        (folder / name).write_bytes(spoil(originals[number % len(kinds)], random))
        yield lambda read=read, path=folder / name: read(path)


def journal_of(path: Path) -> None:
    Journal(Store(), path.parent)


def main(folder: str, count: str) -> None:
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    tried = errors = 0
    slowest, complaints = 0.0, []
    before = 0
    for job in jobs(Path(folder), int(count)):
        signal.alarm(LONGEST)
        started = time.process_time()
        try:
            job()
        except (OSError, ValueError, TypeError) as error:
            errors += 1
            if len(str(error)) > 2000:
                complaints.append(f"{len(str(error))} letters: {str(error)[:200]}")
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

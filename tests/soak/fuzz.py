"""Read damaged files of every kind in a process of its own; print what came of it."""

import json
import resource
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
from flurries import io
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
    bad = bytearray(text)
    for _ in range(int(random.integers(1, 4))):
        place, width = int(random.integers(len(bad))), int(random.integers(0, 8))
        bad[place : place + width] = WORDS[int(random.integers(len(WORDS)))]
    return bytes(bad)


def picture(path: Path) -> None:
    try:
        found = io.read_picture(path)
        io.read_slate(path)
    except (OSError, ValueError) as error:
        assert path.name in str(error), error
        raise
    assert found.pixels.shape == (*found.size[::-1], 3), found.pixels.shape


def films(path: Path) -> None:
    source = io.open_background(path)
    for number in (0, (source.count or 1) - 1):
        source.frame(number)
    source.close()


def jobs(folder: Path, count: int) -> Iterator[Callable[[], Any]]:
    random = np.random.default_rng(7)
    light = random.random((40, 56, 4)).astype(np.float32)
    levels = (255 * light[..., :3]).astype(np.uint8)
    for name, pixels in {
        "a.exr": light, "a.hdr": light[..., :3], "a.tif": light, "a.png": levels, "a.jpg": levels,
    }.items():  # fmt: skip
        io.write_picture(folder / name, pixels)
    io.write_layers(folder / "depth.exr", {"rgba": light, "depth": light[..., 0] + 1.0})
    io.write_layer_views(folder / "views.exr", {"left": {"rgba": light}, "right": {"rgba": light}})
    for name in ("a.mp4", "a.mkv", "a.webm"):
        with io.VideoWriter(folder / name, (56, 40), 24) as film:
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
    read: dict[str, list[Callable[[Path], Any]]] = {
        "a.exr": [picture, picture], "a.png": [picture], "a.jpg": [picture], "a.tif": [picture],
        "a.hdr": [picture], "depth.exr": [io.read_depth, io.read_layers],
        "views.exr": [io.read_views], "a.mp4": [films], "a.mkv": [films], "a.webm": [films],
        "a.toml": [fl.open], "a.json": [lambda path: Journal(Store(), path.parent)],
    }  # fmt: skip
    kinds = [(name, NAME if name == "a.json" else f"bad{Path(name).suffix}", how)
             for name, all_ways in read.items() for how in all_ways]  # fmt: skip
    originals = [(folder / name).read_bytes() for name, _, _ in kinds]
    # The control: what is not damaged is read.
    for original, (_, name, way) in zip(originals, kinds, strict=True):
        (folder / name).write_bytes(original)
        way(folder / name)
    for number in range(count):
        _, name, way = kinds[number % len(kinds)]
        spoil = misspelt if name == "bad.toml" and random.integers(2) else damaged
        (folder / name).write_bytes(spoil(originals[number % len(kinds)], random))
        yield partial(way, folder / name)


def main(folder: str, count: str) -> None:
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    tried = errors = 0
    complaints = []
    for job in jobs(Path(folder), int(count)):
        signal.alarm(LONGEST)
        try:
            job()
        except (OSError, ValueError, TypeError) as error:
            errors += 1
            if len(str(error)) > 2000:
                complaints.append(f"{len(str(error))} letters: {str(error)[:200]}")
        except BaseException as error:
            complaints.append(f"{type(error).__name__}: {error}"[:300])
        tried += 1
    signal.alarm(0)
    print("\n".join(complaints[:20]))
    print(json.dumps({"tried": tried, "errors": errors, "complaints": len(complaints)}))


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Snow of flakes against the tree before it, in turns of one run, one thread.

    python benches/flakes_before.py PYTHON [--runs N]

PYTHON is the interpreter of a checkout before snow was made of flakes (git e07e912), with its own
flurries built by the release profile. A row says the least milliseconds of the process' own time
there and here, and a quotient: a million flakes drawn one by one by that tree over the texture of
as many, and heavy snow on bytes here over there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import flurries as fl

SHAPE, FOCAL, DIAMETER = (1024, 1024), 1200.0, 0.01
NEAR, FAR, FLAKES = 8.0, 60.0, 1_000_000
FALL, SHUTTER = 1.4 / 30.0, 0.5
FRAMES = (224, 1024)

Calls = dict[str, Callable[[], object]]


def flakes(speed: float) -> Callable[[], object]:
    """Return what draws a million flakes one by one."""
    rng = np.random.default_rng(1)
    depth = np.cbrt(NEAR**3 + (FAR**3 - NEAR**3) * rng.random(FLAKES))
    aside = rng.uniform(-0.5, 0.5, (2, FLAKES)) * np.array(SHAPE)[:, None] / FOCAL * depth
    points = np.stack([aside[0], aside[1], depth], axis=1)
    radius, out = 3.0 * DIAMETER / np.sqrt(8.0), np.empty(SHAPE, np.float32)
    moves = {"velocity": (0.0, speed, 0.0), "shutter": SHUTTER} if speed else {}
    camera = fl.camera.Camera(FOCAL)
    return lambda: fl.particles.splat(SHAPE, points, radius, camera, opacity=0.9, out=out, **moves)


def heavy(side: int) -> Callable[[], object]:
    """Return what makes the next frame of heavy snow on bytes."""
    plate = np.random.default_rng(2).integers(0, 256, (side, side, 3), np.uint8)
    scene = fl.Scene(None, plate, effects=[fl.Snow.preset("heavy")])
    frames = iter(range(10**6))
    return lambda: scene.render(float(next(frames)))


def before() -> Calls:
    """Return the calls of the tree before."""
    return {"still": flakes(0.0), "streaks": flakes(FALL)} | {f"{n}": heavy(n) for n in FRAMES}


def now() -> Calls:
    """Return the calls of this tree."""
    from flakes_texture import frame

    per_tile = FLAKES / 361.0
    calls: Calls = {
        "still": frame(6, flakes_per_tile=per_tile)[1],
        # A frame reads patterns with streaks as it does others.
        "streaks, drawn into patterns": frame(6, flakes_per_tile=per_tile)[1],
        "streaks, each tile its own": frame(6, blurred=True, flakes_per_tile=per_tile)[1],
    }
    return calls | {f"{n}": heavy(n) for n in FRAMES}


def timed(call: Callable[[], object]) -> float:
    """Return milliseconds of this process."""
    start = time.process_time()
    call()
    return 1e3 * (time.process_time() - start)


def serve() -> None:
    """Answer names of calls with their times, until nobody asks."""
    calls = before()
    for line in sys.stdin:
        print(timed(calls[line.strip()]), flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("python", nargs="?", help="interpreter of the tree before")
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    fl.set_threads(1)
    if asked.serve:
        serve()
        return
    if asked.python is None:
        parser.error("PYTHON: the interpreter of the tree before is asked for")
    command = [asked.python, __file__, "--serve"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as other:
        assert other.stdin is not None and other.stdout is not None
        calls, least = now(), {}
        for turn in range(asked.runs + 2):
            for name, call in calls.items():
                other.stdin.write(name.split(",")[0] + "\n")
                there = float(other.stdout.readline())
                here = timed(call)
                if turn > 1:
                    old = least.get(name, (np.inf, np.inf))
                    least[name] = (min(old[0], there), min(old[1], here))
        other.stdin.close()
    print(f"{'least ms':46} {'before':>8} {'now':>8}")
    for name, (there, here) in least.items():
        if name.isdigit():
            label, ratio = f"heavy snow, {name} px, uint8", f"now / before {here / there:.2f}"
        else:
            label, ratio = f"a million flakes, {name}", f"before / now {there / here:.0f}"
        print(f"{label:46} {there:8.2f} {here:8.2f}  {ratio}")


if __name__ == "__main__":
    main()

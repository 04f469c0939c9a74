"""Make the pictures and the table of docs/cone.md: four ways to make snow, on one flight.

python docs/make_cone.py
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

import flurries as fl
from flurries import io
from flurries.cli import demo
from flurries.effects import ConeSnow, TentSnow

IMAGES = Path(__file__).parent / "images"
SIZE = 768
AIR = {"fall": 1.6, "wind": (0.5, 0.0, 0.0), "haze": 0.1}


def ways() -> dict[str, object]:
    """Return the four effects, of one fall, wind and haze."""
    heavy = TentSnow("heavy", **AIR)
    return {
        "cone": ConeSnow("heavy", **AIR, flakes=0),
        "spectral texture": TentSnow("heavy", **AIR, flakes=0),
        "particles": TentSnow("heavy", **AIR, texture=0.0, flakes=60_000, near_depth=24.0),
        "hybrid (cone and flakes)": ConeSnow("heavy", **AIR),
        "hybrid (texture and flakes)": heavy,
    }


def paths() -> dict[str, fl.CameraPath | None]:
    """Return a camera that stands, one that turns, and one that flies."""
    lens = fl.Camera(1.2 * SIZE)
    turning = fl.Keys([(0, (0.0, 0.0, 0.0)), (30, (0.0, 0.6, 0.0))])
    return {
        "still": None,
        "turning": fl.CameraPath(lens, orientation=turning),
        "flying": fl.CameraPath(lens, velocity=(0.0, 0.0, 6.0)),
    }


def main() -> None:
    """Write the contact sheet and the motion sheet, and print the times."""
    fl.set_threads(1)
    picture = demo.photograph(SIZE)
    stills, motions = [], []
    print(f"ms of processor time for a frame of {SIZE} x {SIZE}, least of 7")
    print(f"{'':32}" + "".join(f"{name:>10}" for name in paths()))
    for name, effect in ways().items():
        row, moved, times = [], [], []
        for path in paths().values():
            scene = fl.Scene(picture, camera=path, effects=[effect])
            scene.render(14)
            least = np.inf
            for t in (15, 16, 17, 18, 19, 20, 21):
                start = time.process_time()
                frame = scene.render(t)
                least = min(least, time.process_time() - start)
            times.append(1e3 * least)
            row.append(frame)
            step = frame.astype(float) - scene.render(20)
            moved.append(np.clip(128 + 1.5 * step, 0, 255).astype(np.uint8))
        print(f"{name:32}" + "".join(f"{value:>10.1f}" for value in times))
        stills.append(np.hstack(row))
        motions.append(np.hstack(moved))
    for file, rows in (("cone_ways.jpg", stills), ("cone_ways_motion.jpg", motions)):
        sheet = np.vstack(rows)
        width = 1200
        height = round(width * sheet.shape[0] / sheet.shape[1])
        io.write_picture(IMAGES / file, io.fit(sheet, (width, height)), quality=85)


if __name__ == "__main__":
    main()

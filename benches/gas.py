"""What the eye inside the gas costs: ``python benches/gas.py [--runs N]``.

For both eyes, beside the frames a second of Johnson 2005, section 4.1; and what a moving fog takes
in slices with structure and with a lamp. Depth and two eyes are in `benches/layers.py`.
"""

from __future__ import annotations

import argparse
from itertools import count

import numpy as np
from timing import timed

import flurries as fl

# Particles, their radius, and the paper's frames a second on a GeForce 4.
PAPER = {(1000, 0.4): 50, (2000, 0.4): 14, (2000, 0.32): 20}


def inside(runs: int) -> None:
    """Print what the eye inside the gas costs, one and both."""
    shape, camera = (480, 640), fl.Camera(560.0)
    both = fl.stereo.eyes(camera, distance=0.065, convergence=4.0)
    layers = [np.empty((*shape, 4), np.float32) for _ in both]

    def anaglyph(centers: np.ndarray, radius: float) -> None:
        pair = [
            fl.gas.splat(shape, centers, radius, 0.4, 0.7, eye, near_mode="exact", out=layer)[
                ..., :3
            ]
            for eye, layer in zip(both, layers, strict=True)
        ]
        fl.stereo.anaglyph(*pair)

    print("the eye in the middle of a box of 5, 640 x 480: both eyes and the anaglyph, frames/s")
    for (number, radius), paper in PAPER.items():
        centers = np.random.default_rng(1).uniform(-2.5, 2.5, (number, 3))
        row = []
        for threads in (1, 2):
            fl.set_threads(threads)
            found = timed({"both": lambda c=centers, r=radius: anaglyph(c, r)}, runs)
            row.append(1e3 / found["both"][0])
        print(
            f"  {number} particles r {radius}: {row[0]:.0f}, {row[1]:.0f} on two threads; "
            f"the paper {paper}"
        )
    fl.set_threads(1)
    plate = np.full((768, 1024, 3), 128, np.uint8)
    fog = fl.Mist("fog", count=1674, radius=2.16, box=24.0, wind=(1.0, 0.0, 0.0))
    bank = fl.Mist("bank", visibility=20.0, wind=(1.0, 0.0, 0.0))
    flat = fl.Scene(plate, effects=[fog])
    stirred = fl.Scene(plate, effects=[bank])
    lit = fl.Scene(plate, effects=[bank], lights=[fl.scene.Lamp((1.0, -2.0, 8.0), power=60.0)])
    time_of = count()
    found = timed(
        {
            "one eye": lambda: flat.render(next(time_of)),
            "structure": lambda: stirred.render(next(time_of)),
            "structure and a lamp": lambda: lit.render(next(time_of)),
        },
        runs,
    )
    one = found["one eye"][0]
    print(f"moving fog, 1024 x 768, 20 m, one thread: {one:.1f} ms;", end=" ")
    print(", ".join(f"{name} {found[name][0] / one:.2f}" for name in found if name != "one eye"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    inside(parser.parse_args().runs)

"""What both eyes inside the gas cost, beside Johnson 2005, section 4.1: ``benches/gas.py``."""

from __future__ import annotations

import numpy as np
from timing import timed

import flurries as fl

# Particles, their radius, and the paper's frames a second on a GeForce 4.
PAPER = {(1000, 0.4): 50, (2000, 0.4): 14, (2000, 0.32): 20}


def inside() -> None:
    shape, camera = (480, 640), fl.Camera(560.0)
    both = fl.stereo.eyes(camera, distance=0.065, convergence=4.0)
    layers = [np.empty((*shape, 4), np.float32) for _ in both]

    def anaglyph(centers: np.ndarray, radius: float) -> None:
        for eye, layer in zip(both, layers, strict=True):
            fl.gas.splat(shape, centers, radius, 0.4, 0.7, eye, near_mode="exact", out=layer)
        fl.stereo.anaglyph(*(layer[..., :3] for layer in layers))

    print("the eye in the middle of a box of 5, 640 x 480: both eyes and the anaglyph, frames/s")
    for (number, radius), paper in PAPER.items():
        centers = np.random.default_rng(1).uniform(-2.5, 2.5, (number, 3))
        row = []
        for threads in (1, 2):
            fl.set_threads(threads)
            found = timed({"both": lambda c=centers, r=radius: anaglyph(c, r)}, 15)
            row.append(1e3 / found["both"][0])
        print(
            f"  {number} particles r {radius}: {row[0]:.0f}, {row[1]:.0f} on two threads; "
            f"the paper {paper}"
        )


if __name__ == "__main__":
    inside()

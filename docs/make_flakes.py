"""The picture of docs/snow.md, `python docs/make_flakes.py`: ours beside every flake drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flurries as fl
from flurries import io
from flurries.cli import demo

IMAGES = Path(__file__).parent / "images"


def main() -> None:
    plate = demo.photograph(1024)
    region = np.s_[330:760, 60:560]
    halves = []
    for method in ("hybrid", "simulated"):
        snow = fl.Snow.preset("heavy", method=method)
        scene = fl.Scene(None, plate, effects=[snow], seed=3)
        halves.append(scene.render(12, region=region))
    io.write_picture(IMAGES / "flakes.jpg", np.hstack(halves))


if __name__ == "__main__":
    main()

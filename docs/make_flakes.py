"""The picture of docs/snow.md, `python docs/make_flakes.py`, as Fig. 2 of Langer 2004.

Heavy snow by the paper's hybrid, by ours, and with every flake drawn, which takes a minute.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flurries as fl
from flurries import io
from flurries.cli import demo

IMAGES = Path(__file__).parent / "images"


def main() -> None:
    plate = demo.photograph(1024)
    region = np.s_[330:730, 90:510]
    effects = [
        fl.effects.TentSnow("heavy"),
        *(fl.Snow("heavy", method=method) for method in ("flakes", "simulated")),
    ]
    parts = []
    for effect in effects:
        scene = fl.Scene(plate, effects=[effect], seed=3)
        parts += [scene.render(12, region=region), np.full((400, 6, 3), 255, np.uint8)]
    io.write_picture(IMAGES / "flakes.jpg", np.hstack(parts[:-1]))


if __name__ == "__main__":
    main()

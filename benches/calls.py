"""How often a frame goes from one file of the package to another: ``python benches/calls.py``."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import flurries as fl
from flurries._kept import ALL, Kept

FOLDER = str(Path(fl.__file__).parent)


def counts(call: Any) -> dict[str, int]:
    way: list[str] = []

    def look(frame: FrameType, event: str, _: Any) -> None:
        file = frame.f_code.co_filename
        if event == "call" and file.startswith(FOLDER):
            way.append(file)

    sys.setprofile(look)
    try:
        call()
    finally:
        sys.setprofile(None)
    return {
        "calls": len(way),
        "files": len(set(way)),
        "changes of file": sum(a != b for a, b in pairwise(way)),
        "checks": sum(file.endswith("_contract.py") for file in way),
    }


def main() -> None:
    picture = np.zeros((512, 512, 3), np.uint8)
    still = fl.Scene(picture, effects=[fl.Snow("heavy")])
    flying = still.replace(camera=fl.CameraPath(fl.Camera(600.0), velocity=(0.0, 0.0, 1.0)))
    cases = {
        "first heavy frame": lambda: still.render(0),
        "heavy frame": lambda: still.render(7),
        "first frame, flying": lambda: flying.render(0),
        "heavy frame, flying": lambda: flying.render(7),
        "flakes with layers": lambda: still.layers(7),
    }
    for made in ALL.values():
        made.clear() if isinstance(made, Kept) else made.cache_clear()
    for name, call in cases.items():
        print(f"{name:24}" + "".join(f"{n:>6} {key}" for key, n in counts(call).items()))


if __name__ == "__main__":
    main()

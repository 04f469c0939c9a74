"""Golden frames of the looks, version by version: ``python tests/make_looks.py v2``.

A frame changes only with a new version of the looks, which gets a picture of its own: opacities of
64 x 48 px in the middle of pictures, 16 bits, side by side.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
from flurries.effects.presets import CONE_RAIN, CONE_SNOW, MIST, TENT_RAIN, TENT_SNOW

FRAMES = Path(__file__).parent / "frames"
WIDE, HIGH, ACROSS = 64, 48, 8


def looks(version: str) -> dict[str, tuple[Any, tuple[int, int]]]:
    """Return effects by name, each with the size of its picture."""
    found: dict[str, tuple[Any, tuple[int, int]]] = {}
    effects = fl.effects
    kinds: tuple[Any, ...] = (
        effects.TentSnow, effects.TentRain, effects.ConeSnow, effects.ConeRain, fl.Mist,
    )  # fmt: skip
    looks = TENT_SNOW, TENT_RAIN, CONE_SNOW, CONE_RAIN, MIST
    for kind, presets in zip(kinds, looks, strict=True):
        for name in presets:
            effect = kind(name, look=version)
            found[f"{kind.__name__} {name}"] = (effect, (512, 384))
    for kind in (fl.effects.TentSnow, fl.effects.TentRain):
        for rate in (0.5, 4.0, 20.0):
            found[f"{kind.__name__} {rate} mm/h"] = (kind(rate=rate, look=version), (512, 384))
    for size in ((256, 192), (2048, 1536)):
        found[f"Snow at {size[0]}"] = (fl.effects.TentSnow(look=version), size)
        found[f"Rain at {size[0]}"] = (fl.effects.TentRain(look=version), size)
    return found


def frame(effect: Any, size: tuple[int, int]) -> np.ndarray:
    """Return the opacity in the middle of a frame, (HIGH, WIDE)."""
    left, top = (size[0] - WIDE) // 2, (size[1] - HIGH) // 2
    region = np.s_[top : top + HIGH, left : left + WIDE]
    scene = fl.Scene("#000000", size=size, effects=[effect], seed=7)
    return np.asarray(scene.layers(7, region=region).alpha)


def sheet(version: str) -> np.ndarray:
    """Return all of them side by side, uint16."""
    frames = [frame(*look) for look in looks(version).values()]
    rows = -(-len(frames) // ACROSS)
    result = np.zeros((rows * HIGH, ACROSS * WIDE), np.uint16)
    for number, plane in enumerate(frames):
        top, left = number // ACROSS * HIGH, number % ACROSS * WIDE
        result[top : top + HIGH, left : left + WIDE] = np.rint(65535.0 * plane)
    return result


def main() -> None:
    """Write the golden frames of a version; one that is there stays."""
    import skimage.io

    version = sys.argv[1]
    file = FRAMES / f"looks_{version}.png"
    if file.exists():
        sys.exit(f"{file} is there: looks that were released do not change; make a new version")
    skimage.io.imsave(file, sheet(version), check_contrast=False)


if __name__ == "__main__":
    main()

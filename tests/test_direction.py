"""Streaks lean as those of drawn flakes do, in the whole picture and in every block of it."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import flurries as fl
from judges import BLOCK, direction, slopes

SIDE, TIME = 384, 20.0

# Metres: near enough to draw all flakes in a second. Nearly all of them are the texture's.
FAR = 20.0

# One picture's lean deviates by up to .01 from that of another seed, and a block's by .02 to .05:
# of four seeds the difference of two whole pictures has a deviation of at most `LIMIT` / 4.
SEEDS = 4

# Whole pictures of drawn flakes and of ours lean alike within this.
LIMIT = 0.03

# Blocks of the drawn that lean by so much must lean to the same side.
SLANTED = 0.1

PATHS: dict[str, dict[str, Any]] = {
    "still": {},
    "sideways": {"velocity": (2.0, 0.0, 0.0)},
    "forward": {"velocity": (0.0, 0.0, 3.0)},
    "turning": {"orientation": fl.Keys([(0, (0.0, 0.0, 0.0)), (60, (0.0, 0.6, 0.0))])},
}
LOOKS = ("heavy", "blizzard")


def misses(ours: list[np.ndarray], drawn: list[np.ndarray]) -> list[str]:
    """Return what is wrong with the lean of some pictures."""
    sums = [np.array([slopes(picture) for picture in each]) for each in (ours, drawn)]
    got, want = (float(direction(each.sum(axis=(0, 2, 3)))) for each in sums)
    found = [f"whole: {got:+.3f} for {want:+.3f}"] if abs(got - want) > LIMIT else []
    # Four deviations of the difference of two means over the seeds: there are some 600 blocks.
    each = np.array([direction(one) for one in sums[1]])
    spread = float(np.sqrt(each.var(axis=0, ddof=1).mean()))
    most = LIMIT + 4.0 * spread * np.sqrt(2.0 / len(drawn))
    blocks = [direction(each.sum(axis=0)) for each in sums]
    for at in np.ndindex(blocks[0].shape):
        got, want = (float(each[at]) for each in blocks)
        if (abs(want) >= SLANTED and got * want <= 0.0) or abs(got - want) > most:
            found.append(f"block {at}: {got:+.3f} for {want:+.3f}")
    return found


@cache
def pictures(method: str, camera: str, wind: float, look: str) -> list[np.ndarray]:
    path = fl.CameraPath(fl.Camera(600.0), **PATHS[camera])
    snow = fl.Snow(look, wind=(wind, 0.0, 0.0), far=FAR, method=method)
    scenes = [
        fl.Scene("#000000", size=(SIDE, SIDE), camera=path, effects=[snow], seed=3 + n)
        for n in range(SEEDS)
    ]
    found = [one.layers(TIME).layers["snow"].alpha for one in scenes]
    return [one.astype(np.float64) for one in found]


@pytest.mark.parametrize("wind", [0.0, 3.0])
@pytest.mark.parametrize("camera", PATHS)
@pytest.mark.parametrize("look", LOOKS)
def test_streaks_lean_as_those_of_drawn_flakes(look: str, camera: str, wind: float):
    assert not misses(*(pictures(one, camera, wind, look) for one in ("flakes", "simulated")))


@pytest.mark.parametrize("look", LOOKS)
def test_the_judge_sees_mirrored_blocks(look: str):
    drawn = pictures("simulated", "still", 3.0, look)
    mirrored = [alpha.copy() for alpha in drawn]
    for alpha in mirrored:
        for row, col in np.ndindex(SIDE // BLOCK, SIDE // BLOCK):
            if (row + col) % 2:
                block = alpha[row * BLOCK :, col * BLOCK :][:BLOCK, :BLOCK]
                block[:] = block[:, ::-1].copy()
    found = misses(mirrored, drawn)
    assert found[0].startswith("whole") and len(found) == 1 + (SIDE // BLOCK) ** 2 // 2

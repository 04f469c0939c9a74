"""Streaks lean as those of drawn flakes do, in the whole picture and in every block of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

import flurries as fl

SIDE, BLOCK, TIME = 384, 64, 20.0

# Metres: near enough to draw all flakes in a second. Nearly all of them are the texture's.
FAR = 20.0

# One picture's lean deviates by up to .01 from that of another seed, and a block's by .02 to .05:
# of two seeds the difference of two whole pictures has a deviation of at most a third of `LIMIT`.
SEEDS = 2

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


@dataclass(frozen=True)
class Lean:
    """How gradients of some pictures lean: the mean of gx gy over the root of those of gx^2, gy^2.

    Attributes
    ----------
    sums : (seeds, 3, rows, cols)
        Of gx gy, gx^2 and gy^2 over each block.
    """

    sums: np.ndarray

    @staticmethod
    def of(pictures: list[np.ndarray]) -> Lean:
        found = []
        for alpha in pictures:
            gx, gy = np.zeros((2, *alpha.shape))
            gx[1:-1, 1:-1] = 0.5 * (alpha[1:-1, 2:] - alpha[1:-1, :-2])
            gy[1:-1, 1:-1] = 0.5 * (alpha[2:, 1:-1] - alpha[:-2, 1:-1])
            rows, cols = (length // BLOCK for length in alpha.shape)
            products = np.stack([gx * gy, gx * gx, gy * gy])
            found.append(products.reshape(3, rows, BLOCK, cols, BLOCK).sum(axis=(2, 4)))
        return Lean(np.array(found))

    @property
    def whole(self) -> float:
        return float(_lean(self.sums.sum(axis=(0, 2, 3))))

    @property
    def blocks(self) -> np.ndarray:
        return _lean(self.sums.sum(axis=0))

    @property
    def spread(self) -> float:
        """The deviation of a block of one seed, from those of the others."""
        each = np.array([_lean(one) for one in self.sums])
        return float(np.sqrt(each.var(axis=0, ddof=1).mean()))


def _lean(sums: np.ndarray) -> np.ndarray:
    return np.asarray(sums[0] / np.sqrt(sums[1] * sums[2]))


def misses(ours: Lean, drawn: Lean) -> list[str]:
    """Return what is wrong with the lean of some pictures."""
    found = []
    if abs(ours.whole - drawn.whole) > LIMIT:
        found.append(f"whole: {ours.whole:+.3f} for {drawn.whole:+.3f}")
    # Four deviations of the difference of two means over the seeds: there are some 600 blocks.
    most = LIMIT + 4.0 * drawn.spread * np.sqrt(2.0 / len(drawn.sums))
    for at in np.ndindex(drawn.blocks.shape):
        got, want = ours.blocks[at], drawn.blocks[at]
        turned = abs(want) >= SLANTED and got * want <= 0.0
        if turned or abs(got - want) > most:
            found.append(f"block {at}: {got:+.3f} for {want:+.3f}")
    return found


@cache
def pictures(method: str, camera: str, wind: float, look: str) -> list[np.ndarray]:
    path = fl.CameraPath(fl.Camera(600.0), **PATHS[camera])
    snow = fl.Snow.preset(look, wind=(wind, 0.0, 0.0), far=FAR, method=method)
    found = []
    for seed in range(SEEDS):
        scene = fl.Scene((SIDE, SIDE), "#000000", path, [snow], seed=3 + seed)
        found.append(scene.render(TIME, layers=True).layers["snow"][..., 3].astype(np.float64))
    return found


@pytest.mark.parametrize("wind", [0.0, 3.0])
@pytest.mark.parametrize("camera", PATHS)
@pytest.mark.parametrize("look", LOOKS)
def test_streaks_lean_as_those_of_drawn_flakes(look: str, camera: str, wind: float):
    ours, drawn = (
        Lean.of(pictures(method, camera, wind, look)) for method in ("hybrid", "simulated")
    )
    assert not misses(ours, drawn)


@pytest.mark.parametrize("look", LOOKS)
def test_the_judge_sees_mirrored_blocks(look: str):
    drawn = pictures("simulated", "still", 3.0, look)
    mirrored = []
    for alpha in drawn:
        alpha = alpha.copy()
        for row, col in np.ndindex(SIDE // BLOCK, SIDE // BLOCK):
            if (row + col) % 2:
                block = alpha[row * BLOCK :, col * BLOCK :][:BLOCK, :BLOCK]
                block[:] = block[:, ::-1].copy()
        mirrored.append(alpha)
    found = misses(Lean.of(mirrored), Lean.of(drawn))
    assert found[0].startswith("whole") and len(found) == 1 + (SIDE // BLOCK) ** 2 // 2

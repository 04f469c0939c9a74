"""The bench that judges falling snow runs, says what it should, and lets the twin itself pass.

Its figures of the presets are in docs/internals/falling_statistics.md. Here the texture is held
against flakes drawn one by one by `method="simulated"`, where both draw flakes alike.
"""

import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import judges
from judges import BLOCK, direction, slopes

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

import falling_statistics
from falling_cases import Case
from falling_contracts import identities
from falling_statistics import QUOTIENTS, judged, page, table


def picture(method: str, seed: int) -> np.ndarray:
    """A part of a wide picture, and few enough flakes that all of them can be drawn."""
    snow = fl.Snow(density=60.0, far=22.0, method=method)
    scene = fl.Scene(
        "#000000", size=(240, 160), camera=fl.Camera(768.0), effects=[snow], seed=8 + seed
    )
    return scene.layers(10.0).alpha.astype(np.float64)


def test_ours_are_the_numbers_of_drawn_flakes_and_a_gaussian_fails():
    drawn = [picture("simulated", seed) for seed in range(6)]
    known = [judges.numbers(one) for one in drawn]

    def missed(pictures: list[np.ndarray]) -> set[str]:
        """Which numbers are off by more than their limits and three errors of their means."""
        found, missed = [judges.numbers(one) for one in pictures], set()
        # Not the Euler number at the median: near 0, a quotient says little.
        for name in QUOTIENTS.keys() - {"Euler 50"}:
            a, b = (np.array([one[name] for one in each]) for each in (found, known))
            error = np.hypot(a.std(), b.std()) / np.sqrt(len(b))
            if abs(a.mean() - b.mean()) > QUOTIENTS[name] * abs(b.mean()) + 3.0 * error:
                missed.add(name)
        return missed

    assert not missed([picture("flakes", seed) for seed in range(6)])
    assert len(missed([judges.gaussian(one, seed) for seed, one in enumerate(drawn)])) >= 4


def test_a_case_is_judged_and_the_twin_passes_itself(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(falling_statistics, "APART", (0.0, 45.0, 90.0, 135.0, 180.0))
    case = Case("still", "light", 3.0, 192)
    times = (0.0, 1.0, 4.0, 64.0)
    ours, twin = (judged(case, 3, times, of) for of in ("flakes", "twin"))
    assert ours.keys() == twin.keys() >= {*QUOTIENTS, "C(4)", "direction", "after 1"}
    assert not [name for name, figure in twin.items() if figure.verdict == "miss"]
    shown = page({"one": ours, "other": twin}, ["- a line"], 3)
    assert shown.count("\n| ") == len(ours) + 2 and "- a line" in shown
    assert "direction" in table(ours)


@pytest.mark.parametrize("boxed", [False, True])
def test_identities_are_judged(boxed: bool):
    place = np.random.default_rng(1).uniform((-3, -3, 1), (3, 3, 8), (9000, 3))
    kind = [("id", np.uint64), ("place", float, 3), ("pixel", float, 2), ("depth", float)]

    def flakes(scene: fl.Scene, t: float) -> np.ndarray:
        width, height = scene.size
        camera = scene.camera.camera if isinstance(scene.camera, fl.CameraPath) else scene.camera
        found = np.zeros(len(place), kind)
        seen = place * (width / 480.0, height / 360.0, 1.0) if boxed else place
        found["id"], found["place"] = np.arange(len(seen)), seen
        found["pixel"], found["depth"] = fl.camera.project(seen, camera, (height, width))
        # Nobody lists what is far outside.
        return judges.inside(found, (-20.0, -20.0), (width + 20.0, height + 20.0))

    lines = list(identities(flakes))
    assert len(lines) == 4
    assert all(line.endswith("pass") for line in lines) != boxed


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

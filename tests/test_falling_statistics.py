"""The bench that judges falling snow runs, says what it should, and lets the twin itself pass.

Its figures of the presets are in docs/internals/falling_statistics.md. Here the texture is held
against flakes drawn one by one by `method="simulated"`, where both draw flakes alike.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
import judges

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

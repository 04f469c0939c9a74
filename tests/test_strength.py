"""Strength: rate, visibility, number, sizes, fall and opacity of one population."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from measure import cover

OWN, DROPS = (0.003, 0.007, 0.022), (0.001, 0.002, 0.006)
KEYED = fl.Keys([(0, 0.0), (10, 1.0), (20, 4.0)])

SNOW: list[dict[str, Any]] = [
    {"rate": 2.5}, {"rate": 2.0, "flake_size": OWN}, {"rate": 2.0, "density": 100.0},
    {"rate": 2.0, "fall": 3.0}, {"rate": 2.5, "density": 80.0, "flake_size": OWN},
    {"visibility": 300.0}, {"visibility": 300.0, "flake_size": OWN},
    {"visibility": 300.0, "density": 200.0, "opacity": 0.5},
    {"visibility": 500.0, "density": 200.0, "flake_size": OWN}, {"rate": 2.5, "visibility": 900.0},
    {"rate": 2.5, "visibility": 900.0, "density": 100.0},
    {"rate": 2.5, "visibility": 900.0, "density": 100.0, "opacity": 0.9},
    {"rate": 2.5, "visibility": 900.0, "flake_size": OWN, "opacity": 0.8},
    {"severity": 3, "visibility": 800.0}, {"density": 60.0, "flake_size": OWN, "fall": 1.5},
]  # fmt: skip
RAIN: list[dict[str, Any]] = [
    {"rate": 10.0}, {"rate": 10.0, "drop_size": DROPS}, {"visibility": 2000.0},
    {"rate": 50.0, "visibility": 1500.0}, {"severity": 2, "density": 400.0},
]  # fmt: skip
REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"rate": 2.0, "density": 100.0, "flake_size": OWN, "fall": 1.0}, r"rate.*fall.*2\.687.*got 2"),
    ({"rate": 0.01, "density": 30.0, "flake_size": OWN}, r"rate.*density.*0\.8803 mm/h.*got 0\.01"),
    ({"visibility": 500.0, "density": 30.0, "flake_size": OWN}, r"visibility.*2254 m, got 500"),
    ({"rate": 2.5, "visibility": 3000.0}, r"rate 2\.5.*456\.\d to 1014 m, got 3000"),
    ({"visibility": 5.0}, r"snow of 0\.001 to 50 mm/h.*49\.13 to"),
    ({"severity": 3, "rate": 2.0}, r"severity and rate.*3 is 2\.5 mm/h, rate is 2"),
    ({"rate": KEYED, "density": 3.0}, "rate is keyed"), ({"rate": 2.0, "density": 0.0}, "density"),
    ({"rate": 2.0, "fall": KEYED}, "fall must not be keyed beside rate"),
]  # fmt: skip


def drawn(effect: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return mm/h and 1/m of the flakes from 1 to 5 m away, summed, and the errors of counting."""
    found, moment, seeds = [], 0.05, range(3 if effect.NAME == "snow" else 1)
    volume = len(seeds) * 200 * 150 / 100.0**2 * (5.0**3 - 1.0) / 3.0
    scene = fl.Scene(size=(200, 150), camera=fl.Camera(100.0), effects=[effect], fps=30)
    for seed in seeds:
        now, then = (fl.flakes(scene.replace(seed=seed), t) for t in (0.0, moment))
        _, here, there = np.intersect1d(now["id"], then["id"], return_indices=True)
        fall = (then["place"][there, 1] - now["place"][here, 1]) / moment * 30.0
        now = now[here]
        inside = (np.abs(now["pixel"] - (100, 75)) < (100, 75)).all(axis=1)
        inside &= np.abs(now["depth"] - 3.0) < 2.0
        mm = 1e3 * now["diameter"][inside]
        # Brandes et al. 2007, and balls of water; mg.
        mass = math.pi / 6.0 * (0.178 * mm**2.078 if effect.NAME == "snow" else mm**3)
        area = 1e-6 * math.pi / 4.0 * mm**2 * now["opacity"][inside]
        found.append([3600e-6 * mass * fall[inside], area])
    each = np.concatenate(found, axis=1) / volume
    return each.sum(axis=1), np.sqrt((each**2).sum(axis=1))


@pytest.mark.parametrize(
    ("kind", "given"), [(fl.Snow, one) for one in SNOW] + [(fl.Rain, one) for one in RAIN]
)
def test_what_is_given_holds_and_is_what_the_flakes_do(kind: Any, given: dict[str, Any]):
    effect = kind(**given, method="simulated", far=6.0)
    says = effect.strength()
    rates = (0.5, 1.0, 2.5, 5.0, 10.0) if kind is fl.Snow else (2.5, 10.0, 25.0, 50.0, 100.0)
    wanted = {"rate": rates[given["severity"] - 1]} if "severity" in given else {}
    for name, value in {**given, **wanted}.items():
        if name in ("rate", "visibility"):
            assert getattr(says, name) == pytest.approx(value, rel=1e-6)
        elif name != "severity":
            assert getattr(effect, name) == value
    (rate, extinction), errors = drawn(effect)
    # Drops of a class of sizes fall alike, which takes 1 %.
    assert rate == pytest.approx(says.rate, abs=3.0 * errors[0] + 0.012 * says.rate)
    assert extinction == pytest.approx(-math.log(0.05) / says.visibility, abs=3.0 * errors[1])


@pytest.mark.parametrize(("given", "words"), REFUSED)
def test_a_contradiction_is_refused_with_its_numbers(given: dict[str, Any], words: str):
    with pytest.raises(ValueError, match=words):
        fl.Snow(**given)


def test_keyed_knobs_hold_at_all_times():
    seen = fl.Keys([(0, 2000.0), (10, 100.0), (30, 400.0)])
    for t in (0.0, 4.0, 10.0, 17.0, 90.0):
        assert fl.Snow(rate=KEYED).strength(t).rate == pytest.approx(KEYED.at(t), rel=1e-9)
        assert fl.Snow(visibility=seen).strength(t).visibility == pytest.approx(
            seen.at(t), rel=0.01
        )


@pytest.mark.parametrize("weather", [fl.Snow(visibility=100.0), fl.Rain(visibility=400.0)])
@pytest.mark.parametrize(("depth", "ways"), [(None, 0.0), (1.0, 1.0), (1e5, 2.0)])
def test_weather_of_a_visibility_reaches_twice_as_far(weather: Any, depth: Any, ways: float):
    seen = weather.strength().visibility
    wall = depth and depth * seen
    scenes = [fl.Scene(size=(320, 240), effects=[weather], depth=wall, seed=s) for s in range(3)]
    # Flakes fade in up to .4 m.
    want = 1.0 - 0.05 ** (((seen * ways or 60.0) - 0.36) / seen)
    assert np.mean([cover(scene, 3) for scene in scenes]) == pytest.approx(want, abs=0.005)
    assert weather.strength().cover == pytest.approx(1.0 - 0.05 ** (59.64 / seen), rel=1e-6)


def test_representation_and_plan_say_the_numbers():
    snow, mist = fl.Snow(rate=2.0), fl.Mist(visibility=300.0)
    said = "2 mm/h, 296.8 per m3, visibility 877.5 m, covers 18.4 %"
    assert repr(snow).endswith(f")  # {said}") and eval(repr(snow), {"Snow": fl.Snow}) == snow
    plan = fl.Scene(size=(32, 24), effects=[mist, snow]).plan(probe=False)
    assert f"snow  frame 1  {said}" in str(plan) and "visibility 300 m, covers 45.1 %" in str(plan)
    assert plan.to_dict()["strengths"][1][2]["rate"] == pytest.approx(2.0)


def test_thin_rain_is_brighter_than_rain_that_pours():
    thin, pours = (fl.Rain(severity=severity).parts.brightness for severity in (1, 5))
    assert 4.0 > thin > 3.7 and 2.2 > pours > 1.9

"""Strength: rates, visibilities, severities, numbers, sizes, fall; pictures of any size."""

import copy
import hashlib
import math
import pickle
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.effects.checks import LOOKS
from flurries.effects.maps import map_at, power_share
from measure import cover, same_flakes

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
    ({"preset": "heavy", "severity": 3}, "severity and a preset"),
    ({"severity": 2, "method": "tent"}, "severity"),
]  # fmt: skip


def drawn(effect: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return mm/h and 1/m of the flakes from 1 to 5 m away, summed, and the errors of counting."""
    found, moment, seeds = [], 0.05, range(3 if effect.NAME == "snow" else 1)
    volume = len(seeds) * 200 * 150 / 100.0**2 * (5.0**3 - 1.0) / 3.0
    scene = fl.Scene(size=(200, 150), camera=fl.Camera(100.0), effects=[effect], fps=30)
    for seed in seeds:
        now, then = same_flakes(*(fl.flakes(scene.replace(seed=seed), t) for t in (0.0, moment)))
        fall = (then["place"][:, 1] - now["place"][:, 1]) / moment * 30.0
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
    assert rate == pytest.approx(says.rate, abs=3.0 * errors[0])
    assert extinction == pytest.approx(-math.log(0.05) / says.visibility, abs=3.0 * errors[1])


@pytest.mark.parametrize(("given", "words"), REFUSED)
def test_a_contradiction_is_refused_with_its_numbers(given: dict[str, Any], words: str):
    with pytest.raises((TypeError, ValueError), match=words):
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


def test_drops_that_fall_as_their_class_does_carry_the_rate():
    population = (rain := fl.Rain(rate=10.0)).parts.flakes.population
    each = [one.fall * (one.nodes[1] @ rain.MATTER.mass(one.nodes[0]))
            for one in population.classes(4)]  # fmt: skip
    assert 3600.0 * population.density * sum(each) == pytest.approx(10.0, rel=1e-6)


def test_thin_rain_is_brighter_than_rain_that_pours():
    thin, pours = (fl.Rain(severity=severity).parts.brightness for severity in (1, 5))
    assert 4.0 > thin > 3.7 and 2.2 > pours > 1.9


def test_a_density_is_the_same_behind_any_lens():
    snow = fl.effects.TentSnow(texture=0.0, haze=0.0, flake_density=20.0)
    covers = []
    for focal, size in ((300.0, (256, 192)), (600.0, (256, 192)), (307.2, (256, 256))):
        scene = fl.Scene(size=size, effects=[snow], camera=fl.Camera(focal))
        alphas = [cover(scene.replace(seed=s), 3).mean() for s in range(6)]
        covers.append(np.mean(alphas))
    # Flakes behind a pixel are as many whatever the lens; the nearest and largest ones fade.
    assert np.ptp(covers) < 0.15 * np.mean(covers)
    # As many lie in the pyramid of view, to the distance up to which they are drawn.
    drawn = fl.Scene(size=(256, 192), effects=[snow], camera=fl.Camera(500.0))
    counts = []
    for seed in range(6):
        flakes = fl.flakes(drawn.replace(seed=seed), 0.0)
        inside = (flakes["pixel"] > 0.0).all(axis=1) & (flakes["pixel"] < (256, 192)).all(axis=1)
        counts.append((inside & (flakes["depth"] < 11.0)).sum())
    assert np.mean(counts) == pytest.approx(20.0 * 0.512 * 0.384 * 11.0**3 / 3.0, rel=0.03)


def test_knobs_of_others_and_of_copies_are_refused_by_name():
    with pytest.raises(ValueError, match="severity and visibility"):
        fl.Mist(severity=2, visibility=30.0)
    with pytest.raises(TypeError, match="severity"):
        replace(fl.Snow(severity=2), severity=3)


@pytest.mark.parametrize("kind", [fl.Snow, fl.Rain, fl.Mist])
def test_a_knob_leaves_what_is_given_and_is_written_out(kind: Any, tmp_path: Path):
    plain = kind(severity=3)
    if kind is not fl.Mist:
        assert kind(severity=3, density=60.0).density == 60.0 != plain.density
    for made in (pickle.loads(pickle.dumps(plain)), copy.copy(plain), replace(plain, amount=1.0)):
        assert made == plain and "_given" not in vars(made)
    scene = fl.Scene(size=(32, 24), effects=[plain])
    scene.save(tmp_path / "scene.toml")
    assert "severity" not in (tmp_path / "scene.toml").read_text()
    assert fl.open(tmp_path / "scene.toml").effects == (plain,)
    text = f'format = 3\n[[effects]]\nkind = "{kind.NAME}"\nseverity = 3\n'
    (tmp_path / "own.toml").write_text(text)
    assert fl.open(tmp_path / "own.toml").effects == (plain,)


def boxed(alpha: np.ndarray, times: int) -> np.ndarray:
    height, width = alpha.shape
    return alpha.reshape(height // times, times, width // times, times).mean(axis=(1, 3))


def opacities(effect: Any, width: int, count: int) -> np.ndarray:
    scenes = [fl.Scene(size=(width, width), effects=[effect], seed=seed) for seed in range(count)]
    return np.stack([cover(s, 3).astype(np.float64) for s in scenes])


# (effect, error of the mean, of the standard deviation). Streaks of rain at 256 px have waves of
# 2 to 3 px, few in a tile; flakes are never narrower than .62 px of sigma, which takes variance.
SIZES = {
    "texture": (fl.effects.TentSnow(flakes=0, haze=0.0), 0.02, 0.08),
    "heavy texture": (fl.effects.TentSnow("heavy", flakes=0, haze=0.0), 0.02, 0.06),
    "snow": (fl.effects.TentSnow(), 0.02, 0.15),
    "rain": (fl.effects.TentRain(), 0.03, 0.2),
}


@pytest.mark.parametrize("name", SIZES)
def test_a_small_picture_is_the_large_one_made_smaller(name: str):
    effect, mean, deviation = SIZES[name]
    whole = opacities(effect, 1024, 2)
    for width, count in ((256, 12), (512, 6)):
        large = np.stack([boxed(alpha, 1024 // width) for alpha in whole])
        small = opacities(effect, width, count)
        assert small.mean() == pytest.approx(large.mean(), rel=mean), width
        assert small.std() == pytest.approx(large.std(), rel=deviation), width


KEPT = {"v1": "3a05f3713e29d59b"}  # A change of any number of a look needs another version.


def digest(version: str) -> str:
    kinds = TentSnow, TentRain, ConeSnow, ConeRain, fl.Mist
    looks = [asdict(kind(name, look=version)) for kind in kinds for name in kind.PRESETS]
    numbers = repr([sorted(look.items()) for look in looks])
    return hashlib.sha256(numbers.encode()).hexdigest()[:16]


def test_a_look_is_as_it_was():
    assert {version: digest(version) for version in LOOKS} == KEPT


def test_the_tuned_size_is_left_alone_and_maps_keep_their_moments():
    assert power_share((3.0, 24.0), 0.75, 1024) == 1.0
    assert map_at(0.05, 2.0, 2.0, 1.0) == (0.05, 2.0)
    z = np.random.default_rng(3).standard_normal((2, 400_000))
    for share in (0.2, 0.6, 1.1):
        rho = min(share, 1.0 / share)
        # Two pictures that share what is seen, and differ in what is not.
        again = rho * z[0] + math.sqrt(1.0 - rho**2) * z[1]
        mean, spread = map_at(0.05, 2.0, 2.0, share)

        def mapped(field: np.ndarray, mean: float, spread: float) -> np.ndarray:
            return np.clip(mean + field / (2.0 * spread), 0.0, 1.0) ** 2

        def seen(mean: float, spread: float, z1: np.ndarray, z2: np.ndarray) -> tuple[float, float]:
            """Mean and variance of what is left when only a share of the field is seen."""
            first, second = mapped(z1, mean, spread), mapped(z2, mean, spread)
            return float(first.mean()), float(np.cov(first, second)[0, 1])

        part, whole = (z[0], again), (z[0], z[0])
        tuned = seen(0.05, 2.0, *(part if share < 1.0 else whole))
        fitted = seen(mean, spread, *(whole if share < 1.0 else part))
        assert fitted[0] == pytest.approx(tuned[0], rel=0.01)
        assert fitted[1] == pytest.approx(tuned[1], rel=0.03)

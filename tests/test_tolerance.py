"""A tolerance: the error stays within it, and the plan says what it was spent on."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.cli import main
from flurries.effects.keyed import Mixture
from flurries.frame import calibration
from flurries.frame import tolerance as spending
from flurries.frame.costs import NANOSECONDS, milliseconds
from flurries.frame.needs import Cost, Needs, Step
from flurries.frame.tolerance import TABLE, Light, choose
from flurries.io.color import linear_to_srgb, looked_up, to_integer

TOLERANCES = (1 / 255, 1e-3, 1e-5)
W, H = 96, 72
# The last one alone spends its rain.
SCENES = [*range(48), 72]


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Times are not looked at: none are measured."""
    monkeypatch.setenv("FLURRIES_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "measure", lambda: {"kernel": 1.0, "array": 1.0})


def random_scene(number: int) -> fl.Scene:
    """A scene of one to three effects, of any amount down to a millionth, on any background."""
    rng = np.random.default_rng(1000 + number)
    kind = rng.choice(["byte", "word", "light", "bright"])
    if kind in ("byte", "word"):
        dtype = np.uint8 if kind == "byte" else np.uint16
        picture = rng.integers(0, np.iinfo(dtype).max + 1, (H, W, 3)).astype(dtype)
    else:
        picture = rng.gamma(1.0, 0.4, (H, W, 3)).astype(np.float32)
        if kind == "bright":
            picture[5:9, 5:9] *= 40.0

    def amount() -> float:
        return 1.0 if rng.random() < 0.3 else float(10.0 ** rng.uniform(-6.0, 0.0))

    def color() -> Any:
        return rng.random(3).tolist() if rng.random() < 0.7 else "ambient"

    made: list[Any] = []
    for _ in range(rng.integers(1, 4)):
        what = rng.choice(["snow", "rain", "mist", "thick", "cone"])
        common = {"amount": amount(), "color": color(), "seed": int(rng.integers(1000))}
        # A flake that is there shows whole, however few there are.
        number = 400 if common["amount"] > 0.01 else 0
        if what == "snow":
            haze = float(10.0 ** rng.uniform(-6.0, -1.0))
            made.append(fl.TentSnow(**common, haze=haze, flakes=number, texture=amount()))
        elif what == "rain":
            made.append(fl.TentRain(**common, drops=number, texture=amount()))
        elif what == "mist":
            made.append(fl.Mist(**common, count=400))
        elif what == "thick":
            common["amount"] = 1.0
            more = {"count": 3000, "density": 0.8, "lit": bool(rng.random() < 0.5)}
            more["scatter"] = str(rng.choice(["even", "rayleigh", "henyey"]))
            made.append(fl.Mist(**common, **more))
        else:
            made.append(fl.ConeRain(**common, tile=64))
    more = {}
    if rng.random() < 0.5:
        matte = np.clip(rng.normal(0.9, 0.2, (H // 8, W // 8)), 0.0, 1.0)
        matte = np.kron(matte, np.ones((8, 8)))
        # Nearly opaque, as mattes of 8 bits are.
        matte[matte > 0.98] = 1.0 - 10.0 ** rng.uniform(-6.0, -2.0)
        more["foreground"] = matte.astype(np.float32)
    if rng.random() < 0.3:
        more["depth"] = rng.uniform(2.0, 60.0, (H, W)).astype(np.float32)
    if rng.random() < 0.4:
        more["sun"] = fl.Sun((0.4, 1.0, 0.3))
    if rng.random() < 0.4:
        more["space"] = str(rng.choice(["display", "linear"]))
    return fl.Scene(None, picture, effects=made, **more)


def off(scene: fl.Scene, tolerance: float, exact: Any = None) -> float:
    """How far frame 5 is off, of full scale."""
    exact = scene.render(5) if exact is None else exact
    near = scene.render(5, tolerance=tolerance)
    assert near.dtype == exact.dtype
    full = float(np.iinfo(exact.dtype).max) if exact.dtype.kind == "u" else 1.0
    return float(np.abs(exact.astype(np.float64) - near.astype(np.float64)).max()) / full


@pytest.mark.parametrize("number", SCENES)
def test_the_error_stays_within_the_tolerance(number: int):
    scene = random_scene(number)
    exact = scene.render(5)
    for tolerance in TOLERANCES:
        choice = scene.program.choice(5.0, tolerance)
        assert choice.error <= tolerance
        found = off(scene, tolerance, exact)
        if choice.error == 0.0:
            assert found == 0.0
        elif exact.dtype.kind == "u":
            assert found <= choice.error * (1.0 + 1e-12)
        else:
            # Both frames are rounded, some layers one over another.
            assert found <= choice.error + 4.0 * 2.0**-24 * max(float(np.abs(exact).max()), 1.0)


def test_lamps_make_more_of_an_error():
    mist = fl.Mist(count=300, amount=1e-4, density=0.3, wind=(0.1, 0.0, 0.0))
    lamp = fl.Lamp((0.3, 0.0, 2.0), power=1e4, radius=0.05)
    scene = fl.Scene(None, np.zeros((H, W, 3), np.float32), effects=[mist], lights=[lamp])
    assert scene.render(5).max() > 0.02 and off(scene, 1e-2) <= 1e-2


def test_a_population_that_hardly_shows_does_not_take_another_with_it():
    # As between two keys of a size: the flakes of one go as those of the other come.
    snows = Mixture([fl.TentSnow(amount=amount, flakes=0).parts for amount in (1.0, 1e-6)])
    scene = fl.Scene(None, np.zeros((H, W, 3), np.float32), effects=[snows])
    assert off(scene, 1e-2) <= 1e-2 < 0.1 < scene.render(5).max()


def test_more_tolerance_never_saves_less():
    steps = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1 / 255, 5e-3, 1e-2, 3e-2, 0.1]
    rises = 0
    for number in SCENES:
        program = random_scene(number).program
        spent = [program.choice(5.0, tolerance).spent for tolerance in steps]
        saved = [sum(one.milliseconds for one in choice) for choice in spent]
        assert all(after >= before - 1e-9 for before, after in pairwise(saved))
        rises += saved[-1] > saved[0]
    assert rises > len(SCENES) // 2


def test_the_scenes_spend_something():
    kinds: set[str] = set()
    errors = []
    for number in SCENES:
        scene = random_scene(number)
        choice = scene.program.choice(5.0, 1 / 255)
        kinds |= {one.what.split(": ")[-1] for one in choice.spent}
        if choice.spent:
            errors.append(off(scene, 1 / 255))
    assert {"no texture", "rain", "snow", "what hardly shows past what stands in front",
            "particles behind what is opaque but for the error",
            "display values from a table of 16 bits"} <= kinds  # fmt: skip
    assert len(errors) > len(SCENES) // 4 and sum(error > 1e-5 for error in errors) > 6


def test_a_law_that_lies_is_found(monkeypatch: pytest.MonkeyPatch):
    """The control: errors said to be a hundredth of what they are break the tolerance."""
    of = Light.of

    def lying(*given: Any, **more: Any) -> Light:
        light = of(*given, **more)
        return light._replace(factor=0.01 * light.factor)

    monkeypatch.setattr(spending.Light, "of", staticmethod(lying))
    broken = 0
    for number in SCENES:
        scene = random_scene(number)
        if scene.render(0).dtype.kind == "f":
            broken += off(scene, 1e-3) > 1.01e-3
    assert broken > 3


def test_regions_and_eyes_have_the_whole_frame_s_bits():
    for number in SCENES[::12]:
        scene = random_scene(number)
        whole = scene.render(5, tolerance=1e-3)
        part = np.s_[20:50, 10:70]
        assert np.array_equal(scene.render(5, tolerance=1e-3, region=part), whole[part])
        left, right = scene.stereo(5, distance=0.0, tolerance=1e-3)
        assert np.array_equal(left, whole) and np.array_equal(right, whole)
        assert np.array_equal(scene.replace(tolerance=1e-3).render(5), whole)


def test_without_a_tolerance_nothing_changes():
    scene = random_scene(3)
    exact = scene.render(5)
    assert np.array_equal(scene.render(5, tolerance=0.0), exact)
    assert np.array_equal(scene.replace(tolerance=1e-2).render(5, tolerance=0.0), exact)
    # Layers are exact, and one rendering does not change the next.
    layers = scene.render(5, tolerance=1e-2, layers=True)
    assert np.array_equal(layers.alpha, scene.render(5, layers=True).alpha)
    scene.render(5, tolerance=1e-2)
    assert np.array_equal(scene.render(5), exact)


def test_what_never_moves_is_kept_by_what_is_spent():
    fog = fl.Mist(count=3000, density=0.8, color=0.7, seed=3)
    scene = fl.Scene((W, H), (0.2, 0.3, 0.4), effects=[fog])
    exact, near = scene.render(1), scene.render(1, tolerance=1 / 255)
    assert not np.array_equal(exact, near)
    assert np.array_equal(scene.render(2), exact)
    assert np.array_equal(scene.render(2, tolerance=1 / 255), near)


def test_what_is_spent_does_not_run():
    light = np.random.default_rng(3).random((H, W, 3), np.float32)
    effects = [fl.TentSnow(amount=1e-4, seed=1), fl.TentRain()]
    scene = fl.Scene(None, light, effects=effects, depth=30.0)
    with fl.trace.tracing() as exact:
        scene.render(3)
    with fl.trace.tracing() as near:
        scene.render(3, tolerance=1e-3)
    assert near.calls["texture"] == exact.calls["texture"] - 1
    plan = scene.plan(3, tolerance=1e-3)
    assert "within the tolerance" in {one.why for one in plan.left_out}
    assert {step.name for step in plan.steps} < {step.name for step in scene.plan(3).steps}


def test_the_plan_says_what_a_tolerance_is_spent_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    light = np.random.default_rng(3).random((H, W, 3), np.float32)
    scene = fl.Scene(None, light, effects=[fl.TentSnow(amount=1e-4)])
    plan = scene.plan(3, tolerance=1e-3)
    assert plan.tolerance == 1e-3 and 0.0 < plan.error <= 1e-3
    assert sum(one.milliseconds for one in plan.spent) > 0.0
    assert plan.milliseconds < scene.plan(3).milliseconds
    text, values, page = str(plan), json.loads(plan.to_json()), plan._repr_html_()
    assert values["tolerance"] == 1e-3 and values["error"] == plan.error
    for one in plan.spent:
        assert one.what in text and one.what in page
    assert "nothing to be saved" in str(fl.Scene((W, H)).plan(3, tolerance=1e-3))
    assert "tolerance" not in str(scene.plan(3))
    kept = fl.Scene((W, H), "#203040", effects=[fl.TentSnow()], tolerance=1 / 255)
    kept.save(tmp_path / "scene.toml")
    assert fl.Scene.load(tmp_path / "scene.toml").tolerance == 1 / 255
    words = ["plan", "#203040", "--snow", "heavy", "--tolerance", "0.004", "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["tolerance"] == 0.004


@pytest.mark.parametrize("value", [-1e-9, 1.1, float("nan"), "much", None, [0.1]])
def test_a_tolerance_is_refused_by_name(value: Any):
    if value is not None:
        with pytest.raises((ValueError, TypeError), match="tolerance"):
            fl.Scene((8, 8)).render(0, tolerance=value)
    with pytest.raises((ValueError, TypeError), match="tolerance"):
        fl.Scene((8, 8), tolerance=value)


# The parts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [8, 16])
def test_the_table_errs_as_little_as_it_says(bits: int):
    values = np.random.default_rng(1).random(400_000).astype(np.float32) ** 4
    values = np.concatenate([values, np.array([-1.0, 0.0, 1.0, 2.0, 1e-6], np.float32)])
    exact = linear_to_srgb(np.clip(values.astype(np.float64), 0.0, 1.0))
    full = 2**bits - 1
    got = looked_up(values, bits).astype(np.float64) / full
    assert np.abs(got - exact).max() <= TABLE + 0.5 / full + 1e-7
    assert np.abs(looked_up(values, bits).astype(int) - to_integer(exact, bits)).max() <= (
        1 if bits == 8 else 7
    )


def test_integers_count_steps():
    byte = Light(same=True, step=1 / 255, factor=1.0)
    # An altered layer errs by a whole step however little; one that is left out by the nearest.
    assert byte.price(layer=1e-4) == pytest.approx(1 / 255)
    assert byte.price(gone=1e-4) == byte.price() == 0.0
    assert byte.price(gone=1.4 / 255) == pytest.approx(1 / 255)
    assert byte.price(gone=1.6 / 255) == pytest.approx(2 / 255)
    # Laid one over another, in the worst order, by exact integers.
    rng = np.random.default_rng(5)
    for _ in range(2000):
        value = near = float(rng.integers(0, 256))
        price = 0.0
        for _ in range(3):
            alpha, color = rng.random(), rng.integers(0, 256)
            error = float(rng.choice([0.0, 0.3, 1.0, 2.5])) / 255.0
            gone = rng.random() < 0.5
            if gone:
                alpha = min(alpha, error)
                price += byte.price(gone=error)
            else:
                price += byte.price(layer=error)
            value = np.rint(value + alpha * (color - value))
            if not gone:
                close = np.clip(alpha + rng.uniform(-error, error), 0.0, 1.0)
                near = np.rint(near + close * (color - near))
        assert abs(value - near) / 255.0 <= byte.error(price) + 1e-12


def asking(*savings: tuple[str, float, float], whole: float = 1.0) -> Needs:
    """The needs of steps that cost and err as given: (name, error, milliseconds)."""

    def cost(milliseconds: float) -> Cost:
        return Cost({"array number": 1e6 * milliseconds / NANOSECONDS["array number"][1]})

    steps = tuple(Step(name, lambda ms=ms: cost(ms), error=e) for name, e, ms in savings)
    return Needs(steps, most=whole)


def test_the_budget_goes_where_most_time_is_saved():
    light = Light(same=True, step=0.0, factor=1.0)

    def taken(tolerance: float, *needs: Needs) -> set[tuple[int, str]]:
        asked = [(place, f"effect{place}", one) for place, one in enumerate(needs)]
        found = choose(asked, light, tolerance, values=1)
        assert found.error <= tolerance
        return set(found.without)

    a = asking(("x", 0.5, 10.0), ("y", 0.3, 7.0), whole=0.65)
    b = asking(("z", 0.3, 6.0))
    assert taken(0.2, a, b) == set()
    assert taken(0.3, a, b) == {(0, "y")}
    assert taken(0.6, a, b) == {(0, "y"), (1, "z")}
    # The whole effect errs by less than its parts one by one.
    assert taken(0.66, a, b) == {(0, "x"), (0, "y")}
    assert taken(0.99, a, b) == {(0, "x"), (0, "y"), (1, "z")}
    assert taken(0.79, replace(a, most=1.0), b) == {(0, "y"), (1, "z")}
    # The best of many, against all combinations tried one by one.
    many = [asking(("x", 0.01 * (i + 1), 5.0), ("y", 0.02, 1.0 + i)) for i in range(6)]
    saved = {(i, s.name): milliseconds(s.cost().work) for i, n in enumerate(many) for s in n.steps}
    items = [(s.error, saved[i, s.name]) for i, one in enumerate(many) for s in one.steps]
    best = max(
        sum(ms for _, ms in some)
        for count in range(len(items) + 1)
        for some in combinations(items, count)
        if sum(error for error, _ in some) <= 0.1 + 1e-12
    )
    assert sum(saved[one] for one in taken(0.1, *many)) == pytest.approx(best)

"""The plan: what is left out runs no step and changes no bit, and a trace says what runs."""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import judges
from flurries._trace import Trace, tracing
from flurries.camera import Camera
from flurries.cli import main
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.frame import plan as planning
from flurries.frame.needs import LeftOut, Needs, Step, renderer_of

W, H = 200, 150
RNG = np.random.default_rng(41)
BYTES = RNG.integers(0, 256, (H, W, 3)).astype(np.uint8)
LIGHT = RNG.gamma(1.0, 0.5, (H, W, 3)).astype(np.float32)
STILL: dict[str, Any] = {"fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}


@dataclass(frozen=True)
class Everything:
    """An effect that takes all its steps and is told of nothing that cannot be seen."""

    effect: Any
    seed: int = 0

    def needs(self, frame: fl.effects.Frame) -> Needs:
        names = ("texture", "flakes", "veil") if frame.deep else ("texture", "flakes")
        return Needs(tuple(map(Step, names)), reads=frozenset({"depth"}))

    def render(self, frame: fl.effects.Frame) -> Any:
        assert frame.steps is not None
        return renderer_of(self.effect).render(replace(frame, kept=None, visible=None))


def both(effect: Any, picture: Any = BYTES, **more: Any) -> tuple[fl.Scene, fl.Scene]:
    whole = Everything(replace(effect, seed=5), seed=5)
    return (
        fl.Scene(picture, effects=[replace(effect, seed=5)], **more),
        fl.Scene(picture, effects=[whole], **more),
    )


def traced(scene: fl.Scene, t: float = 7.0, way: str = "render", **more: Any) -> tuple[Any, Trace]:
    with tracing() as trace:
        image = getattr(scene, way)(t, **more)
    return image, trace


def left_out(scene: fl.Scene, frames: Any = 7) -> dict[str, str]:
    return {one.what: one.why for one in scene.plan(frames, probe=False).left_out}


# What is left out: (effect, more of the scene, steps that must not run, words of the plan)
ABSENT: dict[str, tuple[Any, dict[str, Any], set[str], str]] = {
    "amount 0": (TentRain(amount=0.0), {}, {"texture", "flakes", "veil", "join"}, "rain"),
    "no texture": (TentSnow(texture=0.0), {}, {"texture"}, "snow: texture"),
    "no flakes": (TentSnow(flakes=0), {}, {"flakes"}, "snow: flakes"),
    "no haze": (TentSnow(haze=0.0, flakes=500), {"depth": 30.0}, {"veil"}, "snow: veil"),
    "half a step": (TentSnow(amount=2e-5, flakes=0), {}, {"texture", "join"}, "snow"),
    "no cone": (ConeSnow(amount=0), {}, {"cone", "flakes", "join"}, "cone_snow"),
}


@pytest.mark.parametrize("case", ABSENT)
def test_what_shows_nothing_is_not_made(case: str):
    effect, more, absent, words = ABSENT[case]
    planned, whole = both(effect, **more)
    image, trace = traced(planned)
    assert not absent & set(trace.sums("calls"))
    want, full = traced(whole)
    assert np.array_equal(image, want)
    assert absent & set(full.sums("calls")), "the control runs what the plan leaves out"
    assert any(what.startswith(words) for what in left_out(planned))


@pytest.mark.parametrize("space", ["display", "linear"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_less_than_half_a_step_is_left_out_and_more_is_not(space: str, dtype: Any):
    picture = BYTES.astype(dtype) * (257 if dtype == np.uint16 else 1)
    bare = fl.Scene(picture, space=space).render(0)
    for veil in (0.01, 0.03, 0.3, 0.49, 0.7, 3.0):
        # White over all values there are, several layers of it.
        haze = veil / np.iinfo(dtype).max
        effect = TentSnow(texture=0.0, flakes=0, haze=haze, color=1.0)
        image, trace = traced(fl.Scene(picture, effects=[effect] * 3, space=space))
        made = "join" in trace.sums("calls")
        if not made:
            whole = fl.Scene(picture, effects=[Everything(effect)] * 3, space=space)
            assert np.array_equal(image, whole.render(7)) and np.array_equal(image, bare)
        if veil > 0.5:
            assert made and not np.array_equal(image, bare)
        assert not (made and veil < (0.49 if space == "display" else 0.011))


def test_nothing_is_made_where_all_is_hidden():
    front = np.zeros((H, W, 4), np.uint8)
    front[..., 3] = 255
    for foreground in (np.ones((H, W), np.float32), front):
        planned, whole = both(TentSnow(), foreground=foreground)
        image, trace = traced(planned)
        assert np.array_equal(image, whole.render(7))
        assert set(trace.sums("calls")) == {"background", "composite"}
        assert left_out(planned)["all effects"] == "they are behind what stands in front"
    # The layers themselves are whole under a picture.
    assert planned.layers(7).alpha.max() > 0.0


@pytest.mark.parametrize(
    "kind, front", [("bytes", "mask"), ("light", "picture"), ("bytes in linear light", "picture")]
)
def test_only_the_part_that_is_seen_is_made(kind: str, front: str):
    cover = np.zeros((H, W), np.float32)
    cover[70:] = cover[:, :20] = 1.0
    foreground: Any = cover
    if front == "picture":
        foreground = np.dstack([RNG.random((H, W, 3), np.float32) * cover[..., None], cover])
    more: dict[str, Any] = {"space": "linear"} if kind.endswith("linear light") else {}
    picture = LIGHT if kind == "light" else BYTES
    planned, whole = both(TentSnow(), picture, foreground=foreground, **more)
    for part in (None, np.s_[30:90, 10:60], np.s_[80:90, 5:60]):
        image, trace = traced(planned, region=part)
        # With the layers apart all of the window is made.
        want, full = traced(whole, region=part, way="layers")
        assert np.array_equal(image, want.image)
        spans = [[*one.spans.values()] for one in (trace, full)]
        made, most = (sum(span.counts.get("tiles", 0) for span in some) for some in spans)
        assert made < most


@pytest.mark.parametrize("way", ["render", "layers"])
def test_what_never_moves_is_made_once(way: str):
    planned, whole = both(TentSnow(**STILL))
    with tracing() as trace:
        images = [getattr(planned, way)(t) for t in (0, 5, 0.5)]
    assert trace.sums("calls")["texture"] == trace.sums("calls")["flakes"] == 1
    for t, image in zip((0, 5, 0.5), images, strict=True):
        want = getattr(whole, way)(t)
        if way == "layers":
            assert image.alpha.flags.writeable
            image, want = image.alpha, want.alpha
        assert np.array_equal(image, want)
    once = {step.name for step in planned.plan("1-5", probe=False).steps if step.once}
    assert once == {"snow: texture", "snow: flakes"}
    # Another eye or another window is another frame.
    eye = Camera(100.0)
    assert np.array_equal(planned.render(3, eye=eye), whole.render(3, eye=eye))
    part = np.s_[3:50, 7:90]
    assert np.array_equal(planned.render(3, region=part), whole.render(3)[part])


def test_gas_of_one_color_is_not_sorted():
    gas = fl.Mist("mist", method="particles", wind=(0.3, 0.0, 0.0))
    sun = fl.scene.Sun((0.0, 1.0, 0.0), 1.0, ambient=1.0)
    plain = fl.Scene(BYTES, effects=[gas])
    image, trace = traced(plain)
    assert "gas" in trace.sums("calls") and "lit gas" not in trace.sums("calls")
    assert left_out(plain)["mist: sort"] == "its particles have one color"
    # All light is even: with colors and a sort it is the same, within a step of rounding.
    want, full = traced(plain.replace(sun=sun))
    assert "lit gas" in full.sums("calls")
    assert np.abs(image.astype(int) - want).max() <= 1


@dataclass(frozen=True)
class Own:
    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        top, bottom, left, right = frame.window
        return fl.effects.Layer("own", np.full((bottom - top, right - left), 0.5, np.float32))


@dataclass(frozen=True)
class Large(Own):
    """An effect whose step takes memory and time that are known, and tells when it was rendered."""

    NAME = "large"
    rendered: Any = None
    amount: Any = 1.0

    def needs(self, frame: fl.effects.Frame) -> Needs:
        amount = self.amount.at(frame.t) if isinstance(self.amount, fl.Keys) else self.amount
        gone = LeftOut("large", "its amount is 0")
        return Needs((Step("work"),)) if amount else Needs((), (gone,), most=0.0)

    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        if self.rendered is not None:
            self.rendered.append(int(frame.t))

        def work() -> fl.effects.Layer:
            time.sleep(0.02)
            assert np.ones(50_000_000, np.uint8)[-1] == 1
            return Own.render(self, frame)

        layer = frame.run(self, "work", work)
        assert layer is not None
        return layer


def test_effects_of_others():
    scene = fl.Scene(BYTES, effects=[Own(), Large(), Large(amount=0.0)])
    _, trace = traced(scene)
    assert trace.sums("calls")["own"] == 1
    assert [step.name for step in scene.plan(1).steps] == [
        "background", "own", "large: work", "composite",
    ]  # fmt: skip
    assert left_out(scene)["large"] == "its amount is 0"
    wrong = type("Wrong", (Own,), {"needs": lambda self, frame: ["paint"]})
    with pytest.raises(TypeError, match=r"Wrong\.needs must return Needs, got list"):
        fl.Scene(BYTES, effects=[wrong()]).render(0)


TURNING = fl.CameraPath(Camera(500.0), orientation=fl.Keys([(0, (0.0,) * 3), (9, (0.0, 0.1, 0.0))]))
LAMP = fl.scene.Lamp((0.0, -1.0, 6.0))
SCENES: dict[str, fl.Scene] = {
    "empty": fl.Scene(BYTES),
    "two alike": fl.Scene(BYTES, effects=[TentSnow(), TentSnow(flakes=0)]),
    "in linear light": fl.Scene(BYTES, effects=[TentSnow()], space="linear"),
    "all hidden": fl.Scene(BYTES, effects=[TentSnow()], foreground=np.ones((H, W))),
    "a depth": fl.Scene(BYTES, effects=[TentSnow(), fl.Rain()], depth=40.0),
    "turning": fl.Scene(BYTES, effects=[TentSnow()], camera=TURNING),
    "still": fl.Scene(BYTES, effects=[TentSnow(**STILL)]),
    "local light": fl.Scene(BYTES, effects=[fl.Snow(color="local")]),
    "lamps": fl.Scene(BYTES, effects=[fl.Snow(), TentSnow()], lights=[LAMP]),
    "gas": fl.Scene(BYTES, effects=[fl.Mist(), fl.Mist("clouds")], sun=fl.scene.Sun()),
    "a cone": fl.Scene(BYTES, effects=[ConeRain(), ConeSnow()]),
}  # fmt: skip


@pytest.mark.parametrize("case", SCENES)
def test_a_plan_names_the_steps_that_run(case: str):
    scene = SCENES[case]
    plan, said = scene.plan(3), scene.plan(3, probe=False)
    ran = traced(scene.replace(seed=4), 3.0)[1]
    assert {step.name.rpartition(": ")[2] for step in plan.steps} == set(ran.sums("calls"))
    assert [step.name for step in plan.steps] == [step.name for step in said.steps]
    assert len({step.name for step in plan.steps}) == len(plan.steps)
    assert said.left_out == plan.left_out
    for step in plan.steps:
        assert step.milliseconds is not None and step.milliseconds > 0.0
        assert step.bytes is not None and step.bytes >= 0
    assert plan.rest is not None and plan.milliseconds is not None
    times = [step.milliseconds or 0.0 for step in plan.steps if not step.once]
    assert plan.milliseconds == pytest.approx(sum(times) + plan.rest)


def test_times_and_bytes_are_those_of_the_step():
    plan = fl.Scene(BYTES, effects=[Large(), TentSnow()]).plan("1-9")
    (step,) = (step for step in plan.steps if step.name == "large: work")
    assert step.milliseconds is not None and step.milliseconds >= 20.0
    assert plan.milliseconds is not None and plan.milliseconds >= step.milliseconds
    assert step.bytes is not None and 50_000_000 <= step.bytes < 50_200_000
    others = [one.bytes or 0 for one in plan.steps if one is not step]
    assert max(others) < 1_000_000 and plan.bytes is not None
    assert step.bytes <= plan.bytes < step.bytes + 4_000_000
    # A still is one frame, with all that the first takes.
    still = fl.Scene(BYTES, effects=[Large()]).plan()
    assert still.frames[2] == 1 and still.first is not None and still.first >= 20.0


def test_a_plan_probes_the_frames_that_it_says():
    def probed(frames: Any, **fields: Any) -> tuple[int, ...]:
        seen: list[int] = []
        plan = fl.Scene(size=(8, 8), effects=[Large(seen, **fields), fl.Mist()]).plan(frames)
        assert sorted(seen) == sorted(2 * [t for t in plan.probed if t in seen])
        return plan.probed

    assert probed(7) == (7,)
    assert probed("3-12") == (3, 7, 12)
    early = fl.Keys([(t, 0.5 + 0.01 * t) for t in range(1, 9)])
    assert {0, 49, 99} < set(probed("0-99", amount=early))
    # A short burst is met, and no more than five frames are rendered.
    burst = fl.Keys([(100, 0.0), (103, 1.0), (106, 0.0)])
    assert {0, 103, 999} <= set(probed("0-999", amount=burst))
    many = fl.Keys([(t, 0.5 + 0.001 * t) for t in range(0, 90, 5)])
    assert len(probed("0-99", amount=many)) == planning.PROBED


def test_without_a_probe_nothing_runs():
    seen: list[int] = []
    with tracing() as trace:
        plan = fl.Scene(BYTES, effects=[Large(seen)]).plan("1-9", probe=False)
    assert not trace.sums("calls") and plan.probed == () and not seen
    assert plan.milliseconds is plan.bytes is plan.rest is None
    assert [(step.name, step.milliseconds, step.bytes) for step in plan.steps] == [
        (name, None, None) for name in ("background", "large: work", "composite")
    ]
    assert "without times" in str(plan)


def test_the_command_line_prints_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file = str(tmp_path / "scene.toml")
    fl.Scene("#203040", size=(64, 48), effects=[TentSnow(), TentRain(amount=0.0)]).save(file)
    assert main(["plan", file, "--frames", "3-9", "--no-probe"]) == 0
    text = capsys.readouterr().out
    assert text.strip() == str(fl.open(file).plan("3-9", probe=False))
    assert main(["plan", file, "--frames", "3", "--json", "--accuracy"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["milliseconds"] > 0.0 and values["bytes"] > 0 and values["probed"] == [3]
    plan = fl.open(file).plan("3-9")
    text, page = str(plan), plan._repr_html_()
    assert json.loads(plan.to_json()) == json.loads(json.dumps(plan.to_dict()))
    assert all(step.name in text and step.name in page for step in plan.steps)
    assert "measured in frames 3, 6, 9" in text and "its amount is 0" in text


def test_accuracy_is_that_of_the_frame_with_other_hand_overs():
    snow = fl.Snow(density=40.0, far=20.0, seed=3)
    scene = fl.Scene(BYTES, effects=[snow, TentRain(seed=1)])
    found = scene.plan("2-8", probe=False, accuracy=True).accuracy
    assert found is not None and found.frame == 5 and found.why == ""
    *near, drawn = found.settings
    depths = [float(one.setting.split()[2]) for one in near]
    assert np.divide(depths, depths[1]) == pytest.approx([0.5, 1.0, 2.0], rel=0.02)
    assert drawn.setting == "every flake drawn"
    every = scene.replace(effects=[replace(snow, method="simulated"), scene.effects[1]])
    pinned = scene.replace(effects=[replace(snow, handover=depths[2]), scene.effects[1]])
    for one, same in ((near[1], scene), (drawn, every), (near[2], pinned)):
        alpha = same.layers(5).alpha
        assert one.rms == pytest.approx(float(alpha.std()), rel=5e-3)
        assert one.euler == pytest.approx(judges.euler(alpha > np.percentile(alpha, 99.0)), rel=0.1)
    assert all(one.milliseconds > 0.0 for one in found.settings)
    assert all(one.setting in str(scene.plan(5, probe=False, accuracy=True)) for one in near)


def test_accuracy_says_where_the_hand_over_has_no_say():
    few = fl.Scene(size=(64, 48), effects=[fl.Snow(density=0.01, far=10.0)])
    again = fl.Scene(size=(64, 48), effects=[fl.Snow(far=10.0)], loop=9)
    for one in (few, again):
        found = one.plan(2, probe=False, accuracy=True).accuracy
        assert found is not None and "`handover` has no say" in found.why
        assert [one.setting for one in found.settings] == ["as is", "every flake drawn"]
    for effects in ([TentSnow()], [fl.Snow(method="simulated")]):
        found = fl.Scene(BYTES, effects=effects).plan(2, probe=False, accuracy=True).accuracy
        assert found is not None and found.settings == () and "draws near flakes" in found.why

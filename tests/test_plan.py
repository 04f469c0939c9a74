"""The plan: what is left out runs no step, and frames have the bits that they have with all."""

from __future__ import annotations

import json
import subprocess
import sys
import tracemalloc
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.camera import Camera
from flurries.effects.layout import Tiling, torus_for
from flurries.frame import calibration, planes, standing
from flurries.frame.effect import renderer_of
from flurries.frame.needs import Cost, LeftOut, Needs, Step

W, H = 200, 150
RNG = np.random.default_rng(41)
BYTES = RNG.integers(0, 256, (H, W, 3)).astype(np.uint8)
LIGHT = RNG.gamma(1.0, 0.5, (H, W, 3)).astype(np.float32)
STILL: dict[str, Any] = {"fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for the calibration, so that tests leave nothing in the user's."""
    monkeypatch.setenv("FLURRIES_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@dataclass(frozen=True)
class Everything:
    """An effect that takes all its steps and is told of nothing that cannot be seen."""

    effect: Any
    seed: int = 0

    def needs(self, frame: fl.Frame) -> Needs:
        names = ("texture", "flakes", "veil") if frame.deep else ("texture", "flakes")
        return Needs(tuple(map(Step, names)), reads=frozenset({"depth"}))

    def render(self, frame: fl.Frame) -> Any:
        assert frame.run is not None
        run = replace(frame.run, kept=None, visible=None)
        return renderer_of(self.effect).render(replace(frame, run=run))


def both(effect: Any, picture: Any = BYTES, **more: Any) -> tuple[fl.Scene, fl.Scene]:
    """The scene, and the one in which everything is computed."""
    whole = Everything(replace(effect, seed=5), seed=5)
    return (
        fl.Scene(None, picture, effects=[replace(effect, seed=5)], **more),
        fl.Scene(None, picture, effects=[whole], **more),
    )


def traced(scene: fl.Scene, t: float = 7.0, **more: Any) -> tuple[Any, fl.trace.Trace]:
    with fl.trace.tracing() as trace:
        image = scene.render(t, **more)
    return image, trace


def left_out(scene: fl.Scene, frames: Any = 7) -> dict[str, str]:
    return {one.what: one.why for one in scene.plan(frames).left_out}


# What is left out: (effect, more of the scene, steps that must not run, words of the plan)
ABSENT: dict[str, tuple[Any, dict[str, Any], set[str], str]] = {
    "amount 0": (fl.TentSnow(amount=0.0), {}, {"texture", "flakes", "veil", "join"}, "snow"),
    "rain amount 0": (fl.TentRain(amount=0.0), {}, {"texture", "flakes", "veil", "join"}, "rain"),
    "no texture": (fl.TentSnow(texture=0.0), {}, {"texture"}, "snow: texture"),
    "no flakes": (fl.TentSnow(flakes=0), {}, {"flakes"}, "snow: flakes"),
    "clear flakes": (fl.TentSnow(flake_opacity=0.0), {}, {"flakes"}, "snow: flakes"),
    "no haze": (fl.TentSnow(haze=0.0), {"depth": 30.0}, {"veil"}, "snow: veil"),
    "half a step": (fl.TentSnow(amount=2e-5, flakes=0), {}, {"texture", "join"}, "snow"),
}


@pytest.mark.parametrize("case", ABSENT)
def test_what_shows_nothing_is_not_made(case: str):
    effect, more, absent, words = ABSENT[case]
    planned, whole = both(effect, **more)
    image, trace = traced(planned)
    assert not absent & set(trace.calls)
    want, full = traced(whole)
    assert np.array_equal(image, want)
    assert absent & set(full.calls), "the control runs what the plan leaves out"
    assert words in left_out(planned)


@pytest.mark.parametrize("space", ["display", "linear"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_less_than_half_a_step_is_left_out_and_more_is_not(space: str, dtype: Any):
    picture = BYTES.astype(dtype) * (257 if dtype == np.uint16 else 1)
    bare = fl.Scene(None, picture, space=space).render(0)
    step = 1.0 / np.iinfo(dtype).max
    for veil in np.array([0.01, 0.03, 0.3, 0.49, 0.7, 3.0]) * step:
        # White over all values there are, several layers of it.
        effect = fl.TentSnow(texture=0.0, flakes=0, haze=veil, color=1.0)
        scene = fl.Scene(None, picture, effects=[effect] * 3, space=space)
        image, trace = traced(scene)
        if "join" not in trace.calls:
            whole = fl.Scene(None, picture, effects=[Everything(effect)] * 3, space=space)
            assert np.array_equal(image, whole.render(7)) and np.array_equal(image, bare)
        if veil > 0.5 * step:
            assert "join" in trace.calls and not np.array_equal(image, bare)
        if veil < (0.49 * step if space == "display" else 0.011 * step):
            assert "join" not in trace.calls


def test_floats_and_layers_show_everything():
    effect = fl.TentSnow(texture=0.0, flakes=0, haze=1e-6, color=1.0)
    bright = fl.Scene(None, LIGHT, effects=[effect])
    assert "join" in traced(bright)[1].calls
    layers = fl.Scene(None, BYTES, effects=[effect]).render(0, layers=True)
    assert np.allclose(layers.alpha, 1e-6, rtol=0.06) and list(layers.layers) == ["snow"]


def test_a_flake_that_is_there_is_never_left_out():
    snow = fl.TentSnow(amount=1e-3, flakes=1500, texture=0.0, haze=0.0)
    scene = fl.Scene(None, BYTES, effects=[snow])
    seen = [np.abs(scene.render(t).astype(int) - BYTES).max() for t in range(0, 400, 20)]
    listed = [len(fl.flakes(scene, t)) for t in range(0, 400, 20)]
    assert all(bool(a) <= bool(b) for a, b in zip(seen, listed, strict=True))
    assert max(seen) > 5 and min(listed) == 0


def test_tiles_behind_a_matte_are_not_made():
    matte = np.ones((H, W), np.float32)
    matte[:40, :30] = matte[-5:, -20:] = 0.25
    matte[60, 100] = 0.999
    planned, whole = both(fl.TentSnow(tile=16, overlap=4), foreground=matte)
    image, trace = traced(planned)
    want, full = traced(whole)
    assert np.array_equal(image, want)
    assert 0 < trace.counts["tiles"] < 0.5 * full.counts["tiles"]
    assert "they are behind what stands in front" in left_out(planned).values()
    # Layers say more of their pixels, and are whole.
    assert np.array_equal(planned.render(7, layers=True).alpha, whole.render(7, layers=True).alpha)


def test_nothing_is_made_where_all_is_hidden():
    front = np.zeros((H, W, 4), np.uint8)
    front[..., 3] = 255
    for foreground in (np.ones((H, W), np.float32), front):
        planned, whole = both(fl.TentSnow(), foreground=foreground)
        image, trace = traced(planned)
        assert np.array_equal(image, whole.render(7))
        assert set(trace.calls) == {"background", "composite"}
        assert left_out(planned)["all effects"] == "they are behind what stands in front"
    # The layers themselves are whole under a picture.
    assert planned.render(7, layers=True).alpha.max() > 0.0


@pytest.mark.parametrize("kind", ["bytes", "light", "bytes in linear light"])
@pytest.mark.parametrize("front", ["mask", "picture"])
def test_only_the_part_that_is_seen_is_made(kind: str, front: str):
    cover = np.zeros((H, W), np.float32)
    cover[70:] = cover[:, :20] = 1.0
    foreground: Any = cover
    if front == "picture":
        foreground = np.dstack([RNG.random((H, W, 3), np.float32) * cover[..., None], cover])
    more: dict[str, Any] = {"space": "linear"} if kind.endswith("linear light") else {}
    picture = LIGHT if kind == "light" else BYTES
    planned, whole = both(fl.TentSnow(), picture, foreground=foreground, **more)
    for part in (None, np.s_[30:90, 10:60], np.s_[80:90, 5:60]):
        image, trace = traced(planned, region=part)
        # With the layers apart all of the window is made.
        want, full = traced(whole, region=part, layers=True)
        assert np.array_equal(image, want.image)
        assert trace.counts.get("tiles", 0) < full.counts["tiles"]


def test_a_region_makes_its_own_tiles_and_flakes():
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(tile=16, overlap=4)])
    image, trace = traced(scene, region=np.s_[100:110, 20:40])
    want, full = traced(scene)
    assert np.array_equal(image, want[100:110, 20:40])
    assert trace.counts["tiles"] < 0.05 * full.counts["tiles"]


def test_a_near_wall_has_no_texture_before_it():
    planned, _ = both(fl.TentSnow(flakes=0), depth=2.0)
    depth = np.full((H, W), 2.0, np.float32)
    depth[:, 150:] = np.inf
    half, whole = both(fl.TentSnow(flakes=0), depth=depth)
    image, trace = traced(half)
    assert np.array_equal(image, traced(whole)[0])
    assert traced(planned)[1].counts["tiles"] == 0
    every = traced(fl.Scene(None, BYTES, effects=[fl.TentSnow(flakes=0)]))[1].counts["tiles"]
    assert 0 < trace.counts["tiles"] < 0.6 * every


def test_waves_too_fast_everywhere_make_no_tiles():
    # Tiles of odd size and a motion along no lattice direction: nothing stands still.
    for fall, wind, made in ((4e5, 1.3e5, False), (1.0, 0.0, True)):
        fast = {"fall": fall, "wind": (wind, 0.0, 0.0), "alias": "cut"}
        snow = fl.TentSnow(flakes=0, tile=15, overlap=3, **fast)
        image, trace = traced(fl.Scene((W, H), effects=[snow]))
        assert (trace.counts["tiles"] > 0) == (image.std() > 0.0) == made


def test_a_part_of_a_flight_has_the_flakes_of_the_whole():
    turning = fl.Keys([(0, (0.0, 0.0, 0.0)), (40, (0.1, 0.5, 0.0))])
    lens = Camera(180.0, aspect=1.7)
    forward = fl.CameraPath(lens, velocity=(0.3, 0.0, 9.0), orientation=turning)
    for effect in (
        fl.TentSnow(texture=0.0, flakes=900, shutter=0.9, flake_size=(0.01, 0.2), seed=2),
        fl.TentRain(texture=0.0, drops=500, shutter=1.5, seed=2),
    ):
        scene = fl.Scene(None, BYTES, effects=[effect], camera=forward)
        part = np.s_[40:47, 60:99]
        assert np.array_equal(scene.render(17.0, region=part), scene.render(17.0)[part])


def test_one_eye_for_two_at_distance_0():
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow()])
    with fl.trace.tracing() as trace:
        left, right = scene.stereo(4, distance=0.0)
    assert trace.calls["texture"] == 1
    assert np.array_equal(left, right) and np.array_equal(left, scene.render(4))
    with fl.trace.tracing() as trace:
        left, right = scene.stereo(4, distance=0.06)
    assert trace.calls["texture"] == 2 and not np.array_equal(left, right)


@pytest.mark.parametrize("layers", [False, True])
def test_what_never_moves_is_made_once(layers: bool):
    planned, whole = both(fl.TentSnow(**STILL))
    with fl.trace.tracing() as trace:
        images = [planned.render(t, layers=layers) for t in (0, 5, 0.5)]
    assert trace.calls["texture"] == trace.calls["flakes"] == 1
    for t, image in zip((0, 5, 0.5), images, strict=True):
        want = whole.render(t, layers=layers)
        if layers:
            assert image.alpha.flags.writeable
            image, want = image.alpha, want.alpha
        assert np.array_equal(image, want)
    assert {step.name for step in planned.plan("1-5").steps if step.once} == {
        "snow: texture",
        "snow: flakes",
    }
    # Another eye or another window is another frame; the color may change.
    eye = Camera(100.0)
    assert np.array_equal(planned.render(3, eye=eye), whole.render(3, eye=eye))
    part = np.s_[3:50, 7:90]
    assert np.array_equal(planned.render(3, region=part), whole.render(3)[part])
    # Kept results do not travel, and do not count as a difference.
    import pickle

    assert np.array_equal(pickle.loads(pickle.dumps(planned)).render(9), whole.render(9))


@pytest.mark.parametrize(
    "change",
    [
        {"fall": 0.1},
        {"wind": (0.0, 0.0, 0.1)},
        {"wind": fl.Keys([(0, (0.0, 0.0, 0.0)), (9, (0.0, 0.0, 0.0))])},
        {"amount": fl.Keys([(0, 1.0), (9, 0.9)])},
        {"mean": fl.Keys([(0, 0.1), (9, 0.2)])},
    ],
)
def test_what_may_move_is_made_each_time(change: dict[str, Any]):
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(**{**STILL, **change})])
    with fl.trace.tracing() as trace:
        scene.render(0), scene.render(5)
    assert trace.calls["texture"] == 2
    moving = fl.CameraPath(Camera(200.0), velocity=(1.0, 0.0, 0.0))
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(**STILL)], camera=moving)
    with fl.trace.tracing() as trace:
        scene.render(0), scene.render(5)
    assert trace.calls["texture"] == 2


def test_six_effects_of_amount_0_are_the_empty_scene():
    six = fl.Scene(None, BYTES, effects=[fl.TentSnow(amount=0.0), fl.TentRain(amount=0.0)] * 3)
    empty = fl.Scene(None, BYTES)
    image, trace = traced(six)
    assert np.array_equal(image, BYTES)
    assert list(trace.calls) == list(traced(empty)[1].calls) == ["background", "composite"]
    peaks = []
    for scene in (six, empty):
        scene.render(1)
        tracemalloc.start()
        scene.render(2)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert abs(peaks[0] - peaks[1]) < 4096


def test_an_unread_depth_is_not_read():
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(amount=0.0)], depth=30.0)
    assert "depth" not in traced(scene)[1].calls
    assert left_out(scene)["depth"] == "nothing reads it"
    scene = scene.replace(effects=[fl.TentSnow()])
    assert "depth" in traced(scene)[1].calls


def test_amounts_that_are_keyed_count_frame_by_frame():
    amount = fl.Keys([(0, 0.0), (10, 0.0), (20, 1.0)])
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(amount=amount)])
    assert "texture" not in traced(scene, 5.0)[1].calls
    assert "texture" in traced(scene, 15.0)[1].calls
    plan = scene.plan("0-20")
    assert 0.0 < next(s.share for s in plan.steps if s.name == "snow: texture") < 1.0
    assert "% of frames" in left_out(scene, "0-20")["snow"]
    # A long film is not looked at frame by frame, but no key of it is missed.
    burst = fl.TentSnow(amount=fl.Keys([(100, 0.0), (103, 1.0), (106, 0.0)]))
    steps = fl.Scene(None, BYTES, effects=[burst]).plan("0-999").steps
    assert "snow: texture" in {step.name for step in steps}


def test_gas_of_one_color_is_not_sorted():
    gas = fl.Mist.preset("mist", wind=(0.3, 0.0, 0.0))
    sun = fl.Sun((0.0, 1.0, 0.0), 1.0, ambient=1.0)
    plain = fl.Scene(None, BYTES, effects=[gas])
    image, trace = traced(plain)
    assert "gas" in trace.calls and "lit gas" not in trace.calls
    assert left_out(plain)["mist: sort"] == "its particles have one color"
    # All light is even: with colors and a sort it is the same, within a step of rounding.
    want, full = traced(plain.replace(sun=sun))
    assert "lit gas" in full.calls
    assert np.abs(image.astype(int) - want).max() <= 1


@pytest.mark.parametrize(
    "effect",
    [fl.Mist(amount=0.0), fl.Mist(count=0), fl.ConeRain(amount=0.0), fl.ConeSnow(amount=0)],
)
def test_no_gas_and_no_cone(effect: Any):
    image, trace = traced(fl.Scene(None, BYTES, effects=[effect]))
    assert set(trace.calls) == {"background", "composite"}
    assert np.array_equal(image, BYTES)


def test_gas_that_stands_still_is_made_once():
    cloud = fl.Mist.preset("clouds", center=(0.0, 0.0, 6.0))
    for sun, name in ((None, "gas"), (fl.Sun(), "lit gas")):
        scene = fl.Scene(None, BYTES, effects=[cloud], sun=sun)
        with fl.trace.tracing() as trace:
            images = [scene.render(t) for t in (0, 4, 9)]
        assert trace.calls[name] == 1
        for image, t in zip(images, (0, 4, 9), strict=True):
            assert np.array_equal(image, scene.replace(fps=30.0).render(t))
        # The background's light is the color of what is kept; the sun's light is made of it.
        grows = fl.Keys([(0, 0.5), (9, 1.0)])
        for change, calls in (({"wind": (0.1, 0.0, 0.0)}, 2), ({"amount": grows}, 2),
                              ({"color": "ambient"}, 2 if sun else 1)):  # fmt: skip
            moving = scene.replace(effects=[replace(cloud, **change)])
            with fl.trace.tracing() as trace:
                moving.render(0), moving.render(4)
            assert trace.calls[name] == calls


def test_gas_that_is_kept_has_the_light_of_each_frame(tmp_path):
    for number, level in enumerate((40, 200)):
        fl.io.write_picture(tmp_path / f"{number}.png", np.full((H, W, 3), level, np.uint8))
    cloud = fl.Mist.preset("clouds", center=(0.0, 0.0, 6.0), color="ambient")
    scene = fl.Scene(None, str(tmp_path / "%d.png"), effects=[cloud])
    with fl.trace.tracing() as trace:
        dark, bright = (scene.render(t) for t in (0, 1))
    assert trace.calls["gas"] == 1
    alone = (scene.replace(fps=30.0).render(t, layers=True) for t in (0, 1))
    for image, whole in zip((dark, bright), alone, strict=True):
        assert np.abs(image - whole.image.astype(float)).max() <= 1
    covered = whole.alpha > 0.5
    assert dark[covered].mean() < 0.5 * bright[covered].mean()


def test_a_cone_without_light_is_only_a_veil():
    effect = fl.ConeSnow(gain=0.0, flakes=0)
    image, trace = traced(fl.Scene(None, BYTES, effects=[effect]))
    assert not {"cone", "flakes"} & set(trace.calls) and "join" in trace.calls
    assert not np.array_equal(image, BYTES)


# One torus ---------------------------------------------------------------------------------------


def test_a_torus_is_taken_where_it_is_cheaper():
    cheap = Tiling((300, 300), 260)
    torus, why = torus_for((512, 512), cheap, (8.0, 32.0), 0.0)
    assert torus == Tiling((512, 512), 0) and "ms" in why
    assert torus_for((512, 512), Tiling((64, 64), 10), (3.0, 24.0), 0.0)[0] is None
    assert torus_for((512, 509), cheap, (8.0, 32.0), 0.0)[0] is None, "509 is a prime"
    assert torus_for((512, 512), cheap, (8.0, 32.0), 600.0)[0] is None
    assert torus_for((256, 256), cheap, (8.0, 32.0), 0.0)[0] is None


# Rain whose streaks need tiles so large that one torus is cheaper.
WIDE = {"drops": 0, "haze": 0.0, "wavelengths": (4.0, 16.0)}


def test_frames_of_a_torus_agree_and_have_equal_statistics():
    def scene(seed: int, **more: Any) -> fl.Scene:
        effect = fl.TentRain(**WIDE, seed=seed)
        return fl.Scene((192, 192), effects=[effect], **more)

    one = scene(1)
    image, trace = traced(one)
    assert trace.counts["tiles"] == 1
    assert "as one torus" in left_out(one)["rain: tiles"]
    part = np.s_[50:90, 100:130]
    assert np.array_equal(one.render(7, region=part), image[part])
    eye = Camera(230.4, offset=(0.1, 0.0, 0.0))
    assert np.array_equal(one.render(7, eye=eye), one.render(7, eye=eye))
    # A camera that goes forward, a wind over depth or a depth needs tiles: for the whole film.
    forward = fl.CameraPath(
        Camera(200.0), velocity=fl.Keys([(0, (0.0,) * 3), (9, (0.0, 0.0, 1.0))])
    )
    for more in ({"camera": forward}, {"depth": 1e4}):
        assert traced(scene(1, **more), 0.0)[1].counts["tiles"] > 1
    # Means and variances over seeds: the same law within three standard errors.
    stats = {}
    for name, more in (("torus", {}), ("tiles", {"tile": 136, "overlap": 22})):
        scenes = [
            fl.Scene((192, 192), effects=[fl.TentRain(**WIDE, **more, seed=s)]) for s in range(24)
        ]
        made = [one.render(3, layers=True).alpha.astype(np.float64) for one in scenes]
        stats[name] = np.array([(a.mean(), a.var(), (a[1:] * a[:-1]).mean()) for a in made])
    apart = stats["torus"].mean(axis=0) - stats["tiles"].mean(axis=0)
    error = np.sqrt(sum(s.var(axis=0, ddof=1) / len(s) for s in stats.values()))
    assert (np.abs(apart) < 3.5 * error).all(), (apart, error)


# What others write -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Own:
    """Somebody's effect without needs."""

    def render(self, frame: fl.Frame) -> fl.Layer:
        top, bottom, left, right = frame.window
        return fl.Layer("own", np.full((bottom - top, right - left), 0.5, np.float32))


@dataclass(frozen=True)
class Priced(Own):
    """Somebody's effect that says what it needs."""

    amount: Any = 1.0

    def needs(self, frame: fl.Frame) -> Needs:
        if self.amount == 0.0:
            return Needs((), (LeftOut("priced", "its amount is 0"),), most=0.0)
        pixels = frame.shape[0] * frame.shape[1]
        return Needs(
            (Step("paint", lambda: Cost({"array pixel": pixels}, "one plane", 4 * pixels)),)
        )


@dataclass(frozen=True)
class Careless(Own):
    """Somebody's effect that writes to what is kept for it."""

    def needs(self, frame: fl.Frame) -> Needs:
        return Needs((Step("paint", once=True),))

    def render(self, frame: fl.Frame) -> fl.Layer:
        layer = frame.steps_of(self)("paint", lambda: Own.render(self, frame))
        assert layer is not None
        layer.alpha[...] *= 0.5
        return layer


@dataclass(frozen=True)
class Wrong(Own):
    def needs(self, frame: fl.Frame) -> Any:
        return ["paint"]


def test_effects_of_others():
    scene = fl.Scene(None, BYTES, effects=[Own(), Priced(), Priced(0.0)])
    _, trace = traced(scene)
    assert trace.calls["own"] == 1
    assert [step.name for step in scene.plan(1).steps] == [
        "frame", "background", "own", "priced: paint", "composite",
    ]  # fmt: skip
    assert left_out(scene)["priced"] == "its amount is 0"
    with pytest.raises(ValueError, match="read-only"):
        fl.Scene(None, BYTES, effects=[Careless()]).render(0)
    with pytest.raises(TypeError, match=r"Wrong\.needs must return Needs, got list"):
        fl.Scene(None, BYTES, effects=[Wrong()]).render(0)


# The plan itself ---------------------------------------------------------------------------------


def test_a_plan_says_the_same_in_all_forms(capsys: pytest.CaptureFixture[str]):
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow(), fl.TentRain(amount=0.0)])
    plan = scene.plan("1-40")
    text, values, page = str(plan), json.loads(plan.to_json()), plan._repr_html_()
    assert values == json.loads(json.dumps(plan.to_dict()))
    assert values["frames"] == {"first": 1, "last": 40, "count": 40}
    assert [one["name"] for one in values["steps"]] == [step.name for step in plan.steps]
    for step in plan.steps:
        assert step.name in text and step.name in page and step.milliseconds >= 0.0
    assert "rain" in text and "its amount is 0" in text and "its amount is 0" in page
    assert plan.milliseconds == pytest.approx(sum(step.milliseconds for step in plan.steps))
    assert page.count("<table") == page.count("</table>") == 2
    assert "<script" not in fl.Scene((8, 8), effects=[Named()]).plan(1)._repr_html_()


@dataclass(frozen=True)
class Named(Own):
    NAME = "<script>"


def test_plans_are_pure_and_leave_frames_alone():
    def scene() -> fl.Scene:
        return fl.Scene(None, BYTES, effects=[fl.TentSnow()])

    looked = scene()
    with fl.trace.tracing() as trace:
        plans = [looked.plan(5).to_dict() for _ in range(2)]
    assert not trace.calls and plans[0] == plans[1]
    assert np.array_equal(looked.render(5), scene().render(5))


@pytest.mark.parametrize("frames", ["3-1", "x", [], -1, 1.5])
def test_frames_are_refused_by_name(frames: Any):
    with pytest.raises((ValueError, TypeError), match="frame"):
        fl.Scene((8, 8)).plan(frames)


def test_bytes_are_foreseen(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(planes, "MOST", 0)
    planes._free.clear()
    matte = np.zeros((H, W), np.float32)
    matte[90:] = 1.0
    picture = np.tile(BYTES, (3, 3, 1))
    big = np.tile(matte, (3, 3))
    scenes = [
        fl.Scene(None, picture),
        fl.Scene(None, picture, effects=[fl.TentSnow()]),
        fl.Scene(None, picture, effects=[fl.TentSnow(texture=0.0, flakes=30000)]),
        fl.Scene(None, picture, effects=[fl.TentSnow(), fl.TentSnow(flakes=0)]),
        fl.Scene(None, picture, effects=[fl.TentSnow()], foreground=big),
        fl.Scene(None, picture, effects=[fl.TentSnow()], space="linear"),
        fl.Scene(None, picture, effects=[fl.TentSnow()], depth=40.0),
        fl.Scene(
            None,
            picture,
            effects=[fl.TentSnow(haze=0.0)],
            camera=fl.CameraPath(
                Camera(500.0), orientation=fl.Keys([(0, (0.0,) * 3), (9, (0.0, 0.1, 0.0))])
            ),
        ),
        fl.Scene(None, picture, effects=[fl.TentSnow(**STILL)]),
        fl.Scene(None, np.tile(LIGHT, (3, 3, 1)), effects=[fl.TentSnow.preset("light")]),
    ]
    for scene in scenes:
        scene.render(2)
        plan = scene.plan(3)
        standing._KEPT.clear()  # What a depth that stays keeps is made anew, and foreseen.
        tracemalloc.start()
        scene.render(3)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert plan.bytes == pytest.approx(most, rel=0.1), str(plan)


def test_the_command_line_prints_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    from flurries.cli import main

    scene = fl.Scene((64, 48), "#203040", effects=[fl.TentSnow(), fl.TentRain(amount=0.0)])
    scene.save(tmp_path / "scene.toml")
    assert main(["plan", str(tmp_path / "scene.toml"), "--frames", "3-9"]) == 0
    text = capsys.readouterr().out
    assert text.strip() == str(fl.Scene.load(tmp_path / "scene.toml").plan("3-9"))
    assert main(["plan", "#203040", "--snow", "heavy", "--json", "--calibrate"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert {"steps", "left_out", "milliseconds", "bytes"} <= set(values)
    assert main(["plan", str(tmp_path / "scene.toml"), "--frames", "9-3"]) == 2
    assert "Traceback" not in capsys.readouterr().err


# Calibration -------------------------------------------------------------------------------------


def test_a_calibration_is_measured_once_and_scales_times_alone(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
):
    scene = fl.Scene(None, BYTES, effects=[fl.TentSnow()])
    count = fl.threads()
    for threads in (3, count):
        fl.set_threads(threads)
        first = scene.plan(3)
    stored = json.loads((cache / "calibration.json").read_text())
    assert len(stored) == 1 + (count != 3)
    monkeypatch.setattr(calibration, "measure", lambda: pytest.fail("measured again"))
    # The same file somewhere else: read, as by another process.
    for name, times in (("same", 1.0), ("slow", 10.0)):
        # A machine ten times as slow takes the same steps.
        slower = {key: {kind: times * value for kind, value in each.items()}
                  for key, each in stored.items()}  # fmt: skip
        (tmp_path / name).mkdir()
        text = json.dumps(slower)
        (tmp_path / name / "calibration.json").write_text(text)
        monkeypatch.setenv("FLURRIES_CACHE", str(tmp_path / name))
        plan = scene.plan(3)
        assert plan.milliseconds == pytest.approx(times * first.milliseconds)
        assert [(s.name, s.size, s.bytes) for s in plan.steps] == [
            (s.name, s.size, s.bytes) for s in first.steps
        ]
        assert plan.left_out == first.left_out


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"machine": 3}', "[[1, 2], [3]]", "\0"])
def test_a_spoilt_calibration_is_made_again(
    text: str, cache: Path, monkeypatch: pytest.MonkeyPatch
):
    cache.mkdir()
    (cache / "calibration.json").write_text(text)
    monkeypatch.setattr(calibration, "measure", lambda: {"kernel": 2.0, "array": 3.0})
    assert calibration.scales() == {"kernel": 2.0, "array": 3.0}
    stored = json.loads((cache / "calibration.json").read_text())
    assert {"kernel": 2.0, "array": 3.0} in stored.values()


def test_a_folder_that_cannot_be_written_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FLURRIES_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(calibration, "measure", lambda: {"kernel": 2.0, "array": 3.0})
    assert calibration.scales() == {"kernel": 2.0, "array": 3.0}


def test_rendering_asks_no_clock_and_imports_nothing_more():
    code = """
import sys
import flurries as fl
fl.Scene, fl.TentSnow, fl.TentRain
before = set(sys.modules)
scene = fl.Scene((32, 24), "#102030", effects=[fl.TentSnow(amount=0.0), fl.TentRain(amount=0.0)])
scene.render(1)
new = {name for name in set(sys.modules) - before if name.startswith(("flurries", "Open", "av"))}
assert not {n for n in new if n.split(".")[1:2] in (["gas"], ["cone"])}, new
assert not {"OpenImageIO", "av", "skimage", "scipy", "tqdm"} & set(sys.modules)
assert "flurries.frame.calibration" not in new
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)

"""Large frames in bands of rows: the bits of the whole, at its cost, with a band's memory."""

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.frame import bands
from flurries.frame.needs import Needs, Step

H, W = 220, 110
RANDOM = np.random.default_rng(1)
BYTES = RANDOM.integers(0, 255, (H, W, 3), dtype=np.uint8)
LIGHT = (2.0 * RANDOM.random((H, W, 3))).astype(np.float32)
ROUGH = np.where(RANDOM.random((H, W)) < 0.2, np.inf, 2.0 + 30.0 * RANDOM.random((H, W)))
SLOPE = np.add.outer(np.linspace(3.0, 40.0, H), np.linspace(0.0, 9.0, W))
MASK = np.zeros((H, W))
MASK[:70], MASK[100:160, 25:], MASK[160:190] = 1.0, 1.0, 0.5
FRONT = np.dstack([BYTES, RANDOM.integers(0, 255, (H, W), dtype=np.uint8)])
STILL: dict[str, Any] = {"fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}

EFFECTS: dict[str, Any] = {
    "snow": TentSnow(flakes=400), "heavy": TentSnow("heavy"), "rain": TentRain("rain"),
    "gusts": TentSnow(flakes=300, wind=fl.Wind((1.0, 0.0, 0.0), gusts=0.5)),
    "texture alone": TentSnow(flakes=0), "flakes alone": TentSnow(texture=0.0),
    "still": TentSnow(flakes=200, **STILL), "by pixel": TentSnow(flakes=200, depth_mode="pixel"),
    "mist": fl.Mist(count=300), "moving mist": fl.Mist(count=300, wind=(1.0, 0.0, 0.0)),
    "cone rain": ConeRain(), "cone snow": ConeSnow(), "flakes and layers": fl.Snow("heavy"),
    "valley": fl.Mist("valley", wind=(1.0, 0.2, 0.5), top=2.0),
    "local light": fl.Snow("heavy", color="local", haze=0.1), "drops": fl.Rain("downpour"),
    "profile": TentSnow(flakes=100, wind=fl.Wind(profile=[(6.0, 1.0), (24.0, -1.5)])),
    "field": TentSnow(flakes=100, wind=fl.Wind(field=RANDOM.normal(size=(2, 3, 3, 3, 3)))),
}  # fmt: skip
FORWARD = fl.CameraPath(
    fl.Camera(150.0),
    velocity=fl.Keys([(0, (0.5, 0.0, 0.0)), (6, (0.5, 0.0, 2.0)), (40, (0, -3, -4))]),
)
TURNING = fl.CameraPath(
    fl.Camera(150.0), orientation=fl.Keys([(0, (0.0, 0.0, 0.0)), (40, (0.0, 0.5, 0.2))])
)
SUN = fl.scene.Sun((0.2, 1.0, 0.3))
SCENES: dict[str, dict[str, Any]] = {
    "bytes": {"background": BYTES}, "clear bytes": {"background": FRONT},
    "light": {"background": LIGHT, "sun": SUN},
    "bytes in linear light": {"background": BYTES, "space": "linear", "sun": SUN},
    "light in display values": {"background": LIGHT, "space": "display"},
    "depth": {"background": BYTES, "depth": ROUGH},
    "smooth depth": {"background": LIGHT, "depth": SLOPE},
    "mask": {"background": LIGHT, "foreground": MASK},
    "mask, depth, linear": {
        "background": BYTES, "foreground": MASK, "depth": SLOPE, "space": "linear"
    },
    "picture in front": {"background": BYTES, "foreground": FRONT, "depth": SLOPE},
    "forward": {"background": LIGHT, "camera": FORWARD},
    "forward, depth": {"background": BYTES, "camera": FORWARD, "depth": SLOPE},
    "turning": {"background": LIGHT, "camera": TURNING},
}  # fmt: skip


@pytest.fixture
def low(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    def lower() -> None:
        monkeypatch.setattr(bands, "WHOLE", 50 * W)
        monkeypatch.setattr(bands, "BAND", 64 * W)

    return lower


def same(first: Any, second: Any) -> bool:
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, second, strict=True))


# Each effect in two kinds of scene, and each kind with three effects.
PAIRS = [(a, b) for i, a in enumerate(EFFECTS) for j, b in enumerate(SCENES) if i % 6 == j % 6]


def frames(scene: fl.Scene, several: fl.Scene, step: int) -> list[Any]:
    """Return what two scenes show, asked for forwards or backwards."""
    part = np.s_[13:210, 10:105]
    asked = [
        # The second time what stands still is known.
        lambda: [scene.render(7.5)], lambda: [scene.render(7.5)], lambda: [several.render(3.0)],
        lambda: [scene.layers(3).image, scene.render(3, region=part)],
        lambda: [scene.render(3)], lambda: several.stereo(3.0, distance=0.065),
    ]  # fmt: skip
    made = [ask() for ask in asked[::step]][::step]
    assert np.array_equal(made[3][0][part], made[3][1], equal_nan=True)
    return [frame for each in made for frame in each]


@pytest.mark.filterwarnings("ignore:.*ambiguous")
@pytest.mark.parametrize("name, kind", PAIRS)
def test_bands_have_the_bits_of_the_whole(name: str, kind: str, low: Callable[[], None]):
    """So have regions, copies, frames in another order, and other numbers of threads."""
    effect = EFFECTS[name]
    scene = fl.Scene(effects=[effect], **SCENES[kind])
    several = fl.Scene(effects=[TentRain(drops=100), effect], **SCENES[kind])
    with fl.settings(threads=1):
        whole = frames(scene, several, 1)
    low()
    again = (pickle.loads(pickle.dumps(one)) for one in (scene, several))
    with fl.settings(threads=3):
        assert same(frames(*again, -1), whole)


@dataclass(frozen=True)
class Own:
    """An effect of somebody else's, that may draw rows or not."""

    by_rows: bool
    honest: bool = True
    calls: Any = None

    def needs(self, frame: fl.effects.Frame) -> Needs:
        return Needs((Step("own"),), by_rows=self.by_rows)

    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        if self.calls is not None:
            self.calls.append(frame.window)
        top, bottom, left, right = frame.window
        rows = np.linspace(0.0, 1.0, frame.shape[0], dtype=np.float32)[top:bottom]
        if not self.honest:
            rows = rows / rows.max()  # Of its window, not of the frame.
        return fl.effects.Layer("own", np.repeat(rows[:, None], right - left, axis=1))


def test_a_window_that_is_not_the_wholes_part_would_be_seen(low: Callable[[], None]):
    own = [Own(by_rows=True, honest=honest) for honest in (True, False)]
    scenes = [fl.Scene(LIGHT, effects=[one], space="display") for one in own]
    whole = [scene.render(1) for scene in scenes]
    low()
    assert [same([one.render(1)], [want]) for one, want in zip(scenes, whole, strict=True)] == [
        True, False,
    ]  # fmt: skip


def test_what_may_draw_the_whole_draws_it_once(low: Callable[[], None]):
    calls: dict[bool, list[Any]] = {True: [], False: []}
    whole = [fl.Scene(BYTES, effects=[Own(by_rows=False)]).render(1)]
    low()
    for by_rows, windows in calls.items():
        scene = fl.Scene(BYTES, effects=[Own(by_rows=by_rows, calls=windows)])
        assert same([scene.render(1)], whole)
    assert calls[False] == [(0, H, 0, W)]
    assert calls[True] == [(y, min(y + 64, H), 0, W) for y in range(0, H, 64)]

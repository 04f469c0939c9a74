"""What effects may answer: layers of one color or of many, one or several, with depths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import flurries as fl

W, H = 40, 30
RNG = np.random.default_rng(21)
BYTES = RNG.integers(0, 256, (H, W, 3)).astype(np.uint8)
LIGHT = RNG.gamma(1.0, 0.5, (H, W, 3)).astype(np.float32)
ALPHA = RNG.random((H, W), np.float32)
ALPHA[:3], ALPHA[3:6] = 0.0, 1.0
STRAIGHT = RNG.gamma(1.0, 0.4, (H, W, 3)).astype(np.float32)
FAR = RNG.uniform(1.0, 9.0, (H, W)).astype(np.float32)
MATTE = RNG.random((H, W), np.float32)


@dataclass(frozen=True)
class Given:
    """An effect that answers what it was made with, cut to the window."""

    answer: Any
    seed: int | None = None

    def render(self, frame: fl.effects.Frame) -> Any:
        def cut(layer: fl.effects.Layer) -> fl.effects.Layer:
            rgb = None if layer.rgb is None else frame.crop(layer.rgb)
            depth = None if layer.depth is None else frame.crop(layer.depth)
            return fl.effects.Layer(layer.name, frame.crop(layer.alpha), layer.color, rgb, depth)

        if isinstance(self.answer, tuple):
            return tuple(map(cut, self.answer))
        return cut(self.answer) if isinstance(self.answer, fl.effects.Layer) else self.answer


ONE = fl.effects.Layer("fog", ALPHA, (0.25, 0.5, 0.75))
MANY = fl.effects.Layer("cloud", ALPHA, rgb=STRAIGHT * ALPHA[..., None], depth=FAR)


def decode(display: np.ndarray) -> np.ndarray:
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


def encode(light: np.ndarray) -> np.ndarray:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.abs(light) ** (1 / 2.4) - 0.055)


def over(behind: np.ndarray, straight: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    cover = alpha[..., None].astype(np.float64)
    return straight * cover + (1.0 - cover) * behind


@pytest.mark.parametrize("space", ["display", "linear"])
@pytest.mark.parametrize("kind", ["bytes", "light"])
@pytest.mark.parametrize("matte", [None, MATTE], ids=["open", "matte"])
def test_color_by_pixel_is_mixed_in_either_light(space: str, kind: str, matte: Any):
    picture = BYTES if kind == "bytes" else LIGHT
    scene = fl.Scene(picture, effects=[Given((ONE, MANY))], space=space, foreground=matte)
    got = scene.render(0)
    alpha = ALPHA.astype(np.float64) * (1.0 if matte is None else 1.0 - matte)
    if space == "linear":
        behind = decode(BYTES / 255.0) if kind == "bytes" else LIGHT.astype(np.float64)
        first, second = decode(np.array(ONE.color)), STRAIGHT.astype(np.float64)
    else:
        behind = BYTES / 255.0 if kind == "bytes" else encode(LIGHT.astype(np.float64))
        first, second = np.array(ONE.color), encode(STRAIGHT.astype(np.float64))
    want = over(over(behind, first, alpha), second, alpha)
    if kind == "bytes":
        # Light that is brighter than white turns white, as far as it is brighter.
        scale = 1.0 / np.maximum(want.max(axis=2, keepdims=True), 1.0)
        white = encode(scale * want + (1.0 - scale) * (1.0 - scale * want))
        want = 255.0 * np.clip(want if space == "display" else white, 0.0, 1.0)
        assert np.abs(got - want).max() <= 1.01  # rounded after each layer
    else:
        want = want if space == "linear" else decode(want)
        assert np.abs(got / want - 1.0).max() <= 1e-5


def test_names_are_unique_and_none_is_taken():
    names = ["snow", "snow2", "snow", "snow", "rgba", "depth", "x.y", "x.y"]
    effects = [Given(tuple(fl.effects.Layer(name, ALPHA) for name in names))]
    got = fl.Scene(BYTES, effects=effects).layers(0)
    assert list(got.layers) == ["snow", "snow2", "snow3", "snow4", "rgba2", "depth2", "x.y", "x.y2"]


WRONG = {
    "nothing": None,
    "an array": ALPHA,
    "a list with one": [ONE, 3],
    "alpha64": fl.effects.Layer("x", ALPHA.astype(np.float64)),
    "alpha of another size": fl.effects.Layer("x", ALPHA[1:]),
    "alpha none": fl.effects.Layer("x", None),  # type: ignore[arg-type]
    "rgb of two": fl.effects.Layer("x", ALPHA, rgb=STRAIGHT[..., :2]),
    "rgb64": fl.effects.Layer("x", ALPHA, rgb=STRAIGHT.astype(np.float64)),
    "rgb a list": fl.effects.Layer("x", ALPHA, rgb=STRAIGHT.tolist()),  # type: ignore[arg-type]
    "depth64": fl.effects.Layer("x", ALPHA, depth=FAR.astype(np.float64)),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_answers_are_refused_by_name(name: str):
    @dataclass(frozen=True)
    class Odd:
        seed: int | None = None

        def render(self, frame: fl.effects.Frame) -> Any:
            return WRONG[name]

    with pytest.raises(TypeError, match=r"effects: .*(Odd|'x')"):
        fl.Scene(BYTES, effects=[Odd()]).render(0)

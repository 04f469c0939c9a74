"""Eq. 7 and `over` against plain float64 NumPy; what effects may answer, and how it is mixed."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import flurries as fl
from every import every

C = fl.composite
DTYPES = ["uint8", "uint16", "float16", "float32", "float64"]
SHAPES = {"gray": (24, 31), "one channel": (24, 31, 1), "RGB": (24, 31, 3)}


def full_scale(dtype: Any) -> float:
    return float(np.iinfo(dtype).max) if np.dtype(dtype).kind == "u" else 1.0


def picture(dtype: Any, shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    values = np.random.default_rng(seed).uniform(0.0, 1.0, shape) * full_scale(dtype)
    return np.rint(values).astype(dtype) if np.dtype(dtype).kind == "u" else values.astype(dtype)


def opacity(shape: tuple[int, ...], dtype: Any = np.float32, seed: int = 1) -> np.ndarray:
    values = np.clip(np.random.default_rng(seed).uniform(-0.2, 1.2, shape[:2]), 0.0, 1.0)
    return values.astype(dtype)


def slack(dtype: Any) -> float:
    """How far from the twin a result may be: half a step, and the rounding of the arithmetic."""
    kind = np.dtype(dtype)
    if kind.kind == "u":
        return 0.5 + 4.0 * float(np.finfo(np.float32).eps) * full_scale(dtype)
    return 4.0 * float(np.finfo(kind).eps)


@pytest.mark.parametrize("intensity", [250 / 255, 0.0, 1.0, (0.9, 0.5, 0.1)], ids=str)
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("dtype", DTYPES)
def test_equation_7(dtype: str, shape: tuple[int, ...], intensity: Any):
    if np.ndim(intensity) and shape[2:] != (3,):
        intensity = 0.25  # a gray picture has one color
    background, alpha = picture(dtype, shape), opacity(shape)
    got = C.snow(background, alpha, intensity=intensity)
    assert got.shape == background.shape
    assert got.dtype == background.dtype
    # The twin: float64, not rounded, in the background's own values.
    back = background.astype(np.float64)
    cover = alpha.astype(np.float64).reshape(*alpha.shape, *[1] * (back.ndim - 2))
    want = np.asarray(intensity) * full_scale(background.dtype) * cover + (1.0 - cover) * back
    wrong = np.abs(got.astype(np.float64) - want)
    assert wrong.max() <= slack(dtype)


@every("alpha_dtype", [np.float16, np.float32, np.float64])
@every("dtype", DTYPES)
def test_ends_are_exact_to_the_bit(dtype: str, alpha_dtype: type):
    background = picture(dtype, (8, 9, 3))
    if np.dtype(dtype).kind == "f":
        largest = np.finfo(dtype).max
        background[0, :4, 0] = [-0.0, np.inf, -np.inf, largest]
        background[0, 4, 0] = np.finfo(dtype).smallest_subnormal
    clear = C.snow(background, np.zeros((8, 9), alpha_dtype), intensity=0.3)
    assert clear.tobytes() == background.tobytes()
    # -0.0 over clear must stay, though -0.0 == 0.0.
    covered = C.snow(background, np.ones((8, 9), alpha_dtype), intensity=(0.25, 0.5, 1.0))
    color = np.array([0.25, 0.5, 1.0]) * full_scale(dtype)
    if np.dtype(dtype).kind == "u":
        color = np.floor(color + 0.5)
    assert np.array_equal(covered, np.broadcast_to(color.astype(dtype), covered.shape))


@every("function", ["snow", "over"])
@every("dtype", ["float16", "float32", "float64"])
def test_bad_pixels_stay_where_they_were_and_infinity_never_becomes_nan(function: str, dtype: str):
    def weather(background: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        if function == "snow":
            return C.snow(background, alpha, intensity=0.5)
        return C.over(background, np.dstack([alpha * 0.5] * 3 + [alpha]))

    for seed in range(100):
        background, rng = picture(dtype, (9, 11, 3), seed), np.random.default_rng(seed)
        bad = rng.uniform(size=background.shape) < rng.choice([0.0, 0.01, 0.3, 1.0])
        background[bad] = np.nan
        assert np.array_equal(np.isnan(weather(background, opacity((9, 11), seed=seed))), bad)
    bright, alpha = np.full((1, 3, 3), np.inf, dtype), np.array([[0.0, 0.5, 1.0]], np.float32)
    got = weather(bright, alpha)
    assert np.isinf(got[0, :2]).all()
    assert np.array_equal(got[0, 2], np.full(3, 0.5, dtype)), "opaque is the layer's color"


@every("dtype", [*DTYPES])
@every("channels", [3, 4])
def test_over_is_premultiplied(dtype: str, channels: int):
    background = picture(dtype, (16, 17, channels))
    layer = np.random.default_rng(2).uniform(0, 0.5, (16, 17, 4)).astype(np.float32)
    layer[0, :5] = 0.0
    got = C.over(background, layer).astype(np.float64)
    front = layer.astype(np.float64)
    want = front[..., :channels] * full_scale(dtype) + (1 - front[..., 3:]) * background
    if np.dtype(dtype).kind == "u":
        want = np.minimum(want, full_scale(dtype))
    assert np.abs(got - want).max() <= slack(dtype)
    assert C.over(background, np.zeros_like(layer)).tobytes() == background.tobytes()


def test_join_does_not_know_an_order():
    planes = [opacity((16, 16), np.float64, seed=s) for s in range(5)]
    matte = opacity((16, 16), np.float64, seed=9)
    want = (1 - 0.9 * np.prod([1 - p for p in planes], axis=0)) * (1 - matte)
    for order in ([0, 1, 2, 3, 4], [4, 2, 0, 1, 3], [3, 4, 1, 0, 2]):
        got = C.join([planes[i] for i in order], haze=0.1, matte=matte)
        assert np.abs(got - want).max() <= 1e-15


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


def same(light: np.ndarray) -> np.ndarray:
    return light


def straight_of(colors: np.ndarray, cover: np.ndarray) -> np.ndarray:
    return np.divide(colors, cover, out=np.zeros_like(colors), where=cover > 0.0)


@pytest.mark.parametrize("space", ["display", "linear"])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("clear", [False, True], ids=["opaque", "16_7 alpha"])
@pytest.mark.parametrize("matte", [None, MATTE], ids=["open", "matte"])
def test_layers_are_mixed_in_either_light(space: str, dtype: str, clear: bool, matte: Any):
    """The twin: float64, straight colors over each other, and back; integers are not multiplied."""
    linear, whole = space == "linear", dtype != "float32"
    top = float(np.iinfo(dtype).max) if whole else 1.0
    plate = np.rint(BYTES / 255.0 * top).astype(dtype) if whole else LIGHT
    cover = np.linspace(-0.2, 1.2, W).clip(0.0, 1.0) * np.ones((H, 1))
    if clear:
        cover = np.rint(top * cover) / top if whole else cover.astype(dtype)
        colors = plate if whole else plate * cover[..., None]
        plate = np.dstack([colors, top * cover]).astype(dtype)
    cover = (cover if clear else np.ones((H, W))).astype(np.float64)[..., None]
    # Display values of integers, light of floats: turned into the light of the mix, and back.
    into, back = (decode, encode) if linear and whole else (same, same)
    into, back = (encode, decode) if not linear and not whole else (into, back)
    colors = plate[..., :3] / top
    under = into(colors if whole or not clear else straight_of(colors, cover)) * cover
    first = np.array(ONE.color)
    colors = (decode(first) if linear else first, STRAIGHT if linear else encode(STRAIGHT))
    for color in colors:
        alpha = ALPHA.astype(np.float64)[..., None]
        alpha = alpha if matte is None else alpha * (1.0 - matte[..., None])
        under, cover = color * alpha + (1.0 - alpha) * under, alpha + (1.0 - alpha) * cover
    want = straight_of(under, cover)
    if whole and linear:
        # Light that is brighter than white turns white, as far as it is brighter.
        scale = 1.0 / np.maximum(want.max(axis=2, keepdims=True), 1.0)
        want = scale * want + (1.0 - scale) * (1.0 - scale * want)
    want = top * np.clip(back(want), 0.0, 1.0) if whole else back(want) * cover
    scene = fl.Scene(plate, effects=[Given((ONE, MANY))], space=space, foreground=matte)
    got, apart = scene.render(0), scene.layers(0)
    assert np.array_equal(apart.image, got)
    for layer, color in zip(apart.layers.values(), colors, strict=True):
        assert np.abs(layer.rgba[..., :3] - color * layer.rgba[..., 3:]).max() <= 1e-6
        assert matte is not None or np.array_equal(layer.rgba[..., 3], ALPHA)
    assert got.dtype == plate.dtype and got.shape == plate.shape
    # The color of what is nearly nothing is one of large errors: it counts as far as it shows.
    wrong = np.abs(got[..., :3] - want) * (cover if whole else 1.0 / np.maximum(want, 0.1))
    assert wrong.max() <= (1.01 if whole else 1e-5)  # Bytes are rounded after each layer.
    if clear:
        assert np.abs(got[..., 3:] - top * cover).max() <= (0.51 if whole else 1e-6)


def test_names_are_unique_none_is_taken_and_what_has_no_color_is_white():
    names = ["snow", "snow2", "snow", "snow", "rgba", "depth", "x.y", "x.y"]
    effects = [Given(tuple(fl.effects.Layer(name, ALPHA) for name in names))]
    got = fl.Scene(BYTES, effects=effects).layers(0)
    assert list(got.layers) == ["snow", "snow2", "snow3", "snow4", "rgba2", "depth2", "x.y", "x.y2"]
    assert all((layer.rgba[..., :3] == ALPHA[..., None]).all() for layer in got.layers.values())


WRONG = {
    "nothing": None,
    "an array": ALPHA,
    "a list with one": [ONE, 3],
    "alpha64": fl.effects.Layer("x", ALPHA.astype(np.float64)),
    "alpha of another size": fl.effects.Layer("x", ALPHA[1:]),
    "rgb of two": fl.effects.Layer("x", ALPHA, rgb=STRAIGHT[..., :2]),
}


@pytest.mark.parametrize("name", WRONG)
def test_other_answers_are_refused_by_name(name: str):
    odd = type("Odd", (), {"render": lambda self, frame: WRONG[name]})()
    with pytest.raises(TypeError, match=r"effects: .*(Odd|'x')"):
        fl.Scene(BYTES, effects=[odd]).render(0)

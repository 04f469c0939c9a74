"""Eq. 7 and `over` against plain float64 NumPy, and what must hold to the last bit."""

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

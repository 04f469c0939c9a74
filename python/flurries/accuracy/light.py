"""Compositing several layers."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries import composite as mixing
from flurries import spectral
from flurries._contract import Array
from flurries.accuracy.ways import Way, largest


def composite() -> list[Way]:
    """Six layers over a picture, rounded after each of them or not."""
    shape = (512, 512)
    picture = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    layers = [
        spectral.alpha(shape, drift=(3.0 * i, 9.0), seed=i, mean=0.1, dtype=np.float64)
        for i in range(6)
    ]
    exact = picture.astype(np.float64) / 255.0
    for layer in layers:
        exact = (250.0 / 255.0) * layer[..., None] + (1.0 - layer[..., None]) * exact
    off = largest(255.0 * exact)

    def chain(name: str, start: Array, dtype: Any, scale: float) -> Way:
        alphas = [layer.astype(dtype) for layer in layers]

        def make() -> Array:
            result = start
            for layer in alphas:
                result = mixing.snow(result, layer)
            return result

        return Way(name, make, lambda made: off(scale * made.astype(np.float64)))

    def joined(dtype: Any) -> Way:
        alphas = [layer.astype(dtype) for layer in layers]
        return Way(
            f"joined, then uint8, {np.dtype(dtype).name}",
            lambda: mixing.snow(picture, mixing.join(alphas)),
            lambda made: off(made.astype(np.float64)),
        )

    wide = picture.astype(np.uint16) * np.uint16(257)
    return [
        chain("uint8 each", picture, np.float32, 1.0),
        chain("uint16 each", wide, np.float32, 1.0 / 257.0),
        chain("float16 each", (picture / 255.0).astype(np.float16), np.float32, 255.0),
        chain("float32", (picture / 255.0).astype(np.float32), np.float32, 255.0),
        chain("float64", picture / 255.0, np.float64, 255.0),
        joined(np.float32),
    ]  # fmt: skip

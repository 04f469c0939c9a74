"""The double cone: what its box filter misses, and what more samples cost."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries import cone as drum
from flurries._contract import Array
from flurries.accuracy.ways import Way, rms
from flurries.camera.lens import Camera

SHAPE = (180, 240)
EYE = Camera(200.0)
LOOK: dict[str, Any] = {"axis": (0.3, 1.0, 0.4), "phase": 0.37, "slope": 0.2}
# Some seven texels to a pixel: what a filter is for.
REPEATS = 16


def cone() -> list[Way]:
    """The box over a pixel's jacobian, with and without samples."""
    tile = drum.rain_tile(512, seed=4, dtype=np.float64)
    off = rms(_many(tile, 16))

    def sampled(count: int, dtype: Any) -> Way:
        shape = (SHAPE[0] * count, SHAPE[1] * count)
        camera = Camera(EYE.focal * count)
        own = tile.astype(dtype)

        def make() -> Array:
            fine = drum.layer(shape, camera, own, repeats=REPEATS, dtype=dtype, **LOOK)
            return np.asarray(fine.reshape(SHAPE[0], count, SHAPE[1], count).mean(axis=(1, 3)))

        return Way(f"box x {count} x {count}, {np.dtype(dtype).name}", make, off)

    return [
        sampled(1, np.float32), sampled(1, np.float64), sampled(2, np.float32),
        sampled(3, np.float32),
        Way("nearest texel, NumPy", lambda: _many(tile, 1), off),
        Way("nearest texel x 2 x 2, NumPy", lambda: _many(tile, 2), off),
        Way("nearest texel x 4 x 4, NumPy", lambda: _many(tile, 4), off),
    ]  # fmt: skip


def _many(tile: Array, count: int) -> Array:
    """The tile at count^2 points in each pixel, from the mapping's equations (docs/cone.md)."""
    total = np.zeros(SHAPE)
    axis = np.array(LOOK["axis"]) / np.linalg.norm(LOOK["axis"])
    down, first, second = drum.frame(axis)
    size = tile.shape[0]
    for i in range(count):
        for j in range(count):
            y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
            x, y = x + (j + 0.5) / count - SHAPE[1] / 2, y + (i + 0.5) / count - SHAPE[0] / 2
            rays = np.stack([x / EYE.focal, y / EYE.focal, np.ones(SHAPE)], -1)
            rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
            s, ex, ey = rays @ down, rays @ first, rays @ second
            across = np.hypot(ex, ey)
            w = s / (across + LOOK["slope"] * np.abs(s))
            turn = np.arctan2(ey, ex) / (2.0 * np.pi) % 1.0
            u = turn * REPEATS
            v = REPEATS / (2.0 * np.pi) * w - LOOK["phase"]
            row, col = ((np.floor(at * size) % size).astype(int) for at in (v, u))
            texel = tile[row, col]
            part = (0.2 * np.abs(s) / (across + 0.2 * np.abs(s)) - 0.6) / 0.35
            part = np.clip(part, 0.0, 1.0)
            total += texel * (1.0 - part * part * (3.0 - 2.0 * part))
    return total / count**2

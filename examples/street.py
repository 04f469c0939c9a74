"""A street at night, as a plate with its depth: walls with lit windows, lamps, snow on the ground.

    python examples/street.py [FOLDER]

writes street.png and street.exr beside street.toml, or into FOLDER.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import flurries as fl

WIDTH, HEIGHT, FOCAL = 640, 360, 620.0
EYE = 1.7  # Metres above the ground.
LAMPS = [(side * 3.4, -2.6, z) for z, side in ((10.0, 1), (14.0, -1), (20.0, 1), (27.0, -1))]
WARM = np.array([1.0, 0.62, 0.28])


def planes(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each ray's depth and what it meets: sky, ground, a wall left, right or ahead."""
    with np.errstate(divide="ignore"):
        far = np.stack([
            np.full(x.shape, np.inf), np.where(y > 0, EYE / y, np.inf),
            np.where(x < 0, -5.2 / x, np.inf), np.where(x > 0, 5.2 / x, np.inf),
            np.full(x.shape, 46.0),
        ])  # fmt: skip
    height = -y * far
    top = np.array([0, 99, 8.5, 6.5, 5.0])[:, None, None]
    far[(height > top) & (np.arange(5)[:, None, None] > 0)] = np.inf
    return far.min(axis=0), far.argmin(axis=0)


def main(folder: Path) -> None:
    random = np.random.default_rng(4)
    across, down = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    x, y = (across - WIDTH / 2) / FOCAL, (down - 0.52 * HEIGHT) / FOCAL
    depth, wall = planes(x, y)
    place = np.stack([x, y, np.ones_like(x)], axis=-1) * np.minimum(depth, 1e3)[..., None]
    # Light of the lamps on everything, and a little of the sky.
    light = np.full((HEIGHT, WIDTH, 3), (0.010, 0.013, 0.022))
    normal = np.array([(0, 0, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, -1)], float)[wall]
    for lamp in LAMPS:
        way = np.array(lamp) - place
        square = (way**2).sum(axis=-1)
        cosine = np.clip((way * normal).sum(axis=-1) / np.sqrt(square), 0.0, 1.0)
        light += (5.0 * cosine / (0.4 + square))[..., None] * WARM
    grain = 0.75 + 0.25 * random.random((HEIGHT, WIDTH))
    albedo = np.array([(0.0, 0, 0), (0.55, 0.57, 0.62), (0.34, 0.26, 0.22), (0.26, 0.27, 0.31),
                       (0.22, 0.21, 0.22)])[wall]  # fmt: skip
    picture = albedo * light * grain[..., None]
    # Windows in rows, some of them lit.
    along = np.where(wall == 4, place[..., 0] + 40.0, place[..., 2])
    row, column = (-place[..., 1] + EYE) / 2.6, along / 2.2
    inside = (abs(row % 1 - 0.55) < 0.27) & (abs(column % 1 - 0.5) < 0.24) & (wall >= 2)
    lit = random.random((3, 8, 64)) < 0.36
    glow = 0.25 + 0.75 * random.random((3, 8, 64))
    at = wall.clip(2) - 2, row.astype(int).clip(0, 7), column.astype(int).clip(0, 63)
    window = np.where(lit[at], 0.5 * glow[at], 0.006)[..., None] * (1.0, 0.74, 0.42)
    bars = (abs(column % 1 - 0.5) < 0.02) | (abs(row % 1 - 0.62) < 0.015)
    picture = np.where((inside & ~bars)[..., None], window, picture)
    sky = np.exp(-4.0 * np.clip(0.25 - y, 0, 1))[..., None] * (0.020, 0.024, 0.040)
    picture = np.where((wall == 0)[..., None], sky, picture)
    # Poles, and the lamps themselves with what the eye and the lens make of them.
    for px, py, pz in LAMPS:
        u, v = px / pz * FOCAL + WIDTH / 2, py / pz * FOCAL + 0.52 * HEIGHT
        foot = EYE / pz * FOCAL + 0.52 * HEIGHT
        pole = (abs(across - u) < 0.05 / pz * FOCAL) & (down > v) & (down < foot)
        picture[pole], depth[pole] = (0.012, 0.012, 0.014), pz
        away = np.hypot(across - u, down - v)
        head = 0.16 / pz * FOCAL
        picture += (np.exp(-((away / head) ** 2)) * 2.5 + 0.05 / (1 + (away / head / 2) ** 2))[
            ..., None
        ] * WARM
    folder.mkdir(parents=True, exist_ok=True)
    display = fl.io.linear_to_srgb(np.clip(picture, 0.0, 1.0))
    fl.io.write_picture(folder / "street.png", np.round(255.0 * display).astype(np.uint8))
    fl.io.write_layers(folder / "street.exr", {"depth": depth.astype(np.float32)})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)

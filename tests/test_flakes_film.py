"""Films of `fl.Snow` as a whole: what a pixel remembers, means of films, pictures of two sizes."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
from measure import cover


def alpha(scene: fl.Scene, t: float) -> np.ndarray:
    return cover(scene, t).astype(np.float64)


def memory(film: list[np.ndarray], most: int) -> np.ndarray:
    """Return the correlation of pixels with themselves after 0 to `most` frames."""
    frames = np.stack(film).reshape(len(film), -1).astype(np.float32)
    frames -= frames.mean(axis=1, keepdims=True)
    frames /= frames.std(axis=1, keepdims=True)
    both = (frames @ frames.T) / frames.shape[1]
    return np.array([np.diagonal(both, lag)[:20].mean() for lag in range(most + 1)])


def test_pixels_forget_snow_straight_down_as_drawn_flakes_do():
    # No wind and no sway. After 24 frames drawn flakes are gone from where they were: 1.5 m/s at
    # 22 m is .8 px a frame. The texture must not show the same ones again, in any layer.
    def scene(method: str) -> fl.Scene:
        snow = fl.Snow(density=30.0, wind=(0.0, 0.0, 0.0), sway=(0.0, 1.0), near=6.0, far=22.0,
                       fall=1.5, method=method)  # fmt: skip
        return fl.Scene((384, 288), camera=fl.Camera(360.0), effects=[snow], seed=4)

    drawn = memory([alpha(scene("simulated"), t) for t in range(0, 28, 4)], 6)
    ours = memory([alpha(scene("hybrid"), t) for t in range(0, 68, 4)], 6)
    assert abs(drawn[6]) < 0.02
    assert np.abs(ours[1:] - drawn[1:]).max() < 0.02, (ours, drawn)
    shown = scene("hybrid")
    texture = shown.effects[0].parts.texture
    film = [texture.alpha(shown.program.views(t)[0][1], 1.0) for t in range(0, 240, 4)]
    assert np.abs(memory(film, 40)[7:]).max() < 0.02


def test_no_tile_is_brighter_than_others_for_ever():
    # Means of 75 frames over each tile, and of 75 others: by chance alone they have nothing in
    # common.
    snow = fl.Snow(density=40.0, wind=(0.4, 0.0, 0.0), fall=1.2, far=30.0)
    scene = fl.Scene((640, 480), camera=fl.Camera(640.0), effects=[snow], seed=6)
    texture = snow.parts.texture
    step = 59
    rows, cols = 480 // step, 640 // step

    def means(times: range) -> np.ndarray:
        views = [scene.program.views(t)[0][1] for t in times]
        mean = np.mean([texture.alpha(view, 1.0) for view in views], axis=0)
        tiles = mean[: rows * step, : cols * step].reshape(rows, step, cols, step)
        return tiles.mean(axis=(1, 3), dtype=np.float64).ravel()

    first, second = means(range(0, 300, 4)), means(range(2000, 2300, 4))
    assert len(first) == 80
    # Three and a half deviations of the correlation of 80 pairs.
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.4
    # And every tile has the mean of all within what drifting flakes leave.
    assert np.abs(first / first.mean() - 1.0).max() < 0.05


@pytest.mark.parametrize("method", ["hybrid", "simulated"])
def test_nothing_is_nearer_than_the_near_depth(method: str):
    # Also where flakes at that depth are the texture's: by the extinction of those beyond.
    kept = []
    for near in (0.5, 12.0):
        snow = fl.Snow(density=60.0, near=near, far=25.0, method=method)
        scene = fl.Scene((160, 120), camera=fl.Camera(190.0), effects=[snow], seed=2)
        kept.append(-np.log1p(-alpha(scene, 8.0).mean()))
        # Flakes fade in over a quarter of the near depth.
        clear = 25.0 - 1.125 * near
        kept[-1] /= snow.parts.texture.weather.population.extinction * clear
    assert kept == pytest.approx([1.0, 1.0], rel=0.05)


def test_a_small_picture_is_a_large_one_made_smaller():
    means, deviations = [], []
    for seed in range(2):
        snow = fl.Snow(density=60.0, near=5.0, far=25.0, flake_size=(0.002, 0.005, 0.015))
        small, large = (
            alpha(fl.Scene((w, w), camera=fl.Camera(1.2 * w), effects=[snow], seed=seed), 8.0)
            for w in (256, 2048)
        )
        made = large.reshape(256, 8, 256, 8).mean(axis=(1, 3))
        means.append(small.mean() / made.mean())
        deviations.append(small[4:-4, 4:-4].std() / made[4:-4, 4:-4].std())
    assert np.mean(means) == pytest.approx(1.0, abs=0.01), means
    assert np.mean(deviations) == pytest.approx(1.0, abs=0.03), deviations

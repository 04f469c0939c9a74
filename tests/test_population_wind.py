"""A population in a wind that differs by depth: drawn flakes and the texture feel the same one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flurries as fl
from measure import cover

LENS = fl.Camera(300.0)
SHAPE = (192, 256)
PROFILE = [(2.0, (1.0, 0.0, 0.0)), (9.0, (-3.0, 0.5, 0.0)), (25.0, (4.0, -0.3, 0.0))]


# Wide enough for some hundreds of drawn flakes.
WIDE = (288, 384)


def scene(shape: tuple[int, int] = SHAPE, **fields: Any) -> fl.Scene:
    snow = fl.Snow(**{"density": 30.0, "sway": (0.0, 1.0), "far": 30.0, **fields})
    return fl.Scene(shape[::-1], camera=LENS, effects=[snow])


def test_flakes_move_with_the_wind_of_their_depth():
    shown = scene(WIDE, wind=fl.Wind((0.3, 0.0, 0.2), profile=PROFILE), fall=1.5,
                  flake_size=(0.008, 0.008, 0.008))  # fmt: skip
    early, late = fl.flakes(shown, 30.0), fl.flakes(shown, 30.5)
    _, one, other = np.intersect1d(early["id"], late["id"], return_indices=True)
    assert len(one) > 100
    moved = (late["place"][other] - early["place"][one]) * 60.0
    depth = early["depth"][one]
    for axis, mean in enumerate((0.3, 1.5)):
        want = mean + np.interp(depth, *zip(*((z, v[axis]) for z, v in PROFILE), strict=True))
        # The air comes nearer at .2 m/s: what a flake felt on its way was other depths' wind.
        assert moved[:, axis] == pytest.approx(want, abs=0.35)
        assert np.median(np.abs(moved[:, axis] - want)) < 0.05
    assert moved[:, 2] == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize("t", [3000.0, -400.0])
def test_a_profile_leaves_as_many_flakes_in_view(t: float):
    # However far it has carried them.
    shown = scene(WIDE, wind=fl.Wind((0.3, 0.0, 0.0), profile=PROFILE))

    def seen(t: float) -> np.ndarray:
        found = fl.flakes(shown, t)
        inside = ((found["pixel"] > 0.0) & (found["pixel"] < WIDE[::-1])).all(axis=1)
        return np.histogram(found["depth"][inside], [1.0, 2.0, 3.0, 4.0])[0]

    still, later = seen(0.0), seen(t)
    assert still.sum() > 140
    assert np.abs(later - still).max() < 4.0 * np.sqrt(2.0 * still.max())


def test_all_flakes_drawn_and_the_texture_feel_one_profile():
    # A wind that grows with depth: pixels forget their flakes as fast in both, and faster than
    # in the wind of the nearest air.
    wind = fl.Wind((0.2, 0.0, 0.0), profile=[(4.0, 1.0), (24.0, 30.0)])
    lags = (1, 4)

    def memory(method: str, wind: Any) -> tuple[np.ndarray, float]:
        rows, means = [], []
        for seed in range(4):
            snow = fl.Snow(method=method, wind=wind, density=25.0, far=22.0, fall=0.2,
                               sway=(0.0, 1.0))  # fmt: skip
            shown = fl.Scene((160, 120), camera=fl.Camera(150.0), effects=[snow], seed=seed)
            film = [cover(shown, 20 + lag).astype(float) for lag in (0, *lags)]
            rows.append([np.corrcoef(film[0].ravel(), one.ravel())[0, 1] for one in film[1:]])
            means.append(film[0].mean())
        return np.mean(rows, axis=0), float(np.mean(means))

    ours, mean = memory("hybrid", wind)
    drawn, wanted = memory("simulated", wind)
    steady, _ = memory("hybrid", (0.2, 0.0, 0.0))
    assert mean == pytest.approx(wanted, rel=0.02)
    assert np.abs(ours - drawn).max() < 0.04, (ours, drawn)
    assert steady[0] - ours[0] > 0.1, (steady, ours)


def test_the_texture_s_motion_is_that_of_its_layers():
    # Of one depth's wind alone it would be 30 times as much or as little.
    fields: dict[str, Any] = {"density": 60.0, "fall": 0.0, "flake_size": (0.008, 0.008, 0.008)}
    profile = [(4.0, 1.0), (24.0, 30.0)]
    shown = scene(wind=fl.Wind((0.2, 0.0, 0.0), profile=profile), **fields)
    texture = shown.effects[0].parts.texture
    views = [shown.program.views(t)[0][1] for t in (5.0, 6.0)]
    (moved, *_), _ = texture.passes(views[0], [views[1]])
    layers = texture.weather.film(views[0]).layers
    cover = np.array([one.slab.coverage for one in layers])
    depths = np.array([one.slab.depth for one in layers])
    factor = np.interp(depths, *zip(*profile, strict=True))
    want = 300.0 * 0.2 / 30.0 * (cover / depths * factor).sum() / cover.sum()
    assert moved[90, 120] == pytest.approx([want, 0.0], rel=1e-5)

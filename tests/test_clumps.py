"""Clumps and fronts: one density for drawn flakes and for sheets, with the mean of even weather."""

import math

import numpy as np
import pytest

import flurries as fl
from flurries.effects.clumps import clumps_of

STRENGTH, H, W, FOCAL = 0.8, 320, 512, 500.0


def scene(snow: fl.Snow, ahead: float = 0.0) -> fl.Scene:
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(0.0, 0.0, ahead))
    plate = np.zeros((H, W, 3), np.uint8)
    return fl.Scene(plate, camera=path, effects=[snow], seed=3, lens=None, fps=30)


def denser(one: fl.Scene, t: float, places: np.ndarray) -> np.ndarray:
    """The law at places (..., 3) relative to the camera, wave by wave."""
    frame = one._program.views(t)[0][1]
    clumps = clumps_of(one.effects[0].parts.flakes, frame)
    phase = 2.0 * math.pi * places @ clumps.waves.T
    s = np.cos(phase) @ clumps.weights[:, 0] - np.sin(phase) @ clumps.weights[:, 1]
    return 1.0 + STRENGTH * s / np.sqrt(1.0 + s**2)


@pytest.mark.parametrize("gusts", [0.0, 0.1])
def test_drawn_flakes_are_those_of_the_densest_places_as_the_law_thins_them(gusts: float):
    more = {"method": "simulated", "far": 30.0, "wind": fl.Wind((0.3, 0.0, 0.0), gusts=gusts)}
    even = scene(fl.Snow(density=9.0, **more))
    clumped = scene(fl.Snow(density=5.0, clumps=STRENGTH, **more))
    all_, some = (fl.flakes(one, 20) for one in (even, clumped))
    at = dict(zip(all_["id"].tolist(), all_["place"], strict=True))
    wanted = [at[number] for number in some["id"].tolist()]
    np.testing.assert_allclose(some["place"], wanted, atol=1e-9)
    if gusts:
        # They carry clumps as they carry flakes: the law is then of places without them.
        return
    there = np.isin(all_["id"], some["id"])
    share = denser(clumped, 20.0, all_["place"]) / (1.0 + STRENGTH)
    for low in np.arange(0.1, 1.0, 0.1):
        own = (share >= low) & (share < low + 0.1)
        if own.sum() > 100:
            wanted = share[own].mean()
            noise = math.sqrt(wanted * (1.0 - wanted) / own.sum())
            # The last ones fade in, over a tenth of the share.
            assert abs(there[own].mean() - wanted) < 4.0 * noise + 0.05 * wanted, low


@pytest.mark.parametrize("ahead", [0.0, 1.0])
def test_sheets_are_as_dense_as_the_law_says(ahead: float):
    more = {"density": 800.0, "handover": 2.0, "far": 16.0, "flake_size": (0.002, 0.003, 0.006)}
    one, even = scene(fl.Snow(clumps=STRENGTH, **more), ahead), scene(fl.Snow(**more), ahead)
    found, plain = (-np.log1p(-np.minimum(s.layers(20).alpha, 0.999)) for s in (one, even))
    blocks = [part.reshape(H // 32, 32, W // 32, 32).mean((1, 3)) for part in (found, plain)]
    y, x = ((np.arange(n // 32) + 0.5) * 32 - 0.5 * n for n in (H, W))
    rays = np.stack(np.broadcast_arrays(x / FOCAL, y[:, None] / FOCAL, 1.0), axis=-1)
    depths = 0.5 + np.arange(16)
    law = np.mean([denser(one, 20.0, depth * rays) for depth in depths], axis=0)
    ratio = blocks[0] / blocks[1]
    assert ratio.std() > 0.05
    assert np.corrcoef(ratio.ravel(), law.ravel())[0, 1] > 0.9
    assert abs(ratio.mean() - law.mean()) < 0.08

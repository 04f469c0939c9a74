"""Flakes live in the world, the same ones in every window, eye and frame; where they are dense."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.effects.uneven import clumps_of
from measure import same_flakes

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

from falling_contracts import identities

H, W = 180, 240
SNOW = fl.Snow(density=40.0, wind=(1.0, 0.0, 0.0), seed=5)
CAMERA = fl.Camera(260.0, center=(120.0, 90.0))


def scene(
    effect: fl.Snow | fl.Rain | fl.effects.TentSnow = SNOW, *, size: tuple[int, int] = (W, H),
    camera: object = CAMERA, **more: object,
) -> fl.Scene:  # fmt: skip
    return fl.Scene("#203040", size=size, camera=camera, effects=[effect], **more)  # type: ignore[arg-type]


def test_overscan_crops_eyes_and_sizes_show_the_same_flakes():
    """By the contracts of the bench; that boxes as large as the picture fail is tested with it."""
    lines = list(identities(fl.flakes))
    assert len(lines) == 4
    assert not [line for line in lines if not line.endswith("pass")]


def test_more_snow_adds_flakes_and_moves_none():
    few, many = (
        fl.flakes(scene(fl.Snow(density=d, seed=5, handover=2.5)), 7.0) for d in (20.0, 70.0)
    )
    assert np.isin(few["id"], many["id"]).mean() > 0.999 and len(many) > 3 * len(few)
    here, there = same_flakes(few, many, 20)
    assert np.abs(here["place"] - there["place"]).max() < 1e-9


@pytest.mark.parametrize("effect", [
    fl.Snow(wind=(1000.0, 0.0, 0.0)), fl.Snow(fall=1000.0), fl.Snow(sway=(1000.0, 1.0)),
    fl.Snow(density=1e5), fl.Snow(density=0.0), fl.Rain(density=1e5),
])  # fmt: skip
def test_what_no_air_is_like_is_drawn_or_refused(effect: fl.Snow | fl.Rain):
    shown = scene(effect, size=(48, 36), camera=None)
    for t in (0.0, 7.5, 1e9):
        try:
            frame = shown.render(t)
        except ValueError as error:
            assert "density" in str(error)
        else:
            assert frame.shape == (36, 48, 3)


def test_flakes_far_in_time_lose_no_bits():
    for t in (0.0, 1e6, 1e9):
        here, there = same_flakes(*(fl.flakes(scene(), t + step) for step in (0.0, 1.0)), 20)
        moved = there["place"] - here["place"]
        assert np.ptp(moved[:, 0]) < 0.2
        assert moved[:, 0].mean() == pytest.approx(1.0 / 30.0, abs=0.01)


def test_a_flake_is_a_ball_over_pixels():
    # The mean over fine points of exp: one flake at rest, at any place between pixels.
    lone = fl.effects.TentSnow(
        texture=0.0, haze=0.0, flakes=3, fall=0.0, wind=(0.0, 0.0, 0.0), sway=(0.0, 1.0),
        flake_opacity=0.6, flake_size=(0.08, 0.08), near_depth=6.0, color=1.0, seed=3,
    )  # fmt: skip
    shown = scene(lone)
    tau = 1.0
    for _ in range(60):
        mean = 1.0 - 2.0 * (1.0 - (1.0 + tau) * np.exp(-tau)) / tau**2
        tau += 4.0 * (0.6 - mean)
    fine = 16
    y, x = (np.mgrid[0 : H * fine, 0 : W * fine] + 0.5) / fine
    through = np.ones((H, W))
    for flake in fl.flakes(shown, 0.0):
        radius = 0.5 * 260.0 * flake["diameter"] / flake["depth"]
        u = ((x - flake["pixel"][0]) ** 2 + (y - flake["pixel"][1]) ** 2) / radius**2
        ball = 1.0 - np.exp(-tau * np.sqrt(np.maximum(1.0 - u, 0.0)))
        share = flake["opacity"] / 0.6
        through *= 1.0 - share * ball.reshape(H, fine, W, fine).mean(axis=(1, 3))
    alpha = shown.layers(0).alpha
    assert alpha.max() > 0.3
    # Radii of tables are 4 % apart.
    assert np.abs(alpha - (1.0 - through)).max() < 0.03
    assert alpha.sum() == pytest.approx((1.0 - through).sum(), rel=0.01)


def test_the_longest_ways_hide_as_much_as_short_ones():
    cover = []
    for speed, exposure in ((0.0, 0.0), (20.0, 1.0), (200.0, 2.0)):
        path = fl.CameraPath(fl.Camera(1200.0), velocity=(speed, 0.0, 1.0))
        snow = fl.Snow("heavy", shutter=exposure, clumps=0.0)
        cover.append(scene(snow, size=(400, 300), camera=path).layers(5).alpha.mean())
    assert cover == pytest.approx([cover[0]] * 3, rel=0.05)


STRENGTH, TALL, WIDE, FOCAL = 0.8, 320, 512, 500.0


def fronts(snow: fl.Snow, ahead: float = 0.0) -> fl.Scene:
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(0.0, 0.0, ahead))
    plate = np.zeros((TALL, WIDE, 3), np.uint8)
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
    even = fronts(fl.Snow(density=9.0, **more))
    clumped = fronts(fl.Snow(density=5.0, clumps=STRENGTH, **more))
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
    one, even = fronts(fl.Snow(clumps=STRENGTH, **more), ahead), fronts(fl.Snow(**more), ahead)
    found, plain = (-np.log1p(-np.minimum(s.layers(20).alpha, 0.999)) for s in (one, even))
    blocks = [part.reshape(TALL // 32, 32, WIDE // 32, 32).mean((1, 3)) for part in (found, plain)]
    y, x = ((np.arange(n // 32) + 0.5) * 32 - 0.5 * n for n in (TALL, WIDE))
    rays = np.stack(np.broadcast_arrays(x / FOCAL, y[:, None] / FOCAL, 1.0), axis=-1)
    depths = 0.5 + np.arange(16)
    law = np.mean([denser(one, 20.0, depth * rays) for depth in depths], axis=0)
    ratio = blocks[0] / blocks[1]
    assert ratio.std() > 0.05
    assert np.corrcoef(ratio.ravel(), law.ravel())[0, 1] > 0.9
    assert abs(ratio.mean() - law.mean()) < 0.08

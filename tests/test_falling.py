"""Flakes live in the world: the same ones in every window, eye and frame, moved by evaluation."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl

H, W = 180, 240
SNOW = fl.Snow(density=40.0, wind=(1.0, 0.0, 0.0), seed=5)
CAMERA = fl.Camera(260.0, center=(120.0, 90.0))


def scene(
    effect: fl.Snow | fl.Rain | fl.TentSnow = SNOW, *, size: tuple[int, int] = (W, H),
    camera: object = CAMERA, **more: object,
) -> fl.Scene:  # fmt: skip
    return fl.Scene(size, "#203040", camera=camera, effects=[effect], **more)  # type: ignore[arg-type]


def both(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of flakes that two lists share, in one order."""
    _, here, there = np.intersect1d(one["id"], other["id"], return_indices=True)
    return one[here], other[there]


def inside(flakes: np.ndarray, low: float = 0.0, width: int = W, height: int = H) -> np.ndarray:
    x, y = flakes["pixel"].T
    return flakes[(x > low) & (x < width - low) & (y > low) & (y < height - low)]


def test_overscan_and_crop_show_the_same_flakes():
    plain = fl.flakes(scene(), 7.0)
    wide = fl.flakes(scene(size=(W + 32, H + 32), camera=fl.Camera(260.0, center=(136, 106))), 7.0)
    crop = fl.flakes(scene(size=(100, 80), camera=fl.Camera(260.0, center=(70, 40))), 7.0)
    for other, moved in ((wide, 16.0), (crop, -50.0)):
        small, large = (plain, other) if len(other) > len(plain) else (other, plain)
        assert np.isin(inside(small, 0.0, 100, 80)["id"], large["id"]).all()
        here, there = both(plain, other)
        assert len(here) > 10
        assert np.abs(here["place"] - there["place"]).max() < 1e-9
        assert np.abs(there["pixel"] - here["pixel"] - moved).max() < 1e-6
        assert (here["diameter"] == there["diameter"]).all()


def test_half_the_size_draws_flakes_of_the_whole():
    whole = fl.flakes(scene(size=(4 * W, 4 * H), camera=fl.Camera(1040.0)), 7.0)
    half = fl.flakes(scene(size=(2 * W, 2 * H), camera=fl.Camera(520.0)), 7.0)
    seen = inside(half, 2.0, 2 * W, 2 * H)
    assert len(seen) > 50 and np.isin(seen["id"], whole["id"]).all()
    here, there = both(whole, half)
    assert np.abs(here["place"] - there["place"]).max() < 1e-9
    # With the same hand-over the half is all of the whole's.
    pinned = fl.Snow(density=40.0, wind=(1.0, 0.0, 0.0), seed=5, handover=3.0)
    whole = fl.flakes(scene(pinned, size=(4 * W, 4 * H), camera=fl.Camera(1040.0)), 7.0)
    half = fl.flakes(scene(pinned, size=(2 * W, 2 * H), camera=fl.Camera(520.0)), 7.0)
    assert np.isin(inside(whole, 4.0, 4 * W, 4 * H)["id"], half["id"]).all()


def test_more_snow_adds_flakes_and_moves_none():
    few, many = (
        fl.flakes(scene(fl.Snow(density=d, seed=5, handover=2.5)), 7.0) for d in (20.0, 70.0)
    )
    assert np.isin(few["id"], many["id"]).mean() > 0.999 and len(many) > 3 * len(few)
    here, there = both(few, many)
    assert np.abs(here["place"] - there["place"]).max() < 1e-9


def test_both_eyes_see_the_same_flakes():
    left, right = (
        fl.flakes(scene(camera=fl.Camera(260.0, center=(120.0, 90.0), offset=(x, 0, 0))), 7.0)
        for x in (-0.03, 0.03)
    )
    here, there = both(left, right)
    assert len(here) > 0.8 * len(left)
    assert np.abs(here["place"] - there["place"]).max() < 1e-9
    apart = here["pixel"][:, 0] - there["pixel"][:, 0]
    assert np.abs(apart - 0.06 * 260.0 / here["depth"]).max() < 1e-6


MOVING = {
    "still": fl.CameraPath(CAMERA),
    "forward": fl.CameraPath(CAMERA, velocity=(0.0, 0.0, 6.0)),
    "zoom": fl.CameraPath(CAMERA, focal=fl.Keys([(0, 260.0), (30, 340.0)])),
    "turning": fl.CameraPath(
        CAMERA, orientation=fl.Keys([(0, (0.0, 0.0, 0.0)), (40, (0.1, 0.5, 0.2))])
    ),
}
GUSTS = fl.Wind((1.0, 0.0, 0.2), gusts=0.8, swirl=0.4)


@pytest.mark.parametrize("wind", [(1.0, 0.0, 0.0), GUSTS], ids=["even", "gusts"])
@pytest.mark.parametrize("camera", MOVING)
def test_motion_is_where_flakes_will_be(camera: str, wind: object):
    # All drawn, so that no texture has a share in what a pixel shows.
    snow = fl.Snow(density=12.0, wind=wind, seed=5, near=1.5, far=8.0, method="simulated")
    shown = scene(snow, camera=MOVING[camera])
    t = 12.0
    seen = shown.render(t, layers=True)
    now = fl.flakes(shown, t)
    ids = seen.ids["snow"]
    alone = (ids >= 0) & (seen.alpha > 0.05)
    assert alone.sum() > 500
    for step, motion in ((1.0, seen.motions["snow"]), (-1.0, seen.backwards["snow"])):
        other = fl.flakes(shown, t + step)
        here, there = both(now, other)
        way = dict(zip(here["id"].tolist(), (there["pixel"] - here["pixel"]).tolist(), strict=True))
        known = np.array([int(i) in way for i in ids[alone]])
        assert known.mean() > 0.7
        want = np.array([way[int(i)] for i in ids[alone][known]])
        off = np.abs(motion[alone][known] - want).max(axis=1)
        assert off.max() < 1e-3


def test_a_loop_ends_where_it_began_and_gives_way_one_by_one():
    shown = scene().loop(24)
    first, last = shown.render(0), shown.render(24)
    assert np.array_equal(first, last) and not np.array_equal(first, shown.render(12))
    # Those that have gone over to the next round are not shown in this one.
    half = fl.flakes(shown, 12)
    assert len(np.unique(half["id"])) > 0.9 * len(half) > 20


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
        now, then = (fl.flakes(scene(), t + step) for step in (0.0, 1.0))
        here, there = both(now, then)
        moved = there["place"] - here["place"]
        assert len(here) > 20 and np.ptp(moved[:, 0]) < 0.2
        assert moved[:, 0].mean() == pytest.approx(1.0 / 30.0, abs=0.01)


def test_a_flake_is_a_ball_over_pixels():
    # The mean over fine points of exp: one flake at rest, at any place between pixels.
    lone = fl.TentSnow(
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
    alpha = shown.render(0, layers=True).alpha
    assert alpha.max() > 0.3
    # Radii of tables are 4 % apart.
    assert np.abs(alpha - (1.0 - through)).max() < 0.03
    assert alpha.sum() == pytest.approx((1.0 - through).sum(), rel=0.01)

"""Flakes live in the world and are dense where the law says; and the bench that judges them."""

import math
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import judges
from flurries.effects.uneven import clumps_of
from judges import BLOCK, direction, slopes
from measure import same_flakes

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

import falling_statistics
from falling_cases import WEATHERS, Case
from falling_contracts import identities
from falling_statistics import QUOTIENTS, judged, measure, page, table

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
    gusts = fl.Wind((1.0, 0.0, 0.0), gusts=3.0, swirl=2.0, scale=2.0)
    lines = [*identities(fl.flakes), *identities(fl.flakes, wind=gusts)]
    assert [line.endswith("pass") for line in lines] == [True] * 8, lines


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


def picture(method: str, seed: int) -> np.ndarray:
    """A part of a wide picture, and few enough flakes that all of them can be drawn."""
    snow = fl.Snow(density=60.0, far=22.0, method=method)
    scene = fl.Scene(
        "#000000", size=(240, 160), camera=fl.Camera(768.0), effects=[snow], seed=8 + seed
    )
    return scene.layers(10.0).alpha.astype(np.float64)


def test_ours_are_the_numbers_of_drawn_flakes_and_a_gaussian_fails():
    drawn = [picture("simulated", seed) for seed in range(6)]
    known = [judges.numbers(one) for one in drawn]

    def missed(pictures: list[np.ndarray]) -> set[str]:
        """Which numbers are off by more than their limits and three errors of their means."""
        found, missed = [judges.numbers(one) for one in pictures], set()
        # Not the Euler number at the median: near 0, a quotient says little.
        for name in QUOTIENTS.keys() - {"Euler 50"}:
            a, b = (np.array([one[name] for one in each]) for each in (found, known))
            error = np.hypot(a.std(), b.std()) / np.sqrt(len(b))
            if abs(a.mean() - b.mean()) > QUOTIENTS[name] * abs(b.mean()) + 3.0 * error:
                missed.add(name)
        return missed

    assert not missed([picture("flakes", seed) for seed in range(6)])
    assert len(missed([judges.gaussian(one, seed) for seed, one in enumerate(drawn)])) >= 4


def test_a_case_is_judged_and_the_twin_passes_itself(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(falling_statistics, "APART", (0.0, 45.0, 90.0, 135.0, 180.0))
    monkeypatch.setattr(falling_statistics, "film", cache(falling_statistics.film))
    monkeypatch.setitem(WEATHERS, "light", {**WEATHERS["light"], "far": 25.0})
    case = Case("still", "light", 3.0, 192)
    times = (0.0, 1.0, 4.0)
    each = ([measure(case, s, times, of) for s in (1, 2, 3)] for of in ("flakes", "twin"))
    ours, twin = (judged(case, one) for one in each)
    assert ours.keys() == twin.keys() >= {*QUOTIENTS, "C(4)", "direction", "after 1"}
    assert not [name for name, figure in twin.items() if figure.verdict == "miss"]
    shown = page({"one": ours, "other": twin}, ["a line"], 3)
    assert shown.count("\n| ") == len(ours) + 2 and "direction" in table(ours)


@pytest.mark.parametrize("boxed", [False, True])
def test_identities_are_judged(boxed: bool):
    place = np.random.default_rng(1).uniform((-3, -3, 1), (3, 3, 8), (9000, 3))
    kind = [("id", np.uint64), ("place", float, 3), ("pixel", float, 2), ("depth", float)]

    def flakes(scene: fl.Scene, t: float) -> np.ndarray:
        width, height = scene.size
        camera = scene.camera.camera if isinstance(scene.camera, fl.CameraPath) else scene.camera
        found = np.zeros(len(place), kind)
        seen = place * (width / 480.0, height / 360.0, 1.0) if boxed else place
        found["id"], found["place"] = np.arange(len(seen)), seen
        found["pixel"], found["depth"] = fl.camera.project(seen, camera, (height, width))
        # Nobody lists what is far outside.
        return judges.inside(found, (-20.0, -20.0), (width + 20.0, height + 20.0))

    lines = list(identities(flakes))
    assert len(lines) == 4
    assert all(line.endswith("pass") for line in lines) != boxed


SIDE, TIME = 384, 20.0

# Metres: near enough to draw all flakes in a second. Nearly all of them are the texture's.
FAR = 20.0

# One picture's lean deviates by up to .01 from that of another seed, and a block's by .02 to .05:
# of four seeds the difference of two whole pictures has a deviation of at most `LIMIT` / 4.
SEEDS = 4

LIMIT = 0.03  # Whole pictures of drawn flakes and of ours lean alike within this.

SLANTED = 0.1  # Blocks of the drawn that lean by so much must lean to the same side.

PATHS: dict[str, dict[str, Any]] = {
    "still": {},
    "sideways": {"velocity": (2.0, 0.0, 0.0)},
    "forward": {"velocity": (0.0, 0.0, 3.0)},
    "turning": {"orientation": fl.Keys([(0, (0.0, 0.0, 0.0)), (60, (0.0, 0.6, 0.0))])},
}
LOOKS = ("heavy", "blizzard")


def misses(ours: list[np.ndarray], drawn: list[np.ndarray]) -> list[str]:
    """Return what is wrong with the lean of some pictures."""
    sums = [np.array([slopes(picture) for picture in each]) for each in (ours, drawn)]
    got, want = (float(direction(each.sum(axis=(0, 2, 3)))) for each in sums)
    found = [f"whole: {got:+.3f} for {want:+.3f}"] if abs(got - want) > LIMIT else []
    # Four deviations of the difference of two means over the seeds: there are some 600 blocks.
    each = np.array([direction(one) for one in sums[1]])
    spread = float(np.sqrt(each.var(axis=0, ddof=1).mean()))
    most = LIMIT + 4.0 * spread * np.sqrt(2.0 / len(drawn))
    blocks = [direction(each.sum(axis=0)) for each in sums]
    for at in np.ndindex(blocks[0].shape):
        got, want = (float(each[at]) for each in blocks)
        if (abs(want) >= SLANTED and got * want <= 0.0) or abs(got - want) > most:
            found.append(f"block {at}: {got:+.3f} for {want:+.3f}")
    return found


@cache
def pictures(method: str, camera: str, wind: float, look: str) -> list[np.ndarray]:
    path = fl.CameraPath(fl.Camera(600.0), **PATHS[camera])
    snow = fl.Snow(look, wind=(wind, 0.0, 0.0), far=FAR, method=method)
    scenes = [
        fl.Scene("#000000", size=(SIDE, SIDE), camera=path, effects=[snow], seed=3 + n)
        for n in range(SEEDS)
    ]
    found = [one.layers(TIME).layers["snow"].alpha for one in scenes]
    return [one.astype(np.float64) for one in found]


# Each camera in still air and in wind, each look with two of both.
WAYS = [(LOOKS[(n + m) % 2], path, 3.0 * m) for n, path in enumerate(PATHS) for m in (0, 1)]


@pytest.mark.parametrize(("look", "camera", "wind"), WAYS)
def test_streaks_lean_as_those_of_drawn_flakes(look: str, camera: str, wind: float):
    assert not misses(*(pictures(one, camera, wind, look) for one in ("flakes", "simulated")))


def test_the_judge_sees_mirrored_blocks():
    drawn = pictures("simulated", "still", 3.0, "blizzard")
    mirrored = [alpha.copy() for alpha in drawn]
    for alpha in mirrored:
        for row, col in np.ndindex(SIDE // BLOCK, SIDE // BLOCK):
            if (row + col) % 2:
                block = alpha[row * BLOCK :, col * BLOCK :][:BLOCK, :BLOCK]
                block[:] = block[:, ::-1].copy()
    found = misses(mirrored, drawn)
    assert found[0].startswith("whole") and len(found) == 1 + (SIDE // BLOCK) ** 2 // 2

"""Every judge of falling snow finds its imitation out, and lets flakes drawn one by one pass."""

import math
from functools import cache

import numpy as np
import pytest

import flurries as fl
import judges
from twin_falling import View, film
from twin_footprints import POINT, Canvas, middle_depth, profile
from twin_law import Law

SNOW = Law(density=60.0, sizes=(0.003, 0.007, 0.022), near=2.0, far=14.0)
AIR = View(size=(192, 144), focal=400.0, wind=(1.5, 0.0, 0.0), sway=(0.02, 4.0))
TIMES = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0)
TILE = 63


@cache
def drawn(seed: int = 1, view: View = AIR) -> np.ndarray:
    return film(SNOW, view, TIMES, seed)


def flow(at: np.ndarray, near: np.ndarray, start: float, end: float) -> np.ndarray:
    way = (end - start) / AIR.fps * AIR.focal * near
    fall = float(SNOW.speed(np.array([SNOW.sizes[1]]))[0])
    return at + np.stack([AIR.wind[0] * way, fall * way])


def test_euler_counts_pieces_and_holes():
    picture = np.zeros((20, 20), bool)
    picture[2:9, 2:9] = True
    picture[4:6, 4:6] = False
    picture[12:14, 12:14] = picture[14:16, 14:16] = True
    assert judges.euler(picture) == 1.0


def killed() -> np.ndarray:
    """A film of tiles, each with flakes of its own: what leaves a tile is gone."""
    films, found = [drawn(seed) for seed in range(1, 5)], drawn(1).copy()
    for row in range(0, 144, TILE):
        for col in range(0, 192, TILE):
            part = np.s_[:, row : row + TILE, col : col + TILE]
            found[part] = films[(row // TILE + 2 * (col // TILE)) % 4][part]
    return found


def life(pictures: np.ndarray) -> float:
    return float(judges.alive(pictures, TIMES, flow, (4.0, SNOW.far))[0].mean())


def test_flakes_that_die_at_the_borders_of_tiles_are_missed():
    assert np.mean([life(drawn(seed)) for seed in (1, 2)]) > 0.55
    assert life(killed()) < 0.8 * life(drawn(1))
    # Of pictures that have nothing to do with each other nearly none is followed.
    strange = np.array([drawn(1)[0]] + [drawn(seed)[n] for n, seed in enumerate((2, 3, 4) * 2)])
    assert life(np.concatenate([strange, drawn(2)[7:]])) < 0.2


def test_a_sheet_of_one_speed_keeps_its_shape():
    picture = drawn(1)[0]
    sheet = np.roll(picture, (9, 17), axis=(0, 1))
    assert judges.largest(picture, drawn(1)[-1]) < 0.5
    assert judges.largest(picture, sheet) > 0.8
    # And it is found at its shift.
    found = judges.correlations(picture, sheet, (64, 64))
    assert np.unravel_index(np.argmax(found), found.shape) == (64 + 9, 64 + 17)


def test_a_picture_of_one_tile_repeats():
    picture = drawn(1)[0]
    assert judges.repeated(picture) < 0.3
    assert judges.repeated(np.tile(picture[:64, :64], (3, 4))) > 0.9
    # What lies within the lobe is a flake and its streak.
    assert judges.repeated(picture, lobe=1) > judges.repeated(picture)


def test_strangers_and_blocks_that_lean_the_other_way_are_counted():
    seen = np.zeros(40, [("id", np.uint64), ("place", float, 3)])
    seen["id"], seen["place"] = np.arange(40), np.random.default_rng(1).random((40, 3))
    moved = seen.copy()
    moved["place"][3:] += 1e-6
    assert judges.strangers(seen, seen[::-1]) == 0 and judges.strangers(seen, moved) == 37
    # One that is missing counts if lists are whole.
    assert judges.strangers(seen[1:], seen, whole=False) == 0
    assert judges.strangers(seen[1:], seen) == judges.strangers(seen, seen[1:], whole=False) == 1
    lean = np.array([0.2, -0.2, 0.05, 0.3])
    assert judges.turned(lean * (-1.0, 1.0, -1.0, 1.0), lean) == pytest.approx(1.0 / 3.0)


def test_an_extrapolated_motion_is_off_in_a_zoom():
    zoom = View(size=(256, 192), focal=400.0, velocity=(1.0, 0.0, 2.0), zoom=0.3)
    rng = np.random.default_rng(3)
    places = np.stack([*rng.uniform(-1.0, 1.0, (2, 50)), rng.uniform(2.0, 9.0, 50)])

    def seen(t: float) -> np.ndarray:
        found = np.zeros(50, [("id", np.uint64), ("pixel", float, 2)])
        found["id"], found["pixel"] = np.arange(50), zoom.project(places, t)[0].T
        return found

    now, then = seen(9.0), seen(10.0)
    assert judges.motion_off(then["pixel"] - now["pixel"], now, then[::-1]) < 1e-9
    exposed = (seen(9.25)["pixel"] - seen(8.75)["pixel"]) / 0.5
    assert judges.motion_off(exposed, now, then) > 0.05
    assert math.isnan(judges.motion_off(exposed, now, then[:0]))


LAW = Law(density=60.0, sizes=(0.003, 0.007, 0.022), near=2.0, far=15.0)
SMALL = View(size=(120, 90), focal=200.0, wind=(3.0, 0.0, 0.0), sway=(0.02, 4.0))


def sampled(way: np.ndarray, diameter: float) -> np.ndarray:
    r2, angle = (np.arange(60) + 0.5) / 60, 2.0 * math.pi * (np.arange(90) + 0.5) / 90
    weight = profile(r2, middle_depth(0.9))[:, None] + 0.0 * angle
    weight *= 0.25 * math.pi * diameter**2 / weight.size
    disc = 0.5 * diameter * np.sqrt(r2)[:, None] * np.array([np.cos(angle), np.sin(angle)])[:, None]
    total, times = np.zeros((24, 24)), 300
    for n in range(times):
        u = 2.0 * (n + 0.5) / times
        a, b = way[int(u)], way[int(u) + 1]
        x, y = (a + (u - int(u)) * (b - a))[:, None, None] + disc
        total += np.histogram2d(
            y.ravel(), x.ravel(), bins=24, range=((0, 24), (0, 24)), weights=weight.ravel()
        )[0]
    return total / times


def painted(way: np.ndarray, diameter: float, opacity: float = 0.9) -> np.ndarray:
    canvas = Canvas((24, 24), opacity)
    canvas.add(way[:, :, None], np.array([diameter]), np.ones(1))
    return canvas.alpha()


WAYS = {
    "rest": np.tile([11.37, 12.81], (3, 1)),
    "short": np.array([[11.37, 12.81], [11.6, 13.1], [11.8, 13.4]]),
    "bent": np.array([[8.2, 6.1], [11.3, 9.2], [16.4, 10.3]]),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("diameter", [0.11, 0.19, 0.21, 0.8, 1.9, 2.1, 6.0])
def test_a_flake_is_its_samples(way: np.ndarray, diameter: float):
    if diameter < POINT:
        # A flake so small goes straight, from the opening to the close.
        way = np.array([way[0], 0.5 * (way[0] + way[2]), way[2]])
    want, got = sampled(way, diameter), painted(way, diameter)
    assert got.sum() == pytest.approx(0.9 * 0.25 * math.pi * diameter**2, rel=0.01)
    # Points: unbiased, and off by a share of the brightest pixel.
    assert np.abs(got - want).max() < 0.1 * want.max()


def test_its_laws_are_those_of_the_package():
    share, at = (np.arange(400_000) + 0.5) / 400_000, np.linspace(0.0005, 0.02, 99)
    # Of some the mean is near an end, or they end long before the largest.
    for sizes in (LAW.sizes, (0.002, 0.027, 0.03), (0.001, 0.0018, 0.04), (0.001, 0.001012, 0.04)):
        diameters = Law(density=1.0, sizes=sizes).diameters(share)
        ours = fl.Snow(flake_size=sizes).parts.texture.weather.population.sizes
        np.testing.assert_allclose(ours.quantile(share), diameters, rtol=1e-6)
        for power in (1.0, 2.0, 3.078):
            # A midpoint sum over shares errs by the tail of the law.
            assert ours.moment(power) == pytest.approx((diameters**power).mean(), rel=1e-5)
    snow = fl.Snow(flake_size=LAW.sizes).parts.texture.weather.population
    np.testing.assert_allclose(LAW.speed(at), snow.speed(at))
    slow = Law(density=1.0, sizes=LAW.sizes, fall=0.5)
    assert slow.speed(np.array([0.007, 0.014])) == pytest.approx([0.5, 0.5 * 2**0.16])
    rain, drops = fl.Rain(), Law(density=1.0, sizes=(0.0005, 0.0009, 0.006), kind="rain")
    np.testing.assert_allclose(drops.speed(at), rain.parts.texture.weather.population.speed(at))


def test_coverage_is_a_formula():
    means = [film(LAW, SMALL, [0.0], seed).mean() for seed in range(8)]
    # All depths cover alike, half of what fades counts.
    want = -math.expm1(-LAW.extinction() * (LAW.far - 0.9 * LAW.near))
    assert np.mean(means) == pytest.approx(want, rel=0.02)

"""Every judge of falling snow finds its imitation out, and lets flakes drawn one by one pass."""

import math
from functools import cache

import numpy as np
import pytest

import judges
from twin_falling import View, film
from twin_law import Law

SNOW = Law(density=60.0, sizes=(0.003, 0.007, 0.022), near=2.0, far=20.0)
AIR = View(size=(256, 192), focal=400.0, wind=(1.5, 0.0, 0.0), sway=(0.02, 4.0))
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
    for row in range(0, 192, TILE):
        for col in range(0, 256, TILE):
            part = np.s_[:, row : row + TILE, col : col + TILE]
            found[part] = films[(row // TILE + 2 * (col // TILE)) % 4][part]
    return found


def life(pictures: np.ndarray) -> float:
    return float(judges.alive(pictures, TIMES, flow, (4.0, 20.0))[0].mean())


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

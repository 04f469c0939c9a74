"""The two halves of the snow are one snow: they move alike, stand never, pop never.

All motion is measured on rendered frames (`measure`): the texture's by the phases of a band of
waves, the flakes' by their centroids. A wave of wavelength L stands for the depth
``near_depth * longest / L``, so that depth times image motion must be the same for both.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import flurries as fl
import measure
from measure import (
    FLAKES,
    FOCAL,
    LONGEST,
    NEAR,
    SIZE,
    TEXTURE,
    TORUS,
    WAVES,
    picture,
    scene,
)

LENS = fl.camera.Camera(FOCAL)
MOTIONS = [
    {"fall": 1.4, "wind": (0.35, 0.0, 0.0)},
    {"fall": 0.3, "wind": (-2.0, 0.0, 0.0)},
    {"fall": -1.0, "wind": (0.7, 0.2, 0.0)},
    {"fall": 1.9, "wind": (0.0, 0.0, 0.0)},
]
# A frame apart, of whole and of fractional numbers and far off.
TIMES = [(0.0, 1.0), (1.0, 2.0), (17.3, 18.3), (-40.0, -39.0), (1000.25, 1001.25)]


def check(measured, wanted, speed: float, degrees: float) -> None:
    ratio, turn = measure.against(measured, wanted)
    assert abs(ratio - 1.0) < speed
    assert abs(turn) < degrees


def check_halves(bands: np.ndarray, flakes: np.ndarray) -> None:
    """Bands against the mean of few flakes, each of which is off by some hundredths of a pixel."""
    assert len(flakes) >= 5
    mean = flakes.mean(axis=0)
    for band in bands:
        check(band, mean, 0.01, 0.7)
    for flake in flakes:
        check(flake, mean, 0.05, 2.5)


@pytest.mark.parametrize("motion, fps", list(zip(MOTIONS, (30.0, 24.0) * 2, strict=True)))
def test_flakes_and_texture_share_one_parallax(motion: dict, fps: float):
    check_halves(
        measure.parallax_of_bands(motion, TIMES, fps=fps),
        measure.parallax_of_flakes(motion, TIMES, fps=fps),
    )


WRONG = {
    "a tenth faster": {"fall": 1.54, "wind": (0.385, 0.0, 0.0)},
    "3 % slower": {"fall": 1.358, "wind": (0.3395, 0.0, 0.0)},
    "the other way": {"fall": -1.4, "wind": (-0.35, 0.0, 0.0)},
    "a mirrored wind": {"fall": 1.4, "wind": (-0.35, 0.0, 0.0)},
    "two degrees off": {"fall": 1.387, "wind": (0.4, 0.0, 0.0)},
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_a_texture_that_does_not_belong_to_the_flakes_would_be_caught(wrong: dict):
    with pytest.raises(AssertionError):
        check_halves(
            measure.parallax_of_bands(wrong, TIMES), measure.parallax_of_flakes(MOTIONS[0], TIMES)
        )


def air(motion: dict) -> np.ndarray:
    """Velocity of the flakes in m per second."""
    x, y, z = motion["wind"]
    return np.array([x, y + motion["fall"], z])


@pytest.mark.parametrize("motion", MOTIONS)
def test_flakes_at_the_depth_of_a_band_move_with_it(motion: dict):
    # Snow draws no flakes that far; the kernels do, in a box that is only as deep as a sheet.
    velocity = air(motion) / 30.0
    shown = scene({**TEXTURE, **TORUS, **motion})
    pair = picture(shown, 7.0), picture(shown, 8.0)
    for wavelength in WAVES:
        moved, mean = measure.band_shift([pair], wavelength, 0.04)
        depth = NEAR * LONGEST / mean
        side = SIZE * depth / FOCAL
        points = fl.particles.positions(
            40, (side, side, 1e-9), seed=3, velocity=velocity, time=7.0, center=(0.0, 0.0, depth)
        )
        points = points[measure.lone(measure.on_screen(points, LENS))]
        shifts = measure.tracked(points, velocity, 1.0)
        assert len(shifts) >= 5
        check(moved, shifts.mean(axis=0), 0.01, 0.5)


GUSTS = {
    "fall": fl.Keys([(0.0, 1.0), (80.0, 2.0)]),
    "wind": fl.Keys([(0.0, (2.0, 0.0, 0.0)), (40.0, (-2.0, 0.5, 0.0)), (80.0, (0.5, -3.0, 0.0))]),
}


def test_halves_agree_in_a_wind_that_changes():
    # The late frames first: none may depend on those before it.
    late, early = (
        (measure.parallax_of_bands(GUSTS, [times]), measure.parallax_of_flakes(GUSTS, [times]))
        for times in ((66.5, 67.5), (11.0, 12.0))
    )
    check_halves(*late)
    check_halves(*early)
    with pytest.raises(AssertionError):
        check_halves(late[0], early[1])


def test_the_disparities_of_flakes_and_texture_agree():
    # To an eye 60 mm to the right all moves to the left, by focal * 0.06 / depth.
    eye = fl.camera.Camera(FOCAL, offset=(0.06, 0.0, 0.0))
    flakes = measure.flake_shifts(scene(FLAKES), 5.0, 0.0, eye)
    texture = scene({**TEXTURE, **TORUS})
    pair = picture(texture, 5.0), picture(texture, 5.0, eye=eye)
    check_halves(measure.parallax(pair), flakes[:, 3:] * flakes[:, :1])


FLIGHT, STEP = (0.0, -0.3, 5.0), 0.5
WAYS = {
    "half overlaps": ({}, LENS, 66.5),
    "overlaps of 10": ({"overlap": 10}, LENS, 11.0),
    "a turned camera": ({}, fl.camera.Camera(FOCAL, rotation=(0.05, -0.15, 0.1)), 66.5),
    "an aside lens": ({}, fl.camera.Camera(FOCAL, center=(300.0, 180.0)), 11.0),
    "a changing wind": (GUSTS, LENS, 66.5),
}


def against_flow(flow: np.ndarray, far: list) -> np.ndarray:
    """(n, 2): ratio and turn of what tiles, seen from the lens, move like against the flakes."""
    return np.array([measure.against(parallax, flow[0] * at + flow[1:]) for at, parallax in far])


def agrees(found: np.ndarray) -> bool:
    """Measured: tiles within 3 % and 1.5 degrees, their mean speed within 1 %.

    A crop of 64 px spreads each wave over directions, which costs it up to 1 % of its speed.
    """
    ratio, turn = abs(found - (1.0, 0.0)).max(axis=0)
    return bool(ratio < 0.05 and turn < 3.0 and abs(found[:, 0].mean() - 1.0) < 0.02)


@pytest.mark.parametrize(("options", "lens", "t"), WAYS.values(), ids=WAYS)
def test_halves_agree_in_every_tile_of_a_flight(options: dict, lens: fl.camera.Camera, t: float):
    path = fl.CameraPath(lens, velocity=FLIGHT)
    flow = measure.flow_of_flakes(options, path, t, STEP)
    tiles = [(at - lens.principal((SIZE, SIZE)), parallax)
             for at, parallax in measure.tiles(options, path, t, STEP, (8.0, 5.5))]  # fmt: skip
    far = [tile for tile in tiles if np.hypot(*(tile[0] + flow[1:] / flow[0])) >= 120.0]
    distance = [np.hypot(*(at + flow[1:] / flow[0])) for at, _ in far]
    assert len(far) >= 60 and min(distance) < 150.0 and max(distance) > 350.0
    found = against_flow(flow, far)
    assert agrees(found), (found.min(axis=0), found.max(axis=0))
    for wrong in (1.1, -1.0, (1.0, -1.0, 1.0), (1.0, 1.0, -1.0), (1.1, 1.0, 1.0)):
        assert not agrees(against_flow(flow * wrong, far))


@pytest.mark.parametrize("overlap", [None, 10])
def test_flakes_at_the_centres_of_tiles_move_with_their_band(overlap: int | None):
    motion = {**MOTIONS[0], "overlap": overlap}
    velocity = (air(motion) - FLIGHT) / 30.0
    path = fl.CameraPath(LENS, velocity=FLIGHT)
    centres, bands = zip(*measure.tiles(motion, path, 20.0, STEP, [8.0]), strict=True)
    depth = NEAR * LONGEST / 8.0
    points = np.array([(*(at - SIZE / 2) * depth / FOCAL, depth) for at in centres])
    seen = measure.tracked(points, velocity, STEP) * depth
    focus = SIZE / 2 + FOCAL * velocity[:2] / velocity[2]
    for at, band, flake in zip(centres, bands, seen, strict=True):
        if np.hypot(*(at - focus)) >= 120.0:
            check(band, flake, 0.05, 3.0)


# What stands still -----------------------------------------------------------------------------

CLIPS = {
    "60 frames": np.arange(60.0),
    # With all waves moving 60 frames far apart are as good as independent.
    "two minutes": np.sort(np.random.default_rng(0).uniform(0.0, 3600.0, 60)),
}


@pytest.mark.parametrize("times", CLIPS.values(), ids=CLIPS)
@pytest.mark.parametrize("preset", ["moderate"])
def test_no_part_of_the_texture_stands_still(preset: str, times: np.ndarray):
    snow = fl.effects.TentSnow(preset, flakes=0, haze=0.0, color=1.0)
    assert measure.stood(snow, times) < 1.1 * measure.kept(snow, times)


@pytest.mark.parametrize("times", CLIPS.values(), ids=CLIPS)
@pytest.mark.parametrize("preset", ["heavy"])
def test_snow_that_falls_straight_down_would_be_caught(preset: str, times: np.ndarray):
    # The waves across the fall, columns of every tile, never move.
    snow = fl.effects.TentSnow(preset, flakes=0, haze=0.0, color=1.0, wind=(0.0, 0.0, 0.0))
    assert measure.stood(snow, times) > 1.15 * measure.kept(snow, times)


# What pops -------------------------------------------------------------------------------------

CROWD = {"texture": 0.0, "haze": 0.0, "color": 1.0, "flakes": 2000, "flake_size": (0.03, 0.05),
         "near_depth": 4.0}  # fmt: skip
SOMETIMES = np.random.default_rng(2).uniform(0.0, 500.0, 25)


# In shorter ones those of the kernel's tables show, of .08.
SHORT = (0.08, 0.04, 0.02)


def changes(options: dict, times: np.ndarray = SOMETIMES, **about) -> np.ndarray:
    shown = scene({**CROWD, **options}, 256, **about)
    return measure.largest_changes(partial(picture, shown), times, SHORT)


@pytest.mark.parametrize("z", [5.0, 0.0, -5.0])
def test_no_flake_pops(z: float):
    path = fl.CameraPath(fl.camera.Camera(300.0), velocity=(1.0, -0.3, z))
    shown = scene(CROWD, 256, camera=path)
    assert measure.smooth(changes({}, camera=path))

    # The control: flakes of air that ends at once.
    def cut(t: float) -> np.ndarray:
        flakes = fl.flakes(shown, t)
        near = flakes["place"][flakes["depth"] < 2.0] - path.place(t, fps=30.0)
        return fl.particles.splat((256, 256), near, 0.02, path.camera, opacity=0.9)

    assert z == 0.0 or not measure.smooth(measure.largest_changes(cut, SOMETIMES, SHORT))


def test_no_flake_pops_while_the_amount_rises():
    amount = fl.Keys([(0.0, 0.0), (30.0, 1.0)])
    # The first ones come soon after one another, and so do the last.
    times = np.append(np.random.default_rng(3).uniform(6.0, 24.0, 25), 6.0)
    # In still air only the amount changes a pixel.
    still = {"amount": amount, "fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}
    assert measure.smooth(changes(still, times))
    assert measure.smooth(changes({"amount": amount, "texture": 0.8, "haze": 0.1}, times))
    none, all_ = (picture(scene({**CROWD, **still}, 256), t) for t in (0.0, 30.0))
    assert none.max() == 0.0
    assert np.array_equal(all_, picture(scene({**CROWD, **still, "amount": 1.0}, 256), 30.0))

    # The control: the same flakes, each there or not.
    shown = scene({**CROWD, **still}, 256)

    def hard(t: float) -> np.ndarray:
        there = fl.flakes(shown, t)
        there = there[there["opacity"] > 0.0]["place"]
        return fl.particles.splat((256, 256), there, 0.02, shown.camera.camera, opacity=0.9)

    assert not measure.smooth(measure.largest_changes(hard, times, SHORT))

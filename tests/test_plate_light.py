"""Light of the plate: what it is worth to a flake, the same in display, linear and float plates."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import gas
from flurries.io.color import linear_to_srgb, srgb_to_linear
from flurries.light.plate import PlateLight, cell_sums, plate_light
from flurries.light.shot import light_of

Array = np.ndarray[Any, Any]
W, H = 320, 240


def scene(plate: Array, effect: Any, **more: Any) -> fl.Scene:
    return fl.Scene(plate, effects=[effect], seed=5, lens=None, **more)


def light_in(picture: Array, encoding: str) -> PlateLight:
    sides = light_of({0: cell_sums(picture, encoding)[0]}).at(0.0)[1:]
    return plate_light(picture, encoding, *sides)


def phase(asymmetry: float, cosine: Array) -> Array:
    return gas.phase(cosine, kind="henyey", asymmetry=asymmetry) / (4.0 * math.pi)


def picture() -> Array:
    plate = np.full((H, W, 3), 0.25)
    plate[: H // 2] = (0.75, 0.8, 0.85)
    plate[200:206, 40:46] = 1.0
    return plate


@pytest.mark.parametrize("level", [0.02, 0.4, 1.0, 6.0])
def test_an_even_plate_makes_flakes_of_albedo_times_its_radiance(level: float):
    plate = np.full((H, W, 3), level, np.float32)
    snow = fl.Snow("moderate", color="local")
    layer = scene(plate, snow).layers(3).layers["snow"].rgba
    shown = layer[..., 3] > 0.01
    assert shown.any()
    radiance = layer[shown, :3] / layer[shown, 3:]
    assert np.abs(radiance / (0.9 * level) - 1.0).max() < 1e-4


def test_display_word_and_float_plates_get_the_same_picture():
    display = picture()
    byte = np.rint(255.0 * display).astype(np.uint8)
    word = byte.astype(np.uint16) * 257
    single = srgb_to_linear(byte / 255.0).astype(np.float32)
    snow = fl.Snow("heavy", color="local", haze=0.2)
    shown = [
        scene(byte, snow).render(7) / 255.0,
        scene(word, snow).render(7) / 65535.0,
        linear_to_srgb(scene(single, snow).render(7)),
    ]
    for other in shown[1:]:
        assert abs(float(other.mean() - shown[0].mean())) < 0.5 / 255.0
        assert np.abs(other - shown[0]).max() < 0.6 / 255.0


def test_a_flake_is_lit_by_what_is_behind_it_and_by_half_a_sky_and_half_a_ground():
    plate = np.full((H, W, 3), 0.1, np.float32)
    plate[: H // 2] = 0.6
    # Through so wide a lens 25 degrees are less than a cell: what lies around is what lies behind.
    found = light_in(plate, "linear").local(1.0, asymmetry=0.76, albedo=0.9)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    low = math.cos(math.radians(25.0))
    cosine = 0.5 * (1.0 - low) * nodes + 0.5 * (1.0 + low)
    seen = math.pi * (1.0 - low) * float(weights @ phase(0.76, cosine))
    for row, level in ((0, 0.6), (-1, 0.1)):
        wanted = 0.9 * (seen * level + (1.0 - seen) * 0.5 * (0.6 + 0.1))
        assert np.abs(found[row] / wanted - 1.0).max() < 1e-3


def test_fog_is_never_darker_than_what_is_behind_it():
    plate = srgb_to_linear(picture()).astype(np.float32)
    for level in (0.3, 0.9):
        snow = fl.Snow(density=0.0, color="local", haze=level)
        seen = scene(plate, snow).render(0)
        sky = seen[10:50, :, 1] / plate[10:50, :, 1]
        assert sky.min() > 1.0 - 1e-3


def test_the_light_of_cells_is_the_mean_of_their_pixels():
    rng = np.random.default_rng(4)
    plate = rng.integers(0, 256, (50, 70, 3), dtype=np.uint8)
    found = light_in(plate, "display")
    light = srgb_to_linear(plate / 255.0)
    cell = found.cell
    wanted = light[cell : 2 * cell, 3 * cell : 4 * cell].mean(axis=(0, 1))
    assert np.abs(found.cells[1, 3] - wanted).max() < 1e-6
    odd = light.astype(np.float32)
    odd[0, 0] = np.nan
    assert np.isfinite(light_in(odd, "linear").cells).all()


def test_air_before_a_wall_takes_no_light_from_the_sky_beyond_its_edge():
    light = fl.scene.Light(0.5, sky=0.5, ground=0.1)
    depth = np.full((H, W), np.inf, np.float32)
    snow = fl.Snow("heavy", color="local", haze=0.3)

    def colors(sky: float, wall: float) -> dict[str, Array]:
        plate = np.full((H, W, 3), 0.05, np.float32)
        # An edge in the middle of a cell, and a sky that is all around.
        plate[:, : W // 2 + 1], depth[:, W // 2 + 1 :] = sky, wall
        plate[:60], depth[:60] = sky, np.inf
        found = scene(plate, snow, depth=depth.copy(), light=light, fps=24).layers(3).layers
        return {
            name: layer.rgba[..., :3] / np.maximum(layer.rgba[..., 3:], 1e-3)
            for name, layer in found.items()
        }

    dim, bright, farther = colors(0.5, 8.0), colors(5.0, 8.0), colors(0.5, 8.2)
    wall = np.s_[60:, W // 2 + 1 :]
    for name, before in dim.items():
        assert np.array_equal(before[wall], bright[name][wall])
        assert bright[name][60:, : W // 2].max() > 0.8
        assert np.abs(before - farther[name]).max() < 0.05

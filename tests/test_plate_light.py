"""Light: of the plate and its shot, of lamps, and what flakes make of it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import gas
from flurries.cli.main import main
from flurries.io.color import linear_to_srgb, srgb_to_linear
from flurries.light.lamp import DROPS, FLAKES, Optics, radiance
from flurries.light.plate import PlateLight, cell_sums, plate_light
from flurries.light.shot import light_of
from test_scene_limits import street

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
    layer = scene(plate, fl.Snow("moderate", color="local")).layers(3).layers["snow"].rgba
    shown = layer[..., 3] > 0.01
    radiance = layer[shown, :3] / layer[shown, 3:]
    assert np.abs(radiance / (0.9 * level) - 1.0).max() < 1e-4


def test_display_word_and_float_plates_get_the_same_picture():
    byte = np.rint(255.0 * picture()).astype(np.uint8)
    single = srgb_to_linear(byte / 255.0).astype(np.float32)
    snow = fl.Snow("heavy", color="local", haze=0.2)
    shown = [
        scene(byte, snow, space="linear").render(7) / 255.0,
        scene(byte.astype(np.uint16) * 257, snow, space="linear").render(7) / 65535.0,
        linear_to_srgb(scene(single, snow).render(7)),
    ]
    for other in shown[1:]:
        assert abs(float(other.mean() - shown[0].mean())) < 0.5 / 255.0
        assert np.abs(other - shown[0]).max() < 0.6 / 255.0


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_over_integers_local_light_is_laid_by_eq_7_in_their_own_values(kind: Any):
    most = np.iinfo(kind).max
    plate = np.rint(most * picture()).astype(kind)
    display = scene(plate, fl.Snow("heavy", color="local"))
    layer = display.replace(space="linear").layers(7).layers["snow"]
    alpha = layer.alpha[..., None].astype(np.float64)
    color = linear_to_srgb(layer.rgba[..., :3] / np.maximum(alpha, 1e-9))
    off = display.render(7) - (plate + alpha * (most * color - plate))
    assert np.abs(off).max() < 0.5 + 1e-5 * most and alpha.max() > 0.9


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
        assert (seen[10:50, :, 1] > (1.0 - 1e-3) * plate[10:50, :, 1]).all()


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


WEATHERS = {"ambient": fl.Snow("heavy"), "mist": fl.Mist("fog", structure=0.0)}


def lamp_at(folder: Path, frames: range, lit: range) -> fl.Scene:
    for number in frames:
        plate = street(0.02, 0.008)
        if number in lit:
            plate[50:85, 80:115] = 3.0
        fl.io.write_picture(folder / f"n.{number:04d}.exr", plate)
    return fl.Scene(str(folder / "n.%04d.exr"), effects=[WEATHERS["ambient"]], fps=24, seed=3)


@pytest.mark.parametrize("name", WEATHERS)
def test_a_lamp_that_enters_a_shot_changes_no_light(name: str, tmp_path: Path):
    shot = lamp_at(tmp_path, range(1, 13), range(8, 13)).replace(effects=[WEATHERS[name]])
    alone = [shot.replace(background=str(tmp_path / f"n.{n:04d}.exr")) for n in (1, 9)]
    shown, dark, bright = (one.render(9)[:30, :30] for one in (shot, *alone))
    np.testing.assert_allclose(shown.mean(), dark.mean(), rtol=0.02)
    assert bright.mean() > 1.2 * dark.mean()


def test_a_machine_with_one_plate_has_the_light_that_was_saved(tmp_path: Path, capsys: Any):
    shot = lamp_at(tmp_path, range(1, 10), range(3, 8))
    shot.save(tmp_path / "shot.toml")
    assert main(["light", str(tmp_path / "shot.toml"), "-o", str(tmp_path / "shot.toml")]) == 0
    printed = capsys.readouterr().out
    assert printed in (tmp_path / "shot.toml").read_text()
    assert main(["light", str(tmp_path / "n.0001.exr"), "-o", str(tmp_path / "shot.toml")]) == 2
    saved = fl.open(tmp_path / "shot.toml")
    assert saved.light == fl.scene.find_light(shot)
    wanted = shot.render(2)
    for number in (1, *range(3, 10)):
        (tmp_path / f"n.{number:04d}.exr").unlink()
    # The plates that are left say another light, and the shot's is in the file.
    assert not np.array_equal(shot.replace().render(2), wanted)
    assert np.array_equal(fl.open(tmp_path / "shot.toml").render(2), wanted)


def test_frames_of_another_light_do_not_go_on(tmp_path: Path):
    shot, frames = lamp_at(tmp_path, range(1, 10), range(3, 6)), str(tmp_path / "out/%04d.png")
    shot.write(frames, "1-2")
    assert len(shot.replace().write(frames, "1-2").kept) == 2
    lamp_at(tmp_path, range(3, 10), range(3, 10))
    with pytest.raises(ValueError, match="another"):
        shot.replace().write(frames, "1-2")
    shot.replace(light=fl.scene.Light(0.5)).write(frames, "1-2", overwrite=True)


def test_keys_follow_a_sky_that_changes_and_no_lamp(tmp_path: Path):
    for number in range(1, 10):
        plate = (1.0 - 0.1 * number) * street(1.0, 0.4)
        plate[50:85, 80:115] = 3.0 if number > 4 else 0.1
        fl.io.write_picture(tmp_path / f"n.{number}.exr", plate)
    light = fl.scene.find_light(fl.Scene(str(tmp_path / "n.%d.exr")), keyed=True)
    skies = [light.at(t)[0].mean() for t in range(1, 10)]
    np.testing.assert_allclose(np.divide(skies, skies[4]), (1 - 0.1 * np.arange(1, 10)) / 0.5, 0.02)
    white = fl.Scene(size=(96, 64), effects=[fl.Snow("heavy")], fps=24)
    keyed = white.replace(light=fl.scene.Light(fl.Keys([(0, 0.1), (10, 0.3)])))
    plain = white.replace(light=fl.scene.Light(np.float64(0.2)))
    assert np.array_equal(keyed.render(5), plain.render(5))


def test_a_light_without_sides_has_those_of_snow():
    snow, sky, ground = fl.scene.Light((0.9, 0.45, 0.0)).at(3.0)
    np.testing.assert_allclose((sky, ground), (snow / 0.9, 0.2 * snow))


EYE = np.zeros(3)


def rows(*lamps: fl.scene.Lamp) -> Array:
    return np.array([lamp.row(0.0, np.eye(3), EYE) for lamp in lamps])


def by_hand(
    point: Array, lamp: Array, power: float, optics: Optics, air: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Return albedo, phase function, irradiance and what air leaves on both ways, multiplied."""
    way = point - lamp
    square = float(way @ way)
    cosine = float(way @ -point) / math.sqrt(square * float(point @ point))
    g = optics.asymmetry
    share = (1.0 - g * g) / (4.0 * math.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
    left = math.exp(-air[0] * math.sqrt(square) - air[1] * math.sqrt(float(point @ point)))
    return optics.albedo * share * power / square * left


@pytest.mark.parametrize("optics", [FLAKES, DROPS])
def test_radiance_at_three_places(optics: Optics):
    lamp = fl.scene.Lamp((1.0, -2.0, 6.0), color=(1.0, 0.5, 0.25), power=20.0)
    points = np.array([[0.0, 0.0, 3.0], [1.0, 0.5, 9.0], [-2.0, -1.0, 5.0]])
    found = radiance(points, rows(lamp), optics, EYE)
    for point, row in zip(points, found, strict=True):
        wanted = by_hand(point, np.array([1.0, -2.0, 6.0]), 20.0, optics)
        assert np.abs(row / (wanted * np.array([1.0, 0.5, 0.25])) - 1.0).max() < 1e-12


def test_drawn_flakes_have_that_radiance_in_mist():
    lamp = fl.scene.Lamp((0.7, -1.0, 5.0), power=9.0)
    snow = fl.Snow(
        density=1.5, flake_size=(0.08, 0.08, 0.08), color=0.0, wind=(0.0, 0.0, 0.0), fall=0.0,
        near=1.0, far=5.0, shape="round", method="simulated", seed=2,
    )  # fmt: skip
    # What lies on the ground is no air between a lamp and all flakes.
    low = fl.Mist(visibility=40.0, top=0.5)
    scene = fl.Scene(
        "#000000", size=(160, 120), camera=fl.Camera(150.0), lights=[lamp], space="linear",
        effects=[low, fl.Mist(visibility=12.0), snow, fl.Mist(visibility=50.0)],
    )  # fmt: skip
    seen = scene.layers(0)
    layer = seen.layers["snow"]
    light, alpha, ids = layer.rgba[..., 0], layer.alpha, layer.ids
    # The mist behind the flakes is on both ways; the one before covers them.
    behind, front = (-math.log(0.05) / far for far in (12.0, 50.0))
    air = behind + front + 1.5 * snow.opacity * math.pi / 4 * 0.08**2, behind
    places = {int(one["id"]): one["place"] for one in fl.flakes(scene, 0)}
    # Where a flake is alone its light is that of its own place.
    checked = 0
    for number, place in places.items():
        inside = (ids == number) & (alpha > 0.3)
        if not inside.any():
            continue
        wanted = by_hand(place, np.array([0.7, -1.0, 5.0]), 9.0, FLAKES, air)
        assert np.median(light[inside] / alpha[inside]) == pytest.approx(wanted, rel=1e-3)
        checked += 1
    assert checked >= 3


def test_a_spot_ends_at_its_cone_and_a_sun_does_not_fade():
    spot = fl.scene.Lamp((0, 0, 0), direction=(0, 0, 1), angle=0.8, soft=0.25, power=5.0)
    point = fl.scene.Lamp((0, 0, 0), power=5.0)
    inside, outside = np.array([[0.4, 0.0, 4.0]]), np.array([[2.0, 0.0, 4.0]])
    for place, whole in ((inside, True), (outside, False)):
        got = radiance(place, rows(spot), FLAKES, EYE)
        wanted = radiance(place, rows(point), FLAKES, EYE)
        assert np.allclose(got, wanted if whole else 0.0)
    sun = rows(fl.scene.Lamp(direction=(0, 1, 0), power=2.0))
    near, far = (radiance(np.array([[0.0, 0.0, z]]), sun, FLAKES, EYE) for z in (1.0, 900.0))
    assert np.allclose(near, far)


def test_a_carried_lamp_goes_with_the_camera():
    way = fl.CameraPath(fl.Camera(200.0), velocity=(0.0, 0.0, 5.0))
    snow = fl.Snow("heavy", color=0.0)

    def later(**lamp: Any) -> float:
        """The light after two seconds over that of the beginning."""
        lights = [fl.scene.Lamp((0.5, 0.5, 0.0), power=30.0, **lamp)]
        plate = np.zeros((96, 128, 3), np.float32)
        scene = fl.Scene(plate, camera=way, effects=[snow], seed=1, lights=lights)
        first, then = (sum(scene.render(t + k).mean() for k in range(0, 25, 4)) for t in (0, 60))
        return float(then / first)

    assert abs(later(carried=True) - 1.0) < 0.5 and later() < 0.3


def test_lamps_light_snow_and_leave_opacity():
    plate = np.full((96, 128, 3), 10, np.uint8)
    dark = fl.Scene(plate, effects=[fl.Snow("heavy", color="local")], seed=1, space="linear")
    lamp = fl.scene.Lamp((1.0, -1.0, 6.0), color=(1.0, 0.6, 0.3), power=40.0)
    lit = dark.replace(lights=(lamp,))
    pair = [scene.layers(4) for scene in (dark, lit)]
    assert np.abs(pair[0].alpha - pair[1].alpha).max() < 1e-6
    more = pair[1].layers["snow"].rgba[..., :3].astype(np.float64).sum(axis=(0, 1))
    more -= pair[0].layers["snow"].rgba[..., :3].sum(axis=(0, 1))
    assert (more > 0.0).all() and abs(more[1] / more[0] - 0.6) < 0.02
    assert np.array_equal(pair[1].image, lit.render(4))
    assert np.array_equal(lit.render(4)[30:70, 20:90], lit.render(4, region=np.s_[30:70, 20:90]))
    off = lit.replace(lights=(fl.scene.Lamp((1.0, -1.0, 6.0), power=0.0),))
    assert np.abs(off.render(4).astype(int) - dark.render(4)).max() <= 1


def test_a_lamp_without_a_place_and_a_spot_without_an_angle_are_refused():
    spot, none = {"place": (0, 0, 1), "direction": (0, 0, 1)}, {"direction": (0, 0, 0)}
    wrong = {"needs a place, a d": {}, "a spot has a place": spot, "direction must not be": none}
    for said, given in wrong.items():
        with pytest.raises(ValueError, match=said):
            fl.scene.Lamp(**given)

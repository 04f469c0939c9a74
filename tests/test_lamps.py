"""Lamps: a flake's radiance by hand, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.light.lamp import DROPS, FLAKES, Optics, radiance

Array = np.ndarray[Any, Any]
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
    snow = fl.Snow("heavy", color="local")
    dark = fl.Scene(plate, effects=[snow], seed=1)
    lamp = fl.scene.Lamp((1.0, -1.0, 6.0), color=(1.0, 0.6, 0.3), power=40.0)
    lit = dark.replace(lights=(lamp,))
    pair = [scene.layers(4) for scene in (dark, lit)]
    assert np.abs(pair[0].alpha - pair[1].alpha).max() < 1e-6
    more = pair[1].layers["snow"].rgba[..., :3].astype(np.float64).sum(axis=(0, 1))
    more -= pair[0].layers["snow"].rgba[..., :3].sum(axis=(0, 1))
    assert (more > 0.0).all() and abs(more[1] / more[0] - 0.6) < 0.02
    assert np.array_equal(pair[1].image, lit.render(4))
    assert np.array_equal(lit.render(4)[30:70, 20:90], lit.render(4, region=np.s_[30:70, 20:90]))
    names = {step.name for step in lit.plan(3, probe=False).steps}
    assert "snow: lamps" in names
    off = lit.replace(lights=(fl.scene.Lamp((1.0, -1.0, 6.0), power=0.0),))
    assert np.abs(off.render(4).astype(int) - dark.render(4)).max() <= 1


def test_a_lamp_without_a_place_and_a_spot_without_an_angle_are_refused():
    for given, said in (
        ({}, "needs a place, a d"),
        ({"place": (0, 0, 1), "direction": (0, 0, 1)}, "a spot has a place"),
        ({"direction": (0, 0, 0)}, "direction must not be"),
    ):
        with pytest.raises(ValueError, match=said):
            fl.scene.Lamp(**given)

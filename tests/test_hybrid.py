"""Snow stands nowhere and pops never, measured on rendered frames."""

from functools import partial

import numpy as np
import pytest

import flurries as fl
import measure
from measure import picture, scene

CROWD = {"texture": 0.0, "haze": 0.0, "color": 1.0, "flakes": 2000, "flake_size": (0.03, 0.05),
         "near_depth": 4.0}  # fmt: skip
SOMETIMES = np.random.default_rng(2).uniform(0.0, 500.0, 25)


# In shorter ones those of the kernel's tables show, of .08.
SHORT = (0.08, 0.04, 0.02)


def changes(options: dict, times: np.ndarray = SOMETIMES, **about) -> np.ndarray:
    shown = scene({**CROWD, **options}, 256, **about)
    return measure.largest_changes(partial(picture, shown), times, SHORT)


TURNING = fl.Keys([(0, (0.0, 0.0, 0.0)), (100, (0.4, 1.2, -0.4))])


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


@pytest.mark.parametrize("given", [
    {"wind": fl.Wind((1.0, 0.0, 0.0), gusts=1.5, swirl=0.5)},
    {"wind": fl.Wind((1.0, 0.0, 0.0), profile=[(1.0, (1.0, 0.0, 0.0)), (4.0, (-1.5, 0.4, 0.0))])},
    {"camera": fl.CameraPath(fl.Camera(300.0), velocity=(0.6, -0.4, 0.0), orientation=TURNING)},
])  # fmt: skip
def test_no_flake_pops_in_wind_and_turning(given: dict):
    camera = given.get("camera", fl.Camera(300.0))
    options = {name: value for name, value in given.items() if name != "camera"}
    assert measure.smooth(changes(options, np.array([0.0, 17.3, 55.1]), camera=camera))


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

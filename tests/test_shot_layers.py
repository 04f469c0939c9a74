"""Depth and motion of every layer: judged by points that are followed one by one."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl

H, W = 72, 96
LENS = fl.Camera(110.0)
FLIGHT = fl.CameraPath(LENS, velocity=(0.5, -0.2, 1.5))
EFFECTS: dict[str, Any] = {
    "mist": fl.Mist("fog", wind=(1.0, 0.0, 0.0)),
    "cone rain": fl.effects.ConeRain("downpour", haze=0.0),
    "snow": fl.Snow("heavy"),
    "tent": fl.effects.TentSnow("heavy"),
}


def rendered(effect: Any, **changes: Any) -> fl.scene.Rendered:
    given: dict[str, Any] = {"camera": FLIGHT, "effects": [effect], "depth": 40.0, "fps": 24.0}
    return fl.Scene((0.0, 0.0, 0.0), size=(W, H), **{**given, **changes}).layers(3)


@pytest.mark.parametrize("name", EFFECTS)
def test_no_layer_is_behind_the_scene(name: str):
    made = rendered(EFFECTS[name])
    (layer,) = made.layers.values()
    assert layer.motion is not None and layer.backward is not None
    depth, shown = layer.depth, layer.alpha > 0.02
    assert shown.any() and np.isfinite(depth[shown]).all()
    assert (depth[np.isfinite(depth)] <= 40.0).all(), "behind the scene"
    assert (depth[shown] > 0.0).all() and depth[shown].min() < 40.0


def test_fog_is_where_its_particles_are():
    """One particle: its depth and its way are those of a point."""
    fog = fl.Mist(count=1, radius=0.4, density=0.9, box=4.0, center=(0.0, 0.0, 0.0), seed=2)
    camera = fl.CameraPath(LENS, position=[(0.05 * t, 0.0, -6.0 + 0.1 * t) for t in range(9)])
    scene = fl.Scene(size=(W, H), effects=[fog], camera=camera, fps=24.0)
    made = scene.layers(3)
    depth, motion = made.layers["mist"].depth, made.layers["mist"].motion
    shown = made.alpha > 0.05
    assert shown.any() and np.ptp(depth[shown]) < 1e-4
    asks = scene._program.views(3.0)
    points, _ = fog.parts.places(asks[0][1], 1.0)
    later, _ = fog.parts.places(scene._program.views(4.0)[0][1], 1.0)
    earlier, _ = fog.parts.places(scene._program.views(2.0)[0][1], 1.0)
    assert depth[shown][0] == pytest.approx(points[0, 2], rel=1e-5)
    # What a pixel shows lies at the particle's depth, and moves as the particle does.
    y, x = np.mgrid[:H, :W] + 0.5
    aside = np.stack([x - W / 2, y - H / 2], axis=-1)[shown]
    place = np.c_[aside / 110.0 * points[0, 2], np.full(len(aside), points[0, 2])]
    for other, told in ((later, motion), (earlier, made.layers["mist"].backward)):
        then = place + (other - points)
        wanted = 110.0 * then[:, :2] / then[:, 2:] - aside
        np.testing.assert_allclose(told[shown], wanted, atol=2e-3)


def test_thick_fog_before_snow_tells_the_fog():
    snow, fog = fl.Snow("light"), fl.Mist("fog", density=1.0, wind=(2.0, 0.0, 0.0))
    made = rendered([snow, fog][0], effects=[snow, fog])
    thick = made.layers["mist"].alpha > 0.9
    assert thick.mean() > 0.3
    np.testing.assert_array_equal(made.weather_depth[thick], made.layers["mist"].depth[thick])
    np.testing.assert_array_equal(made.motion[thick], made.layers["mist"].motion[thick])
    np.testing.assert_array_equal(made.backward[thick], made.layers["mist"].backward[thick])
    assert made.weather_depth[thick].max() < 3.0


def test_the_recipe_of_the_page_rebuilds_the_picture(tmp_path: Path, monkeypatch: Any):
    monkeypatch.chdir(tmp_path)
    plate = np.random.default_rng(1).uniform(0.0, 0.3, (H, W, 3)).astype(np.float32)
    plate[20:24, 30:34] = 30.0
    front = np.zeros((H, W, 4), np.float32)
    front[50:] = (0.0, 0.4, 0.0, 0.5)
    scene = fl.Scene(
        plate, depth=200.0, foreground=front,
        effects=[kind(color="local", haze=0.2) for kind in (fl.Snow, fl.Rain)],
    )  # fmt: skip
    scene.write("shot.%04d.exr", "12", layers=True, bits="float")
    page = (Path(__file__).parents[1] / "docs" / "layers.md").read_text()
    (recipe,) = re.findall(r"```python\n(import OpenImageIO.*?)```", page, re.S)
    made: dict[str, Any] = {}
    exec(recipe, made)
    assert made["names"] == ["snow.veil", "snow", "rain.veil", "rain", "foreground"]
    np.testing.assert_allclose(made["again"], made["layers"]["rgba"][..., :3], atol=1e-5)
    # The control: the veil is no small matter.
    assert made["layers"]["snow.veil"][..., 3].max() > 0.05

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

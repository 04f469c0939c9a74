"""What layers say of their pixels: motion, depth, coverage, ids; as arrays and as channels of EXR.

Where flakes, textures and media are and go is judged in `test_truth.py`.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries.effects import TentRain, TentSnow
from flurries.io import read_layers
from stills import header_of

W, H = 256, 192
LIGHT = np.random.default_rng(3).gamma(1.0, 0.4, (H, W, 3)).astype(np.float32)


def test_the_texture_moves_as_the_mean_of_its_gradients():
    # The formula of the docstring, with the plain spectrum, by hand.
    effect = TentSnow(fall=0.6, wind=(0.2, 0, 0), flakes=0, alias="keep", shutter=0.0)
    scene = fl.Scene(size=(W, H), camera=fl.Camera(300.0), effects=effect)
    got = scene.layers(10)
    low, high = effect.parts.texture.field.band((H, W))
    # 8/3 of the longest wave, in whole steps of 8 px; 16 px at least.
    tile = max(8 * int(np.ceil(high / 3.0)), 16)
    k = np.hypot(np.fft.fftfreq(tile)[:, None], np.fft.fftfreq(tile)[None])
    inside = (k > 0) & (1 / np.maximum(k, 1e-9) > low) & (1 / np.maximum(k, 1e-9) <= high)
    power = np.where(inside, np.maximum(k, 1e-9) ** (-2 * effect.exponent), 0.0)
    length = (power * k).sum() / (power * k**2).sum()
    drift = 300.0 * np.array([0.2, 0.6]) / scene.fps / effect.near_depth
    want = drift * length / high
    assert np.abs(got.layers["snow"].motion / want - 1.0).max() < 0.03
    assert np.abs(got.layers["snow"].depth / (effect.near_depth * high / length) - 1.0).max() < 0.03


def test_ids_are_the_strongest_flake():
    rng = np.random.default_rng(1)
    points = np.c_[rng.uniform(-1, 1, (40, 2)), rng.uniform(1, 3, 40)]
    velocity, radius = rng.normal(0, 0.2, (40, 3)), rng.uniform(0.02, 0.2, 40)
    camera, shape = fl.Camera(60.0), (60, 80)
    common = {"velocity": velocity, "shutter": 0.5}
    got = fl.particles.ids(shape, points, radius, camera, opacity=0.7, **common)
    alone = np.stack([
        fl.particles.splat(shape, points[i : i + 1], radius[i : i + 1], camera, opacity=0.7,
                           velocity=velocity[i : i + 1], shutter=0.5, dtype=np.float64)
        for i in range(40)
    ])  # fmt: skip
    best = np.where(alone.max(axis=0) > 0, alone.argmax(axis=0), -1)
    # float64 tells all but the faintest tails apart.
    differ = got != best
    assert (alone.max(axis=0)[differ] < 1e-9).all() and differ.mean() < 0.01
    wall = np.full(shape, 0.5)
    assert (fl.particles.ids(shape, points, radius, camera, opacity=0.7, depth=wall) == -1).all()


def test_channels_are_called_as_compositors_call_them(tmp_path: Path):
    front = np.zeros((H, W, 4), np.float32)
    front[150:, :100] = (0.1, 0.2, 0.05, 0.8)
    two = [TentSnow(flakes=300), TentRain()]
    scene = fl.Scene(LIGHT, effects=two, depth=30.0, foreground=front, seed=9)
    scene.write(tmp_path / "a.exr", 12, layers=True)
    spec = oiio.ImageBuf(str(tmp_path / "a.exr")).spec()
    types = {name: str(spec.channelformat(i)) for i, name in enumerate(spec.channelnames)}
    named = {*"RGBA", "depth.Z", "alpha.A", "weather.depth.Z"}
    named |= {f"{way}.{c}" for way in ("forward", "backward") for c in "uv"}
    named |= {f"background.{c}" for c in "RGB"} | {f"foreground.{c}" for c in "RGBA"}
    ends = [*"RGBA", "depth.Z", "forward.u", "forward.v", "backward.u", "backward.v",
            "coverage.A", "id.lo", "id.hi"]  # fmt: skip
    named |= {f"{layer}.{end}" for layer in ("snow", "rain") for end in ends}
    assert types == {
        name: "uint" if ".id" in name else "float" if name[-1] in "Zuv" else "half"
        for name in named
    }
    said = header_of(tmp_path / "a.exr")
    assert said["version"] == fl.__version__ and (said["seed"], said["frame"]) == ("9", "12")
    assert said["light"] == "linear" and "y down" in said["motion"] and len(said["scene"]) > 16
    whole, read = scene.layers(12), read_layers(tmp_path / "a.exr")
    assert np.array_equal(read["snow.forward"], whole.layers["snow"].motion)
    assert np.array_equal(read["forward"], whole.motion)
    assert np.array_equal(read["rain.id"], np.maximum(whole.layers["rain"].ids, 0))
    assert np.array_equal(read["rain.depth"], whole.layers["rain"].depth)


@pytest.mark.parametrize("layers", [True, False])
def test_two_eyes_are_two_views(layers: bool, tmp_path: Path):
    scene = fl.Scene(LIGHT, effects=TentSnow(flakes=300))
    eye = scene.camera.camera
    sides = {"left": -0.03, "right": 0.03}
    eyes = {name: fl.Camera(eye.focal, offset=(side, 0, 0)) for name, side in sides.items()}
    scene.write(tmp_path / "%d.exr", "3-4", layers=layers, bits="float", eyes=eyes)
    for part, name in enumerate(eyes):
        buffer = oiio.ImageBuf(str(tmp_path / "4.exr"), part, 0)
        spec = buffer.spec()
        assert (buffer.nsubimages, spec["view"], spec["oiio:subimagename"]) == (2, name, name)
        assert ("snow.forward.u" in spec.channelnames) == layers
        kinds = {n: str(spec.channelformat(i)) for i, n in enumerate(spec.channelnames)}
        assert kinds.get("snow.id.hi") == ("uint" if layers else None)
        assert spec["flurries:frame"] == "4"
        got = oiio.ImageBufAlgo.channels(buffer, ("R", "G", "B")).get_pixels(oiio.FLOAT)
        assert np.array_equal(got, scene.render(4, eye=eyes[name]))
    with pytest.raises(ValueError, match="already"):
        scene.write(tmp_path / "%d.exr", "3", layers=layers, bits="float")


@pytest.mark.parametrize(("name", "eyes"), [
    ("a.png", {"left": fl.Camera(9.0)}), ("a.exr", {"a b": 1}), ("a.exr", {"left": 3}),
    ("a.exr", {}), ("a.exr", 5),
])  # fmt: skip
def test_eyes_that_cannot_be(name: str, eyes: object, tmp_path: Path):
    with pytest.raises((TypeError, ValueError), match="eyes"):
        fl.Scene(size=(8, 8)).write(tmp_path / name, 1, eyes=eyes)
    assert not list(tmp_path.iterdir())


SMALL = (96, 72)
FLIGHT = fl.CameraPath(fl.Camera(110.0), velocity=(0.5, -0.2, 1.5))
EFFECTS: dict[str, Any] = {
    "mist": fl.Mist("fog", wind=(1.0, 0.0, 0.0)),
    "cone rain": fl.effects.ConeRain("downpour", haze=0.0), "snow": fl.Snow("heavy"),
    "tent": TentSnow("heavy"),
}  # fmt: skip


def rendered(*effects: Any) -> fl.scene.Rendered:
    given: dict[str, Any] = {"camera": FLIGHT, "effects": effects, "depth": 40.0, "fps": 24.0}
    return fl.Scene((0.0, 0.0, 0.0), size=SMALL, **given).layers(3)


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
    made = rendered(snow, fog)
    thick = made.layers["mist"].alpha > 0.9
    assert thick.mean() > 0.3
    np.testing.assert_array_equal(made.weather_depth[thick], made.layers["mist"].depth[thick])
    np.testing.assert_array_equal(made.motion[thick], made.layers["mist"].motion[thick])
    np.testing.assert_array_equal(made.backward[thick], made.layers["mist"].backward[thick])
    assert made.weather_depth[thick].max() < 3.0


def test_the_recipe_of_the_page_rebuilds_the_picture(tmp_path: Path, monkeypatch: Any):
    monkeypatch.chdir(tmp_path)
    plate = np.random.default_rng(1).uniform(0.0, 0.3, (72, 96, 3)).astype(np.float32)
    plate[20:24, 30:34] = 30.0
    front = np.zeros((72, 96, 4), np.float32)
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

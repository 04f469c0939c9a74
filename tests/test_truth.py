"""What every layer says of its pixels, before every camera and in files: depth, motion, number.

Flakes and drops are followed in the list of them, media and textures as points of the air at the
depth that the pixel tells; both through a camera written here.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from scipy.spatial.transform import Rotation

import flurries as fl
from flurries.effects import TentRain, TentSnow
from flurries.io import read_layers
from stills import header_of, kinds_of, spec_of

SIZE, FOCAL, FPS, T = np.array((240, 180)), 260.0, 30.0, 12.0
SPEED, SPIN, ZOOM = np.array((0.5, -0.2, 2.0)), np.array((0.0, 0.0125, 0.0)), 2.0
AIR = (1.0, 0.0, 0.3)
STILL = (0.0, 0.0, 0.0)

CAMERAS: dict[str, dict[str, Any]] = {
    "still": {},
    "moving": {"velocity": tuple(SPEED)},
    "turning": {"orientation": fl.Keys([(0, STILL), (40, tuple(40 * SPIN))])},
    "zooming": {"focal": fl.Keys([(0, FOCAL), (40, FOCAL + 40 * ZOOM)])},
}
LENSES = {"pinhole": None, "opening": fl.camera.Lens(focus=4.0, f_stop=1.4)}
NEAR: dict[str, Any] = {"near": 1.5, "far": 8.0, "method": "simulated"}
FLAKES: dict[str, Any] = {
    "snow": fl.Snow("heavy", wind=AIR),
    "snow, all drawn": fl.Snow(density=12.0, wind=AIR, **NEAR),
    "snow in gusts": fl.Snow(density=12.0, wind=fl.Wind(AIR, gusts=0.8, swirl=0.4), **NEAR),
    "rain, all drawn": fl.Rain(density=120.0, wind=AIR, **NEAR),
    "tent": fl.effects.TentSnow(texture=0.0, haze=0.0, wind=AIR),
    "tent's rain": fl.effects.TentRain(texture=0.0, haze=0.0, wind=AIR),
}
# What is cut of fast streaks would weigh depth and motion differently.
WHOLE: dict[str, Any] = {"alias": "keep", "renormalise": False, "shutter": 0.0}
# With the largest error in pixels and the largest median error, of the median speed.
MEDIA: dict[str, Any] = {
    "fog": (fl.Mist("fog", wind=AIR), 1e-5, 1e-6),
    "bank": (fl.Mist("bank", wind=AIR), 1e-5, 1e-6),
    "particles": (fl.Mist("fog", method="particles", wind=AIR), 1e-5, 1e-6),
    "rain on the cone": (fl.effects.ConeRain(haze=0.0, wind=AIR), 1e-5, 1e-6),
    "snow on the cone": (fl.effects.ConeSnow(haze=0.0, flakes=0, wind=AIR), 1e-5, 1e-6),
    # One vector and one depth for each tile, in between interpolated.
    "texture": (fl.effects.TentSnow(flakes=0, haze=0.0, wind=AIR), 0.35, 0.03),
    "rain's texture": (fl.effects.TentRain(drops=0, haze=0.0, wind=AIR, **WHOLE), 0.35, 0.03),
}


def lens(kind: str, t: float) -> tuple[np.ndarray, Rotation, float]:
    turn = Rotation.from_rotvec(SPIN * t * (kind == "turning"))
    return SPEED * t / FPS * (kind == "moving"), turn, FOCAL + ZOOM * t * (kind == "zooming")


def seen(kind: str, places: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    eye, turn, focal = lens(kind, t)
    x = turn.inv().apply(places - eye)
    return focal * x[:, :2] / x[:, 2:] + SIZE / 2, x[:, 2]


def rendered(effect: Any, kind: str, **more: Any) -> tuple[fl.Scene, fl.scene.Rendered, str]:
    path = fl.CameraPath(fl.Camera(FOCAL), **CAMERAS[kind])
    scene = fl.Scene(
        "#203040", size=tuple(SIZE), camera=path, effects=[effect], fps=FPS, seed=5, **more
    )
    made = scene.layers(T)
    (name,) = (name for name, one in made.layers.items() if one.depth is not None)
    return scene, made, name


@pytest.mark.parametrize("opening", LENSES)
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("effect", FLAKES)
def test_a_pixel_tells_the_flake_that_it_shows(effect: str, kind: str, opening: str):
    scene, made, name = rendered(FLAKES[effect], kind, lens=LENSES[opening])
    ids, cover = made.layers[name].ids, made.layers[name].coverage
    # Where the texture behind a flake shows more, the planes are the texture's.
    shown = (ids >= 0) & (cover > 0.6 * made.layers[name].alpha) & (cover > 0.004)
    assert shown.sum() > 40 and len(np.unique(ids[shown])) > 4
    assert (ids[cover == 0.0] == -1).all()
    now = fl.flakes(scene, T)
    here, depth = seen(kind, now["place"], T)
    assert np.abs(here - now["pixel"]).max() < 1e-6
    order = np.argsort(now["id"])
    at = order[np.searchsorted(now["id"], ids[shown].astype(np.uint64), sorter=order)]
    np.testing.assert_array_equal(now["id"][at], ids[shown])
    np.testing.assert_allclose(made.layers[name].depth[shown], depth[at], rtol=1e-6)
    for step, plane in ((1.0, made.layers[name].motion), (-1.0, made.layers[name].backward)):
        then = fl.flakes(scene, T + step)
        both, first, second = np.intersect1d(now["id"], then["id"], return_indices=True)
        ways = np.full((len(now), 2), np.nan)
        ways[first] = seen(kind, then["place"][second], T + step)[0] - here[first]
        known = np.isfinite(ways[at, 0])
        assert known.mean() > 0.6 and len(both) > 20
        assert np.abs(plane[shown][known] - ways[at][known]).max() < 1e-5


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("medium", MEDIA)
def test_a_pixel_tells_the_air_at_its_depth(medium: str, kind: str):
    effect, most, share = MEDIA[medium]
    _, made, name = rendered(effect, kind)
    shown = np.isfinite(made.layers[name].depth) & (made.layers[name].alpha > 0.004)
    assert shown.mean() > 0.3
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    pixels = np.c_[x[shown], y[shown]]
    depth = made.layers[name].depth[shown].astype(float)[:, None]
    eye, turn, focal = lens(kind, T)
    places = eye + turn.apply(np.c_[(pixels - SIZE / 2) / focal, np.ones(len(pixels))] * depth)
    air = np.add(AIR, (0.0, getattr(effect, "fall", 0.0), 0.0))
    for step, plane in ((1.0, made.layers[name].motion), (-1.0, made.layers[name].backward)):
        way = seen(kind, places + air * step / FPS, T + step)[0] - pixels
        off = np.linalg.norm(plane[shown] - way, axis=1)
        assert off.max() < most
        assert np.median(off) < share * np.median(np.linalg.norm(way, axis=1))


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
    differ = got != best  # float64 tells all but the faintest tails apart.
    assert (alone.max(axis=0)[differ] < 1e-9).all() and differ.mean() < 0.01
    wall = np.full(shape, 0.5)
    assert (fl.particles.ids(shape, points, radius, camera, opacity=0.7, depth=wall) == -1).all()


def test_channels_are_called_as_compositors_call_them(tmp_path: Path):
    front = np.zeros((H, W, 4), np.float32)
    front[150:, :100] = (0.1, 0.2, 0.05, 0.8)
    two = [TentSnow(flakes=300), TentRain()]
    scene = fl.Scene(LIGHT, effects=two, depth=30.0, foreground=front, seed=9)
    scene.write(tmp_path / "a.exr", 12, layers=True, plate=True)
    types = kinds_of(spec_of(tmp_path / "a.exr"))
    named = {*"RGBA", "depth.Z", "alpha.A", "weather.depth.Z"}
    named |= {f"{way}.{c}" for way in ("forward", "backward") for c in "uv"}
    named |= {f"background.{c}" for c in "RGB"} | {f"foreground.{c}" for c in "RGBA"}
    ends = [*"RGBA", "depth.Z", "forward.u", "forward.v", "backward.u", "backward.v",
            "coverage.A", "id.lo", "id.hi"]  # fmt: skip
    named |= {f"{layer}.{end}" for layer in ("snow", "rain") for end in ends}
    assert types == {
        name: "uint" if ".id" in name else "float" if name[-1] == "Z" else "half" for name in named
    }
    said = header_of(tmp_path / "a.exr")
    assert said["version"] == fl.__version__ and (said["seed"], said["frame"]) == ("9", "12")
    assert said["light"] == "linear" and "y down" in said["motion"] and len(said["scene"]) > 16
    whole, read = scene.layers(12), read_layers(tmp_path / "a.exr")
    for name, wanted in (("snow.forward", whole.layers["snow"].motion), ("forward", whole.motion)):
        assert np.array_equal(read[name], wanted.astype(np.float16))
    assert np.array_equal(read["rain.id"], np.maximum(whole.layers["rain"].ids, 0))
    assert np.array_equal(read["rain.depth"], whole.layers["rain"].depth)


def test_nothing_stands_twice_in_a_file_and_bits_are_as_many_as_show(tmp_path: Path):
    picture = np.random.default_rng(1).integers(0, 256, (96, 128, 3), np.uint8)
    snow, mist = fl.Snow("heavy"), fl.Mist("fog")
    whole = ["alpha", "backward", "forward", "weather.depth"]
    for plate, effects in ((picture, [snow]), (LIGHT, [snow]), (picture, [snow, mist])):
        scene = fl.Scene(plate, effects=effects, depth=20.0, fps=24.0)
        scene.write(tmp_path / "a.exr", 3, layers=True, overwrite=True)
        got, made = read_layers(tmp_path / "a.exr"), scene.layers(3)
        names = [name.partition(".")[0] for name in got]
        # Those of one layer are its own.
        assert sorted(set(got) & set(whole)) == (whole if len(effects) == 2 else [])
        assert set(names) <= {"snow", "mist", *(one.partition(".")[0] for one in whole)}
        for name, layer in made.layers.items():
            # 9 bits over bytes, and else the 11 of a half, which is coarser below 2^-14.
            error = 2.0**-9 if plate is picture else 2.0**-11
            parts = {
                "": (layer.rgba, error), ".coverage": (layer.coverage, error),
                ".forward": (layer.motion, 2.0**-11), ".backward": (layer.backward, 2.0**-11),
                ".depth": (layer.depth, 0.0),
            }  # fmt: skip
            for end, (wanted, most) in parts.items():
                assert (name + end in got) == (wanted is not None)
                if wanted is not None:
                    limit = most * np.maximum(np.abs(wanted), 2.0**-13)
                    close = np.abs(got[name + end] - wanted) <= limit
                    assert (close | (got[name + end] == wanted)).all(), name + end
        scene.write(tmp_path / "b.exr", 3, layers=True, bits="float", overwrite=True)
        exact = read_layers(tmp_path / "b.exr")
        assert all(np.array_equal(exact[name], made.layers[name].rgba) for name in made.layers)


@pytest.mark.parametrize("layers", [True, False])
def test_two_eyes_are_two_views(layers: bool, tmp_path: Path):
    scene = fl.Scene(LIGHT, effects=TentSnow(flakes=300))
    eye = scene.camera.camera
    sides = {"left": -0.03, "right": 0.03}
    eyes = {name: fl.Camera(eye.focal, offset=(side, 0, 0)) for name, side in sides.items()}
    scene.write(tmp_path / "%d.exr", "3-4", layers=layers, plate=layers, bits="float", eyes=eyes)
    for part, name in enumerate(eyes):
        buffer = oiio.ImageBuf(str(tmp_path / "4.exr"), part, 0)
        spec = buffer.spec()
        assert (buffer.nsubimages, spec["view"], spec["oiio:subimagename"]) == (2, name, name)
        assert ("snow.forward.u" in spec.channelnames) == layers
        assert kinds_of(spec).get("snow.id.hi") == ("uint" if layers else None)
        assert spec["flurries:frame"] == "4"
        got = oiio.ImageBufAlgo.channels(buffer, ("R", "G", "B")).get_pixels(oiio.FLOAT)
        assert np.array_equal(got, scene.render(4, eye=eyes[name]))
    with pytest.raises(ValueError, match="already"):
        scene.write(tmp_path / "%d.exr", "3", layers=layers, bits="float")


def test_eyes_that_cannot_be(tmp_path: Path):
    names = {"a.png": [{"left": fl.Camera(9.0)}], "a.exr": [{"a b": 1}, {"left": 3}, {}, 5]}
    for name, eyes in ((name, one) for name, many in names.items() for one in many):
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


def before_a_wall(*effects: Any) -> fl.scene.Rendered:
    given: dict[str, Any] = {"camera": FLIGHT, "effects": effects, "depth": 40.0, "fps": 24.0}
    return fl.Scene((0.0, 0.0, 0.0), size=SMALL, **given).layers(3)


@pytest.mark.parametrize("name", EFFECTS)
def test_no_layer_is_behind_the_scene(name: str):
    made = before_a_wall(EFFECTS[name])
    (layer,) = made.layers.values()
    assert layer.motion is not None and layer.backward is not None
    depth, shown = layer.depth, layer.alpha > 0.02
    assert shown.any() and np.isfinite(depth[shown]).all()
    assert (depth[np.isfinite(depth)] <= 40.0).all(), "behind the scene"
    assert (depth[shown] > 0.0).all() and depth[shown].min() < 40.0


def test_thick_fog_before_snow_tells_the_fog():
    snow, fog = fl.Snow("light"), fl.Mist("fog", density=1.0, wind=(2.0, 0.0, 0.0))
    made = before_a_wall(snow, fog)
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
    scene.write("shot.%04d.exr", "12", layers=True, plate=True, bits="float")
    page = (Path(__file__).parents[1] / "docs" / "layers.md").read_text()
    (recipe,) = re.findall(r"```python\n(import OpenImageIO.*?)```", page, re.S)
    made: dict[str, Any] = {}
    exec(recipe, made)
    assert made["names"] == ["snow.veil", "snow", "rain.veil", "rain", "foreground"]
    np.testing.assert_allclose(made["again"], made["layers"]["rgba"][..., :3], atol=1e-5)
    # The control: the veil is no small matter.
    assert made["layers"]["snow.veil"][..., 3].max() > 0.05

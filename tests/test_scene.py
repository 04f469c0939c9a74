"""The scene: a frame is a pure function, its layers add up, files with alpha, what it refuses."""

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import read_picture, read_video, write_picture

Keys, Snow, Scene, Camera = fl.Keys, fl.effects.TentSnow, fl.Scene, fl.camera.Camera
W, H = 90, 70
RNG = np.random.default_rng(11)
BYTES = RNG.integers(0, 200, (H, W, 3)).astype(np.uint8)
FLOATS = RNG.gamma(1.0, 0.5, (H, W, 3)).astype(np.float32)
MASK = np.zeros((H, W), np.float32)
MASK[:, 30:60], MASK[:, 60:] = 0.5, 1.0
FEW = {"flakes": 300}


def fly(**way: Any) -> fl.CameraPath:
    return fl.CameraPath(Camera(110.0), **way)


SCENES: dict[str, fl.Scene] = {
    "keyed": Scene("#203040", size=(W, H), camera=fly(velocity=(0.3, -0.2, 1.5)), seed=-5,
                   effects=[Snow(amount=Keys([(0, 0.2), (20, 1.0)]), **FEW,
                                 wind=Keys([(0, (0, 0, 0)), (9, (2, 0, 1))]))], fps=24.0),
    "float": Scene(FLOATS, camera=fly(position=RNG.normal(size=(5, 3)).cumsum(axis=0)),
                   effects=[Snow("blizzard", **FEW),
                            Snow(seed=9, jitter=True, color=(0.5, 0.7, 0.9), **FEW)]),
    "matte": Scene(BYTES, effects=[Snow("heavy", **FEW)], foreground=MASK, space="linear"),
    "paper": Scene(BYTES, effects=[Snow("paper", **FEW)], seed=2**63 - 1),
}  # fmt: skip


PARTS = [
    np.s_[0:1, 0:1], np.s_[H - 1 : H, W - 1 : W], np.s_[33:34, 45:46], np.s_[:, :],
    np.s_[20:51, 13:77], np.s_[-9:, :], np.s_[:, 63:65], np.s_[5:1000, 80:],
]  # fmt: skip


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_a_region_has_the_bits_of_the_whole(scene: fl.Scene):
    whole = scene.layers(7.5)
    for part in PARTS:
        assert np.array_equal(scene.render(7.5, region=part), whole.image[part])
        apart = scene.layers(7.5, region=part)
        assert np.array_equal(apart.alpha, whole.alpha[part])
        for name, layer in whole.layers.items():
            assert np.array_equal(apart.layers[name].rgba, layer.rgba[part])


@pytest.mark.parametrize("t", [1e6, -5.5, 1e6 + 0.37, -1e6, np.float32(2.5), np.int64(3)])
def test_any_time_is_finite(t: Any):
    for scene in SCENES.values():
        got = scene.layers(t)
        assert np.isfinite(got.image).all() and np.isfinite(got.alpha).all()
        assert 0.0 < got.alpha.mean() < 1.0


def test_frozen_and_nobody_elses():
    scene, snow = SCENES["keyed"], Snow()
    for thing in (scene, snow, scene.layers(0)):
        for field in dataclasses.fields(thing):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(thing, field.name, 1)
    mine, mask = BYTES.copy(), MASK.copy()
    scene = Scene(mine, effects=[Snow(**FEW)], foreground=mask)
    scene.render(3)[...] = 1
    want = scene.render(3)
    assert np.array_equal(mine, BYTES) and np.array_equal(mask, MASK), "altered"
    mine[...], mask[...] = 7, 0.25
    assert np.array_equal(scene.render(3), want)
    for made in (scene.replace(fps=scene.fps), scene._anew(), pickle.loads(pickle.dumps(scene))):
        assert np.array_equal(made.render(3), want), "what the caller did reached a copy"


@pytest.mark.parametrize("space", ["auto", "linear"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_no_snow_is_the_background(dtype: type, space: str):
    kinds = {np.uint8: BYTES, np.uint16: BYTES.astype(np.uint16) * 257, np.float32: FLOATS.copy()}
    picture = kinds[dtype]
    if dtype is np.float32:
        picture[0, :3, 0] = [np.nan, np.inf, -0.0]
    for effects in ((), Snow(amount=0.0), [Snow(amount=Keys([(5, 0.0), (9, 1.0)]), haze=1.0)]):
        scene = Scene(picture, effects=effects, space=space)
        assert scene.render(5).tobytes() == picture.tobytes()
    assert scene.render(6).tobytes() != picture.tobytes()


@pytest.mark.parametrize("kind", ["float", "uint8", "bool", "file"])
def test_a_mask_hides_the_snow(kind: str, tmp_path: Path):
    masks: dict[str, Any] = {"float": MASK, "uint8": np.rint(MASK * 255).astype(np.uint8),
                             "bool": MASK == 1.0, "file": tmp_path / "mask.png"}  # fmt: skip
    write_picture(masks["file"], masks["uint8"])
    snow = [Snow("heavy", haze=0.5, **FEW)]
    free = Scene(BYTES, effects=snow).render(3)
    got = Scene(BYTES, effects=snow, foreground=masks[kind]).render(3)
    assert np.array_equal(got[:, 60:], BYTES[:, 60:])
    assert np.array_equal(got[:, :30], free[:, :30])
    assert not np.array_equal(free[:, 60:], BYTES[:, 60:])
    middle = (free[:, 30:60].astype(float) + BYTES[:, 30:60]) / 2
    wanted = free[:, 30:60] if kind == "bool" else middle
    assert np.abs(got[:, 30:60] - wanted).max() <= 1.5


@pytest.mark.parametrize("picture", [BYTES, FLOATS], ids=["bytes", "floats"])
def test_a_picture_stands_in_front(picture: np.ndarray):
    plain = Scene(picture, effects=[Snow(**FEW)])
    front = np.zeros((H, W, 4), picture.dtype)
    if picture is BYTES:
        front[...] = (10, 130, 250, 255)  # straight
        front[:, :40, 3], front[:, 40:50, 3] = 0, 51
        cover, most = front[..., 3:] / 255.0, 0.51
        color = front[..., :3] * cover
    else:
        front[:, 40:] = (0.1, 2.0, 0.5, 1.0)  # premultiplied
        front[:, 40:50] *= np.float32(0.25)
        cover, most, color = front[..., 3:].astype(float), 1e-6, front[..., :3]
    got = plain.replace(foreground=front).render(3)
    assert np.abs(got - color - (1.0 - cover) * plain.render(3)).max() <= most
    assert np.array_equal(got[:, :40], plain.render(3)[:, :40])


KEYED: dict[str, Any] = {
    "amount": 0.5, "fall": 2.0, "wind": (1.0, 2.0, 3.0), "color": (0.1, 0.2, 0.3), "haze": 0.5,
    "shutter": 0.0, "texture": 0.0, "mean": -0.5, "spread": 1.0, "power": 1.0, "flake_opacity": 0.5,
}  # fmt: skip


@pytest.mark.parametrize("name", KEYED)
def test_what_may_be_keyed_is(name: str):
    good = KEYED[name]
    snow = Snow(**{name: Keys([(0, good), (10, good)]), **FEW})
    plain = Snow(**{name: good, **FEW})
    first, second = (Scene(size=(W, H), effects=[s]).render(4).astype(int) for s in (snow, plain))
    assert np.abs(first - second).max() <= 1  # the way of keyed air is summed otherwise


@pytest.mark.parametrize("argument", ["background", "depth", "foreground"])
def test_a_file_that_is_missing_or_unreadable_is_told_with_its_argument(
    argument: str, tmp_path: Path
):
    size = None if argument == "background" else (8, 8)
    with pytest.raises(FileNotFoundError, match=rf"{argument}: No such file .*none\.exr"):
        fl.Scene(size=size, **{argument: "none.exr"})
    with pytest.raises(IsADirectoryError, match=rf"{argument}: Is a folder"):
        fl.Scene(size=size, **{argument: tmp_path})
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(OSError, match=rf"^{argument}: .*text\.png: the picture cannot be read"):
        fl.Scene(size=size, **{argument: tmp_path / "text.png"})


LIGHT = np.random.default_rng(5).random((48, 64, 3), np.float32)
SNOW = fl.effects.TentSnow("heavy", color=(0.9, 0.8, 1.0), flakes=300)
EFFECTS = [fl.Mist(count=60, density=0.6), fl.effects.TentSnow("heavy", flakes=150)]


def plate(dtype: Any, opaque: bool = False) -> np.ndarray:
    """Noise with every alpha from none to all, and places where there is nothing."""
    random = np.random.default_rng(8)
    light = random.random((48, 64, 4))
    light[..., 3] = np.linspace(-0.2, 1.2, 64).clip(0.0, 1.0)
    if opaque:
        light[..., 3] = 1.0
    if np.dtype(dtype).kind == "u":
        return np.rint(light * np.iinfo(dtype).max).astype(dtype)
    light[..., :3] *= light[..., 3:]
    return light.astype(dtype)


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.tif"])
def test_16_7_files_with_alpha_go_in_and_come_out(tmp_path: Path, name: str):
    background = plate("float32" if name == "a.exr" else "uint8")
    write_picture(tmp_path / name, background, half=False)
    scene = fl.Scene(tmp_path / name, effects=EFFECTS)
    frame = scene.render(5)
    assert np.array_equal(frame, fl.Scene(background, effects=EFFECTS).render(5))
    bits = "float" if name == "a.exr" else None
    scene.write(tmp_path / "out" / f"%d{Path(name).suffix}", "5", bits=bits)
    found = read_picture(tmp_path / "out" / f"5{Path(name).suffix}")
    assert found.premultiplied == (name == "a.exr")
    np.testing.assert_array_equal(found.rgba(), frame)
    # Fitted to another size it has alpha, too.
    small = fl.Scene(tmp_path / name, size=(32, 24), effects=EFFECTS).render(5)
    assert small.shape == (24, 32, 4)


@pytest.mark.parametrize("name", ["a.mp4", "%d.jpg"])
def test_16_7_files_without_alpha_take_what_is_opaque(tmp_path: Path, name: str):
    scene = fl.Scene(plate("uint8", opaque=True), effects=EFFECTS)
    scene.write(tmp_path / name, "1")
    found = next(read_video(tmp_path / name)) if name == "a.mp4" else tmp_path / "1.jpg"
    assert found is not None
    clear = fl.Scene(plate("uint8"), effects=EFFECTS)
    with pytest.raises(ValueError, match=r"the frame is transparent in places; take \.png"):
        clear.write(tmp_path / "other" / name, "1")


LEVELS = np.random.default_rng(2).integers(0, 256, (48, 64, 3)).astype(np.float32)
OF_LEVELS: dict[str, Any] = {
    "array": lambda file: fl.Scene(LEVELS),
    "file": lambda file: fl.Scene(file).render(0),
    "foreground": lambda file: fl.Scene(
        size=(64, 48), foreground=np.dstack([LEVELS, np.ones((48, 64), np.float32)])
    ),
    "transform": lambda file: fl.augment.Snowfall(seed=1)(LEVELS),
    "over": lambda file: fl.composite.over(LEVELS, np.zeros((48, 64, 4), np.float32)),
}


@pytest.mark.parametrize("way", OF_LEVELS)
def test_16_7_a_float_picture_of_levels_is_warned_of(tmp_path: Path, way: str):
    write_picture(tmp_path / "1.tif", LEVELS)
    with pytest.warns(UserWarning, match="is a float picture of values up to 255, .*if that is"):
        OF_LEVELS[way](tmp_path / "1.tif")


def test_16_7_bright_light_is_not():
    """A lamp, a snow field in the sun, and a picture of 0 to 1: warnings are errors here."""
    some = np.where(LIGHT > 0.999, 200.0, LIGHT)
    for bright in (LIGHT, 8.0 * LIGHT, some, 1e4 * LIGHT):
        fl.Scene(bright.astype(np.float32)).render(0)
        fl.composite.snow(bright.astype(np.float32), np.zeros((48, 64), np.float32))


def test_over_its_background_it_is_the_composite(tmp_path: Path):
    scene = fl.Scene(LIGHT, effects=[SNOW, fl.effects.TentSnow("light")])
    scene.write(tmp_path / "%d.exr", "7", alone=True, bits="float")
    layer = read_picture(tmp_path / "7.exr")
    assert layer.alpha is not None and layer.premultiplied
    whole = layer.pixels + (1.0 - layer.alpha[..., None]) * LIGHT
    assert np.abs(whole - scene.render(7)).max() < 1e-6
    assert 0.0 < layer.alpha.mean() < 1.0


def test_a_png_holds_straight_display_values(tmp_path: Path):
    scene = fl.Scene("#204060", size=(64, 48), effects=[SNOW])
    scene.write(tmp_path / "snow.png", 7, alone=True)
    layer = read_picture(tmp_path / "snow.png")
    assert layer.alpha is not None and not layer.premultiplied
    seen = layer.alpha > 0.15
    color = layer.pixels[seen].mean(axis=0) / 255.0
    assert np.abs(color - (0.9, 0.8, 1.0)).max() < 0.01
    assert np.abs(layer.alpha - scene.layers(7).alpha).max() <= 0.5 / 255 + 1e-6


@pytest.mark.parametrize("name", ["film.mp4", "%d.jpg"])
def test_what_has_no_alpha_is_refused(name: str, tmp_path: Path):
    with pytest.raises(ValueError, match="alone"):
        fl.Scene(LIGHT, effects=[SNOW]).write(tmp_path / name, "1", alone=True)
    assert not list(tmp_path.iterdir())

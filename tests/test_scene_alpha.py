"""Files with alpha, the weather alone among them, and float pictures that are no light."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import read_picture, read_video, write_picture

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

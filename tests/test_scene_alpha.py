"""Files with alpha, and float pictures that are no light."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import read_picture, read_video, write_picture

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
    light = np.random.default_rng(2).random((48, 64, 3)).astype(np.float32)
    for bright in (light, 8.0 * light, np.where(light > 0.999, 200.0, light), 1e4 * light):
        fl.Scene(bright.astype(np.float32)).render(0)
        fl.composite.snow(bright.astype(np.float32), np.zeros((48, 64), np.float32))

"""Color spaces: the same snow in every working space, and plates that come out as they went in."""

from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries import io
from flurries.io.colorspace import config_hash

H, W = 24, 36
LIGHT = np.random.default_rng(3).random((H, W, 3)).astype(np.float32) * 0.5
# Rec. 709 to AP1 as the Academy's S-2014-004 with a Bradford adaptation from D65 to D60 has it.
AP1 = np.array([[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452],
                [0.020616, 0.109570, 0.869815]])  # fmt: skip
SNOW = [fl.effects.TentSnow("heavy", color=(0.9, 0.7, 0.5)), fl.Mist("fog", density=0.2)]


def turned(pixels: np.ndarray, matrix: np.ndarray = AP1) -> np.ndarray:
    return np.ascontiguousarray(pixels @ matrix.T, dtype=np.float32)


LIT = [fl.effects.TentSnow("heavy", color="ambient"), fl.Mist("clouds")]
SUN = fl.scene.Sun((0.3, 1.0, 0.2), (1.0, 0.8, 0.6), 0.3)


@pytest.mark.parametrize(("effects", "sun"), [(SNOW, None), (LIT, SUN)], ids=["plain", "lit"])
def test_snow_over_an_acescg_plate_is_that_over_one_of_rec_709(effects: list[object], sun: object):
    given = {"effects": effects, "sun": sun}
    plain = fl.Scene(LIGHT, **given).render(4)
    wide = fl.Scene(turned(LIGHT), **given, colorspace="ACEScg").render(4)
    np.testing.assert_allclose(turned(wide, np.linalg.inv(AP1)), plain, atol=5e-5)
    # The control: without the name it is another color.
    other = fl.Scene(turned(LIGHT), **given).render(4)
    assert np.abs(turned(other, np.linalg.inv(AP1)) - plain).max() > 0.02


@pytest.mark.parametrize("name", ["ACEScct", "sRGB - Display", "Gamma 2.4 Encoded Rec.709"])
def test_a_plate_that_is_encoded_comes_out_as_it_went_in(name: str, tmp_path: Path):
    levels = np.random.default_rng(4).integers(8000, 50000, (H, W, 3)).astype(np.uint16)
    io.write_picture(tmp_path / "plate.png", levels)
    plain = fl.Scene(tmp_path / "plate.png", colorspace=name)
    plain.write(tmp_path / "out.png")
    found = io.read_picture(tmp_path / "out.png").pixels
    assert found.dtype == np.uint16 and np.abs(found.astype(int) - levels).max() <= 2
    # Snow is mixed in light: over black it is what it is over black light.
    snowy = plain.replace(effects=SNOW).render(4)
    assert snowy.dtype == np.float32 and np.abs(snowy - plain.render(4)).max() > 0.05


def test_what_is_written_may_be_in_another_space(tmp_path: Path):
    io.write_picture(tmp_path / "plate.exr", turned(LIGHT), half=False)
    scene = fl.Scene(tmp_path / "plate.exr", colorspace="ACEScg")
    scene.write(tmp_path / "out.exr", bits="float", colorspace="Linear Rec.709 (sRGB)")
    np.testing.assert_allclose(io.read_picture(tmp_path / "out.exr").pixels, LIGHT, atol=2e-6)
    scene.write(tmp_path / "out.png", bits=16, colorspace="sRGB - Display")
    wanted = io.linear_to_srgb(LIGHT)
    made = io.read_picture(tmp_path / "out.png").pixels / 65535.0
    np.testing.assert_allclose(made, wanted, atol=2e-3)
    for name, space in (("a.png", None), ("a.mp4", None), ("a.exr", "ACEScct")):
        with pytest.raises(ValueError, match="linear"):
            scene.write(tmp_path / name, "1", colorspace=space)
    with pytest.raises(ValueError, match="needs the scene's own"):
        fl.Scene(size=(4, 4)).write(tmp_path / "a.exr", "1", colorspace="ACEScg")


def test_alone_and_layers_are_in_the_space(tmp_path: Path):
    scene = fl.Scene(turned(LIGHT), effects=SNOW[:1], colorspace="ACEScg")
    plain = fl.Scene(LIGHT, effects=SNOW[:1])
    for made, name in ((scene, "wide"), (plain, "plain")):
        made.write(tmp_path / f"{name}.exr", 4, alone=True, bits="float")
    wide, rec = (io.read_picture(tmp_path / f"{name}.exr") for name in ("wide", "plain"))
    np.testing.assert_array_equal(wide.alpha, rec.alpha)
    np.testing.assert_allclose(wide.pixels, turned(rec.pixels), atol=2e-5)


def test_a_configuration_counts_by_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "ocio").mkdir()
    monkeypatch.setenv("OCIO", str(tmp_path / "ocio" / "a.ocio"))
    (tmp_path / "ocio" / "a.ocio").write_text("search_path: ..\na: !<F> {src: a.lut}\n")
    found = [(tmp_path / "a.lut").write_text(text) and config_hash() for text in ("1", "2", "1")]
    assert found[0] == found[2] != found[1]

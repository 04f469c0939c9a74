"""How frames are written: by a scene file's [output], by what comes before it, and in colors."""

from pathlib import Path

import av
import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.cli.main import main
from flurries.io.colorspace import config_hash
from flurries.scene.fingerprint import fingerprint
from flurries.scene.output import Output
from stills import spec_of as header

SNOW = [fl.Snow("heavy")]
# Of every field a value that is not its default.
OTHER = {
    "bits": "float", "codec": "ffv1", "motion": "y-up", "colorspace": "ACEScg",
    "compression": "piz", "quality": "draft", "layers": True, "plate": True, "alone": True,
    "deep": True, "damaged": "hold", "sound": False,
}  # fmt: skip


def scene(**output: object) -> fl.Scene:
    return fl.Scene("#203040", size=(40, 30), effects=SNOW, output=fl.scene.Output(**output))


@pytest.mark.parametrize("name", OTHER)
def test_a_key_is_saved_and_comes_back(name: str, tmp_path: Path):
    saved = scene(**{name: OTHER[name]})
    saved.save(tmp_path / "scene.toml")
    assert "[output]" in (tmp_path / "scene.toml").read_text()
    again = fl.open(tmp_path / "scene.toml")
    assert again._output == saved._output != Output()
    # Frames do not depend on how they are written.
    assert fingerprint(again) == fingerprint(scene())


def test_the_command_line_obeys_the_file_and_comes_before_it(tmp_path: Path):
    file = tmp_path / "scene.toml"
    scene(bits="float", motion="y-up", layers=True, codec="ffv1").save(file)
    words = ["render", str(file), "-q", "--frames", "1", "-o"]
    assert main([*words, str(tmp_path / "a.%d.exr")]) == 0
    first = header(tmp_path / "a.1.exr")
    assert first.format == oiio.FLOAT and "snow.depth.Z" in first.channelnames
    assert first.get_string_attribute("flurries:motion").endswith("y up")
    assert main([*words, str(tmp_path / "b.%d.exr"), "--bits", "half", "--motion", "y-down"]) == 0
    second = header(tmp_path / "b.1.exr")
    assert second.channelformats[0] == oiio.HALF
    assert second.get_string_attribute("flurries:motion").endswith("y down")
    up, down = (io.read_layers(tmp_path / f"{name}.1.exr")["snow.forward"] for name in "ab")
    np.testing.assert_allclose(up[..., 1], -down[..., 1], atol=2e-2)
    assert np.abs(down[..., 1]).max() > 0.1


@pytest.mark.parametrize(
    ("given", "channels"), [({"alone": True}, {4}), ({"layers": False}, {3, 4})]
)
def test_one_kind_that_is_given_takes_the_place_of_the_scenes(
    given: dict[str, bool], channels: set[int], tmp_path: Path
):
    scene(layers=True).write(tmp_path / "a.exr", 1, **given)
    assert header(tmp_path / "a.exr").nchannels in channels


def test_a_codec_is_for_films_and_a_compression_for_what_is_packed(tmp_path: Path):
    said = scene(codec="ffv1", compression="piz", quality="draft")
    said.write(tmp_path / "a.png", 1)
    said.write(tmp_path / "a.exr", 1)
    assert header(tmp_path / "a.exr").get_string_attribute("compression") == "piz"
    said.write(tmp_path / "layers.exr", 1, layers=True)
    said.write(tmp_path / "a.mkv", "1-2")
    with av.open(str(tmp_path / "a.mkv")) as film:
        assert film.streams.video[0].codec_context.name == "ffv1"
    for name, more, words in (
        ("b.png", {"codec": "h264"}, "codec is one of a film"),
        ("b.png", {"compression": "dwaa"}, "compression is for a composite"),
        ("b.exr", {"compression": "dwaa", "layers": True}, "compression is for a composite"),
    ):
        with pytest.raises(ValueError, match=words):
            said.write(tmp_path / name, 1, **more)
    with pytest.raises(ValueError, match="bits must be half, float"):
        scene(bits=10).write(tmp_path / "b.exr", 1)


H, W = 24, 36
LIGHT = np.random.default_rng(3).random((H, W, 3)).astype(np.float32) * 0.5
# Rec. 709 to AP1 as the Academy's S-2014-004 with a Bradford adaptation from D65 to D60 has it.
AP1 = np.array([[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452],
                [0.020616, 0.109570, 0.869815]])  # fmt: skip
WEATHER = [fl.effects.TentSnow("heavy", color=(0.9, 0.7, 0.5)), fl.Mist("fog", density=0.2)]


def turned(pixels: np.ndarray, matrix: np.ndarray = AP1) -> np.ndarray:
    return np.ascontiguousarray(pixels @ matrix.T, dtype=np.float32)


LIT = [fl.effects.TentSnow("heavy", color="ambient"), fl.Mist("clouds")]
SUN = fl.scene.Sun((0.3, 1.0, 0.2), (1.0, 0.8, 0.6), 0.3)


@pytest.mark.parametrize(("effects", "sun"), [(WEATHER, None), (LIT, SUN)], ids=["plain", "lit"])
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
    snowy = plain.replace(effects=WEATHER).render(4)
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
    scene = fl.Scene(turned(LIGHT), effects=WEATHER[:1], colorspace="ACEScg")
    plain = fl.Scene(LIGHT, effects=WEATHER[:1])
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

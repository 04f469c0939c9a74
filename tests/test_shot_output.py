"""How frames are written, as the scene says it: [output] of a scene file, and what comes before."""

import re
from pathlib import Path

import av
import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.cli.main import main
from flurries.scene.fingerprint import fingerprint
from flurries.scene.output import Output

SNOW = [fl.Snow("heavy")]
# Of every field a value that is not its default.
OTHER = {
    "bits": "float", "codec": "ffv1", "motion": "y-up", "colorspace": "ACEScg",
    "compression": "piz", "quality": "draft", "layers": True, "alone": True, "deep": True,
    "damaged": "hold", "sound": False,
}  # fmt: skip


def scene(**output: object) -> fl.Scene:
    return fl.Scene("#203040", size=(40, 30), effects=SNOW, output=fl.scene.Output(**output))


def header(file: Path) -> oiio.ImageSpec:
    return oiio.ImageInput.open(str(file)).spec()


@pytest.mark.parametrize("name", OTHER)
def test_a_key_is_saved_and_comes_back(name: str, tmp_path: Path):
    saved = scene(**{name: OTHER[name]})
    saved.save(tmp_path / "scene.toml")
    assert "[output]" in (tmp_path / "scene.toml").read_text()
    again = fl.open(tmp_path / "scene.toml")
    assert again._output == saved._output != Output()
    # Frames do not depend on how they are written.
    assert fingerprint(again) == fingerprint(scene())


def test_a_wrong_key_is_told_with_its_line(tmp_path: Path):
    file = tmp_path / "scene.toml"
    for line, said in {
        'bits = "ten"': "line 3: bits must be one of 8, 10, 16, half, float, got 'ten'",
        'codek = "h264"': "line 3: unknown key 'codek' in output; did you mean 'codec'",
        "layers = true\nalone = true": "line 4: alone and layers must not both be given",
    }.items():
        file.write_text(f"format = 3\n[output]\n{line}\n")
        with pytest.raises((ValueError, TypeError), match=re.escape(said)):
            fl.open(file)


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
    up, down = (io.read_layers(tmp_path / f"{name}.1.exr")["forward"] for name in "ab")
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
    with pytest.raises(ValueError, match="codec is one of a film"):
        said.write(tmp_path / "b.png", 1, codec="h264")
    with pytest.raises(ValueError, match="bits must be half, float"):
        scene(bits=10).write(tmp_path / "b.exr", 1)

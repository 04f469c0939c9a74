"""Scenes to files: what is in them, what stays, and that nothing of another scene is mixed in."""

from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.io import VideoWriter, read_picture, srgb_to_linear, write_picture
from stills import header_of
from test_nothing_wrong import contents

Scene, Snow = fl.Scene, fl.effects.TentSnow
W, H = 66, 50
RNG = np.random.default_rng(3)
BYTES = RNG.integers(0, 220, (H, W, 3)).astype(np.uint8)
LIGHT = RNG.gamma(1.0, 1.0, (H, W, 3)).astype(np.float32)  # with values above 1
SNOW = Snow("heavy", flakes=200, wavelengths=(2.0, 4.0))


@pytest.fixture
def scene() -> fl.Scene:
    return Scene(BYTES, effects=[SNOW], fps=12.0)


def wide(scene: fl.Scene) -> fl.Scene:
    """The scene over the same levels in 16 bits, which is what more bits are made of."""
    return scene.replace(background=BYTES.astype(np.uint16) * np.uint16(257))


@pytest.mark.parametrize("ending", ["png", "tif", "exr"])
def test_a_sequence_holds_the_frames(ending: str, scene: fl.Scene, tmp_path: Path):
    options = {"bits": "float"} if ending == "exr" else {}
    done = scene.write(tmp_path / "new" / f"%04d.{ending}", "2-6x2", **options)
    assert (done.written, done.kept) == ([2, 4, 6], [])
    assert done.files == [tmp_path / "new" / f"000{n}.{ending}" for n in (2, 4, 6)]
    assert sorted(contents(tmp_path)) == [f"new/000{n}.{ending}" for n in (2, 4, 6)]
    for number, file in zip(done.written, done.files, strict=True):
        got, want = read_picture(file).pixels, scene.render(number)
        if ending == "exr":
            want = wide(scene).render(number)
            assert np.abs(got - srgb_to_linear(want / 65535.0)).max() < 1e-6
        else:
            assert np.array_equal(got, want)


@pytest.mark.parametrize("bits", ["half", "float"])
def test_an_exr_holds_the_light(bits: str, tmp_path: Path):
    bright = Scene(LIGHT, effects=[SNOW, Snow(color=(0.9, 0.4, 0.1), flakes=100)])
    bright.write(tmp_path / "still.exr", "7", bits=bits)
    want = bright.render(7)
    assert want.max() > 1.5
    stored = want.astype(np.float16) if bits == "half" else want
    assert np.array_equal(read_picture(tmp_path / "still.exr").pixels, stored)


def test_a_film_is_not_its_own_background(tmp_path: Path):
    film = tmp_path / "film.mkv"
    with VideoWriter(film, (W, H), 24) as video:
        video.write(BYTES)
        video.write(BYTES[::-1])
    before = film.read_bytes()
    with pytest.raises((ValueError, OSError), match=r"film\.mkv"):
        Scene(film, effects=[SNOW]).write(film)
    assert film.read_bytes() == before


def test_headers_say_which_frame_and_nothing_private(scene: fl.Scene, tmp_path: Path):
    scene.write(tmp_path / "%d.png", [12])
    found = header_of(tmp_path / "12.png")
    assert found["frame"] == "12" and found["version"] == fl.__version__
    assert len(found["scene"]) >= 16
    assert str(tmp_path) not in (tmp_path / "12.png").read_bytes().decode("latin-1")


def test_frames_that_were_not_named(tmp_path: Path):
    for number in (3, 4, 5):
        write_picture(tmp_path / f"plate.{number}.png", np.roll(BYTES, number, axis=1))
    done = Scene(tmp_path / "plate.%d.png").write(tmp_path / "out" / "%d.png")
    assert done.written == [3, 4, 5]
    got = read_picture(tmp_path / "out" / "4.png").pixels
    assert np.array_equal(got, np.roll(BYTES, 4, axis=1))
    still = Scene("#102030", size=(8, 8), fps=1.5)
    assert still.write(tmp_path / "still" / "%d.png").written == [1, 2, 3, 4, 5]  # 3 s and a bit
    assert still.write(tmp_path / "one.png").written == [1]

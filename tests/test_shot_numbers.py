"""Frame numbers of a shot: plate, matte, depth and camera of one number make the frame of it."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.camera import importers
from flurries.cli.main import main
from flurries.io.films.reader import Tags
from flurries.io.timecode import TimeCode
from stills import write_exr

RANGE = range(1001, 1009)
SIZE = (24, 16)


@pytest.fixture
def shot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Plates, mattes, depths and a camera of 1001-1008; each says its number in its content."""
    monkeypatch.chdir(tmp_path)
    width, height = SIZE
    for number in RANGE:
        step = number - 1000
        io.write_picture(f"plate.{number}.png", np.full((height, width, 3), 10 * step, np.uint8))
        mask = np.zeros((height, width), np.uint8)
        mask[:, : 2 * step] = 255
        io.write_picture(f"matte.{number}.png", mask)
        io.write_layers(f"depth.{number}.exr", {"depth": np.full((height, width), step, "f4")})
    lines = [f"{number} {number - 1000} 0 0 0 0 0 40" for number in RANGE]
    Path("camera.chan").write_text("\n".join(lines))
    return tmp_path


class Ask:
    """An effect that paints the depth, so that a frame tells which one it got."""

    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        shown = np.zeros(frame.shape, np.float32)
        if frame.depth is not None:
            shown[...] = frame.depth / 100.0
        return fl.effects.Layer("ask", np.ascontiguousarray(frame.crop(shown)))


def scene(**changes: object) -> fl.Scene:
    camera = importers.load("camera.chan", SIZE[::-1])
    given = {
        "background": "plate.####.png", "foreground": "matte.$F4.png",
        "depth": "depth.%04d.exr", "camera": camera, "effects": [Ask()],
    }  # fmt: skip
    return fl.Scene(**{**given, **changes})


def test_every_number_has_its_own_plate_matte_depth_and_camera(shot: Path):
    made = scene()
    assert made._range == (1001, 1008)
    made.write("out.####.exr", layers=True, plate=True)
    assert sorted(path.name for path in shot.glob("out.*")) == [f"out.{n}.exr" for n in RANGE]
    for step, number in enumerate(RANGE, 1):
        layers = io.read_layers(f"out.{number}.exr")
        np.testing.assert_allclose(layers["background"][..., 0], 10 * step / 255, atol=1e-3)
        assert (layers["depth"] == step).all()
        covered = layers["ask"][..., 3] == 0.0
        assert covered[:, : 2 * step].all() and not covered[:, 2 * step :].any()
        assert made.camera.place(number, fps=24.0)[0] == step


@pytest.mark.parametrize("short", ["plate", "matte", "depth", "camera"])
def test_an_overrun_names_both_ranges_and_writes_nothing(shot: Path, short: str):
    if short == "camera":
        lines = Path("camera.chan").read_text().splitlines()[:5]
        Path("camera.chan").write_text("\n".join(lines))
    else:
        for number in (1006, 1007, 1008):
            next(shot.glob(f"{short}.{number}.*")).unlink()
    words = r"frames 1003-1008 are asked for; frames 1006-1008 .* has 1001-1005"
    with pytest.raises(ValueError, match=words):
        scene().write("out.%04d.png", "1003-1008")
    assert not list(shot.glob("out.*"))
    with pytest.raises(ValueError, match=r"frame 1007 of the shot: .* has 1001-1005"):
        scene().render(1007)
    scene().write("out.%04d.png", "1003-1005")


@pytest.mark.parametrize("short", ["plate", "matte", "depth"])
def test_a_gap_is_named(shot: Path, short: str):
    for number in (1004, 1005):
        next(shot.glob(f"{short}.{number}.*")).unlink()
    with pytest.raises(FileNotFoundError, match=r"of 1001-1008 the \w+ lacks 1004-1005") as error:
        scene().write("out.%04d.png")
    assert short in str(error.value.filename)
    assert not list(shot.glob("out.*"))
    # What needs none of the missing files goes on.
    scene().write("out.%04d.png", "1006-1008")


def test_holding_and_looping_are_said(shot: Path):
    held = scene(extend="hold")
    np.testing.assert_array_equal(held.render(1012), held.render(1008))
    np.testing.assert_array_equal(held.render(3), held.render(1001))
    looped = scene(extend="loop", camera=None)
    np.testing.assert_array_equal(looped.render(1009), looped.render(1001))
    np.testing.assert_array_equal(looped.render(1000), looped.render(1008))
    with pytest.raises(ValueError, match="camera has 1001-1008"):
        scene(extend="loop").render(1009)


def test_a_held_camera_stands_still(shot: Path):
    snow = fl.effects.TentSnow("heavy", fall=0.0, wind=(0.0, 0.0, 0.0), sway=(0.0, 0.0))
    held = scene(extend="hold", effects=[snow], foreground=None)
    np.testing.assert_array_equal(held.render(1020), held.render(1011))
    assert (held.render(1007) != held.render(1008)).any()
    # The control: a path made by hand goes on.
    goes = fl.CameraPath(held.camera.camera, position=held.camera.position)
    free = held.replace(camera=goes)
    assert (free.render(1020) != free.render(1011)).any()


def test_films_take_the_numbers_of_the_plate_or_of_start(shot: Path):
    with io.VideoWriter("matte.mkv", SIZE, 24) as film:
        for number in RANGE:
            film.write(np.full((*SIZE[::-1], 3), 255 * (number % 2), np.uint8))
    moved = scene(foreground="matte.mkv")
    assert (moved.render(1001) == 10).all() and (moved.render(1002) > 20).any()
    alone = fl.Scene(background="matte.mkv", start=1001)
    assert alone._range == (1001, 1008)
    assert (alone.render(1002) == 0).all() and (alone.render(1003) == 255).all()
    assert fl.Scene(background="matte.mkv")._range == (0, 7)


def test_scene_files_hold_the_numbers(shot: Path):
    scene(effects=(), extend="hold", start=7).save("scene.toml")
    again = fl.open("scene.toml")
    assert (again._extend, again._start, again._range) == ("hold", 7, (1001, 1008))
    assert again.camera.extend == "stop"
    Path("scene.toml").write_text(
        'format = 3\nbackground = "plate.####.png"\nextend = "loop"\n'
        '[[foreground]]\nsource = "matte.####.png"\ndepth = 3.5\n'
        '[[foreground]]\nsource = "plate.####.png"\n'
        '[foreground.depth]\nsource = "matte.####.png"\nnear = 1.0\nfar = 9.0\n'
    )
    again = fl.open("scene.toml")
    assert again.foreground[0].depth == 3.5
    again.render(1010)
    again.save("copy.toml")
    np.testing.assert_array_equal(fl.open("copy.toml").render(1003), again.render(1003))


def test_one_plain_name_is_no_place_for_a_range(shot: Path):
    with pytest.raises(ValueError, match=r"out.png is one file for 3 frames.*out.%04d.png"):
        scene().write("out.png", "1001-1003")
    scene().write("out.png", 1003)
    assert io.read_picture("out.png").pixels[0, 0, 0] == 30


def test_frames_before_0_are_frames(shot: Path):
    assert io.frame_range("-2-1,-7--5x2") == [-2, -1, 0, 1, -7, -5]
    plain = fl.Scene("#405060", size=SIZE, effects=[fl.Snow("heavy")])
    how = ["--snow", "heavy", "--frames", "-2-1", "-o", "early.%04d.png"]
    assert main(["render", "plate.1001.png", *how]) == 0
    names = [path.name for path in plain.write("new.%04d.exr", "-2-1").files]
    assert names == ["new.-002.exr", "new.-001.exr", "new.0000.exr", "new.0001.exr"]
    plates = fl.Scene("new.%04d.exr")
    assert plates._range == (-2, 1) and len(list(shot.glob("early.*"))) == 4
    first = io.read_picture("new.-002.exr").pixels[..., :3]
    np.testing.assert_array_equal(plates.render(-2), first)


def test_a_still_has_the_number_in_its_name(shot: Path):
    still = fl.Scene("plate.1003.png", effects=[fl.Snow("heavy")])
    assert still.write("out.%04d.png").files == [Path("out.1003.png")]
    assert still.write("one.png").written == [1003]
    assert len(still.write("out.mkv", quality="draft").written) == 90


@pytest.mark.parametrize(("name", "rate"), [("film.mov", 24), ("coded.%04d.exr", 30)])
def test_time_codes_of_held_handles_count_on(name: str, rate: int, shot: Path):
    code, black = TimeCode.of_text("01:00:00:00", Fraction(rate)), np.zeros((*SIZE[::-1], 3))
    if name == "film.mov":
        with io.VideoWriter(name, SIZE, rate, tags=Tags(timecode=code)) as film:
            for _ in range(2):
                film.write(black.astype(np.uint8))
    else:
        for n in range(2):
            slate = io.Slate().at(Fraction(rate), code.later(n))
            io.write_picture(name % n, black.astype(np.float32), slate=slate)
    held, looped = (fl.Scene(name, extend=extend, fps=rate) for extend in ("hold", "loop"))
    for number in (-3, 0, 1, 7):
        assert held._slate(number).timecode == code.later(number)
    assert looped._slate(7).timecode == code.later(1)


@pytest.mark.parametrize("layers", [False, True])
def test_a_plate_that_is_a_part_of_its_picture_remains_it(shot: Path, layers: bool):
    levels = np.full((6, 10, 3), 0.2, np.float32)
    write_exr("crop.1001.exr", levels, "RGB", kind="half", data=(12, 8), display=(0, 0, *SIZE))
    part = fl.Scene("crop.1001.exr", effects=[fl.Snow("heavy")])
    part.write("out.1001.exr", layers=layers, plate=layers, bits="float")
    found = oiio.ImageInput.open("out.1001.exr")
    spec = found.spec()
    window = (spec.x, spec.y, spec.width, spec.height, spec.full_width, spec.full_height)
    assert window == (12, 8, 10, 6, *SIZE)
    shown = part.render(1001)[8:14, 12:22, :3]
    np.testing.assert_allclose(found.read_image(0, 3, "float"), shown, atol=1e-6)


def test_a_matte_with_a_depth_hides_only_what_is_behind_it():
    mask = np.zeros((48, 64), np.float32)
    mask[:, 32:] = 1.0
    base = fl.Scene(size=(64, 48), effects=[fl.Snow("heavy", seed=3)])
    wall, stood, before = (base.replace(**more).render(5) for more in (
        {"depth": 6.0}, {"foreground": fl.scene.Foreground(mask, depth=6.0)}, {"foreground": mask}
    ))  # fmt: skip
    np.testing.assert_array_equal(stood[:, 32:], wall[:, 32:])
    assert np.abs(stood[:, :32].astype(int) - base.render(5)[:, :32]).mean() < 2.0
    assert (before[:, 32:] == 0).all() and stood[:, 32:].any()

"""What a plate says of itself goes through: before and after, line by line."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries import io
from flurries.cli import main
from flurries.io.timecode import TimeCode
from stills import spec_of as header
from stills import write_exr

H, W = 24, 36
SNOW = [fl.effects.TentSnow("heavy")]
RNG = np.random.default_rng(5)
LIGHT = (RNG.random((H, W, 4)) * 0.8).astype(np.float32)
LIGHT[..., :3] *= LIGHT[..., 3:]

SAID: dict[str, tuple[str, Any]] = {
    "chromaticities": ("float[8]", (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)),
    "PixelAspectRatio": ("float", 2.0), "smpte:TimeCode": ("timecode", (0x01020304, 0)),
    "FramesPerSecond": ("rational", (24000, 1001)), "framesPerSecond": ("rational", (24000, 1001)),
    "Copyright": ("string", "the owner"), "whiteLuminance": ("float", 100.0),
    "DocumentName": ("string", "a take"), "screenWindowWidth": ("float", 1.5),
    "worldtocamera": ("matrix", tuple(np.eye(4, dtype=float).ravel().tolist())),
}  # fmt: skip


def plate(
    path: Path, names: list[str], pixels: Any = LIGHT, *, windows: Any = (0, 0), **more: Any
) -> None:
    said = {name: SAID[name] for name in names} | more
    write_exr(
        path, pixels.astype(np.float16), ("R", "G", "B", "A")[: pixels.shape[2]], kind="half",
        data=windows[:2], display=windows[2:], header=said,
    )  # fmt: skip


KINDS: dict[str, Any] = {"composite": {}, "layers": {"layers": True}, "alone": {"alone": True}}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SAID)
def test_each_line_of_an_exr_goes_through(name: str, kind: str, tmp_path: Path):
    plate(tmp_path / "plate.exr", [name])
    scene = fl.Scene(tmp_path / "plate.exr", effects=SNOW)
    scene.write(tmp_path / "out.exr", **KINDS[kind])
    wanted, found = (
        next((a for a in header(path).extra_attribs if a.name.lower() == name.lower()), None)
        for path in (tmp_path / "plate.exr", tmp_path / "out.exr")
    )
    assert found is not None and str(found.type) == str(wanted.type)
    assert np.array_equal(found.value, wanted.value), (found.value, wanted.value)


def test_the_rate_of_the_header_is_that_of_the_scene(tmp_path: Path):
    plate(tmp_path / "plate.exr", ["framesPerSecond"])
    scene = fl.Scene(tmp_path / "plate.exr")
    assert abs(scene.fps - 24000 / 1001) < 1e-12
    scene.replace(fps=25.0).write(tmp_path / "out.exr")
    assert tuple(header(tmp_path / "out.exr").getattribute("framesPerSecond")) == (25, 1)


WINDOWS = {
    "overscan": (-4, -2, 0, 0, W - 8, H - 4),
    "uneven overscan": (-6, -1, 0, 0, W - 8, H - 4),
    "cropped": (3, 2, 0, 0, W + 10, H + 6),
    "moved": (105, 52, 100, 50, W + 10, H + 6),
}


@pytest.mark.parametrize("name", WINDOWS)
def test_windows_go_through_and_overscan_is_rendered(name: str, tmp_path: Path):
    windows, before, after = WINDOWS[name], tmp_path / "plate.exr", tmp_path / "same.exr"
    plate(before, ["PixelAspectRatio"], windows=windows)
    source = fl.Scene(before)
    source.write(after)
    one, other = header(before), header(after)
    for field in ("full_x", "full_y", "full_width", "full_height"):
        assert getattr(one, field) == getattr(other, field), field
    assert (other.x, other.y, other.width, other.height) == (*windows[:2], W, H)
    if "overscan" in name:
        assert source.size == (W, H)
        assert source._display == (-windows[0], -windows[1], W - 8, H - 4)
    # Amount 0 is the plate.
    assert error_of(before, after) == 0.0


def error_of(one: Path, other: Path) -> float:
    buffers = (oiio.ImageBuf(str(path)) for path in (one, other))
    return oiio.ImageBufAlgo.compare(*buffers, 0.0, 0.0).maxerror


def test_pixels_that_are_not_square_stretch_the_lens(tmp_path: Path):
    plate(tmp_path / "plate.exr", ["PixelAspectRatio"])
    scene = fl.Scene(tmp_path / "plate.exr")
    assert scene._backdrop.aspect == scene.camera.camera.aspect == 2.0
    text = 'format = 3\nbackground = "plate.exr"\n[camera]\nfocal = 50.0\n'
    (tmp_path / "scene.toml").write_text(text)
    assert fl.open(tmp_path / "scene.toml").camera.camera.aspect == 2.0


def test_depth_and_mattes_find_their_place_in_overscan(tmp_path: Path):
    plate(tmp_path / "plate.exr", [], windows=WINDOWS["uneven overscan"])
    inner = np.full((H - 4, W - 8), 3.0, np.float32)
    io.write_layers(tmp_path / "depth.exr", {"depth": inner})
    io.write_picture(tmp_path / "mask.png", np.full(inner.shape, 255, np.uint8))
    io.write_picture(tmp_path / "front.exr", np.ones((*inner.shape, 4), np.float32))
    files = {"depth": tmp_path / "depth.exr", "foreground": tmp_path / "mask.png"}
    scene = fl.Scene(tmp_path / "plate.exr", effects=SNOW, **files)
    wanted = np.full((H, W), np.inf, np.float32)
    wanted[1 : H - 3, 6 : W - 2] = 3.0
    np.testing.assert_array_equal(scene._depth_at(0), wanted)
    shown = scene.layers(0).alpha
    around = ~np.isfinite(wanted)
    assert (shown[~around] == 0.0).all() and (shown[around] > 0.0).any()
    plain = fl.Scene(tmp_path / "plate.exr")
    front = plain.replace(foreground=tmp_path / "front.exr").render(0)
    np.testing.assert_array_equal(front[around], plain.render(0)[around])
    assert (front[~around] == 1.0).all()


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_profile_goes_through(ending: str, tmp_path: Path):
    from PIL import Image, ImageCms

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    picture = Image.fromarray((LIGHT[..., :3] * 255).astype(np.uint8))
    picture.save(tmp_path / f"plate.{ending}", icc_profile=profile)
    scene = fl.Scene(tmp_path / f"plate.{ending}", effects=SNOW)
    for out in (f"out.{ending}", "out.jpg"):
        scene.write(tmp_path / out)
        with Image.open(tmp_path / out) as found:
            assert found.info["icc_profile"] == profile
    # Linear light is none of a display's.
    scene.write(tmp_path / "out.exr")
    assert header(tmp_path / "out.exr").getattribute("ICCProfile") is None


PLATES = {
    "png 8": ("png", np.uint8), "png 16": ("png", np.uint16), "tif 16": ("tif", np.uint16),
    "exr": ("exr", np.float16), "tif float": ("tif", np.float32), "dpx": ("dpx", np.uint16),
}  # fmt: skip


@pytest.mark.parametrize("name", PLATES)
def test_amount_0_is_the_plate(name: str, tmp_path: Path):
    ending, dtype = PLATES[name]
    levels = LIGHT[..., :3] if ending == "dpx" else LIGHT
    if np.dtype(dtype).kind == "u":
        levels = (levels * np.iinfo(dtype).max).astype(dtype)
    path, out = tmp_path / f"plate.{ending}", tmp_path / f"out.{ending}"
    bits = {"bits": 10} if ending == "dpx" else {}
    io.write_picture(path, levels.astype(np.float32) if dtype == np.float16 else levels, **bits)
    code = main(["render", str(path), "--snow", "heavy", "--amount", "0", "--frames", "1",
                 "-o", str(out), "-q"])  # fmt: skip
    assert code == 0
    assert error_of(path, out) == 0.0
    one, other = header(path), header(out)
    assert one.channelnames == other.channelnames and one.format == other.format
    bits = "oiio:BitsPerSample"
    assert one.get_int_attribute(bits) == other.get_int_attribute(bits)


def test_a_dpx_says_what_its_numbers_are(tmp_path: Path):
    video, log = ("Unspecified video", "ITU-R 709-4"), ("Logarithmic", "User defined")
    light = fl.Scene(LIGHT[..., :3], colorspace="ACEScg")

    def said(scene: fl.Scene, name: str, space: str | None = None) -> tuple[str, ...]:
        scene.write(tmp_path / name, 1, bits=16, colorspace=space)
        names = ("dpx:Transfer", "dpx:Colorimetric")
        return tuple(map(header(tmp_path / name).get_string_attribute, names))

    assert said(fl.Scene("#204060", size=(W, H)), "plain.dpx") == video
    assert said(light, "log.dpx", "ACEScct") == log
    with pytest.raises(ValueError, match=r"log\.dpx says that its numbers are logarithmic: color"):
        fl.Scene(tmp_path / "log.dpx")
    plate = fl.Scene(tmp_path / "log.dpx", colorspace="ACEScct")
    np.testing.assert_allclose(plate.render(0), light.render(0), atol=1e-3)
    assert said(plate, "same.dpx") == log and said(plate, "b.dpx", "sRGB - Display") == video
    # Some programs call all that they write linear.
    data = bytearray((tmp_path / "plain.dpx").read_bytes())
    data[801] = 2
    (tmp_path / "linear.dpx").write_bytes(data)
    with pytest.warns(UserWarning, match="linear, not display values"):
        fl.Scene(tmp_path / "linear.dpx")


def test_every_plate_keeps_its_own_time_code(tmp_path: Path):
    codes = {n: TimeCode.of_text("01:00:00:00", Fraction(24)).later(n) for n in range(1001, 1004)}
    for number, code in codes.items():
        said = {"smpte:TimeCode": ("timecode", (code.word, 0))}
        plate(tmp_path / f"plate.{number}.exr", ["framesPerSecond"], LIGHT[..., :3], **said)
    scene = fl.Scene(tmp_path / "plate.####.exr", effects=SNOW)
    scene.write(tmp_path / "out.####.exr", layers=True)
    for number, code in codes.items():
        found = header(tmp_path / f"out.{number}.exr").getattribute("smpte:TimeCode")
        assert found[0] == code.word
    scene.write(tmp_path / "film.mov", "1002-1003")
    with av.open(str(tmp_path / "film.mov")) as film:
        assert codes[1002].text in [one.metadata.get("timecode") for one in film.streams]


def test_more_bits_than_the_plate_has_are_steps_of_the_weather(tmp_path: Path):
    scene = fl.Scene("#203040", size=(W, H), effects=SNOW)
    scene.write(tmp_path / "a.png", 5, bits=16)
    deep = io.read_picture(tmp_path / "a.png").pixels
    assert deep.dtype == np.uint16 and len(np.unique(deep % 257)) > 20
    assert np.abs(deep / 257.0 - scene.render(5)).max() <= 0.51
    scene.replace(effects=()).write(tmp_path / "b.png", 5, bits=16)
    assert (io.read_picture(tmp_path / "b.png").pixels == [32 * 257, 48 * 257, 64 * 257]).all()


@pytest.mark.parametrize(("name", "bits"), [
    ("a.png", "float"), ("a.png", "half"), ("a.png", 10), ("a.exr", 8), ("a.jpg", 16),
    ("a.tif", "half"), ("a.mp4", "float"), ("a.mov", 16),
])  # fmt: skip
def test_bits_that_a_file_cannot_hold_are_refused(name: str, bits: Any, tmp_path: Path):
    with pytest.raises(ValueError, match="bits must be"):
        fl.Scene(size=(W, H), effects=SNOW).write(tmp_path / name, "1", bits=bits)
    assert not list(tmp_path.iterdir())


def test_snow_of_the_display_window_is_that_of_a_plate_without_overscan(tmp_path: Path):
    """The lens is that of the display window: overscan shows more of the same snow."""
    plate(tmp_path / "wide.exr", [], windows=WINDOWS["uneven overscan"])
    wide = fl.Scene(tmp_path / "wide.exr", effects=[fl.Snow("heavy")])
    left, top, width, height = wide._display
    shown = wide.layers(3).alpha[top : top + height, left : left + width]
    # So is that of a narrower one whose lens is as much off its middle.
    for less in (0, 1):
        lens = fl.Camera(1.2 * width, center_shift=(0.5 * less, 0.0))
        plain = fl.Scene(size=(width - less, height), effects=wide.effects, camera=lens)
        np.testing.assert_allclose(plain.layers(3).alpha, shown[:, : width - less], atol=2e-3)


def test_the_weather_alone_of_a_plate_of_16_bits_has_16(tmp_path: Path):
    levels = (LIGHT[..., :3] * 65535).astype(np.uint16)
    io.write_picture(tmp_path / "plate.png", levels)
    fl.Scene(tmp_path / "plate.png", effects=SNOW).write(tmp_path / "a.png", alone=True)
    assert io.read_picture(tmp_path / "a.png").pixels.dtype == np.uint16
    fl.Scene(size=(W, H), effects=SNOW).write(tmp_path / "b.png", alone=True)
    assert io.read_picture(tmp_path / "b.png").pixels.dtype == np.uint8

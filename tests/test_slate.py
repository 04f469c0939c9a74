"""What a plate says of itself goes through: before and after, line by line."""

from __future__ import annotations

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
from flurries.io.films.tags import Tags
from flurries.io.timecode import TimeCode

H, W = 24, 36
SNOW = [fl.TentSnow.preset("heavy")]
RNG = np.random.default_rng(5)
LIGHT = (RNG.random((H, W, 4)) * 0.8).astype(np.float32)
LIGHT[..., :3] *= LIGHT[..., 3:]

SAID: dict[str, tuple[str, Any]] = {
    "chromaticities": ("float[8]", (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)),
    "PixelAspectRatio": ("float", 2.0),
    "smpte:TimeCode": ("timecode", (0x01020304, 0)),
    "FramesPerSecond": ("rational", (24000, 1001)),
    "framesPerSecond": ("rational", (24000, 1001)),
    "Copyright": ("string", "the owner"),
    "whiteLuminance": ("float", 100.0),
    "DocumentName": ("string", "a take"),
    "screenWindowWidth": ("float", 1.5),
    "worldtocamera": ("matrix", tuple(np.eye(4, dtype=float).ravel().tolist())),
}


def plate(path: Path, names: list[str], *, windows: Any = None, kind: str = "half") -> None:
    spec = oiio.ImageSpec(W, H, 4, kind)
    spec.channelnames = ("R", "G", "B", "A")
    for name in names:
        spec.attribute(name, oiio.TypeDesc(SAID[name][0]), SAID[name][1])
    if windows is not None:
        spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = windows
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_scanlines(spec.y, spec.y + H, 0, LIGHT.astype(np.float16))
    assert out.close()


def header(path: Path) -> Any:
    reader = oiio.ImageInput.open(str(path))
    assert reader is not None, oiio.geterror()
    spec = reader.spec()
    reader.close()
    return spec


KINDS: dict[str, dict[str, Any]] = {"composite": {}, "layers": {"layers": True}, "alone": {
    "alone": True
}}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SAID)
def test_each_line_of_an_exr_goes_through(name: str, kind: str, tmp_path: Path):
    plate(tmp_path / "plate.exr", [name])
    scene = fl.Scene(None, tmp_path / "plate.exr", effects=SNOW)
    scene.write(tmp_path / "out.exr", **KINDS[kind])
    wanted, found = (
        next((a for a in header(path).extra_attribs if a.name.lower() == name.lower()), None)
        for path in (tmp_path / "plate.exr", tmp_path / "out.exr")
    )
    assert found is not None and str(found.type) == str(wanted.type)
    assert np.array_equal(found.value, wanted.value), (found.value, wanted.value)


def test_the_rate_of_the_header_is_that_of_the_scene(tmp_path: Path):
    plate(tmp_path / "plate.exr", ["framesPerSecond"])
    scene = fl.Scene(None, tmp_path / "plate.exr")
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
    windows = WINDOWS[name]
    plate(tmp_path / "plate.exr", ["PixelAspectRatio"], windows=windows)
    source = fl.Scene(None, tmp_path / "plate.exr")
    source.write(tmp_path / "same.exr")
    before, after = header(tmp_path / "plate.exr"), header(tmp_path / "same.exr")
    for one in ("full_x", "full_y", "full_width", "full_height"):
        assert getattr(before, one) == getattr(after, one), one
    if "overscan" in name:
        assert (after.x, after.y, after.width, after.height) == (*windows[:2], W, H)
        assert source.size == (W, H)
        assert source.display == (-windows[0], -windows[1], W - 8, H - 4)
    else:
        assert (after.x, after.y) == windows[2:4] and after.width == W + 10
    # Amount 0 is the plate.
    stored = oiio.ImageBuf(str(tmp_path / "plate.exr"))
    made = oiio.ImageBuf(str(tmp_path / "same.exr"))
    result = oiio.ImageBufAlgo.compare(stored, made, 0.0, 0.0)
    assert result.maxerror == 0.0


def test_snow_of_the_display_window_is_that_of_a_plate_without_overscan(tmp_path: Path):
    """The lens is that of the display window: overscan shows more of the same snow."""
    plate(tmp_path / "wide.exr", [], windows=WINDOWS["uneven overscan"])
    flakes = [fl.TentSnow(flakes=400)]
    wide = fl.Scene(None, tmp_path / "wide.exr", effects=flakes)
    left, top, width, height = wide.display
    black = np.zeros((height, width, 3), np.float32)
    lens = fl.Camera(1.2 * width, aspect=1.0)
    plain = fl.Scene(None, black, effects=flakes, camera=lens)
    assert wide.camera.camera.focal == pytest.approx(lens.focal)
    whole = wide.render(3, layers=True)
    inner = plain.render(3, layers=True)
    points = [scene.program.camera(None, 3.0).principal(scene.shape) for scene in (wide, plain)]
    np.testing.assert_allclose(np.subtract(*points), (left, top))
    assert whole.alpha.shape == (H, W) and inner.alpha.shape == (height, width)


def test_pixels_that_are_not_square_stretch_the_lens(tmp_path: Path):
    plate(tmp_path / "plate.exr", ["PixelAspectRatio"])
    scene = fl.Scene(None, tmp_path / "plate.exr")
    assert scene.pixel_aspect == scene.camera.camera.aspect == 2.0
    (tmp_path / "scene.toml").write_text('background = "plate.exr"\n[camera]\nfocal = 50.0\n')
    assert fl.Scene.load(tmp_path / "scene.toml").camera.camera.aspect == 2.0


def test_depth_and_mattes_find_their_place_in_overscan(tmp_path: Path):
    windows = WINDOWS["uneven overscan"]
    plate(tmp_path / "plate.exr", [], windows=windows)
    left, top, width, height = -windows[0], -windows[1], W - 8, H - 4
    inner = np.full((height, width), 3.0, np.float32)
    io.write_layers(tmp_path / "depth.exr", {"depth": inner})
    io.write_picture(tmp_path / "mask.png", np.full((height, width), 255, np.uint8))
    scene = fl.Scene(
        None, tmp_path / "plate.exr", depth=tmp_path / "depth.exr",
        foreground=tmp_path / "mask.png", effects=SNOW,
    )  # fmt: skip
    wanted = np.full((H, W), np.inf, np.float32)
    wanted[top : top + height, left : left + width] = 3.0
    np.testing.assert_array_equal(scene.depth_at(0), wanted)
    shown = scene.render(0, layers=True).alpha
    assert (shown[np.isfinite(wanted)] == 0.0).all() and (shown[~np.isfinite(wanted)] > 0.0).any()


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_profile_goes_through(ending: str, tmp_path: Path):
    from PIL import Image, ImageCms

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    picture = Image.fromarray((LIGHT[..., :3] * 255).astype(np.uint8))
    picture.save(tmp_path / f"plate.{ending}", icc_profile=profile)
    scene = fl.Scene(None, tmp_path / f"plate.{ending}", effects=SNOW)
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
    result = oiio.ImageBufAlgo.compare(oiio.ImageBuf(str(path)), oiio.ImageBuf(str(out)), 0, 0)
    assert result.maxerror == 0.0
    one, other = header(path), header(out)
    assert one.channelnames == other.channelnames and one.format == other.format
    assert one.get_int_attribute("oiio:BitsPerSample") == other.get_int_attribute(
        "oiio:BitsPerSample"
    )


CODECS = {"h264": ("mp4", 8), "h265": ("mp4", 10), "prores-hq": ("mov", 10), "ffv1": ("mkv", 10)}


def pictures(path: Path) -> np.ndarray:
    film = io.open_background(path)
    return np.stack([film.frame(number).pixels for number in range(4)])


@pytest.mark.parametrize("codec", CODECS)
def test_a_film_at_amount_0_is_what_the_codec_makes_of_the_plate(codec: str, tmp_path: Path):
    ending, bits = CODECS[codec]
    tags = Tags(primaries=1, transfer=1, matrix=1)
    tall, wide = 96, 128
    rows, columns = np.mgrid[:tall, :wide] / 40.0
    plate, ours, again = (tmp_path / f"{name}.{ending}" for name in ("plate", "ours", "again"))
    with io.VideoWriter(plate, (wide, tall), 24, codec=codec, bits=bits, tags=tags) as film:
        for number in range(4):
            wave = np.stack([np.sin(k * rows + columns + 0.3 * number) for k in (1, 2, 3)], axis=2)
            levels = (0.5 + 0.4 * wave) * (255 if bits == 8 else 65535)
            film.write(levels.astype(np.uint8 if bits == 8 else np.uint16))
    none = [fl.Snow.preset("heavy", amount=0.0)]
    fl.Scene(None, plate, effects=none).write(ours, codec=codec, bits=bits)
    before = pictures(plate)
    with io.VideoWriter(again, (wide, tall), 24, codec=codec, bits=bits, tags=tags) as film:
        for picture in before:
            film.write(picture)
    # The codec's own error, of the very pictures that the plate's film shows.
    lost = pictures(again).astype(float) - before
    np.testing.assert_array_equal(pictures(ours), pictures(again))
    assert np.abs(pictures(ours).astype(float) - before).max() <= np.abs(lost).max()


# Time codes --------------------------------------------------------------------------------------


def test_time_codes_count_as_clocks_do():
    rate = Fraction(30000, 1001)
    drop = TimeCode.of_text("00:00:59;29", rate)
    assert drop is not None and drop.later(1).text == "00:01:00;02"
    assert TimeCode.of_text("00:09:59;29", rate).later(1).text == "00:10:00;00"
    # 29.97 frames a second for an hour are an hour but for 4 ms.
    assert TimeCode.of_text("00:00:00;00", rate).later(107892).text == "01:00:00;00"
    code = TimeCode.of_text("23:59:59:23", Fraction(24))
    assert code is not None and code.later(1).text == "00:00:00:00"
    for text in ("01:02:03:04", "19:59:48:17"):
        one = TimeCode.of_text(text, Fraction(24))
        assert one is not None and one.text == text
        assert TimeCode.of_word(one.word, Fraction(24)) == one
    assert TimeCode.of_word(0x01020304, Fraction(24)).text == "01:02:03:04"
    assert TimeCode.of_text("noon", Fraction(24)) is None


def test_every_plate_keeps_its_own_time_code(tmp_path: Path):
    for number in range(1001, 1004):
        plate(tmp_path / f"plate.{number}.exr", ["framesPerSecond"])
        code = TimeCode.of_text("01:00:00:00", Fraction(24)).later(number)
        spec = header(tmp_path / f"plate.{number}.exr")
        spec.attribute("smpte:TimeCode", oiio.TypeDesc("timecode"), (code.word, 0))
        out = oiio.ImageOutput.create(str(tmp_path / f"plate.{number}.exr"))
        out.open(str(tmp_path / f"plate.{number}.exr"), spec)
        opaque = np.concatenate([LIGHT[..., :3], np.ones_like(LIGHT[..., :1])], axis=2)
        out.write_scanlines(0, H, 0, opaque.astype(np.float16))
        out.close()
    scene = fl.Scene(None, tmp_path / "plate.####.exr", effects=SNOW)
    scene.write(tmp_path / "out.####.exr", layers=True)
    for number in range(1001, 1004):
        code = TimeCode.of_text("01:00:00:00", Fraction(24)).later(number)
        found = header(tmp_path / f"out.{number}.exr").getattribute("smpte:TimeCode")
        assert found[0] == code.word
    scene.write(tmp_path / "film.mov", "1002-1003")
    with av.open(str(tmp_path / "film.mov")) as film:
        said = [one.metadata.get("timecode") for one in film.streams]
        assert TimeCode.of_text("01:00:00:00", Fraction(24)).later(1002).text in said


# Films -------------------------------------------------------------------------------------------

CODE = TimeCode.of_text("10:20:30:05", Fraction(24))
FILMS: dict[str, tuple[str, dict[str, Any], Tags]] = {
    "709": ("a.mp4", {}, Tags(primaries=1, transfer=1, matrix=1, timecode=CODE)),
    "601": ("a.mp4", {}, Tags(primaries=6, transfer=6, matrix=6)),
    "full range": ("a.mp4", {}, Tags(primaries=1, transfer=1, matrix=1, full=True)),
    "anamorphic": ("a.mov", {}, Tags(aspect=Fraction(2), timecode=CODE)),
    "ten bits": ("a.mp4", {"codec": "h265", "bits": 10}, Tags(primaries=9, transfer=14, matrix=9)),
    "ten bits h264": ("a.mp4", {"bits": 10}, Tags(primaries=9, transfer=14, matrix=9)),
    "prores": ("a.mov", {"codec": "prores-hq"}, Tags(primaries=9, transfer=1, matrix=9)),
    "vp9": ("a.webm", {}, Tags(primaries=1, transfer=1, matrix=1)),
    "ffv1 16": ("a.mkv", {"bits": 16}, Tags(primaries=9, transfer=13, timecode=CODE)),
}


def film(path: Path, tags: Tags, given: dict[str, Any]) -> None:
    # Twice as large as plates: H.265 has no room in less than 64 px.
    down, across = 2 * H, 2 * W
    y, x = np.mgrid[:down, :across]
    shade = np.stack([x / across, y / down, (x + y) / (down + across)], -1)
    with io.VideoWriter(path, (across, down), 24, tags=tags, **given) as writer:
        for level in range(3):
            deep = (0.2 + 0.2 * level + 0.3 * shade) * (255 if writer.bits == 8 else 65535)
            writer.write(deep.astype(np.uint8 if writer.bits == 8 else np.uint16))


@pytest.mark.parametrize("name", FILMS)
def test_what_a_film_says_goes_through(name: str, tmp_path: Path):
    file, given, tags = FILMS[name]
    film(tmp_path / file, tags, given)
    codec = {"codec": given["codec"]} if "codec" in given else {}
    scene = fl.Scene(None, tmp_path / file, effects=SNOW)
    before = io.open_background(tmp_path / file).tags
    assert (before.primaries, before.full, before.aspect) == (
        tags.primaries if tags.primaries != 2 else 1, tags.full or file.endswith("mkv"), tags.aspect
    )  # fmt: skip
    out = tmp_path / f"out{Path(file).suffix}"
    scene.write(out, **codec)
    assert io.open_background(out).tags == before
    assert scene.pixel_aspect == scene.camera.camera.aspect == float(tags.aspect)
    if tags.timecode is not None:
        scene.write(tmp_path / f"later{out.suffix}", "1-2", **codec)
        later = io.open_background(tmp_path / f"later{out.suffix}").tags.timecode
        assert later == tags.timecode.later(1)
    # Amount 0 is the film within what the codec loses.
    plain = fl.Scene(None, tmp_path / file)
    plain.write(tmp_path / f"plain{out.suffix}", **codec)
    one, other = (
        list(io.read_video(path)) for path in (tmp_path / file, tmp_path / f"plain{out.suffix}")
    )
    scale = 255.0 / np.iinfo(one[0].dtype).max
    assert one[0].dtype == other[0].dtype
    for a, b in zip(one, other, strict=True):
        gone = np.abs(a.astype(float) - b) * scale
        assert gone.max() < 8.0 and gone.mean() < 1.5


def test_a_film_of_ten_bits_is_not_made_one_of_eight(tmp_path: Path):
    film(tmp_path / "ten.mp4", Tags(), {"bits": 10})
    scene = fl.Scene(None, tmp_path / "ten.mp4", effects=SNOW)
    assert scene.render(0).dtype == np.uint16
    with pytest.raises(ValueError, match=r"the film has 10 bits, the new one at most 8: bits="):
        scene.write(tmp_path / "out.webm")
    scene.write(tmp_path / "out.webm", bits=8)
    scene.write(tmp_path / "out.mp4")
    assert io.open_background(tmp_path / "out.mp4").tags.bits == 10


@pytest.mark.parametrize("transfer", [16, 18])
def test_hdr_is_refused(transfer: int, tmp_path: Path):
    film(tmp_path / "hdr.mp4", Tags(primaries=9, transfer=transfer, matrix=9), {"bits": 10})
    with pytest.raises(ValueError, match=r"is HDR \((PQ|HLG)\)"):
        fl.Scene(None, tmp_path / "hdr.mp4")


def test_interlaced_film_is_refused(tmp_path: Path):
    path = tmp_path / "fields.mp4"
    with av.open(str(path), "w") as made:
        stream = made.add_stream("libx264", rate=25, options={"x264-params": "tff=1"})
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        stream.codec_context.flags |= 0x40000  # AV_CODEC_FLAG_INTERLACED_DCT
        for level in range(3):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 40 * level, np.uint8), "rgb24")
            made.mux(stream.encode(frame))
        made.mux(stream.encode())
    for use in ({"background": path}, {"size": (64, 64), "foreground": path}):
        with pytest.raises(ValueError, match="is interlaced"):
            fl.Scene(**use)


# Bits --------------------------------------------------------------------------------------------


def test_the_weather_alone_of_a_plate_of_16_bits_has_16(tmp_path: Path):
    levels = (LIGHT[..., :3] * 65535).astype(np.uint16)
    io.write_picture(tmp_path / "plate.png", levels)
    fl.Scene(None, tmp_path / "plate.png", effects=SNOW).write(tmp_path / "a.png", alone=True)
    assert io.read_picture(tmp_path / "a.png").pixels.dtype == np.uint16
    fl.Scene((W, H), effects=SNOW).write(tmp_path / "b.png", alone=True)
    assert io.read_picture(tmp_path / "b.png").pixels.dtype == np.uint8


def test_more_bits_than_the_plate_has_are_steps_of_the_weather(tmp_path: Path):
    scene = fl.Scene((W, H), "#203040", effects=SNOW)
    scene.write(tmp_path / "a.png", 5, bits=16)
    deep = io.read_picture(tmp_path / "a.png").pixels
    assert deep.dtype == np.uint16 and len(np.unique(deep % 257)) > 20
    assert np.abs(deep / 257.0 - scene.render(5)).max() <= 0.51
    scene.replace(effects=()).write(tmp_path / "b.png", 5, bits=16)
    assert (io.read_picture(tmp_path / "b.png").pixels == [32 * 257, 48 * 257, 64 * 257]).all()


@pytest.mark.parametrize(
    ("name", "bits"),
    [("a.png", "float"), ("a.png", "half"), ("a.png", 10), ("a.exr", 8), ("a.jpg", 16),
     ("a.tif", "half"), ("a.mp4", "float"), ("a.mov", 16)],
)  # fmt: skip
def test_bits_that_a_file_cannot_hold_are_refused(name: str, bits: Any, tmp_path: Path):
    with pytest.raises(ValueError, match="bits must be"):
        fl.Scene((W, H), effects=SNOW).write(tmp_path / name, "1", bits=bits)
    assert not list(tmp_path.iterdir())


def test_the_command_line_refuses_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    base = ["render", "#203040", "--snow", "heavy", "--size", "36x24", "--frames", "1", "-q"]
    out = str(tmp_path / "a.png")
    assert main([*base, "--float", "-o", out]) == 2
    assert "bits must be 8, 16" in capsys.readouterr().err
    assert main([*base, "--snow", "light", "-o", out]) == 2
    assert "--snow is given twice" in capsys.readouterr().err
    assert main([*base, "--bits", "16", "-o", out]) == 0
    assert io.read_picture(out).pixels.dtype == np.uint16


def test_snow_alone_in_prores_4444(tmp_path: Path):
    scene = fl.Scene((64, 48), "#000000", effects=SNOW)
    scene.write(tmp_path / "snow.mov", "1-2", alone=True, codec="prores-4444")
    with av.open(str(tmp_path / "snow.mov")) as made:
        frame = next(made.decode(video=0))
        assert frame.format.name.startswith("yuva444p")
        rgba = frame.to_ndarray(format="rgba64le") / 65535.0
    truth = scene.render(1, layers=True)
    assert np.abs(rgba[..., 3] - truth.alpha).max() < 0.03
    with pytest.raises(ValueError, match="alone needs codec='prores-4444'"):
        scene.write(tmp_path / "b.mp4", "1-2", alone=True)


def test_a_picture_too_small_for_h265_is_refused(tmp_path: Path):
    """Its library wrote past its own memory there, and ended the process."""
    with pytest.raises(ValueError, match=r"codec h265 needs 64 px in width or height, got 48 x 48"):
        io.VideoWriter(tmp_path / "a.mp4", (48, 48), 24, codec="h265")

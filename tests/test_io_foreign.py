"""Pictures that others wrote, of every kind; that are none, broke off or claim too much."""

import struct
import zlib

import numpy as np
import pytest
import skimage.data
import tifffile
from PIL import Image, ImageOps

from flurries import io
from flurries.io import open_background, read_layers, read_picture, srgb_to_linear, write_picture
from flurries.io.layers.planes import Deep, write_deep
from flurries.io.pictures.reader import luminance
from stills import assert_reads_as, levels, noise, png_chunk, write_exr


def test_grey_palettes_bits_and_ink(tmp_path):
    photograph = np.ascontiguousarray(skimage.data.astronaut()[:48, 200:264])
    image = Image.fromarray(photograph)
    cases = {
        "palette.png": (image.quantize(16), {}), "grey-alpha.png": (image.convert("LA"), {}),
        "grey.jpg": (image.convert("L"), {"quality": 100}),
        "lzw.tif": (image, {"compression": "tiff_lzw"}), "plain.webp": (image, {"lossless": True}),
    }  # fmt: skip
    for name, (written, options) in cases.items():
        written.save(tmp_path / name, **options)
        picture = read_picture(tmp_path / name)
        wanted = np.asarray(Image.open(tmp_path / name).convert("RGB"))
        error = np.abs(picture.pixels.astype(int) - wanted)
        assert error.max() <= (3 if name.endswith("jpg") else 0), name
        assert picture.pixels.dtype == np.uint8
        assert picture.encoding == "display"


def test_straight_alpha_of_other_formats_stays_straight(tmp_path):
    pixels = levels((20, 30, 4), np.uint8)
    image = Image.fromarray(pixels)
    for name in ("a.png", "a.tga", "a.tif"):
        image.save(tmp_path / name)
        picture = read_picture(tmp_path / name)
        assert not picture.premultiplied, name
        np.testing.assert_array_equal(picture.pixels, pixels[..., :3], name)
        np.testing.assert_array_equal(np.rint(picture.alpha * 255), pixels[..., 3], name)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_honoured(tmp_path, orientation):
    pixels = levels((6, 9, 3), np.uint8)
    pixels[:3, :4] = 200
    tags = Image.Exif()
    tags[0x0112] = orientation
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=tags, quality=100, subsampling=0)
    upright = np.asarray(ImageOps.exif_transpose(Image.open(tmp_path / "a.jpg")))
    picture = read_picture(tmp_path / "a.jpg")
    assert np.abs(picture.pixels.astype(int) - upright).max() <= 2
    assert open_background(tmp_path / "a.jpg").size == picture.size == upright.shape[1::-1]


@pytest.mark.parametrize(("data", "display"), [
    ((2, 1), (0, 0, 12, 9)),  # smaller than the display
    ((-3, -2), (0, 0, 4, 3)),  # larger: overscan
    ((5, -1), (-2, 3, 9, 4)),  # partly outside, origin not at 0
    ((100, 100), (0, 0, 5, 6)),  # not in it at all
])  # fmt: skip
def test_the_display_window_is_what_comes(tmp_path, data, display):
    pixels = np.abs(noise((7, 8, 4)))
    write_exr(tmp_path / "a.exr", pixels, ("R", "G", "B", "A"), data=data, display=display)
    left, top, width, height = display
    canvas = np.zeros((300, 300, 4), np.float32)
    canvas[data[1] + 50 : data[1] + 57, data[0] + 50 : data[0] + 58] = pixels
    wanted = canvas[top + 50 : top + 50 + height, left + 50 : left + 50 + width]
    assert_reads_as(tmp_path / "a.exr", wanted[..., :3], wanted[..., 3], "linear")
    assert open_background(tmp_path / "a.exr").size == (width, height)


def test_the_right_channels_are_found(tmp_path):
    pixels = noise((5, 6, 5))
    cases = [
        (("A", "B", "G", "R", "Z"), (3, 2, 1), 0),
        (("depth.Z", "snow.A", "B", "G", "R"), (4, 3, 2), None),
        (("snow.B", "snow.G", "snow.R", "snow.A", "x"), (2, 1, 0), 3),
        (("Y", "A", "p", "q", "r"), (0, 0, 0), 1),
        (("one", "two", "three", "four", "five"), None, None),
    ]
    for names, color, alpha in cases:
        write_exr(tmp_path / "a.exr", pixels, names)
        picture = read_picture(tmp_path / "a.exr")
        if color:
            np.testing.assert_array_equal(picture.pixels, pixels[..., list(color)])
        if alpha is None:
            assert picture.alpha is None
        else:
            np.testing.assert_array_equal(picture.alpha, pixels[..., alpha])


@pytest.mark.parametrize("overscan", [False, True])
def test_colors_and_depth_are_found_in_parts_and_lie_where_their_own_data_are(tmp_path, overscan):
    color, depth = noise((9, 12, 3)), 1.0 + np.abs(noise((4, 5, 1)))
    write_exr(tmp_path / "a.exr", depth, "Z", data=(3, 2), display=(0, 0, 8, 7),
              then=[(color, "RGB", (-2, -1))])  # fmt: skip
    wanted = np.full((9, 12), np.inf, np.float32)
    wanted[3:7, 5:10] = depth[..., 0]
    cut = np.s_[:, :] if overscan else np.s_[1:8, 2:10]
    found = io.read_depth(tmp_path / "a.exr", overscan=overscan)
    np.testing.assert_array_equal(found, wanted[cut])
    shown = read_picture(tmp_path / "a.exr", overscan=overscan)
    assert np.array_equal(shown.pixels, color[cut]) and shown.encoding == "linear"


def test_pictures_of_other_kinds_are_refused(tmp_path):
    write_exr(tmp_path / "chroma.exr", noise((4, 4, 3)), ("Y", "RY", "BY"))
    with pytest.raises(ValueError, match=r"chroma\.exr: .*luminance and chroma"):
        read_picture(tmp_path / "chroma.exr")
    write_deep(tmp_path / "deep.exr", Deep(np.ones((2, 2), int), np.ones((4, 6), np.float32)))
    with pytest.raises(ValueError, match=r"deep\.exr: deep pictures"):
        read_picture(tmp_path / "deep.exr")


def test_luminance(tmp_path):
    wild = np.array([[np.nan, np.inf, -3.0, 0.25, 9.0]], np.float32)
    color = levels((16, 16, 3), np.uint8)
    for name, pixels, wanted in [
        ("color.png", color, color / 255 @ [0.2126, 0.7152, 0.0722]),
        ("wild.exr", wild, [[0, 1, 0, 0.25, 1]]),
    ]:
        write_picture(tmp_path / name, pixels, half=False)
        found = luminance(read_picture(tmp_path / name))
        np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_files_that_are_no_pictures(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.txt").write_text("no picture\n" * 30)
    (tmp_path / "text.png").write_text("no picture\n" * 30)
    (tmp_path / "picture.null").write_text("no picture\n" * 30)
    for name, error in [
        ("missing.png", FileNotFoundError), ("empty.png", OSError), ("text.txt", ValueError),
        ("text.png", OSError), ("picture.null", ValueError),
    ]:  # fmt: skip
        for function in (read_picture, open_background, read_layers):
            with pytest.raises(error, match=name):
                function(tmp_path / name)
    for path in ("", "a\0b.png"):
        with pytest.raises(ValueError, match="path must name a file"):
            read_picture(path)
    with pytest.raises(OSError):
        read_picture("/dev/zero")


def specimens(folder):
    photograph = np.ascontiguousarray(skimage.data.astronaut()[90:186, 180:276])
    image = Image.fromarray(photograph)
    light = srgb_to_linear(photograph / np.float32(255))
    write_picture(folder / "ours.png", photograph)
    write_picture(folder / "ours.jpg", photograph)
    write_picture(folder / "ours.tif", photograph)
    write_picture(folder / "zip.exr", light)
    write_picture(folder / "none.exr", light, compression="none")
    write_picture(folder / "piz.exr", light, compression="piz")
    write_picture(folder / "ours.hdr", light)
    image.save(folder / "others.png")
    image.save(folder / "progressive.jpg", progressive=True, quality=90)
    image.save(folder / "lzw.tif", compression="tiff_lzw")
    tifffile.imwrite(folder / "first.tif", photograph, photometric="rgb")  # directory in front
    image.save(folder / "others.webp", lossless=True)
    return sorted(folder.iterdir())


def test_a_picture_that_broke_off_is_an_error(tmp_path):
    tried = 0
    for path in specimens(tmp_path):
        data, whole = path.read_bytes(), read_picture(path).pixels
        cut = path.with_stem("cut")
        for length in [1, *(len(data) * n // 16 for n in range(1, 16)), len(data) - 20]:
            cut.write_bytes(data[:length])
            with pytest.raises((OSError, ValueError), match=r"cut\."):
                read_picture(cut)
            tried += 1
        # The last bytes may be a trailer that nobody needs: then all pixels must be right.
        cut.write_bytes(data[:-1])
        try:
            assert np.array_equal(read_picture(cut).pixels, whole), path.name
        except (OSError, ValueError) as error:
            assert cut.name in str(error)
        cut.unlink()
    assert tried == 12 * 17


def parts(data: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], 8
    while at < len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        found.append((name, data[at + 8 : at + 8 + length]))
        at += 12 + length
    return found


def crafted(whole: list[tuple[bytes, bytes]], rng: np.random.Generator) -> list:
    """Return the parts of a PNG with one of them changed, whose sum will be right."""
    at = int(rng.integers(len(whole)))
    name, data = whole[at]
    packed = zlib.decompress(data) if name == b"IDAT" else data
    other = bytearray(name)
    other[rng.integers(4)] ^= 32
    changed = [
        [], [(name, data)] * 2, [(name, data[: len(data) // 2])], [(bytes(other), data)],
        [(name, data + b"more")], [(name, b"")], [(b"a!b", b"")],
        [(b"iCCP", b"profile\0\0no stream"), (name, data)], [(b"PLTE", b"four"), (name, data)],
        [(b"zTXt", b"k" * 90 + b"\0\0" + data), (name, data)],
        [(name, zlib.compress(b"\x09" + packed[1:]))], [(name, zlib.compress(packed[:-5]))],
        [(b"tEXt", b"k\0" + b"long" * 10**6), (name, data)],
    ][rng.integers(13)]  # fmt: skip
    return [*whole[:at], *changed, *whole[at + 1 :]]


def test_a_damaged_png_is_told_by_us_alone(tmp_path, capfd):
    rng, bad, refused = np.random.default_rng(6), tmp_path / "bad.png", 0
    image = Image.fromarray(skimage.data.astronaut()[90:130, 180:220])
    image.save(tmp_path / "plain.png", dpi=(72, 72))
    image.convert("P").save(tmp_path / "palette.png")
    for number in range(400):
        data = bytearray((tmp_path / ("plain.png", "palette.png")[number % 2]).read_bytes())
        if wrong := number % 4 > 1:
            data[rng.integers(8, len(data) - 12)] ^= 1 << rng.integers(8)
        else:
            data[8:] = b"".join(png_chunk(*part) for part in crafted(parts(bytes(data)), rng))
        bad.write_bytes(data)
        try:
            read_picture(bad)
            assert not wrong
        except OSError as error:
            refused += 1
            assert str(error).startswith(f"{bad}: the picture ") and "\n" not in str(error)
    assert refused > 280 and capfd.readouterr() == ("", "")

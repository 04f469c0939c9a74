"""Pictures that others wrote: palettes, orientations, windows, channels, parts, masks."""

import numpy as np
import OpenImageIO as oiio
import pytest
import skimage.data
import skimage.transform
from PIL import Image, ImageOps

from flurries.io import read_header, read_picture, write_picture
from flurries.io.pictures.reader import luminance
from stills import assert_reads_as, levels, noise, write_exr


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
    assert read_header(tmp_path / "a.jpg").size == picture.size == upright.shape[1::-1]


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
    assert read_header(tmp_path / "a.exr").size == (width, height)


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


def test_the_part_with_colors_is_found(tmp_path):
    path = str(tmp_path / "parts.exr")
    depth, color = noise((5, 6, 1)), noise((5, 6, 3))
    specs = [oiio.ImageSpec(6, 5, 1, "float"), oiio.ImageSpec(6, 5, 3, "float")]
    specs[0].channelnames = ("Z",)
    for name, spec in zip(("depth", "beauty"), specs, strict=True):
        spec.attribute("oiio:subimagename", name)
    output = oiio.ImageOutput.create(path)
    assert output.open(path, specs)
    assert output.write_image(depth)
    assert output.open(path, specs[1], "AppendSubimage")
    assert output.write_image(color)
    assert output.close()
    assert_reads_as(path, color, None, "linear")


def test_pictures_of_other_kinds_are_refused(tmp_path):
    write_exr(tmp_path / "chroma.exr", noise((4, 4, 3)), ("Y", "RY", "BY"))
    with pytest.raises(ValueError, match=r"chroma\.exr: .*luminance and chroma"):
        read_picture(tmp_path / "chroma.exr")
    spec = oiio.ImageSpec(2, 2, 2, "float")
    spec.channelnames, spec.deep = ("Z", "A"), True
    deep = oiio.DeepData()
    deep.init(spec)
    output = oiio.ImageOutput.create("x.exr")
    assert output.open(str(tmp_path / "deep.exr"), spec)
    assert output.write_deep_image(deep)
    output.close()
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

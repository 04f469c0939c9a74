"""Pictures come back as they were written, whatever the format, and damaged ones do not."""

import hashlib
import os
import struct
import subprocess
import sys
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest
import skimage.data
import skimage.transform
import tifffile
from PIL import Image, ImageOps
from skimage.metrics import peak_signal_noise_ratio

from flurries.io import (
    Budget,
    fit,
    linear_to_srgb,
    read_header,
    read_layers,
    read_mask,
    read_picture,
    srgb_to_linear,
    write_layers,
    write_picture,
)

# Newer Pythons warn when a process with threads is forked, which is what these tests are about.
pytestmark = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")

SHAPES = [(21, 34), (21, 34, 1), (21, 34, 3), (21, 34, 4), (130, 5, 3), (1, 1, 3)]


def noise(shape, seed=0):
    """Light from below 0 to well above 1."""
    return np.random.default_rng(seed).normal(1.0, 3.0, shape).astype(np.float32)


def levels(shape, dtype, seed=0):
    return np.random.default_rng(seed).integers(0, np.iinfo(dtype).max + 1, shape, dtype)


def as_read(pixels):
    """What a reader gives for an array that was written: colors in three channels, alpha."""
    array = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    color = array[..., :3] if array.shape[2] >= 3 else np.repeat(array, 3, axis=2)
    return color, array[..., 3] if array.shape[2] == 4 else None


def same_bits(a, b):
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def assert_reads_as(path, color, alpha, encoding):
    picture = read_picture(path)
    assert same_bits(picture.pixels, np.ascontiguousarray(color))
    assert picture.encoding == encoding
    assert picture.size == (color.shape[1], color.shape[0])
    assert picture.pixels.flags.c_contiguous
    if alpha is None:
        assert picture.alpha is None
    else:
        assert same_bits(picture.alpha, np.ascontiguousarray(alpha))


# Read-back


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["a.exr", "a.tif"])
def test_float32_comes_back_bit_for_bit(tmp_path, shape, name):
    pixels = noise(shape)
    pixels.flat[: min(6, pixels.size)] = [np.nan, np.inf, -np.inf, 1e-42, 3e38, -0.0][: pixels.size]
    write_picture(tmp_path / name, pixels, half=False)
    assert_reads_as(tmp_path / name, *as_read(pixels), "linear")


@pytest.mark.parametrize("shape", SHAPES)
def test_half_is_within_half_an_ulp(tmp_path, shape):
    pixels = np.clip(noise(shape) * np.exp(noise(shape, 1)), -60_000, 60_000)
    write_picture(tmp_path / "a.exr", pixels)
    color, alpha = as_read(pixels)
    picture = read_picture(tmp_path / "a.exr")
    spacing = np.spacing(np.abs(color).astype(np.float16)).astype(np.float32)
    assert (np.abs(picture.pixels - color) <= spacing / 2).all()
    assert picture.pixels.max() > 1 or pixels.size < 9
    assert (picture.alpha is None) == (alpha is None)
    # The control: bfloat16, three bits poorer, would not pass.
    poor = (color.view(np.uint32) & np.uint32(0xFFFF0000)).view(np.float32)
    assert color.size < 9 or not (np.abs(poor - color) <= spacing / 2).all()


def test_half_has_a_largest_number_and_no_infinity(tmp_path):
    values = np.array([[65504, 65519, 70000, 1e30, np.inf, -1e9, np.nan, 2.0]], np.float32)
    write_picture(tmp_path / "a.exr", values)
    found = read_picture(tmp_path / "a.exr").pixels[0, :, 0]
    np.testing.assert_array_equal(found, [65504] * 5 + [-65504, np.nan, 2.0])
    # The control: OpenImageIO by itself stores infinity.
    spec = oiio.ImageSpec(8, 1, 1, "half")
    output = oiio.ImageOutput.create("b.exr")
    assert output.open(str(tmp_path / "b.exr"), spec)
    assert output.write_image(values[..., np.newaxis])
    output.close()
    assert np.isinf(read_picture(tmp_path / "b.exr").pixels[0, 2, 0])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["a.png", "a.tiff"])
def test_integers_come_back_exactly(tmp_path, shape, dtype, name):
    pixels = levels(shape, dtype)
    write_picture(tmp_path / name, pixels)
    color, alpha = as_read(pixels)
    if alpha is not None:
        alpha = alpha.astype(np.float32) / np.float32(np.iinfo(dtype).max)
    assert_reads_as(tmp_path / name, color, alpha, "display")
    assert not read_picture(tmp_path / name).premultiplied


@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz", "dwaa", "dwab"])
def test_every_compression(tmp_path, compression):
    pixels = np.abs(noise((70, 40, 3))) / 4
    write_picture(tmp_path / "a.exr", pixels, compression=compression)
    found = read_picture(tmp_path / "a.exr").pixels
    lossy = compression.startswith("dwa")
    assert np.array_equal(found, pixels.astype(np.float16).astype(np.float32)) is not lossy
    assert np.abs(found - pixels).mean() < 0.05


@pytest.mark.parametrize("shape", [(64, 48), (64, 48, 3)])
def test_jpeg_and_hdr_are_near(tmp_path, shape):
    photograph = skimage.data.astronaut()[: shape[0], 200 : 200 + shape[1]]
    pixels = photograph[..., 1] if len(shape) == 2 else photograph
    color, _ = as_read(np.ascontiguousarray(pixels))
    write_picture(tmp_path / "a.jpg", pixels)
    found = read_picture(tmp_path / "a.jpg")
    assert (found.encoding, found.pixels.dtype) == ("display", np.uint8)
    assert peak_signal_noise_ratio(color, found.pixels) > 39
    light = srgb_to_linear(color / 255.0) * 40
    write_picture(tmp_path / "a.hdr", light[..., 0] if len(shape) == 2 else light)
    found = read_picture(tmp_path / "a.hdr")
    assert (found.encoding, found.pixels.dtype) == ("linear", np.float32)
    assert (np.abs(found.pixels - light) <= light.max(axis=2, keepdims=True) / 120).all()
    assert found.pixels.max() > 10


def test_float64_and_float16(tmp_path):
    exact = noise((9, 9, 3)).astype(np.float64) / 3
    exact[0, 0] = [1e300, -1e300, np.inf]
    write_picture(tmp_path / "a.exr", exact, half=False)
    largest = np.finfo(np.float32).max
    found = read_picture(tmp_path / "a.exr").pixels
    np.testing.assert_array_equal(found[0, 0], [largest, -largest, np.inf])
    np.testing.assert_array_equal(found[1:], exact[1:].astype(np.float32))
    halves = noise((9, 9, 3)).astype(np.float16)
    write_picture(tmp_path / "b.exr", halves)
    np.testing.assert_array_equal(read_picture(tmp_path / "b.exr").pixels, halves)


# Encodings and alpha


def test_srgb_is_the_standard_formula():
    display = np.linspace(-0.5, 3, 3001)
    wanted = np.where(
        display <= 0.04045, display / 12.92, (np.maximum(display, 0) / 1.055 + 0.055 / 1.055) ** 2.4
    )
    np.testing.assert_allclose(srgb_to_linear(display), wanted, rtol=1e-14)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(display)), display, atol=1e-7)
    assert abs(float(srgb_to_linear(0.5)) - 0.21404114048223255) < 1e-15
    # The control: the usual shortcut, a power of 2.2, is far off in the shadows.
    assert abs(0.02**2.2 - float(srgb_to_linear(0.02))) > 0.5 * float(srgb_to_linear(0.02))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_level_survives_linear_light(dtype):
    largest = np.iinfo(dtype).max
    every = np.arange(largest + 1) / np.float32(largest)
    back = linear_to_srgb(srgb_to_linear(every.astype(np.float32)))
    np.testing.assert_array_equal(np.rint(back * largest), np.arange(largest + 1))


def test_srgb_keeps_dtypes_and_nan_and_refuses_integers():
    for dtype, kept in [
        (np.float32, np.float32),
        (np.float64, np.float64),
        (np.float16, np.float32),
    ]:
        values = np.array([0.1, np.nan, 4.0], dtype)
        for function in (srgb_to_linear, linear_to_srgb):
            assert function(values).dtype == kept
            assert np.isnan(function(values)).tolist() == [False, True, False]
    for integers in (np.arange(4), np.zeros(3, np.uint8), 5):
        with pytest.raises(TypeError, match="values must be floats"):
            srgb_to_linear(integers)


def test_light_becomes_display_values_in_png(tmp_path):
    light = np.array([[-1.0, 0.0, 0.002, 0.2, 0.5, 1.0, 4.0, np.nan, np.inf]])
    for bits, largest in ((8, 255), (16, 65535)):
        write_picture(tmp_path / "a.png", light, bits=bits)
        display = np.clip(linear_to_srgb(np.nan_to_num(light, nan=0, posinf=1)), 0, 1)
        found = read_picture(tmp_path / "a.png").pixels
        assert found.dtype == (np.uint8 if bits == 8 else np.uint16)
        np.testing.assert_array_equal(found[..., 0], np.rint(display * largest))
    # The control: as they are, without the curve, a fifth is 51 and not 124.
    write_picture(tmp_path / "b.png", light, encoding="display")
    assert read_picture(tmp_path / "b.png").pixels[0, 3, 0] == 51
    assert round(read_picture(tmp_path / "a.png").pixels[0, 3, 0] / 257) == 124


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_display_values_become_light_in_exr(tmp_path, dtype):
    pixels = levels((30, 20, 3), dtype)
    write_picture(tmp_path / "a.exr", pixels, half=False)
    wanted = srgb_to_linear(pixels / np.iinfo(dtype).max).astype(np.float32)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr").pixels, wanted)
    write_picture(tmp_path / "b.exr", pixels / np.iinfo(dtype).max, encoding="display", half=False)
    np.testing.assert_allclose(read_picture(tmp_path / "b.exr").pixels, wanted, rtol=1e-6)
    write_picture(tmp_path / "c.exr", pixels, encoding="linear", half=False)
    scaled = pixels.astype(np.float32) / np.float32(np.iinfo(dtype).max)
    np.testing.assert_array_equal(read_picture(tmp_path / "c.exr").pixels, scaled)


def test_bits_can_be_asked_for(tmp_path):
    deep = levels((20, 20, 3), np.uint16)
    write_picture(tmp_path / "a.png", deep, bits=8)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png").pixels, np.rint(deep / 257))
    write_picture(tmp_path / "a.png", deep.astype(np.uint8), bits=16)
    wanted = deep.astype(np.uint8).astype(np.uint16) * 257
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png").pixels, wanted)
    write_picture(tmp_path / "a.tif", deep / 65535, bits=16, encoding="display")
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tif").pixels, deep)


def test_alpha_is_multiplied_in_exr_and_not_in_png(tmp_path):
    display = levels((40, 30, 4), np.uint8)
    display[..., 3] = np.maximum(display[..., 3], 8)
    write_picture(tmp_path / "a.exr", display, half=False)
    stored = read_picture(tmp_path / "a.exr")
    alpha = display[..., 3:].astype(np.float32) / np.float32(255)
    light = srgb_to_linear(display[..., :3] / np.float32(255))
    assert stored.premultiplied
    np.testing.assert_array_equal(stored.alpha, alpha[..., 0])
    np.testing.assert_allclose(stored.pixels, light * alpha, rtol=1e-5)
    # And back again, to the same integers.
    write_picture(tmp_path / "a.png", stored.pixels, alpha=stored.alpha)
    back = read_picture(tmp_path / "a.png")
    np.testing.assert_array_equal(back.pixels, display[..., :3])
    np.testing.assert_array_equal(np.rint(back.alpha * 255), display[..., 3])
    # The control: colors taken for straight are too dark where it is thin.
    write_picture(tmp_path / "b.png", stored.pixels, alpha=stored.alpha, premultiplied=False)
    assert read_picture(tmp_path / "b.png").pixels.mean() < back.pixels.mean() - 20


def test_color_without_opacity_stays(tmp_path):
    glow = np.array([[[0.5, 0.25, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]]], np.float32)
    write_picture(tmp_path / "a.exr", glow)
    assert_reads_as(tmp_path / "a.exr", glow[..., :3], glow[..., 3], "linear")
    write_picture(tmp_path / "a.png", glow)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "a.png").pixels, np.rint(linear_to_srgb(glow[..., :3]) * 255)
    )


def test_alpha_apart_is_the_same_as_alpha_within(tmp_path):
    for name, pixels in [("a.exr", noise((9, 8, 4))), ("a.png", levels((9, 8, 4), np.uint8))]:
        write_picture(tmp_path / name, pixels)
        write_picture(tmp_path / f"b{name}", pixels[..., :3], alpha=pixels[..., 3])
        assert (tmp_path / name).read_bytes() == (tmp_path / f"b{name}").read_bytes()
    write_picture(tmp_path / "g.png", levels((9, 8), np.uint8), alpha=np.full((9, 8), 0.2))
    assert read_header(tmp_path / "g.png").channels == ("Y", "A")
    np.testing.assert_array_equal(read_picture(tmp_path / "g.png").alpha, np.float32(51 / 255))


# Headers


def test_metadata_come_back(tmp_path):
    given = {
        "seed": -(2**63),
        "frame": np.int64(12),
        "fps": np.float32(0.5),
        "third": 1 / 3,
        "scene": "Schnee, 雪, ❄",
        "flurries:version": "1.0",
    }
    wanted = {
        "seed": str(-(2**63)),
        "frame": "12",
        "fps": "0.5",
        "third": repr(1 / 3),
        "scene": "Schnee, 雪, ❄",
        "version": "1.0",
        "DateTime": "2000:01:01 00:00:00",
    }
    for name in ("a.exr", "a.png", "a.tif", "a.jpg"):
        write_picture(tmp_path / name, np.zeros((4, 4, 3)), metadata=given)
        assert read_header(tmp_path / name).metadata == wanted, name
    # Programs see them under their full names.
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert spec.get_string_attribute("flurries:seed") == str(-(2**63))
    write_picture(tmp_path / "b.exr", np.zeros((4, 4, 3)))
    assert read_header(tmp_path / "b.exr").metadata == {}


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.tif", "a.jpg", "a.hdr"])
def test_bytes_depend_on_nothing_but_the_arguments(tmp_path, name):
    pixels = np.abs(noise((70, 30, 3))) / 4
    (tmp_path / "elsewhere").mkdir()
    for folder in (tmp_path, tmp_path / "elsewhere"):
        write_picture(folder / name, pixels, metadata={"b": 1, "a": 2})
    data = (tmp_path / name).read_bytes()
    assert data == (tmp_path / "elsewhere" / name).read_bytes()
    # No folder, no temporary name, no program's path.
    for word in (b"elsewhere", tmp_path.name.encode(), b".flurries-", b"pytest", b"/tmp"):
        assert word not in data
    if name != "a.hdr":
        # The control: the moment is in there, so a clock would show.
        write_picture(tmp_path / name, pixels, metadata={"DateTime": "2001:02:03 04:05:06"})
        assert (tmp_path / name).read_bytes() != data


# Reading what others wrote


def test_grey_palettes_bits_and_ink(tmp_path):
    photograph = np.ascontiguousarray(skimage.data.astronaut()[:48, 200:264])
    image = Image.fromarray(photograph)
    cases = {
        "grey.png": (image.convert("L"), {}),
        "bits.png": (image.convert("1"), {}),
        "palette.png": (image.quantize(16), {}),
        "grey-alpha.png": (image.convert("LA"), {}),
        "progressive.jpg": (image, {"progressive": True}),
        "grey.jpg": (image.convert("L"), {"quality": 100}),
        "lzw.tif": (image, {"compression": "tiff_lzw"}),
        "plain.webp": (image, {"lossless": True}),
        "plain.tga": (image, {}),
        "plain.bmp": (image, {}),
    }
    for name, (written, options) in cases.items():
        written.save(tmp_path / name, **options)
        picture = read_picture(tmp_path / name)
        wanted = np.asarray(Image.open(tmp_path / name).convert("RGB"))
        error = np.abs(picture.pixels.astype(int) - wanted)
        assert error.max() <= (3 if name.endswith("jpg") else 0), name
        assert picture.pixels.dtype == np.uint8
        assert picture.encoding == "display"
    image.convert("CMYK").save(tmp_path / "ink.tif")
    assert read_picture(tmp_path / "ink.tif").pixels.shape == photograph.shape


def test_straight_alpha_of_other_formats_stays_straight(tmp_path):
    pixels = levels((20, 30, 4), np.uint8)
    image = Image.fromarray(pixels)
    options = {"a.webp": {"lossless": True, "exact": True}}
    for name in ("a.png", "a.webp", "a.tga", "a.bmp", "a.tif"):
        image.save(tmp_path / name, **options.get(name, {}))
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
    tag = [(274, "H", 1, orientation, True)]
    tifffile.imwrite(tmp_path / "a.tif", pixels, photometric="rgb", extratags=tag)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "a.tif").pixels, turned(pixels, orientation)
    )


def turned(pixels, orientation):
    """The standard's own words: where the first row and the first column of the file belong."""
    row_is, column_is = {
        1: ("top", "left"),
        2: ("top", "right"),
        3: ("bottom", "right"),
        4: ("bottom", "left"),
        5: ("left", "top"),
        6: ("right", "top"),
        7: ("right", "bottom"),
        8: ("left", "bottom"),
    }[orientation]
    if row_is in ("left", "right"):
        pixels = pixels.swapaxes(0, 1)
        row_is, column_is = column_is, row_is
    if row_is == "bottom":
        pixels = pixels[::-1]
    return pixels[:, ::-1] if column_is == "right" else pixels


def write_exr(path, pixels, names, *, data=(0, 0), display=None, kind="float", part=None):
    """An EXR straight from OpenImageIO."""
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.channelnames = names
    spec.x, spec.y = data
    if display:
        spec.full_x, spec.full_y, spec.full_width, spec.full_height = display
    output = oiio.ImageOutput.create("x.exr")
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(pixels), output.geterror()
    assert output.close()


@pytest.mark.parametrize(
    ("data", "display"),
    [
        ((2, 1), (0, 0, 12, 9)),  # smaller than the display
        ((-3, -2), (0, 0, 4, 3)),  # larger: overscan
        ((5, -1), (-2, 3, 9, 4)),  # partly outside, origin not at 0
        ((100, 100), (0, 0, 5, 6)),  # not in it at all
    ],
)
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


def test_unusual_numbers(tmp_path):
    whole = np.arange(12, dtype=np.uint32).reshape(3, 4) * 300_000_000
    tifffile.imwrite(tmp_path / "wide.tif", whole)
    picture = read_picture(tmp_path / "wide.tif")
    assert picture.encoding == "display"
    np.testing.assert_allclose(picture.pixels[..., 0], whole / (2**32 - 1), rtol=1e-6)
    doubles = noise((3, 4, 3)).astype(np.float64)
    tifffile.imwrite(tmp_path / "double.tif", doubles, photometric="rgb")
    assert_reads_as(tmp_path / "double.tif", doubles.astype(np.float32), None, "linear")


def test_masks(tmp_path):
    grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
    write_picture(tmp_path / "grey.png", grey)
    np.testing.assert_array_equal(read_mask(tmp_path / "grey.png"), grey / np.float32(255))
    color = levels((16, 16, 3), np.uint8)
    write_picture(tmp_path / "color.png", color)
    wanted = color / 255 @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(read_mask(tmp_path / "color.png"), wanted, atol=1e-6)
    write_picture(tmp_path / "alpha.png", color, alpha=grey)
    np.testing.assert_array_equal(read_mask(tmp_path / "alpha.png"), grey / np.float32(255))
    wild = np.array([[np.nan, np.inf, -3.0, 0.25, 9.0]], np.float32)
    write_picture(tmp_path / "wild.exr", wild, half=False)
    np.testing.assert_array_equal(read_mask(tmp_path / "wild.exr"), [[0, 1, 0, 0.25, 1]])
    half = np.linspace(0, 1, 50, dtype=np.float32).reshape(5, 10)
    write_picture(tmp_path / "mask.png", half, encoding="display", bits=16)
    np.testing.assert_allclose(read_mask(tmp_path / "mask.png"), half, atol=1 / 131070)


# Layers


def test_layers_come_back(tmp_path):
    layers = {
        "rgba": noise((70, 9, 4)),
        "snow": noise((70, 9, 4), 1),
        "light": noise((70, 9, 3), 2),
        "depth": np.abs(noise((70, 9), 3)) * 1000,
        "motion": noise((70, 9, 2), 4) * 100,
        "alpha": np.abs(noise((70, 9), 5)),
        "left.mask": np.abs(noise((70, 9), 6)),
        "noise": noise((70, 9), 7),
    }
    layers["depth"][0, 0] = np.inf
    write_layers(tmp_path / "a.exr", layers, metadata={"seed": 3})
    assert set(read_header(tmp_path / "a.exr").channels) == {
        *("R", "G", "B", "A", "snow.R", "snow.G", "snow.B", "snow.A", "light.R", "light.G"),
        *("light.B", "depth.Z", "motion.X", "motion.Y", "alpha.A", "left.mask.A", "noise.Y"),
    }
    assert read_header(tmp_path / "a.exr").metadata["seed"] == "3"
    found = read_layers(tmp_path / "a.exr")
    assert found.keys() == layers.keys()
    for name, layer in layers.items():
        precise = name in ("depth", "motion")
        wanted = layer if precise else layer.astype(np.float16).astype(np.float32)
        assert same_bits(found[name], wanted), name
    # A program that knows nothing of layers sees the picture.
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr").pixels, found["rgba"][..., :3])
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    kinds = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    assert (kinds["R"], kinds["depth.Z"], kinds["alpha.A"]) == ("half", "float", "half")
    write_layers(tmp_path / "b.exr", layers, half=False)
    for name, layer in layers.items():
        assert same_bits(read_layers(tmp_path / "b.exr")[name], layer)


# Refusals


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    good, four = np.zeros((4, 5, 3), np.uint8), np.zeros((4, 5, 4))
    for name, pixels, match, options in [
        ("a.xyz", good, r"\.exr, \.hdr, .*not as '\.xyz'", {}),
        ("a", good, "not as ''", {}),
        ("a.jpg", good, "bits must be 8 for jpeg", {"bits": 16}),
        ("a.jpg", four, "holds no alpha", {}),
        ("a.hdr", four, "holds no alpha", {}),
        ("a.png", four, "alpha must be left out", {"alpha": good[..., 0]}),
        ("a.jpg", good, "do not fit", {"metadata": {"scene": "x" * 70_000}}),
    ]:
        with pytest.raises(ValueError, match=match):
            write_picture(tmp_path / name, pixels, **options)
    with pytest.raises(ValueError, match=r"only \.exr"):
        write_layers(tmp_path / "a.png", {"rgba": four})
    assert not any(tmp_path.iterdir())


def test_files_that_are_no_pictures(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.txt").write_text("no picture\n" * 30)
    (tmp_path / "text.png").write_text("no picture\n" * 30)
    (tmp_path / "picture.null").write_text("no picture\n" * 30)
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "fifo.png")
    for name, error in [
        ("missing.png", FileNotFoundError),
        ("empty.png", OSError),
        ("text.txt", ValueError),
        ("text.png", OSError),
        ("picture.null", ValueError),
        ("folder.png", IsADirectoryError),
        ("fifo.png", OSError),
    ]:
        for function in (read_picture, read_mask, read_header, read_layers):
            with pytest.raises(error, match=name):
                function(tmp_path / name)
    for path in ("", "a\0b.png"):
        with pytest.raises(ValueError, match="path must name a file"):
            read_picture(path)
    with pytest.raises(OSError):
        read_picture("/dev/zero")
    # The control: the null format reads any text as a black picture.
    assert oiio.ImageInput.open(str(tmp_path / "picture.null")).read_image("float").shape[0] == 1024


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def test_a_picture_that_claims_to_be_huge_is_refused_before_it_is_read(tmp_path):
    header = struct.pack(">IIBBBBB", 300_000, 300_000, 8, 2, 0, 0, 0)
    parts = [(b"IHDR", header), (b"IDAT", zlib.compress(bytes(99))), (b"IEND", b"")]
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + b"".join(chunk(name, data) for name, data in parts)
    )
    with pytest.raises(OSError, match=r"a\.png"):
        read_picture(tmp_path / "a.png")
    window = (0, 0, 2**20, 2**20)
    write_exr(tmp_path / "a.exr", noise((4, 4, 3)), ("R", "G", "B"), display=window)
    with pytest.raises(OSError, match=r"a\.exr: .*1048576 x 1048576"):
        read_picture(tmp_path / "a.exr")
    write_picture(tmp_path / "b.png", np.zeros((10, 11), np.uint8))
    with pytest.raises(OSError, match="11 x 10"):
        read_picture(tmp_path / "b.png", budget=Budget(pixels=100))


# Damage


def specimens(folder):
    """Pictures in the formats of film and photography, from us and from others."""
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


def test_without_the_guards_half_a_jpeg_is_half_grey(tmp_path):
    """The control: the decoder calls it a success."""
    photograph = np.ascontiguousarray(skimage.data.astronaut()[90:186, 180:276])
    write_picture(tmp_path / "a.jpg", photograph)
    data = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(data[: len(data) // 2])
    found = oiio.ImageInput.open(str(tmp_path / "a.jpg")).read_image("uint8")
    assert found.shape == photograph.shape
    assert np.ptp(found[-8:], axis=(0, 1)).max() == 0
    with pytest.raises(OSError, match="Premature end"):
        read_picture(tmp_path / "a.jpg")


def test_errors_do_not_spill_over_to_the_next_picture(tmp_path):
    write_picture(tmp_path / "good.jpg", np.zeros((8, 8, 3), np.uint8))
    (tmp_path / "bad.jpg").write_bytes((tmp_path / "good.jpg").read_bytes()[:200])
    for _ in range(3):
        with pytest.raises(OSError):
            read_picture(tmp_path / "bad.jpg")
        assert read_picture(tmp_path / "good.jpg").size == (8, 8)
    assert oiio.geterror() == ""


# Fitting


def smooth(height, width):
    y, x = np.mgrid[:height, :width] + 0.5
    waves = [np.sin(x / 17 + 0.3) * np.cos(y / 13), np.cos(x / 23 - y / 19), np.sin(y / 29)]
    return (0.5 + 0.4 * np.stack(waves, axis=-1)).astype(np.float32)


@pytest.mark.parametrize("size", [(120, 75), (320, 200), (37, 90), (200, 31), (161, 100), (90, 90)])
@pytest.mark.parametrize("how", ["cover", "stretch", "contain"])
def test_fit_puts_things_where_geometry_says(size, how):
    picture = smooth(100, 160)
    width, height = size
    fitted = fit(picture, size, how)
    assert fitted.shape == (height, width, 3)
    assert fitted.dtype == np.float32
    across, down = width / 160, height / 100
    if how != "stretch":
        across = down = (max if how == "cover" else min)(across, down)
    # scikit-image counts from pixel centres: the middle of the frame is the middle of the picture.
    map_back = skimage.transform.AffineTransform(
        scale=(1 / across, 1 / down),
        translation=(
            79.5 - (width - 1) / 2 / across,
            49.5 - (height - 1) / 2 / down,
        ),
    )
    wanted = skimage.transform.warp(
        picture, map_back, output_shape=(height, width), order=3, mode="edge"
    )
    inside = np.zeros((height, width), bool)
    rows, columns = min(height, round(100 * down)), min(width, round(160 * across))
    top, left = (height - rows) // 2, (width - columns) // 2
    inside[top + 4 : top + rows - 4, left + 4 : left + columns - 4] = True
    tolerance = np.full((height, width, 1), 0.004)
    if how != "stretch":
        # A kept aspect is exact to a pixel over the whole length, and exact in the middle; the
        # waves rise by at most 0.4 / 13 a pixel.
        y, x = np.abs(
            np.mgrid[:height, :width] - np.array([height - 1, width - 1])[:, None, None] / 2
        )
        tolerance[..., 0] += 0.4 / 13 * (y / (100 * down) / down + x / (160 * across) / across)
    assert (np.abs(fitted - wanted) <= tolerance)[inside].all()
    # The control: half a pixel beside it would show.
    shifted = fit(picture[:, 1:], size, how)
    assert not (np.abs(shifted - wanted) <= tolerance)[inside].all()


def test_contain_has_bars_and_cover_has_none():
    white = np.ones((50, 100, 4), np.float32)
    contained = fit(white, (60, 60), "contain")
    np.testing.assert_array_equal(contained[15:45], 1)
    np.testing.assert_array_equal(contained[:15], 0)
    np.testing.assert_array_equal(contained[45:], 0)
    upright = fit(white.swapaxes(0, 1), (60, 60), "contain")
    np.testing.assert_array_equal(upright, contained.swapaxes(0, 1))
    np.testing.assert_array_equal(fit(white, (61, 33), "cover"), 1)
    np.testing.assert_array_equal(fit(white, (3, 200), "contain").sum(axis=(0, 2)) > 0, True)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [(), (1,), (3,), (4,)])
def test_fit_keeps_the_dtype_and_flat_areas(dtype, channels):
    whole = np.dtype(dtype).kind == "u"
    value = 77 if whole else 0.3
    picture = np.full((13, 17, *channels), value, dtype)
    fitted = fit(picture, (31, 9))
    assert fitted.shape == (9, 31, *channels)
    assert fitted.dtype == dtype
    np.testing.assert_allclose(fitted.astype(float), float(picture.flat[0]), rtol=1e-6)
    same = fit(picture, (17, 13))
    assert same_bits(same, picture)
    assert not np.may_share_memory(same, picture)


def test_fit_averages_light_and_not_display_values():
    board = np.indices((64, 64)).sum(axis=0) % 2 * np.uint8(255)
    middle = fit(board.astype(np.uint8), (8, 8))[2:-2, 2:-2]
    wanted = round(float(linear_to_srgb(0.5)) * 255)
    assert np.abs(middle.astype(int) - wanted).max() <= 1
    # The control: display values would average to 128.
    plain = fit(board.astype(np.uint8), (8, 8), encoding="linear")[2:-2, 2:-2]
    assert np.abs(plain.astype(int) - 128).max() <= 1


def test_fit_does_not_ring_and_keeps_light():
    stars = np.zeros((100, 100), np.float32)
    stars[::10, ::10] = 50
    for size in ((37, 37), (250, 250)):
        fitted = fit(stars, size)
        assert fitted.min() >= 0
        assert fitted.max() <= 50
    y, x = np.mgrid[:100, :100] - 49.5
    lamp = np.exp(-(x**2 + y**2) / 50).astype(np.float32)
    for size in ((37, 37), (250, 250)):
        assert abs(fit(lamp, size).mean() / lamp.mean() - 1) < 0.002


def test_fit_mixes_no_color_from_where_there_is_nothing():
    picture = np.zeros((40, 40, 4), np.uint8)
    picture[..., 1] = 255  # invisible green
    picture[10:30, 10:30] = [255, 0, 0, 255]
    fitted = fit(picture, (23, 23))
    seen = fitted[..., 3] > 10
    assert seen.sum() > 50
    assert fitted[seen][:, 1].max() <= 1
    assert fitted[seen][:, 0].min() >= 254


# Processes


CODE = """
import os, sys
import numpy as np
{prepare}
from flurries.io import fit, write_picture, read_picture
before = len(os.listdir("/proc/self/task"))
pixels = np.random.default_rng(0).random((300, 300, 3)).astype(np.float32)
write_picture(sys.argv[1], pixels)
read_picture(sys.argv[1])
fit(pixels, (50, 50))
{control}
print(len(os.listdir("/proc/self/task")) - before)
"""
POOL = """
import OpenImageIO
OpenImageIO.attribute("exr_threads", 3)
write_picture(sys.argv[1], pixels)
"""


def run(code, *arguments):
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    ).stdout.strip()


def test_pictures_need_no_threads(tmp_path):
    """A pool of threads would be lost in a forked child, which then waits for it for ever."""
    assert run(CODE.format(prepare="", control=""), tmp_path / "a.exr") == "0"
    # The control: OpenEXR's pool does show in the count.
    assert int(run(CODE.format(prepare="", control=POOL), tmp_path / "a.exr")) > 0


def test_forked_children_read_and_write(tmp_path):
    pixels = noise((100, 100, 3))
    write_picture(tmp_path / "parent.exr", pixels)
    children = []
    for number in range(10):
        child = os.fork()
        if child == 0:
            code = 1
            try:
                write_picture(tmp_path / f"{number}.exr", pixels)
                fit(read_picture(tmp_path / "parent.exr").pixels, (30, 30))
                code = 0
            finally:
                os._exit(code)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 10
    made = {hashlib.sha256(path.read_bytes()).digest() for path in tmp_path.iterdir()}
    assert len(made) == 1

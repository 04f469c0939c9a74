"""Pictures come back as they were written, whatever the format, and are fitted in light."""

import numpy as np
import OpenImageIO as oiio
import pytest
import skimage.data
import skimage.transform
from skimage.metrics import peak_signal_noise_ratio

from flurries.io import (
    fit,
    linear_to_srgb,
    read_layers,
    read_picture,
    srgb_to_linear,
    write_layers,
    write_picture,
)
from stills import (
    as_read,
    assert_reads_as,
    header_of,
    kinds_of,
    levels,
    noise,
    same_bits,
    spec_of,
)  # fmt: skip

SHAPES = [(21, 34), (21, 34, 4), (130, 5, 3), (1, 1, 3)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("name", "dtype"), [
    ("a.exr", np.float32), ("a.tif", np.float32), ("a.png", np.uint8), ("a.png", np.uint16),
    ("a.tiff", np.uint8), ("a.tiff", np.uint16),
])  # fmt: skip
def test_pixels_come_back_bit_for_bit(tmp_path, shape, name, dtype):
    whole = np.dtype(dtype).kind == "u"
    pixels = levels(shape, dtype) if whole else noise(shape)
    odd = [np.nan, np.inf, -np.inf, 1e-42, 3e38, -0.0][: 0 if whole else pixels.size]
    pixels.flat[: len(odd)] = odd
    write_picture(tmp_path / name, pixels, half=False)
    color, alpha = as_read(pixels)
    if alpha is not None and whole:
        alpha = alpha.astype(np.float32) / np.float32(np.iinfo(dtype).max)
    assert_reads_as(tmp_path / name, color, alpha, "display" if whole else "linear")
    assert not (whole and read_picture(tmp_path / name).premultiplied)
    # Grey stays one channel.
    assert spec_of(tmp_path / name).nchannels == (*shape, 1)[2]


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


def test_other_floats_are_the_nearest_that_a_file_holds(tmp_path):
    # Half has a largest number and no infinity.
    values = np.array([[65504, 65519, 70000, 1e30, np.inf, -1e9, np.nan, 2.0]], np.float32)
    write_picture(tmp_path / "a.exr", values)
    found = read_picture(tmp_path / "a.exr").pixels[0, :, 0]
    np.testing.assert_array_equal(found, [65504] * 5 + [-65504, np.nan, 2.0])
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


def test_srgb_is_the_standard_formula():
    display = np.linspace(-0.5, 3, 3001)
    wanted = np.where(
        display <= 0.04045, display / 12.92, (np.maximum(display, 0) / 1.055 + 0.055 / 1.055) ** 2.4
    )
    np.testing.assert_allclose(srgb_to_linear(display), wanted, rtol=1e-14)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(display)), display, atol=1e-7)
    assert abs(float(srgb_to_linear(0.5)) - 0.21404114048223255) < 1e-15


def test_light_becomes_display_values_in_png(tmp_path):
    light = np.array([[-1.0, 0.0, 0.002, 0.2, 0.5, 1.0, 4.0, np.nan, np.inf]])
    display = np.clip(linear_to_srgb(np.nan_to_num(light, nan=0, posinf=1)), 0, 1)
    for bits, largest, dtype in ((8, 255, np.uint8), (16, 65535, np.uint16)):
        write_picture(tmp_path / "a.png", light, bits=bits)
        found = read_picture(tmp_path / "a.png").pixels
        assert found.dtype == dtype
        np.testing.assert_array_equal(found[..., 0], np.rint(display * largest))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_display_values_become_light_in_exr(tmp_path, dtype):
    pixels = levels((30, 20, 3), dtype)
    write_picture(tmp_path / "a.exr", pixels, half=False)
    wanted = srgb_to_linear(pixels / np.iinfo(dtype).max).astype(np.float32)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr").pixels, wanted)
    write_picture(tmp_path / "b.exr", pixels / np.iinfo(dtype).max, encoding="display", half=False)
    np.testing.assert_allclose(read_picture(tmp_path / "b.exr").pixels, wanted, rtol=1e-6)


def test_bits_can_be_asked_for(tmp_path):
    deep = levels((20, 20, 3), np.uint16)
    low = deep.astype(np.uint8)
    for name, given, more, wanted in [
        ("a.png", deep, {"bits": 8}, np.rint(deep / 257)),
        ("b.png", low, {"bits": 16}, low.astype(np.uint16) * 257),
        ("c.tif", deep / 65535, {"bits": 16, "encoding": "display"}, deep),
    ]:
        write_picture(tmp_path / name, given, **more)
        np.testing.assert_array_equal(read_picture(tmp_path / name).pixels, wanted)


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


def test_color_without_opacity_stays(tmp_path):
    glow = np.array([[[0.5, 0.25, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]]], np.float32)
    write_picture(tmp_path / "a.exr", glow)
    assert_reads_as(tmp_path / "a.exr", glow[..., :3], glow[..., 3], "linear")
    write_picture(tmp_path / "a.png", glow)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "a.png").pixels, np.rint(linear_to_srgb(glow[..., :3]) * 255)
    )


def test_metadata_come_back(tmp_path):
    given = {
        "seed": -(2**63), "frame": np.int64(12), "fps": np.float32(0.5), "third": 1 / 3,
        "scene": "Schnee, 雪, ❄", "flurries:version": "1.0",
    }  # fmt: skip
    wanted = {key.removeprefix("flurries:"): str(value) for key, value in given.items()}
    for name in ("a.exr", "a.png", "a.tif", "a.jpg"):
        write_picture(tmp_path / name, np.zeros((4, 4, 3)), metadata=given)
        assert header_of(tmp_path / name) == wanted, name
    write_picture(tmp_path / "b.exr", np.zeros((4, 4, 3)))
    assert header_of(tmp_path / "b.exr") == {}


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.tif", "a.jpg", "a.hdr", "a.dpx"])
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


def test_layers_come_back(tmp_path):
    layers = {
        "rgba": noise((70, 9, 4)), "snow": noise((70, 9, 4), 1), "light": noise((70, 9, 3), 2),
        "depth": np.abs(noise((70, 9), 3)) * 1000, "motion": noise((70, 9, 2), 4) * 100,
        "snow.forward": noise((70, 9, 2), 8) * 100,
        "alpha": np.abs(noise((70, 9), 5)), "left.mask": np.abs(noise((70, 9), 6)),
        "noise": noise((70, 9), 7),
    }  # fmt: skip
    layers["depth"][0, 0] = np.inf
    write_layers(tmp_path / "a.exr", layers, metadata={"seed": 3})
    assert set(spec_of(tmp_path / "a.exr").channelnames) == {
        *("R", "G", "B", "A", "snow.R", "snow.G", "snow.B", "snow.A", "light.R", "light.G"),
        *("light.B", "depth.Z", "motion.X", "motion.Y", "alpha.A", "left.mask.A", "noise.Y"),
        *("snow.forward.u", "snow.forward.v"),
    }
    assert header_of(tmp_path / "a.exr")["seed"] == "3"
    found = read_layers(tmp_path / "a.exr")
    assert found.keys() == layers.keys()
    for name, layer in layers.items():
        precise = name in ("depth", "motion")
        wanted = layer if precise else layer.astype(np.float16).astype(np.float32)
        assert same_bits(found[name], wanted), name
    # A program that knows nothing of layers sees the picture.
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr").pixels, found["rgba"][..., :3])
    kinds = kinds_of(spec_of(tmp_path / "a.exr"))
    assert (kinds["R"], kinds["depth.Z"], kinds["alpha.A"]) == ("half", "float", "half")


def test_whole_numbers_come_back_to_the_bit(tmp_path):
    numbers = np.random.default_rng(1).integers(0, 2**63 - 1, (70, 9))
    # Bits of NaNs, infinities and the smallest float; both ends.
    edges = [0, 1, 0x7F800001, 0xFF800000, 2**31, 2**32 - 1, 2**32, 2**53 - 1, 2**63 - 1]
    numbers.flat[: len(edges)] = edges
    layers = {"rgba": noise((70, 9, 4)), "snow.id": numbers, "depth": noise((70, 9))}
    for name, given in {"a": layers, "b": {"snow.id": numbers.astype(np.uint64)}}.items():
        path = tmp_path / f"{name}.exr"
        write_layers(path, given)
        spec = spec_of(path)
        assert kinds_of(spec)["snow.id.lo"] == kinds_of(spec)["snow.id.hi"] == "uint"
        reader = oiio.ImageInput.open(str(path))
        halves = {"snow.id.lo": numbers & 0xFFFFFFFF, "snow.id.hi": numbers >> 32}
        for channel, wanted in halves.items():
            place = spec.channelindex(channel)
            got = reader.read_scanlines(0, 0, 0, 70, 0, place, place + 1, "uint")[..., 0]
            np.testing.assert_array_equal(got, wanted)
        found = read_layers(path)
        assert found.keys() == given.keys() and found["snow.id"].dtype == np.int64
        np.testing.assert_array_equal(found["snow.id"], numbers)


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


def smooth(height, width):
    y, x = np.mgrid[:height, :width] + 0.5
    waves = [np.sin(x / 17 + 0.3) * np.cos(y / 13), np.cos(x / 23 - y / 19), np.sin(y / 29)]
    return (0.5 + 0.4 * np.stack(waves, axis=-1)).astype(np.float32)


@pytest.mark.parametrize("size", [(120, 75), (320, 200), (37, 90), (200, 31), (161, 100), (90, 90)])
@pytest.mark.parametrize("how", ["cover", "stretch"])
def test_fit_puts_things_where_geometry_says(size, how):
    picture = smooth(100, 160)
    width, height = size
    fitted = fit(picture, size, how)
    assert fitted.shape == (height, width, 3)
    assert fitted.dtype == np.float32
    across, down = width / 160, height / 100
    if how != "stretch":
        across = down = max(across, down)
    # scikit-image counts from pixel centres: the middle of the frame is the middle of the picture.
    map_back = skimage.transform.AffineTransform(
        scale=(1 / across, 1 / down),
        translation=(79.5 - (width - 1) / 2 / across, 49.5 - (height - 1) / 2 / down),
    )
    wanted = skimage.transform.warp(
        picture, map_back, output_shape=(height, width), order=3, mode="edge"
    )
    tolerance = np.full((height, width, 1), 0.004)
    if how != "stretch":
        # A kept aspect is exact to a pixel over the whole length, and exact in the middle; the
        # waves rise by at most 0.4 / 13 a pixel.
        y, x = np.abs(
            np.mgrid[:height, :width] - np.array([height - 1, width - 1])[:, None, None] / 2
        )
        tolerance[..., 0] += 0.4 / 13 * (y / (100 * down) / down + x / (160 * across) / across)
    assert (np.abs(fitted - wanted) <= tolerance)[4:-4, 4:-4].all()


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

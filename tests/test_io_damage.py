"""Pictures that are none, broke off or claim too much; and processes that read and write them."""

import numpy as np
import pytest
import skimage.data
import skimage.transform
import tifffile
from PIL import Image

from flurries.io import read_header, read_layers, read_picture, srgb_to_linear, write_picture


def test_files_that_are_no_pictures(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.txt").write_text("no picture\n" * 30)
    (tmp_path / "text.png").write_text("no picture\n" * 30)
    (tmp_path / "picture.null").write_text("no picture\n" * 30)
    for name, error in [
        ("missing.png", FileNotFoundError), ("empty.png", OSError), ("text.txt", ValueError),
        ("text.png", OSError), ("picture.null", ValueError),
    ]:  # fmt: skip
        for function in (read_picture, read_header, read_layers):
            with pytest.raises(error, match=name):
                function(tmp_path / name)
    for path in ("", "a\0b.png"):
        with pytest.raises(ValueError, match="path must name a file"):
            read_picture(path)
    with pytest.raises(OSError):
        read_picture("/dev/zero")


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


def test_a_damaged_png_is_told_by_us_alone(tmp_path, capfd):
    rng, bad = np.random.default_rng(5), tmp_path / "bad.png"
    image = Image.fromarray(skimage.data.astronaut()[90:130, 180:220])
    image.save(tmp_path / "plain.png")
    image.convert("P").save(tmp_path / "palette.png")
    for number in range(44):
        data = bytearray((tmp_path / ("plain.png", "palette.png")[number % 2]).read_bytes())
        data[rng.integers(8, len(data) - 12)] ^= 1 << rng.integers(8)
        bad.write_bytes(data)
        with pytest.raises(OSError, match=r"^.*bad\.png: the picture is damaged.*$"):
            read_picture(bad)
    assert capfd.readouterr() == ("", "")

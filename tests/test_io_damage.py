"""Pictures that are none, broke off or claim too much; and processes that read and write them."""

import struct
import zlib

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


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I4s", len(data), name) + data + zlib.crc32(name + data).to_bytes(4, "big")


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
            data[8:] = b"".join(chunk(*part) for part in crafted(parts(bytes(data)), rng))
        bad.write_bytes(data)
        try:
            read_picture(bad)
            assert not wrong
        except OSError as error:
            refused += 1
            assert str(error).startswith(f"{bad}: the picture ") and "\n" not in str(error)
    assert refused > 280 and capfd.readouterr() == ("", "")

"""Pictures to write and to compare: noise, levels, and an EXR straight from OpenImageIO."""

import json
import struct
import zlib

import numpy as np
import OpenImageIO as oiio

from flurries.io import read_picture


def write_exr(
    path, pixels, names, *, then=(), data=(0, 0), display=None, kind="float", header=None
):
    """An EXR from OpenImageIO; parts are (pixels, names, data), a header's values may be typed."""
    parts = [(pixels, names, data), *then]
    specs = []
    for number, (values, channels, data) in enumerate(parts):
        spec = oiio.ImageSpec(*values.shape[1::-1], values.shape[2], kind)
        spec.channelnames, (spec.x, spec.y) = tuple(channels), data
        for key, value in (header or {}).items():
            typed = isinstance(value, tuple)
            spec.attribute(key, *((oiio.TypeDesc(value[0]), value[1]) if typed else (value,)))
        if display:
            spec.full_x, spec.full_y, spec.full_width, spec.full_height = display
        if then:
            spec.attribute("oiio:subimagename", f"part {number}")
        specs.append(spec)
    output = oiio.ImageOutput.create("x.exr")
    assert output.open(str(path), specs), output.geterror()
    for number, (values, _, _) in enumerate(parts):
        assert not number or output.open(str(path), specs[number], "AppendSubimage")
        assert output.write_image(values), output.geterror()
    assert output.close()


def png_chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I4s", len(data), name) + data + zlib.crc32(name + data).to_bytes(4, "big")


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


def spec_of(path):
    reader = oiio.ImageInput.open(str(path))
    assert reader is not None, oiio.geterror()
    return reader.spec()


def kinds_of(spec):
    return {name: str(spec.channelformat(n)) for n, name in enumerate(spec.channelnames)}


def header_of(path):
    """Return what other programs see under ``flurries:`` in a picture's header."""
    spec = spec_of(path)
    said = spec.get_string_attribute("ImageDescription")
    found = json.loads(said) if said.startswith("{") else {}
    found |= {one.name: one.value for one in spec.extra_attribs if one.name.startswith("flurries:")}
    return {key.removeprefix("flurries:"): value for key, value in found.items()}

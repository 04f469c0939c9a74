"""sRGB: integers, display values of 0 to 1, and linear light, whose 1 is the white of paper."""

from __future__ import annotations

import re
from typing import Literal, TypeAlias

import numpy as np

from flurries import _core
from flurries._contract import Array, ArrayLike, choice, numbers, rectangular, sealed
from flurries._kept import kept

Encoding: TypeAlias = Literal["display", "linear"]

# The largest finite half float. Anything above rounds to infinity when it is stored as half.
LARGEST_HALF = 65504.0

_HEX = re.compile(r"#[0-9a-fA-F]{6}")


def planes_of(name: str, values: ArrayLike) -> Array:
    """Return a picture as (H, W, 1, 3 or 4)."""
    array = numbers(name, values)
    planes = array[..., np.newaxis] if array.ndim == 2 else array
    if planes.ndim != 3 or planes.shape[2] not in (1, 3, 4) or 0 in planes.shape:
        raise ValueError(f"{name} must be (H, W) or (H, W, 1, 3 or 4), got {array.shape}")
    return planes


def encoding_of(encoding: str | None, pixels: Array) -> str:
    """Return what pixels are; by default integers are display values and floats linear light."""
    usual = "display" if pixels.dtype.kind == "u" else "linear"
    return usual if encoding is None else choice("encoding", encoding, ("display", "linear"))


def parse_hex(name: str, text: str) -> tuple[int, int, int]:
    """Return (r, g, b), 0 to 255, of a color as the web writes it; `name` is for the error."""
    if _HEX.fullmatch(text) is None:
        raise ValueError(f"{name} must be '#rrggbb' for a color, got {text!r}")
    red, green, blue = bytes.fromhex(text[1:])
    return red, green, blue


def srgb_to_linear(values: ArrayLike) -> Array:
    """Decode sRGB display values to linear light, of the same shape.

    The exact two-part formula of IEC 61966-2-1. Below 0 its straight part goes on, above 1 its
    power goes on, so that every finite value survives a round trip; NaN stays NaN. `values` are
    floats, 0 to 1 for what a screen can show: float32 and float64 keep their dtype, float16 becomes
    float32.
    """
    display = _floats("values", values)
    # The base of the power is kept off negative numbers, where it would be NaN with a warning.
    with np.errstate(over="ignore"):
        power = ((np.maximum(display, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(display <= 0.04045, display / 12.92, power).astype(display.dtype, copy=False)


def linear_to_srgb(values: ArrayLike) -> Array:
    """Encode linear light as sRGB display values, not clipped; the inverse of `srgb_to_linear`."""
    linear = _floats("values", values)
    power = 1.055 * np.maximum(linear, 0.0) ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, linear * 12.92, power).astype(linear.dtype, copy=False)


def to_unit(pixels: Array, out: Array | None = None) -> Array:
    """Return integer pixels as float32 from 0 to 1; float pixels as float32 or float64."""
    if pixels.dtype.kind == "u":
        largest = np.float32(np.iinfo(pixels.dtype).max)
        unit: Array = np.divide(pixels, largest, out=out, dtype=np.float32)
        return unit
    return pixels.astype(np.float32) if pixels.dtype.itemsize == 2 else pixels


def to_linear(pixels: Array, encoding: str) -> Array:
    """Return pixels of either encoding as linear float light; alpha must not be among them."""
    if encoding == "linear":
        return to_unit(pixels)
    if pixels.dtype.kind == "u":
        return decoding_table(pixels.dtype.itemsize).take(pixels)
    return srgb_to_linear(pixels)


def to_display(pixels: Array, encoding: str) -> Array:
    """Return pixels of either encoding as float display values; alpha must not be among them."""
    values = to_unit(pixels)
    return values if encoding == "display" else linear_to_srgb(values)


def light_of(pixels: Array, encoding: str | None = None) -> Array:
    """Return pixels as linear light, multiplied by alpha; integers are not yet."""
    light = to_linear(pixels[..., :3], encoding_of(encoding, pixels))
    if pixels.shape[2] < 4:
        return light
    alpha = to_unit(pixels[..., 3:])
    return np.concatenate([light * alpha if pixels.dtype.kind == "u" else light, alpha], axis=-1)


def unmultiply(colors: Array, alpha: Array) -> Array:
    """Return straight colors, which encoding wants as it bends; black where alpha is 0."""
    return np.divide(colors, alpha, out=np.zeros_like(colors), where=alpha > 0.0)


def to_integer(values: Array, bits: int) -> Array:
    """Round floats from 0 to 1 to integers of 8 or 16 bits; the rest is clipped, NaN becomes 0."""
    largest = 2**bits - 1
    # float32 holds 65535 levels with room to spare, so no wider type is needed here.
    bounded: Array = np.clip(np.nan_to_num(values, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    levels: Array = np.rint(bounded * largest)
    return levels.astype(np.uint8 if bits == 8 else np.uint16)


def to_half(values: Array) -> Array:
    """Round floats to half, with the largest half in place of infinity; NaN stays NaN."""
    if values.dtype == np.float32:
        half = np.empty(values.shape, np.float16)
        _core.to_half(
            half.view(np.uint16).reshape(-1),
            np.require(values, requirements=["C", "A"]).reshape(-1),
        )
        return half
    bounded: Array = np.clip(values, -LARGEST_HALF, LARGEST_HALF)
    return bounded.astype(np.float16)


def to_single(values: Array) -> Array:
    """Return floats as float32; what float32 cannot hold becomes its largest number."""
    if values.dtype.itemsize <= 4:
        return values.astype(np.float32, copy=False)
    largest = float(np.finfo(np.float32).max)
    # Infinity itself is a value that float32 has, and it is kept.
    bounded = np.where(np.isinf(values), values, np.clip(values, -largest, largest))
    return bounded.astype(np.float32)


@kept(2)
def decoding_table(itemsize: int) -> Array:
    """Return the linear light of every 8-bit or 16-bit display value."""
    levels = 256**itemsize
    table = srgb_to_linear(np.arange(levels) / (levels - 1)).astype(np.float32)
    table.flags.writeable = False
    return table


@kept(1)
def encoding_edges() -> Array:
    """Return the least linear light that `to_integer` makes each byte from 1 to 255 of, (255,)."""
    wanted = np.arange(1, 256)
    # Floats of one sign have the order of their bits.
    bits = [np.zeros(255, np.int32), np.ones(255, np.float32).view(np.int32)]
    while (bits[1] - bits[0] > 1).any():
        middle = (bits[0] + bits[1]) // 2
        enough = to_integer(linear_to_srgb(middle.view(np.float32)), 8) >= wanted
        bits = [np.where(enough, bits[0], middle), np.where(enough, middle, bits[1])]
    return sealed(bits[1].astype(np.int32).view(np.float32))


def encode_bytes(light: Array) -> Array:
    """Return linear light, float32, as bytes of display values, each rounded to the nearest."""
    result = np.empty(light.shape, np.uint8)
    flat = np.ascontiguousarray(light, np.float32).reshape(-1)
    _core.encode_bytes(result.reshape(-1), flat, decoding_table(1), encoding_edges())
    return result


def _floats(name: str, values: ArrayLike) -> Array:
    array = values if type(values) is np.ndarray else rectangular(name, values)
    if array.dtype.kind != "f":
        raise TypeError(f"{name} must be floats, got dtype {array.dtype}")
    return array.astype(np.float32) if array.dtype.itemsize == 2 else array


def in_file(
    color: Array, alpha: Array | None, encoding: str, premultiplied: bool, stored: str
) -> Array:
    """Return rows of a picture as the file holds them, alpha as the last channel."""
    floats = stored in ("half", "float")
    if encoding != ("linear" if floats else "display") or (
        alpha is not None and premultiplied != floats
    ):
        opacity = None if alpha is None else to_unit(alpha)[..., None]
        if opacity is not None and premultiplied:
            # Light without opacity, a glow, has no straight color and is left as it is.
            color = to_unit(color)
            color = np.divide(color, opacity, out=color.copy(), where=opacity > 0)
        color = (to_linear if floats else to_display)(color, encoding)
        if opacity is not None and floats:
            color = color * opacity
    planes = [color] if alpha is None else [color, alpha[..., None]]
    return np.concatenate([_stored(plane, stored) for plane in planes], axis=-1)


def _stored(values: Array, stored: str) -> Array:
    if values.dtype.name == stored:
        return values
    if stored.startswith("uint"):
        return to_integer(to_unit(values), int(stored[4:]))
    return (to_half if stored == "half" else to_single)(to_unit(values))

"""How layers become a picture: in which light they are mixed, and in what form it goes back."""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.frame.layer import Layer
from flurries.frame.planes import plane
from flurries.io.color import (
    decoding_table,
    encode_bytes,
    encoding_edges,
    linear_to_srgb,
    srgb_to_linear,
    to_display,
    to_integer,
    to_linear,
    to_single,
    to_unit,
    unmultiply,
)

# Values that are encoded at a time: in float32 they and what is made on the way fit a cache.
CHUNK = 1 << 16

# What files with layers call their own planes.
_TAKEN = ("rgba", "alpha", "background", "depth", "foreground", "forward", "weather")


# Display values of bytes, and the least that is rounded to each from 1 on.
_BYTES = (
    np.arange(256, dtype=np.float32) / np.float32(255.0),
    (np.arange(255, dtype=np.float32) + np.float32(0.5)) / np.float32(255.0),
)


@dataclass(frozen=True)
class Mix:
    """The light that layers are mixed in, over a background of an encoding."""

    linear: bool  # Whether that is linear light, or display values.
    encoding: str  # The background's own, "display" or "linear".
    # Whether the background is of integers with alpha, which its colors are not multiplied by. In
    # the mix they are, and those of floats are already.
    straight: bool = False
    # (3, 3): linear light c of Rec. 709's primaries, as effects give it, is c @ primaries in the
    # mix.
    primaries: Array | None = None

    @property
    def same(self) -> bool:
        """Whether that is the light that the background holds."""
        return self.linear == (self.encoding == "linear") and not self.straight

    def decode(self, picture: Array) -> Array:
        """Return the background in the light that layers are mixed in."""
        if self.same:
            return np.ascontiguousarray(picture)

        def turn(part: Array) -> Array:
            if part.shape[2] == 3:
                return self._decode(part)
            cover = to_unit(part[..., 3:])
            colors = part[..., :3] if self.straight else unmultiply(part[..., :3], cover)
            return np.concatenate([self._decode(colors) * cover, cover], axis=2)

        return _by_parts(turn, picture, np.empty(picture.shape, np.float32))

    def _decode(self, colors: Array) -> Array:
        turn = to_linear if self.linear else to_display
        return turn(colors, self.encoding)

    def plate(self, picture: Array) -> Array:
        """Return the background in the light that layers are mixed in, float32."""
        light = self.decode(picture)
        return to_single(to_unit(light, plane(light.shape) if light.dtype.kind == "u" else None))

    def encode(self, working: Array, picture: Array, into: Array | None = None) -> Array:
        """Return the composite in the background's own encoding and dtype, in `into` if given."""
        if self.same and into is None:
            # The background's own pixels where nothing lay over them: the caller gets a copy.
            return working if working.flags.writeable else working.copy()
        result = np.empty(picture.shape, picture.dtype) if into is None else into
        if self.same:
            if result is not working:
                result[...] = working
            return result
        if working.shape[2] == 3:
            return _by_parts(lambda part: self._encode(part, picture.dtype), working, result)
        _by_parts(lambda part: self._with_alpha(part, picture.dtype), working, result)
        if self.straight:
            # Where nothing is, there is no color; that of the background stays in the file.
            nothing = result[..., 3] == 0
            result[nothing, :3] = picture[nothing, :3]
        return result

    def _with_alpha(self, working: Array, dtype: np.dtype[Any]) -> Array:
        cover = working[..., 3:]
        colors = self._encode(unmultiply(working[..., :3], cover), dtype)
        if not self.straight:
            return np.concatenate([colors * cover, cover], axis=2)
        return np.concatenate([colors, to_integer(cover, 8 * dtype.itemsize)], axis=2)

    def _encode(self, working: Array, dtype: np.dtype[Any]) -> Array:
        if self.linear == (self.encoding == "linear"):
            return to_integer(working, 8 * dtype.itemsize) if dtype.kind == "u" else working
        if not self.linear:
            return to_linear(working, "display")
        if dtype.kind == "u":
            single = working.dtype == np.float32
            working = np.array(working, np.float32)
            _core.whiten(working.reshape(-1))
            if dtype == np.uint8 and single:
                return encode_bytes(working)
        return to_integer(to_display(working, "linear"), 8 * dtype.itemsize)

    def over(self, working: Array, layer: Layer, into: Array | None = None) -> Array:
        """Return a layer over what lies behind it, in `into` if given: another array."""
        result = np.empty_like(working) if into is None else into
        single = working.dtype == result.dtype == np.float32 and working.shape[2] == 3
        single = single and self.primaries is None
        given: tuple[Any, ...] = ()
        if layer.shade is not None and working.dtype == result.dtype == np.uint8:
            # Display values over bytes: read and rounded as they are.
            single, given = working.shape[2] == 3 and not self.linear, _BYTES
        if layer.shade is not None and single and (self.linear or layer.glow is None):
            colors = None if self.linear else linear_to_srgb(layer.shade.colors)
            shade = layer.shade.given(colors)
            _core.shade_over(result, working, layer.alpha, shade, layer.glow, *given)
            return result
        if layer.shade is None and layer.rgb is None and working.shape[2] == 3:
            _core.snow(result, working, layer.alpha, self.light(layer.color))
        else:
            _core.over(result, working, self.rgba(layer))
        return result

    def bytes_of(self, plate: Array) -> bool:
        """Whether a plate of bytes is mixed in linear light."""
        plain = self.linear and self.encoding == "display" and self.primaries is None
        return plain and plate.dtype == np.uint8 and plate.shape[2] == 3

    def in_bytes(self, layer: Layer, plate: Array, into: Array | None) -> Array | None:
        """Return a layer of a shade over bytes in one pass, with the same bits, or None."""
        if layer.shade is None or not self.bytes_of(plate):
            return None
        fits = into is not None and into.flags.c_contiguous
        result = into if into is not None and fits else np.empty(plate.shape, np.uint8)
        plate, coding = np.ascontiguousarray(plate), (decoding_table(1), encoding_edges())
        given = layer.shade.given()
        _core.shade_over(result, plate, layer.alpha, given, layer.glow, *coding)
        if into is not None and into is not result:
            into[...] = result
            return into
        return result

    def rgba(self, layer: Layer) -> Array:
        """Return a layer as (h, w, 4) float32, premultiplied, in the light of the mix."""
        if layer.shade is not None:
            layer = lit(layer)
        if layer.rgb is None:
            return layer.rgba(self.light(layer.color))
        result = np.empty((*layer.alpha.shape, 4), np.float32)
        result[..., 3] = layer.alpha
        if self.linear:
            result[..., :3] = layer.rgb if self.primaries is None else layer.rgb @ self.primaries
            return result
        cover = layer.alpha[..., None]
        np.multiply(linear_to_srgb(unmultiply(layer.rgb, cover)), cover, out=result[..., :3])
        return result

    def light(self, color: Any) -> list[float]:
        if not self.linear:
            return list(color)
        light = srgb_to_linear(np.asarray(color, np.float64))
        if self.primaries is not None:
            light = np.maximum(light @ self.primaries, 0.0)
        found: list[float] = light.tolist()
        return found


def _by_parts(turn: Callable[[Array], Array], values: Array, result: Array) -> Array:
    """Fill `result`, few rows at a time: turning values makes many arrays on the way."""
    rows = max(CHUNK // values[0].size, 1)
    for first in range(0, len(values), rows):
        part = slice(first, first + rows)
        result[part] = turn(values[part])
    return result


def behind(layer: Layer, cover: Array) -> Layer:
    """Return a layer as far as a matte in front of it leaves it."""
    left = 1.0 - cover

    def less(plane: Array) -> Array:
        return np.asarray(plane * (left if plane.ndim == 2 else left[..., None]))

    return layer.turned(less, "alpha", "rgb", "glow", "coverage")


def lit(layer: Layer) -> Layer:
    assert layer.shade is not None
    rgb = np.empty((*layer.alpha.shape, 3), np.float32)
    _core.shade_over(rgb, np.zeros_like(rgb), layer.alpha, layer.shade.given(), layer.glow)
    return replace(layer, rgb=rgb, shade=None, glow=None)


def free_name(name: str, taken: Container[str]) -> str:
    """Return the name, or the name with the first number from 2 on that makes it a new one."""
    number, free = 1, name
    while free in taken or free in _TAKEN:
        number += 1
        free = f"{name}{number}"
    return free

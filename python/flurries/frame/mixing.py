"""How layers become a picture: in which light they are mixed, and in what form it goes back."""

from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.frame.layer import Layer, Shade
from flurries.frame.planes import plane
from flurries.io import color as io_color

# Values that are encoded at a time: in float32 they and what is made on the way fit a cache.
CHUNK = 1 << 16

# What files with layers call their own planes.
_TAKEN = ("rgba", "alpha", "background", "depth", "foreground", "forward", "weather")


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

    def decode(self, picture: Array, room: Array | None = None) -> Array:
        """Return the background in the light that layers are mixed in, in `room` if it differs."""
        if self.same:
            return np.ascontiguousarray(picture)
        room = np.empty(picture.shape, np.float32) if room is None else room
        return _by_parts(self._decode, picture, room)

    def _decode(self, part: Array) -> Array:
        turn = io_color.to_linear if self.linear else io_color.to_display
        if part.shape[2] == 3:
            return turn(part, self.encoding)
        cover = io_color.to_unit(part[..., 3:])
        colors = part[..., :3] if self.straight else io_color.unmultiply(part[..., :3], cover)
        return np.concatenate([turn(colors, self.encoding) * cover, cover], axis=2)

    def plate(self, picture: Array) -> Array:
        """Return the background in the light that layers are mixed in, float32."""
        room = plane(picture.shape)
        return io_color.to_single(io_color.to_unit(self.decode(picture, room), room))

    def encode(self, working: Array, picture: Array, into: Array | None = None) -> Array:
        """Return the composite in the background's own encoding and dtype, in `into` if given."""
        if self.same and into is None:
            # The background's own pixels where nothing lay over them: the caller gets a copy.
            return working if working.flags.writeable else working.copy()
        result = np.empty(picture.shape, picture.dtype) if into is None else into
        if not self.same:
            _by_parts(lambda part: self._encode(part, picture.dtype), working, result)
        elif result is not working:
            result[...] = working
        if self.straight:
            # Where nothing is, there is no color; that of the background stays in the file.
            nothing = result[..., 3] == 0
            result[nothing, :3] = picture[nothing, :3]
        return result

    def _encode(self, part: Array, dtype: np.dtype[Any]) -> Array:
        if part.shape[2] == 4:
            cover = part[..., 3:]
            colors = self._encode(io_color.unmultiply(part[..., :3], cover), dtype)
            if not self.straight:
                return np.concatenate([colors * cover, cover], axis=2)
            return np.concatenate([colors, io_color.to_integer(cover, 8 * dtype.itemsize)], axis=2)
        if self.encoding == "linear" and not self.linear:
            part = io_color.to_linear(part, "display")
        elif self.encoding == "display" and self.linear:
            single = part.dtype == np.float32
            part = np.array(part, np.float32)
            _core.whiten(part.reshape(-1))
            if dtype == np.uint8 and single:
                return io_color.encode_bytes(part)
            part = io_color.to_display(part, "linear")
        return io_color.to_integer(part, 8 * dtype.itemsize) if dtype.kind == "u" else part

    def over(self, working: Array, layer: Layer, into: Array | None = None) -> Array:
        """Return a layer over what lies behind it, in `into` if given: another array."""
        result = np.empty_like(working) if into is None else into
        kinds = working.dtype.char + result.dtype.char
        whole = not self.linear and kinds == "BB"
        direct = whole or (kinds == "ff" and self.primaries is None)
        opaque, shade = working.shape[2] == 3, layer.shade
        plain = opaque and (self.linear or layer.glow is None)
        if shade is None and layer.rgb is None and opaque:
            _core.snow(result, working, layer.alpha, self.light(layer.color))
        elif shade is not None and plain and direct:
            colors = shade.colors if self.linear else shade.display
            colors = io_color.linear_to_srgb(shade.colors) if colors is None else colors
            colors = 255 * colors if whole else colors
            _core.shade_over(result, working, layer.alpha, shade.given(colors), layer.glow)
        else:
            _core.over(result, working, self.rgba(layer))
        return result

    def bytes_of(self, plate: Array) -> bool:
        """Whether a plate of bytes is mixed in linear light."""
        plain = self.linear and self.encoding == "display" and self.primaries is None
        return plain and plate.dtype == np.uint8 and plate.shape[2] == 3

    def in_bytes(self, layer: Layer, plate: Array, into: Array | None) -> Array:
        """Return a layer of a shade or one color over bytes in one pass, with the same bits."""
        shade = layer.shade or Shade(np.array([[self.light(layer.color)]]), 1.0, (0, 0))
        result = np.empty(plate.shape, np.uint8) if into is None else into
        plate = np.ascontiguousarray(plate)
        coding = io_color.decoding_table(1), io_color.encoding_edges()
        _core.shade_over(result, plate, layer.alpha, shade.given(), layer.glow, coding)
        return result

    def rgba(self, layer: Layer) -> Array:
        """Return a layer as (h, w, 4) float32, premultiplied, in the light of the mix."""
        rgb, light, shade = layer.rgb, None, layer.shade
        if shade is not None:
            one = shade.colors.size == 3 and layer.glow is None
            if one and self.linear and self.primaries is None:
                light = shade.colors.ravel().tolist()
            else:
                rgb = plane((*layer.alpha.shape, 3))
                np.copyto(rgb, 0.0 if layer.glow is None else layer.glow)
                _core.shade_add(rgb, layer.alpha, shade.given())
        result = plane((*layer.alpha.shape, 4))
        if rgb is None:
            alpha = np.ascontiguousarray(layer.alpha)
            _core.layer_rgba(result, alpha, light or self.light(layer.color))
            return result
        result[..., 3] = layer.alpha
        if self.linear:
            rgb = rgb if self.primaries is None else rgb @ self.primaries
            for channel in range(3):  # Three at once take nine times as long.
                result[..., channel] = rgb[..., channel]
            return result
        cover = layer.alpha[..., None]
        display = io_color.linear_to_srgb(io_color.unmultiply(rgb, cover))
        np.multiply(display, cover, out=result[..., :3])
        return result

    def light(self, color: Any) -> list[float]:
        if not self.linear:
            return list(color)
        light = io_color.srgb_to_linear(np.asarray(color, np.float64))
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

    return layer.turned(less, "alpha", "rgb", "glow", "coverage", "near")


def free_name(name: str, taken: Container[str]) -> str:
    """Return the name, or the name with the first number from 2 on that makes it a new one."""
    number, free = 1, name
    while free in taken or free in _TAKEN:
        number += 1
        free = f"{name}{number}"
    return free

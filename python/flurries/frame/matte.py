"""What stands in front of the weather: a mask of the background's own pixels, or a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.frame.bands import crop
from flurries.frame.visible import Window
from flurries.io.color import linear_to_srgb, srgb_to_linear, unmultiply


@dataclass(frozen=True, eq=False)
class Matte:
    """What stands in front of the weather, over the frame or a window of it.

    Attributes
    ----------
    cover : (H, W) float32
        Where it hides the weather, 0 to 1.
    light : (H, W, 4) float32 or None
        Its own picture, straight display colors and alpha; None for the background's own pixels.
    linear_light : bool
        Whether `light` is premultiplied linear light instead.
    """

    cover: Array
    light: Array | None
    linear_light: bool = False

    @property
    def hides(self) -> Array:
        """How much of the weather nobody sees, (H, W): behind the mask or under the picture."""
        if self.light is None:
            return self.cover
        return np.asarray(np.maximum(self.cover, self.light[..., 3]))

    def window(self, window: Window) -> Matte:
        """Return the part of a window."""
        light = None if self.light is None else crop(self.light, window)
        return Matte(crop(self.cover, window), light, self.linear_light)

    def over(self, background: Array, *, linear: bool) -> Array:
        """Return its picture over a composite, in linear light or in display values."""
        result = np.empty_like(background)
        _core.over(result, background, self.rgba(linear=linear))
        return result

    def rgba(self, *, linear: bool) -> Array:
        """Return its picture (H, W, 4), premultiplied, in linear light or in display values."""
        assert self.light is not None
        cover = self.light[..., 3:]
        colors = self.light[..., :3]
        if self.linear_light and not linear:
            colors = linear_to_srgb(unmultiply(colors, cover)) * cover
        elif not self.linear_light:
            colors = (srgb_to_linear(colors) if linear else colors) * cover
        return np.concatenate([colors, cover], axis=2)

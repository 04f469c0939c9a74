"""What stands in front of the weather: a mask, or a picture with alpha."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import composite
from flurries._contract import Array, rectangular


@dataclass(frozen=True, eq=False)
class Foreground:
    """A matte over the frame or a window of it.

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

    def window(self, window: tuple[int, int, int, int]) -> Foreground:
        """Return the part of a window."""
        top, bottom, left, right = window
        light = None if self.light is None else self.light[top:bottom, left:right]
        return Foreground(self.cover[top:bottom, left:right], light, self.linear_light)

    def over(self, background: Array, *, linear: bool) -> Array:
        """Return its picture over a composite, in linear light or in display values."""
        return composite.over(background, self.rgba(linear=linear))

    def rgba(self, *, linear: bool) -> Array:
        """Return its picture (H, W, 4), premultiplied, in linear light or in display values."""
        from flurries.io import linear_to_srgb, srgb_to_linear

        assert self.light is not None
        cover = self.light[..., 3:]
        colors = self.light[..., :3]
        if self.linear_light and not linear:
            # Encoding bends: it wants straight colors.
            straight = np.divide(colors, cover, out=np.zeros_like(colors), where=cover > 0.0)
            colors = linear_to_srgb(straight) * cover
        elif not self.linear_light:
            colors = (srgb_to_linear(colors) if linear else colors) * cover
        return np.concatenate([colors, cover], axis=2)


def foreground_of(value: Any, shape: tuple[int, int]) -> Foreground:
    """Return the foreground of a scene's argument, of the scene's size."""
    if isinstance(value, (str, os.PathLike)):
        return _of_file(value, shape)
    given = rectangular("foreground", value)
    given = given.astype(given.dtype.newbyteorder("="), copy=False)
    if given.dtype not in (np.uint8, np.uint16, np.bool_, np.float16, np.float32, np.float64):
        raise TypeError(f"foreground must be a path or an array, got an array of {given.dtype}")
    if given.shape[:2] != shape or given.ndim not in (2, 3) or given.shape[2:] not in ((), (4,)):
        raise ValueError(f"foreground must have shape {shape} or {(*shape, 4)}, got {given.shape}")
    whole = given.dtype.kind in "ub"
    scale = 1.0 / float(np.iinfo(given.dtype).max) if given.dtype.kind == "u" else 1.0
    plane = np.array(given, dtype=np.float32, order="C") * np.float32(scale)
    cover = plane if plane.ndim == 2 else np.ascontiguousarray(plane[..., 3])
    if not bool(((cover >= 0.0) & (cover <= 1.0)).all()):
        raise ValueError("foreground: alpha must be from 0 to 1 everywhere")
    if plane.ndim == 2:
        return Foreground(cover, None)
    # A picture hides what is behind it by itself; the weather is whole under it.
    return Foreground(np.zeros_like(cover), plane, linear_light=not whole)


def _of_file(path: Any, shape: tuple[int, int]) -> Foreground:
    from flurries.io import fit, read_mask, read_picture

    size = (shape[1], shape[0])
    picture = read_picture(path)
    if picture.alpha is None:
        mask = read_mask(path)
        return Foreground(mask if mask.shape == shape else np.clip(fit(mask, size), 0.0, 1.0), None)
    pixels = picture.pixels
    whole = pixels.dtype.kind == "u"
    alpha = np.rint(picture.alpha * np.iinfo(pixels.dtype).max) if whole else picture.alpha
    rgba = np.concatenate([pixels, alpha.astype(pixels.dtype)[..., None]], axis=2)
    if not whole and not picture.premultiplied:
        rgba[..., :3] *= rgba[..., 3:]
    return foreground_of(rgba if rgba.shape[:2] == shape else fit(rgba, size), shape)

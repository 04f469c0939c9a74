"""What stands in front of the weather: masks of the background's own pixels, and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, sealed
from flurries.frame.bands import Visible, Window, crop
from flurries.frame.layer import Layer
from flurries.io.color import linear_to_srgb, srgb_to_linear, unmultiply

NOTHING = np.float32(1e-3)  # Metres: before what stands so near there is no weather.


@dataclass(frozen=True, eq=False)
class Matte:
    """A mask or a picture, over the frame or a window of it."""

    cover: Array  # (H, W) float32: where it hides the weather, 0 to 1.
    light: Array | None  # (H, W, 4) float32, straight display colors; None: the background's own.
    linear_light: bool = False  # Whether `light` is premultiplied linear light instead.

    def window(self, window: Window) -> Matte:
        light = None if self.light is None else crop(self.light, window)
        return Matte(crop(self.cover, window), light, self.linear_light)

    def rgba(self, *, linear: bool) -> Array:
        """Return its picture (H, W, 4), premultiplied, in linear light or in display values."""
        assert self.light is not None
        colors, cover = self.light[..., :3], self.light[..., 3:]
        if self.linear_light and not linear:
            colors = linear_to_srgb(unmultiply(colors, cover)) * cover
        elif not self.linear_light:
            colors = (srgb_to_linear(colors) if linear else colors) * cover
        return np.concatenate([colors, cover], axis=2)


def _over(pictures: Sequence[Matte], light: Array, *, linear: bool) -> Array:
    """Return pictures, back to front, over a composite in linear light or in display values."""
    for picture in pictures:
        under, light = light, np.empty_like(light)
        _core.over(light, under, picture.rgba(linear=linear))
    return light


@dataclass(frozen=True, eq=False)
class Deep:
    """What stands at a depth of its own in a share of each pixel: mattes, near sides of steps."""

    cover: Array  # (H, W) float32: how much of a pixel they take together.
    # (H, W) float32 of the nearest in the pixel; `NOTHING` where none is: no weather is before it.
    depth: Array
    pictures: tuple[Matte, ...] = ()  # Those that are pictures, back to front, behind the weather.

    @staticmethod
    def of(parts: Sequence[tuple[Matte, Array]]) -> Deep:
        """Return mattes, back to front, each with its depth."""
        cover: Array = np.zeros(parts[0][0].cover.shape, np.float32)
        depth: Array = np.full(cover.shape, np.inf, np.float32)
        for matte, far in parts:
            cover = 1.0 - (1.0 - cover) * (1.0 - matte.cover)
            depth = np.where(matte.cover > 0.0, np.minimum(depth, far), depth)
        pictures = tuple(matte for matte, _ in parts if matte.light is not None)
        depth = np.where(cover > 0.0, depth, NOTHING)
        return Deep(np.ascontiguousarray(cover), np.ascontiguousarray(depth), pictures)

    @cached_property
    def seen(self) -> Visible:
        return Visible(1.0 - self.cover)

    @cached_property
    def places(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """The rows and columns of the pixels where it stands."""
        rows, columns = np.nonzero(self.cover)
        return rows, columns

    def before(self, depth: Array) -> Array:
        """Return a scene's depth with it in front, read-only; the same again for the same one."""
        kept: tuple[Array, Array] | None = self.__dict__.get("_joint")
        if kept is None or kept[0] is not depth:
            kept = self.__dict__["_joint"] = depth, sealed(np.minimum(depth, self.depth))
        return kept[1]

    def join(self, whole: Layer, near: Layer, window: Window, part: Window) -> Layer:
        """Return a layer of a window by `whole`, without it, and `near`, a part before it."""
        rows, columns = self.places
        inside = (rows >= part[0]) & (rows < part[1]) & (columns >= part[2]) & (columns < part[3])
        rows, columns = rows[inside], columns[inside]
        share = self.cover[rows, columns]
        at = rows - window[0], columns - window[2]
        there = rows - part[0], columns - part[2]

        found: dict[str, Any] = dict.fromkeys(whole.planes())
        for name, close in near.planes().items():
            if name in found:
                plane = found[name] = getattr(whole, name).copy()
                own = share[:, None] if plane.ndim == 3 else share
                if name in ("alpha", "rgb", "glow", "coverage"):
                    plane[at] = (1.0 - own) * plane[at] + own * close[there]
                else:
                    plane[at] = np.where(own >= 0.5, close[there], plane[at])
        found["near"] = np.full_like(whole.alpha, np.nan) if whole.near is None else whole.near
        found["near"][at] = near.alpha[there]
        return replace(whole, **found)


@dataclass(frozen=True, eq=False)
class Front:
    """All that stands in front of the weather in a frame."""

    flat: tuple[Matte, ...] = ()  # Those before all weather, back to front.
    deep: Deep | None = None  # Those at a depth.

    @property
    def cover(self) -> Array | None:
        """The share of the weather that masks hide, (H, W); None without masks."""
        masks = [matte.cover for matte in self.flat if matte.light is None]
        return reduce(lambda a, b: 1.0 - (1.0 - a) * (1.0 - b), masks) if masks else None

    @cached_property
    def visible(self) -> Visible | None:
        """The pixels where the weather can be seen in the composite; None is everywhere."""
        hidden = [
            matte.cover if matte.light is None else np.maximum(matte.cover, matte.light[..., 3])
            for matte in self.flat
        ]
        hides = reduce(np.maximum, hidden) if hidden else None
        return None if hides is None or not (hides >= 1.0).any() else Visible(hides)

    @property
    def pictures(self) -> tuple[Matte, ...]:
        """Pictures before all weather, back to front."""
        return tuple(matte for matte in self.flat if matte.light is not None)

    def window(self, window: Window) -> Front:
        """Return the part of a window, without what stands at a depth but for its pictures."""
        flat = tuple(matte.window(window) for matte in self.flat)
        if self.deep is None:
            return Front(flat)
        pictures = tuple(matte.window(window) for matte in self.deep.pictures)
        return Front(flat, replace(self.deep, pictures=pictures))

    def behind(self, light: Array, *, linear: bool) -> Array:
        """Return the background with the pictures at a depth over it."""
        return light if self.deep is None else _over(self.deep.pictures, light, linear=linear)

    def over(self, light: Array, *, linear: bool) -> Array:
        """Return the composite with the pictures before all weather over it."""
        return _over(self.pictures, light, linear=linear)

    def rgba(self, *, linear: bool) -> Array | None:
        """Return the pictures before all weather as one, (H, W, 4) premultiplied."""
        found = [picture.rgba(linear=linear) for picture in self.pictures]
        return reduce(lambda a, b: b + (1.0 - b[..., 3:]) * a, found) if found else None

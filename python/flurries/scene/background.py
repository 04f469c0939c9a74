"""What a background can be, brought to one size and one way to ask for a frame."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries._contract import Array, require, table
from flurries._warnings import warn, warn_of_levels
from flurries.io import fit, open_background
from flurries.io.color import parse_hex
from flurries.io.colorspace import ColorSpace
from flurries.io.files import file_of
from flurries.io.sequences import Span
from flurries.scene.numbered import Display, Numbered, Planes, pixels_of, read_only

_DEFAULT_SIZE = (1024, 768)


@dataclass(frozen=True, eq=False)
class Backdrop:
    """A background of one size."""

    size: tuple[int, int]  # (width, height) px.
    encoding: str  # "display" or "linear".
    count: int | None  # How many frames it has; None for a still.
    source: Planes
    fps: float | None = None  # Of a film, or as a picture's header says.
    # (left, top, width, height) of the display window in a plate with overscan.
    display: Display | None = None
    aspect: float = 1.0  # Width of a pixel over its height.
    photograph: bool = False  # Whether it is a picture or a film of integers.

    def frame(self, t: float) -> Array:
        """Return (H, W, 3), or (H, W, 4) with alpha, of frame floor(t)."""
        # The colors of integers are straight, those of floats are multiplied by alpha.
        pixels: Array = self.source.frame(t)
        return pixels

    def sampled(self, most: int) -> list[int]:
        """Return the numbers of frames spread evenly over all there are."""
        span = self.span
        if self.files is None or span is None:
            return [0]
        count = span.last - span.first + 1
        most = min(most, count)
        numbers = [span.first + (2 * k + 1) * count // (2 * most) for k in range(most)]
        missing = self.files.gaps(numbers)
        return [number for number in numbers if number not in missing] or [span.first]

    @property
    def deep(self) -> bool:
        """Whether it has more than 8 bits a color, as its first frame says."""
        return self.frame(0 if self.span is None else self.span.first).dtype != np.uint8

    @property
    def span(self) -> Span | None:
        """The numbers of its frames; None of a still."""
        return None if self.files is None else self.files.span

    def decoded(self, space: ColorSpace) -> Backdrop:
        """Return the same as light of a color space's working space."""
        made = self.source.then(lambda pixels: read_only(space.decode(pixels)))
        return replace(self, encoding="linear", source=made)

    def require_display(self) -> None:
        """Refuse numbers that say they are no display values, where no color space is named."""
        source = None if self.files is None else self.files.source
        curve, where = getattr(source, "curve", ""), f"background: {getattr(source, 'spec', '')}"
        name = "colorspace= (--colorspace) names their space, such as 'ACEScct'"
        if curve in ("Logarithmic", "Printing density", "ADX"):
            raise ValueError(f"{where} says that its numbers are {curve.lower()}: {name}")
        if curve == "Linear":
            warn(f"{where} says that its numbers are linear, not display values: {name}")

    def fine(self) -> Backdrop:
        """Return the same in 16 bits, where it has 8."""
        return replace(self, source=self.source.then(_fine))

    @property
    def files(self) -> Numbered | None:
        return self.source.files


def _fine(pixels: Array) -> Array:
    return pixels.astype(np.uint16) * np.uint16(257) if pixels.dtype == np.uint8 else pixels


def backdrop(
    background: Any, size: tuple[int, int] | None, *, extend: str = "stop", start: int | None = None
) -> Backdrop:
    """Return the backdrop of a scene's `background` argument; see `Scene` for the others."""
    if isinstance(background, str) and background.startswith("#"):
        return _plain(parse_hex("background", background), np.dtype(np.uint8), size)
    if isinstance(background, (str, os.PathLike)):
        with file_of("background"):
            opened = open_background(background, overscan=True)
        if opened.display is not None and size not in (None, tuple(opened.size)):
            # Another size that is asked for is one of the display window.
            opened = open_background(background)
        return _of_source(opened, size, extend, start)
    if isinstance(background, (tuple, list)) and len(background) == 3 and np.ndim(background) == 1:
        return _plain(table("background", background, ndim=1), np.dtype(np.float32), size)
    is_array = isinstance(background, np.ndarray)
    if not is_array and hasattr(background, "frame") and hasattr(background, "size"):
        return _of_source(background, size, extend, start)
    return _of_array(background, size)


def _plain(color: Any, dtype: np.dtype[Any], size: tuple[int, int] | None) -> Backdrop:
    width, height = size or _DEFAULT_SIZE
    pixels = np.empty((height, width, 3), dtype)
    pixels[...] = color
    return _still(pixels, plain=True)


def _still(pixels: Array, *, plain: bool = False) -> Backdrop:
    size = pixels.shape[1], pixels.shape[0]
    encoding = "linear" if pixels.dtype.kind == "f" else "display"
    photograph = encoding == "display" and not plain
    return Backdrop(size, encoding, None, Planes(read_only(pixels)), photograph=photograph)


def _of_source(
    source: Any, size: tuple[int, int] | None, extend: str, start: int | None
) -> Backdrop:
    wanted = size or tuple(source.size)
    files = Numbered.of("background", source, extend=extend, start=start)
    rate, display = getattr(source, "fps", None), getattr(source, "display", None)
    refitted = wanted != tuple(source.size)
    if display is not None and refitted:
        raise ValueError(
            f"size must be left out for a background that was opened with its overscan, got {size}"
        )
    # Fitted to another size pixels are square, as the frame's are.
    aspect = 1.0 if refitted else float(getattr(source, "aspect", 1.0))
    warned = False

    def fitted(picture: Any) -> Array:
        nonlocal warned
        # A source of somebody's own need not know of alpha.
        bare = getattr(picture, "alpha", None) is None
        pixels: Array = picture.pixels if bare else picture.rgba()
        if not warned:
            warn_of_levels("background", pixels, "divide them by 255")
        warned = True
        return pixels if (pixels.shape[1], pixels.shape[0]) == wanted else fit(pixels, wanted)

    kind = source.encoding, source.count, Planes(None, files, (fitted,)), rate, display, aspect
    return Backdrop(wanted, *kind, photograph=source.encoding == "display")


def _of_array(background: Any, size: tuple[int, int] | None) -> Backdrop:
    given = pixels_of("background", background, "a path, a color")
    if given.ndim == 2:
        given = np.repeat(given[..., None], 3, axis=2)
    if given.ndim != 3 or given.shape[2] not in (3, 4) or 0 in given.shape:
        raise ValueError(
            f"background must have shape (H, W, 3) or (H, W, 4), got {np.shape(background)}"
        )
    kind = given.dtype.kind
    if kind == "f" and given.shape[2] == 4:
        cover = given[..., 3]
        whole = (cover >= 0.0) & (cover <= 1.0)
        require("background: alpha", cover, whole, "from 0 to 1 everywhere")
    warn_of_levels("background", given, "divide them by 255")
    own = (given.shape[1], given.shape[0])
    if size is not None and size != own:
        hint = "; size is (width, height)" if size == own[::-1] else ""
        raise ValueError(f"background must have size {size}, got {own}{hint}")
    # A copy: a frame must not change because the caller's array did. One that nobody can change, as
    # that of another scene, is taken as it is.
    frozen = given.base is None and not given.flags.writeable
    dtype = np.float32 if kind == "f" else given.dtype
    return _still(np.array(given, dtype=dtype, order="C", copy=None if frozen else True))

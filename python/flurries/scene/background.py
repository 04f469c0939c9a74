"""What a background can be, brought to one size and one way to ask for a frame."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, numbers, require, sealed, table
from flurries._warnings import warn, warn_of_levels
from flurries.io import fit, open_background
from flurries.io.color import parse_hex
from flurries.io.colorspace import ColorSpace
from flurries.io.files import file_of, path_text
from flurries.scene.numbered import Display, Planes

Size = tuple[int, int]

_DEFAULT_SIZE = (1024, 768)


@dataclass(frozen=True, eq=False)
class Backdrop(Planes):
    """A background of one size; colors of integers are straight, floats multiplied by alpha."""

    size: Size = _DEFAULT_SIZE  # (width, height) px.
    encoding: str = "display"  # Or "linear".
    fps: float | None = None  # Of a film, or as a picture's header says.
    display: Display | None = None  # The display window in a plate with overscan.
    aspect: float = 1.0  # Width of a pixel over its height.
    photograph: bool = False  # Whether it is a picture or a film of integers.

    @property
    def count(self) -> int | None:
        """How many frames it has; None for a still."""
        return None if self.span is None else self.span.last - self.span.first + 1

    def sampled(self, most: int) -> list[int]:
        """Return the numbers of frames spread evenly over all there are."""
        if self.span is None or self.count is None:
            return [0]
        most = min(most, self.count)
        first, count = self.span.first, self.count
        numbers = [first + (2 * k + 1) * count // (2 * most) for k in range(most)]
        missing = self.gaps(numbers)
        return [number for number in numbers if number not in missing] or [self.span.first]

    @property
    def deep(self) -> bool:
        """Whether it has more than 8 bits a color, as its first frame says."""
        first = self.frame(0 if self.span is None else self.span.first)
        return bool(first.dtype != np.uint8)

    def decoded(self, space: ColorSpace) -> Backdrop:
        """Return the same as light of a color space's working space."""
        return replace(self.then(lambda p: sealed(space.decode(p))), encoding="linear")

    def fine(self) -> Backdrop:
        """Return the same in 16 bits, where it has 8."""
        return self.then(lambda p: p.astype(np.uint16) * 257 if p.dtype == np.uint8 else p)

    def require_display(self) -> None:
        """Refuse numbers that say they are no display values, where no color space is named."""
        curve, where = getattr(self.source, "curve", ""), f"background: {self.spec}"
        name = "colorspace= (--colorspace) names their space, such as 'ACEScct'"
        if curve in ("Logarithmic", "Printing density", "ADX"):
            raise ValueError(f"{where} says that its numbers are {curve.lower()}: {name}")
        if curve == "Linear":
            warn(f"{where} says that its numbers are linear, not display values: {name}")


def backdrop(background: Any, size: Size | None, **numbers: Any) -> Backdrop:
    """Return the backdrop of a scene's `background` argument; `numbers`: see `Planes.of`."""
    if isinstance(background, str) and background.startswith("#"):
        return _plain(parse_hex("background", background), np.uint8, size)
    if isinstance(background, (str, os.PathLike)):
        with file_of("background"):
            opened = open_background(path_text("background", background), overscan=True)
        if opened.display is not None and size not in (None, tuple(opened.size)):
            # Another size that is asked for is one of the display window.
            opened = open_background(background)
        return _of_source(opened, size, **numbers)
    if isinstance(background, (tuple, list)) and len(background) == 3 and np.ndim(background) == 1:
        return _plain(table("background", background, ndim=1), np.float32, size)
    if hasattr(background, "frame") and hasattr(background, "size"):
        return _of_source(background, size, **numbers)
    return _of_array(background, size)


def _plain(color: Any, dtype: npt.DTypeLike, size: Size | None) -> Backdrop:
    width, height = size or _DEFAULT_SIZE
    return replace(_still(np.full((height, width, 3), color, dtype)), photograph=False)


def _still(pixels: Array) -> Backdrop:
    encoding = "linear" if pixels.dtype.kind == "f" else "display"
    size = pixels.shape[1], pixels.shape[0]
    whole = encoding == "display"
    return Backdrop(sealed(pixels), size=size, encoding=encoding, photograph=whole)


def _of_source(source: Any, size: Size | None, **numbers: Any) -> Backdrop:
    wanted = size or tuple(source.size)
    display, refitted = getattr(source, "display", None), wanted != tuple(source.size)
    if display is not None and refitted:
        raise ValueError(
            f"size must be left out for a background that was opened with its overscan, got {size}"
        )
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

    return Backdrop.of(
        "background", source, fitted, **numbers, size=wanted, encoding=source.encoding,
        fps=getattr(source, "fps", None), display=display,
        # Fitted to another size pixels are square, as the frame's are.
        aspect=1.0 if refitted else float(getattr(source, "aspect", 1.0)),
        photograph=source.encoding == "display",
    )  # fmt: skip


def _of_array(background: Any, size: Size | None) -> Backdrop:
    given = numbers("background", background, "a path, a color or an array of ")
    if given.ndim == 2:
        given = np.repeat(given[..., None], 3, axis=2)
    if given.ndim != 3 or given.shape[2] not in (3, 4) or 0 in given.shape:
        wanted = "(H, W, 3) or (H, W, 4)"
        raise ValueError(f"background must have shape {wanted}, got {np.shape(background)}")
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

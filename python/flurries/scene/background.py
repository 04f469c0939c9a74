"""What a background can be, brought to one size and one way to ask for a frame."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array, rectangular, table, warn_of_levels
from flurries.io import fit, open_background

_COLOR = re.compile(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})")
_DEFAULT_SIZE = (1024, 768)


@dataclass(frozen=True, eq=False)
class Backdrop:
    """A background of one size.

    Attributes
    ----------
    size : (width, height)
        Pixels.
    encoding : "display" or "linear"
        What its values mean.
    count : int or None
        How many frames it has; None for a still.
    source : array or a source of `flurries.io`
        Where they come from.
    fps : float or None
        Frames per second of a film.
    """

    size: tuple[int, int]
    encoding: str
    count: int | None
    source: Any
    fps: float | None = None

    def frame(self, t: float) -> Array:
        """Return (H, W, 3), or (H, W, 4) with alpha, of frame floor(t); ends hold outside.

        The colors of integers are straight, those of floats are multiplied by alpha.
        """
        if isinstance(self.source, np.ndarray):
            return self.source
        # The source keeps what it decoded last, so a still is read and fitted once.
        pixels: Array = self.source.frame(math.floor(t))
        return pixels


@dataclass
class _Fitted:
    """Frames of a file, fitted to the size; the last one is kept."""

    source: Any
    size: tuple[int, int]
    _last: tuple[int, Array] | None = None

    def frame(self, index: int) -> Array:
        index = 0 if self.source.count is None else min(max(index, 0), self.source.count - 1)
        last = self._last
        if last is not None and last[0] == index:
            return last[1]
        picture = self.source.frame(index)
        # A source of somebody's own need not know of alpha.
        bare = getattr(picture, "alpha", None) is None
        pixels: Array = picture.pixels if bare else picture.rgba()
        if last is None:
            warn_of_levels("background", pixels, "divide them by 255")
        if (pixels.shape[1], pixels.shape[0]) != self.size:
            pixels = fit(pixels, self.size)
        self._last = (index, pixels)
        return pixels

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_last": None}


def backdrop(background: Any, size: tuple[int, int] | None) -> Backdrop:
    """Return the backdrop of a scene's `background` argument."""
    if isinstance(background, str) and background.startswith("#"):
        match = _COLOR.fullmatch(background)
        if match is None:
            raise ValueError(f"background must be '#rrggbb' for a color, got {background!r}")
        return _plain([int(part, 16) for part in match.groups()], np.dtype(np.uint8), size)
    if isinstance(background, (str, os.PathLike)):
        return _of_source(open_background(background), size)
    if isinstance(background, (tuple, list)) and len(background) == 3 and np.ndim(background) == 1:
        return _plain(table("background", background, ndim=1), np.dtype(np.float32), size)
    if (
        hasattr(background, "frame")
        and hasattr(background, "size")
        and not isinstance(background, np.ndarray)
    ):
        return _of_source(background, size)
    return _of_array(background, size)


def _plain(color: Any, dtype: np.dtype[Any], size: tuple[int, int] | None) -> Backdrop:
    width, height = size or _DEFAULT_SIZE
    pixels = np.empty((height, width, 3), dtype)
    pixels[...] = color
    pixels.flags.writeable = False
    return Backdrop((width, height), "linear" if dtype.kind == "f" else "display", None, pixels)


def _of_source(source: Any, size: tuple[int, int] | None) -> Backdrop:
    wanted = size or tuple(source.size)
    rate = getattr(source, "fps", None)
    return Backdrop(wanted, source.encoding, source.count, _Fitted(source, wanted), rate)


def _of_array(background: Any, size: tuple[int, int] | None) -> Backdrop:
    given = rectangular("background", background)
    given = given.astype(given.dtype.newbyteorder("="), copy=False)
    if given.dtype not in (np.uint8, np.uint16, np.float16, np.float32, np.float64):
        raise TypeError(
            "background must be a path, a color or an array of uint8, uint16 or float, "
            f"got {type(background).__name__} of dtype {given.dtype}"
        )
    if given.ndim == 2:
        given = np.repeat(given[..., None], 3, axis=2)
    if given.ndim != 3 or given.shape[2] not in (3, 4) or 0 in given.shape:
        raise ValueError(
            f"background must have shape (H, W, 3) or (H, W, 4), got {np.shape(background)}"
        )
    kind = given.dtype.kind
    if kind == "f" and given.shape[2] == 4:
        cover = given[..., 3]
        if not bool(((cover >= 0.0) & (cover <= 1.0)).all()):
            raise ValueError("background: alpha must be from 0 to 1 everywhere")
    warn_of_levels("background", given, "divide them by 255")
    own = (given.shape[1], given.shape[0])
    if size is not None and size != own:
        hint = "; size is (width, height)" if size == own[::-1] else ""
        raise ValueError(f"background must have size {size}, got {own}{hint}")
    # A copy: a frame must not change because the caller's array did.
    pixels = np.array(
        given, dtype=np.float32 if kind == "f" else given.dtype.newbyteorder("="), order="C"
    )
    pixels.flags.writeable = False
    return Backdrop(own, "linear" if kind == "f" else "display", None, pixels)

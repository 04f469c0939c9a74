"""How far away what stands in the picture is: a wall, an array, files, or a map painted by hand."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import Array, choice, depths, real, rectangular, require, suggesting
from flurries._warnings import warn_of_units
from flurries.io import fit_nearest, open_background, open_depth
from flurries.io.color import to_unit
from flurries.io.files import file_of
from flurries.io.pictures.reader import luminance
from flurries.scene.numbered import Last, Numbered
from flurries.scene.overscan import Display, placed

__all__ = ["DepthMap"]

White: TypeAlias = Literal["near", "far"]
_WHITE = get_args(White)
Law: TypeAlias = Literal["linear", "inverse"]
_LAWS = get_args(Law)


@suggesting
@dataclass(frozen=True, eq=False)
class DepthMap:
    """A grey picture that stands for depth, such as one painted by hand.

    With g the grey from 0 to 1, and w = 1 - g where white is near, or g where it is far:
    "linear" gives near + w (far - near); "inverse" gives 1 / (1/near + w (1/far - 1/near)), which
    spends more greys on what is near, as disparity maps do.

    Parameters
    ----------
    source : path or array
        A picture, an image sequence (``depth.%04d.png``) or a film; or an array (H, W) of uint8,
        uint16 or float from 0 to 1. A color picture counts with its luminance, as stored.
    near, far : float
        Depths at the two ends of the grey scale, world units, 0 < near < far. `far` may be infinity
        with the law "inverse": the sky.
    white : {"near", "far"}
        Which end is white.
    law : {"linear", "inverse"}
        What is in proportion to the grey: depth, or its inverse.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> painted = np.array([[255, 0]], np.uint8)
    >>> scene = fl.Scene((2, 1), depth=fl.DepthMap(painted, near=2.0, far=50.0))
    >>> scene.depth_at(0).tolist()
    [[2.0, 50.0]]
    """

    source: Any
    near: float
    far: float
    white: White = "near"
    law: Law = "linear"

    def __init__(
        self, source: Any, *, near: float, far: float, white: str = "near", law: str = "linear"
    ) -> None:
        settle = object.__setattr__
        settle(self, "near", real("near", near, above=0.0))
        settle(self, "white", choice("white", white, _WHITE))
        settle(self, "law", choice("law", law, _LAWS))
        endless = law == "inverse" and isinstance(far, float) and far == math.inf
        settle(self, "far", far if endless else real("far", far, above=self.near))
        if not isinstance(source, (str, os.PathLike)):
            source = _greys(source)
        settle(self, "source", source)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self.source, self.near, self.far, self.white, self.law)

    def depth_of(self, grey: Array) -> Array:
        """Return the depths of greys from 0 to 1, float32 of the same shape."""
        w = grey.astype(np.float64)
        w = 1.0 - w if self.white == "near" else w
        if self.law == "linear":
            depth = self.near + w * (self.far - self.near)
        else:
            with np.errstate(divide="ignore"):
                depth = 1.0 / (1.0 / self.near + w * (1.0 / self.far - 1.0 / self.near))
        return np.asarray(depth, np.float32)


def _rebuilt(source: Any, near: float, far: float, white: str, law: str) -> DepthMap:
    return DepthMap(source, near=near, far=far, white=white, law=law)


def _greys(source: Any) -> Array:
    """Return a read-only copy of an array of greys."""
    given = rectangular("source", source)
    given = given.astype(given.dtype.newbyteorder("="), copy=False)
    if given.dtype not in (np.uint8, np.uint16, np.float16, np.float32, np.float64):
        raise TypeError(
            "source must be a path or an array of uint8, uint16 or float, "
            f"got {type(source).__name__} of dtype {given.dtype}"
        )
    if given.ndim != 2 or 0 in given.shape:
        raise ValueError(f"source must have shape (H, W), got {given.shape}")
    if given.dtype.kind == "f":
        require("source", given, (given >= 0.0) & (given <= 1.0), "from 0 to 1 everywhere")
    copy = np.array(given, order="C")
    copy.flags.writeable = False
    return copy


@dataclass(frozen=True, eq=False)
class Distance:
    """The depth of a scene's background, of the frame's size, for every frame."""

    source: Any  # (H, W) float32 array, or files.

    @property
    def still(self) -> bool:
        """Whether every frame has the same depth."""
        if isinstance(self.source, np.ndarray):
            return True
        return self.source.files.span is None

    @property
    def files(self) -> Numbered | None:
        """The files of the depth, where it has any."""
        return None if isinstance(self.source, np.ndarray) else self.source.files

    def frame(self, t: float) -> Array:
        """Return (H, W) float32 of frame floor(t), read-only."""
        return self.source if isinstance(self.source, np.ndarray) else self.source.frame(t)


@dataclass
class _Fitted:
    """Depths from files, fitted to the frame; the last one is kept."""

    files: Numbered
    law: DepthMap | None
    shape: tuple[int, int]
    display: Display | None = None
    _last: Last = field(default_factory=Last)

    def frame(self, t: float) -> Array:
        picture = self.files.frame(t)
        return self._last.of((picture,), lambda: self._fitted(picture))

    def _fitted(self, picture: Any) -> Array:
        depth = picture.pixels if self.law is None else self.law.depth_of(luminance(picture))
        whole = placed(depth, picture.display, self.shape, self.display, fit_nearest, np.inf)
        # A copy where it is the file's own, which other frames may share.
        return _read_only(np.array(whole, order="C"))


def distance_of(
    value: Any,
    shape: tuple[int, int],
    *,
    name: str = "depth",
    extend: str = "stop",
    start: int | None = None,
    display: Display | None = None,
) -> Distance:
    """Return the depth of a scene's `depth` argument, or of another called `name`."""

    def of_files(source: Any, law: DepthMap | None) -> Distance:
        files = Numbered.of(name, source, extend=extend, start=start)
        return Distance(_Fitted(files, law, shape, display))

    if isinstance(value, DepthMap):
        if isinstance(value.source, np.ndarray):
            _require_shape(f"{name}: source", value.source.shape, shape)
            return Distance(_read_only(value.depth_of(to_unit(value.source))))
        with file_of(name):
            return of_files(open_background(value.source, overscan=display is not None), value)
    if isinstance(value, (str, os.PathLike)):
        with file_of(name):
            return of_files(open_depth(value, overscan=display is not None), None)
    if not isinstance(value, (dict, set, list, tuple)) and np.ndim(value) == 0:
        wall = real(name, value, above=0.0)
        return Distance(_read_only(np.full(shape, wall, np.float32)))
    given = rectangular(name, value)
    if given.dtype.kind != "f":
        raise TypeError(
            f"{name} must be a number, a path, a DepthMap or an array of float, got {given.dtype}; "
            "greys become depths through DepthMap"
        )
    _require_shape(name, given.shape, shape)
    plane = depths(name, np.array(given, np.float32, order="C"))
    warn_of_units(name, plane)
    return Distance(_read_only(plane))


def _require_shape(name: str, got: tuple[int, ...], wanted: tuple[int, int]) -> None:
    if got != wanted:
        raise ValueError(f"{name} must have shape {wanted}, got {got}")


def _read_only(plane: Array) -> Array:
    plane.flags.writeable = False
    return plane

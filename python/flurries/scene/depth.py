"""How far away what stands in the picture is: a wall, an array, files, or a map painted by hand."""

from __future__ import annotations

import math
import os
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import Array, choice, depths, real, rectangular, require, suggesting
from flurries._warnings import warn_of_units
from flurries.frame.edges import Edges, edges_of
from flurries.io import fit_nearest, open_background, open_depth
from flurries.io.color import to_unit
from flurries.io.files import file_of
from flurries.io.pictures.reader import luminance
from flurries.scene.numbered import Display, Numbered, Planes, pixels_of, placed, read_only

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
        Depths at the ends of the grey scale, 0 < near < far; with "inverse" infinity is the sky.
    white : {"near", "far"}
        Which end is white.
    law : {"linear", "inverse"}
        What is in proportion to the grey: depth, or its inverse.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> painted = np.array([[255, 0]], np.uint8)
    >>> scene = fl.Scene(size=(2, 1), depth=fl.scene.DepthMap(painted, near=2.0, far=50.0))
    >>> scene._depth_at(0).tolist()
    [[2.0, 50.0]]
    """

    source: Any
    _: KW_ONLY
    near: float
    far: float
    white: White = "near"
    law: Law = "linear"

    def __post_init__(self) -> None:
        settle = object.__setattr__
        settle(self, "near", real("near", self.near, above=0.0))
        choice("white", self.white, _WHITE)
        choice("law", self.law, _LAWS)
        endless = self.law == "inverse" and isinstance(self.far, float) and self.far == math.inf
        settle(self, "far", self.far if endless else real("far", self.far, above=self.near))
        if not isinstance(self.source, (str, os.PathLike)):
            settle(self, "source", _greys(self.source))

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


def _greys(source: Any) -> Array:
    """Return a read-only copy of an array of greys."""
    given = pixels_of("source", source, "a path")
    if given.ndim != 2 or 0 in given.shape:
        raise ValueError(f"source must have shape (H, W), got {given.shape}")
    if given.dtype.kind == "f":
        require("source", given, (given >= 0.0) & (given <= 1.0), "from 0 to 1 everywhere")
    return read_only(np.array(given, order="C"))


class Distance(Planes):
    """A scene's depth, with the pixels in which a near and a far side meet."""

    @staticmethod
    def of(planes: Planes, *, inverse: bool = False) -> Distance:
        """Return planes (H, W), or (H, W, 3) of near, far and the near one's share, with edges."""
        split = partial(_split, inverse=inverse)
        return Distance(planes.given, planes.files, (*planes.steps, split))

    def frame(self, t: float) -> Array:
        """Return the depth at frame floor(t), (H, W) float32."""
        depth: Array = super().frame(t)[0]
        return depth

    def edges(self, t: float) -> Edges | None:
        edges: Edges | None = super().frame(t)[1]
        return edges

    def up_to(self, wall: float) -> Distance:
        """Return the same with a wall at one depth before it."""
        return Distance(self.given, self.files, (*self.steps, partial(_walled, wall=wall)))


def _split(found: Array, *, inverse: bool) -> tuple[Array, Edges | None]:
    """Return a depth for each pixel, and the edges or None."""
    if found.ndim == 2:
        return found, edges_of(found, inverse=inverse)
    near, back, share = (np.ascontiguousarray(found[..., k]) for k in range(3))
    share = np.where(np.isfinite(share), share, np.float32(0.0))
    return read_only(np.where(share >= 0.5, near, back)), Edges.of(near, read_only(back), share)


def _walled(found: tuple[Array, Edges | None], wall: float) -> tuple[Array, Edges | None]:
    depth, edges = found
    if edges is not None:
        front = replace(edges.front, depth=np.minimum(edges.front.depth, np.float32(wall)))
        edges = Edges(np.minimum(edges.back, np.float32(wall)), front)
    return np.minimum(depth, np.float32(wall)), edges


def distance_of(
    value: Any, shape: tuple[int, int], *, name: str = "depth", extend: str = "stop",
    start: int | None = None, display: Display | None = None,
) -> Planes:  # fmt: skip
    """Return the depth of a scene's `depth` argument, or of another called `name`."""

    def of_files(source: Any, law: DepthMap | None) -> Planes:
        def fitted(picture: Any) -> Array:
            depth = picture.pixels if law is None else law.depth_of(luminance(picture))
            whole = placed(depth, picture.display, shape, display, fit_nearest, np.inf)
            # A copy where it is the file's own, which other frames may share.
            return read_only(np.array(whole, order="C"))

        files = Numbered.of(name, source, extend=extend, start=start)
        return Planes(None, files, (fitted,))

    if isinstance(value, DepthMap):
        if isinstance(value.source, np.ndarray):
            _require_shape(f"{name}: source", value.source.shape, shape)
            return Planes(read_only(value.depth_of(to_unit(value.source))))
        with file_of(name):
            return of_files(open_background(value.source, overscan=display is not None), value)
    if isinstance(value, (str, os.PathLike)):
        with file_of(name):
            return of_files(open_depth(value, overscan=display is not None), None)
    if not isinstance(value, (dict, set, list, tuple)) and np.ndim(value) == 0:
        wall = real(name, value, above=0.0)
        return Planes(read_only(np.full(shape, wall, np.float32)))
    given = rectangular(name, value)
    if given.dtype.kind != "f":
        raise TypeError(
            f"{name} must be a number, a path, a DepthMap or an array of float, got {given.dtype}; "
            "greys become depths through DepthMap"
        )
    _require_shape(name, given.shape, shape)
    plane = depths(name, np.array(given, np.float32, order="C"))
    warn_of_units(name, plane)
    return Planes(read_only(plane))


def _require_shape(name: str, got: tuple[int, ...], wanted: tuple[int, int]) -> None:
    if got != wanted:
        raise ValueError(f"{name} must have shape {wanted}, got {got}")

"""How far away what stands in the picture is: a wall, an array, files, or a map painted by hand."""

from __future__ import annotations

import math
import os
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

from flurries import _contract as check
from flurries._contract import Array, choice, depths, real, rectangular, require, sealed, suggesting
from flurries._warnings import warn_of_units
from flurries.frame.edges import Edges, edges_of
from flurries.io import fit_nearest, open_background, open_depth
from flurries.io.color import to_unit
from flurries.io.files import file_of
from flurries.io.pictures.reader import luminance
from flurries.scene.numbered import Display, Planes, placed

White: TypeAlias = Literal["near", "far"]
Law: TypeAlias = Literal["linear", "inverse"]


@suggesting
@dataclass(frozen=True, eq=False)
class DepthMap:
    """A grey picture that stands for depth, such as one painted by hand.

    With g the grey from 0 to 1, and w = 1 - g where white is near, or g where it is far: "linear"
    gives near + w (far - near); "inverse" gives 1 / (1/near + w (1/far - 1/near)), which spends
    more greys on what is near, as disparity maps do.

    Parameters
    ----------
    source : path or array
        A picture, an image sequence (``depth.%04d.png``) or a film; or an array (H, W) of uint8,
        uint16 or float from 0 to 1. A color picture counts with its luminance, as stored.
    near, far : float
        Depths at the ends of the grey scale, 0 < near < far; with "inverse" infinity is the sky.
    white, law : {"near", "far"}, {"linear", "inverse"}
        Which end is white, and what is in proportion to the grey: depth, or its inverse.

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
        settle = partial(object.__setattr__, self)
        settle("near", real("near", self.near, above=0.0))
        choice("white", self.white, White)
        choice("law", self.law, Law)
        endless = self.law == "inverse" and isinstance(self.far, float) and self.far == math.inf
        settle("far", self.far if endless else real("far", self.far, above=self.near))
        if isinstance(self.source, (str, os.PathLike)):
            return
        given = check.numbers("source", self.source, "a path or an array of ")
        if given.ndim != 2 or 0 in given.shape:
            raise ValueError(f"source must have shape (H, W), got {given.shape}")
        if given.dtype.kind == "f":
            require("source", given, (given >= 0.0) & (given <= 1.0), "from 0 to 1 everywhere")
        settle("source", sealed(np.array(given, order="C")))

    def depth_of(self, grey: Array) -> Array:
        """Return the depths of greys from 0 to 1, float32 of the same shape."""
        w = grey.astype(np.float64)
        w = 1.0 - w if self.white == "near" else w
        if self.law == "linear":
            return np.asarray(self.near + w * (self.far - self.near), np.float32)
        with np.errstate(divide="ignore"):
            closeness = 1.0 / self.near + w * (1.0 / self.far - 1.0 / self.near)
            return np.asarray(1.0 / closeness, np.float32)


class Distance(Planes):
    """A scene's depth, with the pixels in which a near and a far side meet."""

    @staticmethod
    def of_planes(planes: Planes, *, inverse: bool = False) -> Distance:
        """Return planes (H, W), or (H, W, 3) of near, far and the near one's share, with edges."""
        split = partial(_split, inverse=inverse)
        return Distance(planes.given, planes.source, planes.span, (*planes.steps, split))

    def frame(self, t: float) -> Array:
        """Return the depth at frame floor(t), (H, W) float32."""
        depth: Array = super().frame(t)[0]
        return depth

    def edges(self, t: float) -> Edges | None:
        edges: Edges | None = super().frame(t)[1]
        return edges

    def up_to(self, wall: float) -> Distance:
        """Return the same with a wall at one depth before it."""

        def walled(found: tuple[Array, Edges | None]) -> tuple[Array, Edges | None]:
            depth, edges = found
            if edges is not None:
                front = replace(edges.front, depth=np.minimum(edges.front.depth, near))
                edges = Edges(np.minimum(edges.back, near), front)
            return np.minimum(depth, near), edges

        near = np.float32(wall)
        return self.then(walled)


def _split(found: Array, *, inverse: bool) -> tuple[Array, Edges | None]:
    """Return a depth for each pixel, and the edges or None."""
    if found.ndim == 2:
        return found, edges_of(found, inverse=inverse)
    near, back, share = (np.ascontiguousarray(found[..., k]) for k in range(3))
    share = np.where(np.isfinite(share), share, np.float32(0.0))
    return sealed(np.where(share >= 0.5, near, back)), Edges.of(near, sealed(back), share)


def distance_of(
    value: Any, shape: tuple[int, int], *, name: str = "depth", display: Display | None = None,
    **numbers: Any,
) -> Planes:  # fmt: skip
    """Return the depth of a scene's `depth` argument, or of another called `name`."""
    law = value if isinstance(value, DepthMap) else None
    source = value if law is None else law.source

    def fitted(picture: Any) -> Array:
        depth = picture.pixels if law is None else law.depth_of(luminance(picture))
        whole = placed(depth, picture.display, shape, display, fit_nearest, np.inf)
        # A copy where it is the file's own, which other frames may share.
        return sealed(np.array(whole, order="C"))

    if isinstance(source, (str, os.PathLike)):
        with file_of(name):
            opened = (open_background if law else open_depth)(source, overscan=display is not None)
            return Planes.of(name, opened, fitted, **numbers)
    if law is None and not isinstance(value, (dict, set, list, tuple)) and np.ndim(value) == 0:
        return Planes(sealed(np.full(shape, real(name, value, above=0.0), np.float32)))
    given = rectangular(name, source)
    if law is None and given.dtype.kind != "f":
        raise TypeError(
            f"{name} must be a number, a path, a DepthMap or an array of float, got {given.dtype}; "
            "greys become depths through DepthMap"
        )
    if given.shape != shape:
        of = name if law is None else f"{name}: source"
        raise ValueError(f"{of} must have shape {shape}, got {given.shape}")
    if law is not None:
        return Planes(sealed(law.depth_of(to_unit(given))))
    plane = depths(name, np.array(given, np.float32, order="C"))
    warn_of_units(name, plane)
    return Planes(sealed(plane))

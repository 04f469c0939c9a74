"""A chart of the rays through a picture, kept while camera and axis stand still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import (
    Array,
    _came,
    aligned,
    integer,
    is_pair,
    real,
    shape_of,
)
from flurries._contract import pixels as pixels_of
from flurries.camera.lens import Camera
from flurries.cone.rays import Pose, pose, reach_of
from flurries.cone.sheet import MOST_REPEATS

__all__ = ["Mapping"]

BLOCK = 16

# The first layer nearest, each of the others half as large and twice as far.
MULTIPLES = (1, 2, 4, 8)

# Azimuth, height, fade, what the blocks are, footprints: see src/cone/chart.rs.
Chart: TypeAlias = tuple[Array, Array, Array, Array, Array]


class Mapping:
    """The point of the textures that every pixel sees: the part of a frame that does not scroll.

    It depends on the lens and rotation of the camera, on the axis, the stretch and the slope; while
    these stand still one mapping serves all frames. :func:`layers` makes one where none is given,
    with the same result to the last bit.

    Parameters
    ----------
    shape, camera, axis, stretch, slope, repeats
        See :func:`flurries.cone.layer`.
    radius : float
        Radius of the first layer's cone, world units; it matters for a camera with an `offset`
        only.
    multiples : sequence of int
        Repetitions of each layer over those of the first: 1, 2, 4, 8.
    rows : (start, stop), optional
        Only these rows of the picture; they have the same bits as in the whole picture.
    depth : (H, W) array, optional
        Planar depth of what stands in the picture, world units; a layer behind it is hidden. Needs
        `radius`.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        camera: Camera,
        *,
        axis: npt.ArrayLike,
        stretch: float = 1.0,
        slope: float = 0.0,
        repeats: int = 4,
        radius: float = math.inf,
        multiples: Sequence[int] = MULTIPLES,
        rows: tuple[int, int] | None = None,
        depth: npt.ArrayLike | None = None,
    ) -> None:
        self.shape = shape_of("shape", shape)
        self.stretch = real("stretch", stretch, low=1e-6, high=1e6)
        self.repeats = integer("repeats", repeats, low=1, high=MOST_REPEATS)
        self.multiples = multiples_of(multiples)
        radius = reach_of(radius)
        start, stop = (0, self.shape[0]) if rows is None else two_of("rows", rows)
        start = integer("rows[0]", start, low=0, high=self.shape[0] - 1)
        stop = integer("rows[1]", stop, low=start + 1, high=self.shape[0])
        self.rows = (start, stop)
        # Blocks lie where they lie in the whole picture.
        self._top = start - start % BLOCK
        self._poses = [
            pose(self.shape, camera, axis, slope, radius * factor) for factor in self.multiples
        ]
        self._together = self._poses[0][-1] == (0.0, 0.0, 0.0)
        self._charts = [
            self._chart(given) for given in self._poses[: 1 if self._together else None]
        ]
        self._shown = None if depth is None else self._before(depth, radius)

    def _chart(self, given: Pose) -> Chart:
        height, blocks = self.rows[1] - self._top, -(-self.shape[1] // BLOCK)
        course = (self.repeats, self.stretch, self._top)
        wide = (height, blocks * BLOCK)
        across, along = np.empty(wide, np.uint32), np.empty(wide, np.uint32)
        fade, state = np.empty(wide, np.float32), np.empty((height, blocks), np.uint8)
        _core.cone_chart(across, along, fade, state, given, course)
        return across, along, fade, state, footprints_of(wide, given, course)

    def _before(self, depth: npt.ArrayLike, radius: float) -> Array:
        """Return the number of layers, nearest first, that stand before the depth map."""
        first = real("radius", radius, above=0.0)
        map_, _ = pixels_of("depth", depth, ndim=2)
        if map_.shape != self.shape:
            raise ValueError(f"depth must have shape {self.shape}, got {map_.shape}")
        part = aligned(map_[self._top : self.rows[1]], np.float32)
        counts = np.zeros((len(part), -(-self.shape[1] // BLOCK) * BLOCK), np.uint8)
        radii = [first * factor for factor in self.multiples]
        _core.cone_shown(counts, part, self._poses[0], radii, self._top)
        return counts


def footprints_of(shape: tuple[int, int], given: Pose, course: tuple[int, float, int]) -> Array:
    """Return log2 of a pixel's footprint in tiles for blocks of a picture, (.., .., 2)."""
    steps = np.empty((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK), 2), np.float32)
    _core.cone_footprints(steps, given, course)
    return steps


def two_of(name: str, values: Any) -> tuple[Any, Any]:
    if not is_pair(values):
        raise TypeError(f"{name} must be (start, stop), got {_came(values)}")
    return values[0], values[1]


def multiples_of(values: Sequence[int]) -> tuple[int, ...]:
    if not isinstance(values, (list, tuple)) or not 1 <= len(values) <= 16:
        raise ValueError(f"multiples must be 1 to 16 whole numbers, got {_came(values)}")
    numbers = tuple(integer("multiples", value, low=1, high=1024) for value in values)
    if any(a >= b for a, b in pairwise(numbers)):
        raise ValueError(f"multiples must increase, nearest layer first, got {numbers}")
    return numbers

"""Labels that know about the weather: what it hides, how it moves, how far away it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, Float64, pixels, rectangular, shares, table
from flurries.augment.pictures import layer_of

# From this opacity on a flake, not what is behind it, is what is seen at a pixel.
SEEN = 0.5


@dataclass(frozen=True, eq=False)
class Weathered:
    """A picture with weather, and its labels; what was not asked for is None.

    Attributes
    ----------
    image : array
        The picture with weather, of the shape and dtype of the picture given.
    alpha : (H, W) float32
        Opacity of the weather, 0 to 1.
    color : (r, g, b)
        Color of the weather, display values, 0 to 1.
    record : dict
        Plain numbers and words from which :func:`flurries.augment.replay` makes the same weather.
    boxes, masks : as they came
        Weather moves nothing in the picture.
    occlusion, coverage, visibility : (n,) float64
        Of each box the mean opacity, 0 to 1; that without a veil; and the share in which more than
        half of the light is the picture's own.
    instances : (m,)
        The numbers in a mask (H, W) of integers, but 0; or 0 to m - 1 of masks (m, H, W) of bool.
    instance_occlusion, instance_visibility : (m,) float64
        As `occlusion` and `visibility`, over the pixels of each instance.
    flow : (H, W, 2) float32
        The flow given, px per frame, with the weather's own where it hides more than half.
    depth : (H, W) float32
        The depth given, metres, with that of flakes that hide more than half. A veil has neither
        depth nor motion. Holes, NaN or 0, stay holes.
    soft_flow, soft_depth : like `flow` and `depth`
        Means of picture and weather by what is seen of each; of the depth the harmonic mean.
    disparity : (H, W) float32
        Of `depth`, px: how much farther left it is for the right eye. NaN in holes.
    weather_disparity : (H, W) float32
        Of the densest flake at each pixel; 0 where there is none.
    motion : (H, W, 2) float32
        Of the weather, pixels (x, y) per frame: at each pixel of what is densest there.
    falling : (H, W, 4) float32
        Flakes or drops as a layer of their own, without a veil: motion (x, y) in pixels per frame,
        nearness (one over the depth, 1/m), opacity; the first three premultiplied with the fourth.
    """

    image: Array
    alpha: Array
    color: tuple[float, float, float]
    record: dict[str, Any] = field(default_factory=dict)
    boxes: Any = None
    masks: Any = None
    occlusion: Float64 | None = None
    coverage: Float64 | None = None
    visibility: Float64 | None = None
    instances: Array | None = None
    instance_occlusion: Float64 | None = None
    instance_visibility: Float64 | None = None
    flow: Array | None = field(init=False, repr=False)
    depth: Array | None = field(init=False, repr=False)
    soft_flow: Array | None = field(init=False, repr=False)
    soft_depth: Array | None = field(init=False, repr=False)
    disparity: Array | None = field(init=False, repr=False)
    weather_disparity: Array | None = field(init=False, repr=False)
    motion: Array | None = field(init=False, repr=False)
    falling: Array | None = field(init=False, repr=False)
    _mixture: Callable[[], dict[str, Any]] | None = field(default=None, repr=False)

    def __getattr__(self, name: str) -> Any:
        later = [one.name for one in fields(self) if not one.init]
        if name not in later:
            raise AttributeError(f"a Weathered has no attribute {name!r}")
        # All of them, when the first is asked for: they cost several times what the picture does.
        # Threads that ask at once make the same.
        made = self._mixture
        if name not in vars(self):
            vars(self).update(dict.fromkeys(later) | (made() if made else {}), _mixture=None)
        return vars(self)[name]

    def __getstate__(self) -> dict[str, Any]:
        _ = self.motion
        return vars(self)

    @property
    def layer(self) -> Array:
        """(H, W, 4) float32: the weather alone, display values premultiplied with its opacity."""
        return layer_of(self.alpha, self.color)


def hidden(alpha: Array, veil: Any, corners: Float64 | None, masks: Any) -> dict[str, Any]:
    """Return what weather hides of boxes and of instances, as fields of `Weathered`."""
    found: dict[str, Any] = {}
    if corners is not None:
        found["occlusion"], found["visibility"] = _means(alpha, corners, lambda part: part < SEEN)
        if isinstance(veil, float):
            # What falls leaves all that the veil does not take.
            clear = max(1.0 - veil, 1e-9)
            found["coverage"] = np.clip(1.0 - (1.0 - found["occlusion"]) / clear, 0.0, 1.0)
        else:
            (found["coverage"],) = _means(1.0 - (1.0 - alpha) / (1.0 - veil), corners)
    if not isinstance(masks, np.ndarray) or masks.shape[-2:] != alpha.shape:
        return found
    if (masks.ndim, masks.dtype.kind) in ((2, "i"), (2, "u"), (3, "b")):
        numbers = np.unique(masks[masks != 0]) if masks.ndim == 2 else np.arange(len(masks))
        planes = [masks == number for number in numbers] if masks.ndim == 2 else masks
        parts = [alpha[plane] for plane in planes]
        found["instances"] = numbers
        for name, of in (("occlusion", parts), ("visibility", [part < SEEN for part in parts])):
            means = [part.mean(dtype=np.float64) if part.size else np.nan for part in of]
            found[f"instance_{name}"] = np.array(means, np.float64)
    return found


def occlusion(alpha: npt.ArrayLike, boxes: npt.ArrayLike) -> Float64:
    """Return the share of each box that the weather hides.

    Parameters
    ----------
    alpha : (H, W)
        Opacity, 0 to 1, float.
    boxes : (n, 4)
        (x0, y0, x1, y1) in pixels, x0 <= x1 and y0 <= y1; pixel (row i, column j) covers [j, j + 1)
        x [i, i + 1). Parts of pixels count as parts, what lies outside the picture does not count.

    Returns
    -------
    (n,) float64
        The mean opacity over the box, 0 to 1; NaN for a box without area inside the picture.
    """
    plane, _ = pixels("alpha", alpha, ndim=2)
    shares("alpha", plane)
    return _means(plane, boxes_of(boxes))[0]


def _means(plane: Array, corners: Float64, *laws: Callable[[Array], Array]) -> tuple[Float64, ...]:
    """Return the mean of a plane, and of what laws make of it, over each box."""
    found = np.full((1 + len(laws), len(corners)), np.nan)
    for number, (x0, y0, x1, y1) in enumerate(corners.tolist()):
        rows, down, tall = _covered(y0, y1, plane.shape[0])
        columns, across, wide = _covered(x0, x1, plane.shape[1])
        area = tall * wide
        if area > 0.0:
            part = plane[rows, columns]
            for row, one in enumerate((part, *(law(part) for law in laws))):
                found[row, number] = float(down @ (one @ across)) / area
    return tuple(np.clip(found, 0.0, 1.0))


def _covered(first: float, last: float, length: int) -> tuple[slice, Float64, float]:
    """Return the pixels of an interval, how much it covers of each, and of all of them."""
    low, high = min(max(first, 0.0), length), min(max(last, 0.0), length)
    start, end = int(low), math.ceil(high)
    covered = np.ones(max(end - start, 0))
    if len(covered):
        covered[0] -= low - start
        covered[-1] -= end - high
    return slice(start, end), covered, max(high - low, 0.0)


def boxes_of(boxes: npt.ArrayLike) -> Float64:
    """Return boxes (n, 4) float64, checked; none of them is (0, 4)."""
    corners = table("boxes", boxes, ndim=None)
    if corners.size == 0:
        return np.empty((0, 4))
    if corners.ndim != 2 or corners.shape[1] != 4:
        raise ValueError(f"boxes must have shape (n, 4), got {corners.shape}")
    turned = (corners[:, :2] > corners[:, 2:]).any(axis=1)
    if turned.any():
        at = int(turned.argmax())
        raise ValueError(
            "boxes must be (x0, y0, x1, y1) with x0 <= x1 and y0 <= y1, "
            f"got {tuple(corners[at].tolist())} at [{at}]"
        )
    return corners


def flow_of(flow: npt.ArrayLike, shape: tuple[int, int]) -> Array:
    """Return the label of the picture's own motion, (H, W, 2) float, checked."""
    given = rectangular("flow", flow)
    if given.dtype.kind != "f":
        raise TypeError(f"flow must be an array of float, got {given.dtype}")
    if given.shape != (*shape, 2):
        raise ValueError(f"flow must have shape {(*shape, 2)}, got {given.shape}")
    return given

"""Labels that know about the weather: what it hides, how it moves, how far away it is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, Float64, pixels, rectangular, shares, table

if TYPE_CHECKING:
    from flurries.augment.slices import Labels
    from flurries.augment.weather import Weather

# From this opacity on a flake, not what is behind it, is what is seen at a pixel.
SEEN = 0.5


@dataclass(frozen=True, eq=False)
class Weathered:
    """A picture with weather, and its labels.

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
        The boxes and masks given: weather moves nothing in the picture.
    occlusion : (n,) float64 or None
        The mean opacity over each box, 0 to 1.
    coverage : (n,) float64 or None
        The mean opacity of flakes or drops over each box, without a veil.
    visibility : (n,) float64 or None
        The share of each box in which more than half of the light is the picture's own.
    flow : (H, W, 2) float32 or None
        The flow given, with the weather's own motion where flakes, drops or the texture hide more
        than half. Pixels per frame.
    depth : (H, W) float32 or None
        The depth given, with the weather's own where they hide more than half. Metres. A veil has
        no depth and no motion. Holes in the depth given, NaN or 0, stay holes.
    soft_flow, soft_depth : like `flow` and `depth`, or None
        Means of picture and weather, weighted by what is seen of each; for the depth the harmonic
        mean.
    motion : (H, W, 2) float32 or None
        Motion of the weather, pixels (x, y) per frame: at each pixel of what is densest there.
    falling : (H, W, 4) float32 or None
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
    flow: Array | None = None
    depth: Array | None = None
    soft_flow: Array | None = None
    soft_depth: Array | None = None
    motion: Array | None = None
    falling: Array | None = None

    @property
    def layer(self) -> Array:
        """(H, W, 4) float32: the weather alone, display values premultiplied with its opacity."""
        return layer_of(self.alpha, self.color)


def hidden(
    alpha: Array, falls: Labels | None, *, corners: Float64 | None, flow: Array | None,
    depth: Array | None, came: Array | None, motion: bool,
) -> dict[str, Any]:  # fmt: skip
    """Return the fields of `Weathered` that follow from labels before it; holes stay holes."""
    found: dict[str, Any] = {}
    if falls is None:
        return found
    if corners is not None:
        found["occlusion"] = occlusion(alpha, corners)
        found["coverage"] = occlusion(np.clip(falls.alpha, 0.0, 1.0), corners)
        found["visibility"] = occlusion((alpha < SEEN).astype(np.float32), corners)
    # A layer of the texture alone may be denser than all of them, which are smoother.
    seen = (falls.most.opacity > SEEN) & (alpha > SEEN)
    left = 1.0 - falls.alpha
    if flow is not None:
        found["flow"] = np.where(seen[..., None], falls.most.motion, flow).astype(np.float32)
        found["soft_flow"] = (left[..., None] * flow + falls.motion).astype(np.float32)
    if depth is not None:
        nearer = np.where(seen, np.minimum(falls.most.depth, depth), depth)
        soft = 1.0 / (left / depth + falls.nearness)
        if came is not None:
            holes = np.isnan(came) | (came == 0.0)
            np.copyto(nearer, came, where=holes & ~seen)
            soft[holes] = came[holes]
        found["depth"] = nearer.astype(np.float32)
        found["soft_depth"] = soft.astype(np.float32)
    if motion:
        found["motion"] = falls.most.motion
        parts = (falls.motion, falls.nearness[..., None], falls.alpha[..., None])
        found["falling"] = np.concatenate(parts, axis=-1)
    return found


def layer_of(alpha: Array, color: tuple[float, ...]) -> Array:
    """Return (..., 4) float32: a color, premultiplied with an opacity."""
    layer = np.empty((*alpha.shape, 4), np.float32)
    np.multiply(alpha[..., None], np.asarray(color, np.float32), out=layer[..., :3])
    layer[..., 3] = alpha
    return layer


def thicker(weather: Weather, given: Any, fps: float, depth: Any) -> Array:
    """Return an opacity with that of a weather over it, of a picture (H, W) or a film (T, H, W)."""
    before = rectangular("alpha", given)
    if before.dtype.kind != "f" or before.ndim not in (2, 3) or before.size == 0:
        raise ValueError(
            "alpha must be float of shape (H, W), or (T, H, W) for a film, got "
            f"{before.dtype} {before.shape}"
        )
    clear = np.zeros(before.shape, np.float32)
    how: dict[str, Any] = {} if before.ndim == 2 else {"fps": fps}
    made = weather.clip if how else weather
    _, layer = made(clear, depth=depth, return_layer=True, **how)
    return np.asarray(1.0 - (1.0 - before) * (1.0 - layer[..., 3]), before.dtype)


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
    corners = boxes_of(boxes)
    height, width = plane.shape
    sums = np.zeros((height + 1, width + 1))
    np.cumsum(np.cumsum(plane, axis=0, dtype=np.float64), axis=1, out=sums[1:, 1:])
    x = np.clip(corners[:, 0::2], 0.0, width)
    y = np.clip(corners[:, 1::2], 0.0, height)

    def upto(column: Float64, row: Float64) -> Float64:
        """The integral from the corner of the picture: bilinear between corners of pixels."""
        j = np.minimum(column.astype(np.int64), width - 1)
        i = np.minimum(row.astype(np.int64), height - 1)
        right, down = column - j, row - i
        upper = sums[i, j] + right * (sums[i, j + 1] - sums[i, j])
        lower = sums[i + 1, j] + right * (sums[i + 1, j + 1] - sums[i + 1, j])
        return np.asarray(upper + down * (lower - upper))

    hidden = (
        upto(x[:, 1], y[:, 1]) - upto(x[:, 0], y[:, 1])
        - upto(x[:, 1], y[:, 0]) + upto(x[:, 0], y[:, 0])
    )  # fmt: skip
    area = (x[:, 1] - x[:, 0]) * (y[:, 1] - y[:, 0])
    share = np.divide(hidden, area, out=np.full(len(area), np.nan), where=area > 0.0)
    return np.asarray(np.clip(share, 0.0, 1.0))


def boxes_of(boxes: npt.ArrayLike) -> Float64:
    """Return boxes (n, 4) float64, checked; none of them is (0, 4)."""
    corners = table("boxes", boxes, ndim=None)
    if corners.size == 0:
        return np.empty((0, 4))
    if corners.ndim != 2 or corners.shape[1] != 4:
        raise ValueError(f"boxes must have shape (n, 4), got {corners.shape}")
    turned = (corners[:, :2] > corners[:, 2:]).any(axis=1)
    if turned.any():
        first = int(turned.argmax())
        raise ValueError(
            "boxes must be (x0, y0, x1, y1) with x0 <= x1 and y0 <= y1, "
            f"got {tuple(corners[first].tolist())} at [{first}]"
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

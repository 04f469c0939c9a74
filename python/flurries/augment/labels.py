"""Labels that know about the weather: what it hides, how it moves, how far away it is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64, pixels, rectangular, shares, table
from flurries.augment.air import Here
from flurries.augment.pictures import layer_of

# Labels that are made when one of them is asked for.
_LATER = ("flow", "depth", "soft_flow", "soft_depth", "disparity", "weather_disparity",
          "motion", "falling")  # fmt: skip

# From this opacity on a flake, not what is behind it, is what is seen at a pixel.
SEEN = 0.5

# Pixels whose labels are made at once, so that sums stay in a cache.
_BLOCK = 1 << 15

# How opaque some flakes are, (H, W); their motion, pixels (x, y) per frame, and one over their
# depth, 1/m, (3, H, W); or what those are at one metre, (3, 1, 1), and their depth.
Slice: TypeAlias = tuple[Array, Array, Any]


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
    _mixture: Callable[[], dict[str, Any]] | None = field(default=None, repr=False)

    def __getattr__(self, name: str) -> Any:
        if name not in _LATER:
            raise AttributeError(f"a Weathered has no attribute {name!r}")
        # All of them, when the first is asked for: they cost several times what the picture does.
        # Threads that ask at once make the same.
        made = self._mixture
        if name not in vars(self):
            vars(self).update(dict.fromkeys(_LATER) | (made() if made else {}), _mixture=None)
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
        means = _means(alpha, corners, veil)
        found["occlusion"], found["visibility"], found["coverage"] = means
    if isinstance(masks, np.ndarray) and masks.shape[-2:] == alpha.shape:
        found |= _instances(alpha.reshape(-1), masks)
    return found


def _instances(alpha: Array, masks: Array) -> dict[str, Any]:
    """Return what is hidden of instances; nothing of what are no masks of them."""
    planes = alpha, alpha < SEEN
    if masks.ndim == 2 and masks.dtype.kind in "iu":
        flat = masks.reshape(-1)
        # Summed along runs of one number, of which there are few.
        first = np.flatnonzero(np.append(True, flat[1:] != flat[:-1]))
        numbers, own = np.unique(flat[first], return_inverse=True)
        runs = [np.add.reduceat(plane, first, dtype=np.float64) for plane in planes]
        each = [np.bincount(own, run) for run in (*runs, np.diff(first, append=flat.size))]
        numbers, *sums, sizes = (one[numbers != 0] for one in (numbers, *each))
    elif masks.ndim == 3 and masks.dtype.kind == "b":
        numbers, rows = np.arange(len(masks)), masks.reshape(len(masks), alpha.size)
        sums = [np.array([p[row].sum(dtype=np.float64) for row in rows]) for p in planes]
        sizes = np.count_nonzero(rows, axis=1)
    else:
        return {}
    with np.errstate(invalid="ignore"):
        occluded, seen = (one / sizes for one in sums)
    return {"instances": numbers, "instance_occlusion": occluded, "instance_visibility": seen}


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
    means: Float64 = _means(plane, boxes_of(boxes))[0]
    return means


def _means(alpha: Array, corners: Float64, veil: Any = 0.0) -> Float64:
    """Return of each box the mean opacity, the share that is seen, and the first without a veil."""
    found = np.zeros((len(corners), 3))
    plane, haze = (veil, 0.0) if isinstance(veil, np.ndarray) else (alpha[:0], veil)
    if veil is alpha:
        # Where all is veil, nothing is hidden by anything else.
        plane, haze = alpha[:0], 1.0
    _core.box_means(found, corners, alpha, plane, (SEEN, haze))
    return np.ascontiguousarray(found.T)


def boxes_of(boxes: npt.ArrayLike) -> Float64:
    """Return boxes (n, 4) float64, checked; none of them is (0, 4)."""
    corners = table("boxes", boxes, ndim=None)
    if corners.size == 0:
        return np.empty((0, 4))
    if corners.ndim != 2 or corners.shape[1] != 4:
        raise ValueError(f"boxes must have shape (n, 4), got {corners.shape}")
    turned = corners[:, :2] > corners[:, 2:]
    if turned.any():
        at = int(turned.any(axis=1).argmax())
        raise ValueError(
            "boxes must be (x0, y0, x1, y1) with x0 <= x1 and y0 <= y1, "
            f"got {tuple(corners[at].tolist())} at [{at}]"
        )
    return corners


def flow_of(flow: npt.ArrayLike, shape: tuple[int, int]) -> Array:
    """Return the label of the picture's own motion, (H, W, 2) float, checked."""
    given, wanted = rectangular("flow", flow), (*shape, 2)
    if given.dtype.kind != "f":
        raise TypeError(f"flow must be an array of float, got {given.dtype}")
    if given.shape != wanted:
        raise ValueError(f"flow must have shape {wanted}, got {given.shape}")
    return given


def mixture_of(
    here: Here, alpha: Array, flow: Array | None, motion: bool, fps: float
) -> dict[str, Any]:
    """Return the labels of what is seen of picture and weather; holes stay holes."""
    depth, came, (height, width) = here.distances.given, here.distances.came, here.view.shape
    parts, parallax = slices(here, fps), here.view.focal * 2.0 * here.view.eyes

    def block(rows: slice) -> dict[str, Array]:
        found: dict[str, Array] = {}
        planes, most = falling_of(here, parts, fps, rows)
        # A layer of the texture alone may be denser than all of them, which are smoother.
        seen, left = (most[3] > SEEN) & (alpha[rows] > SEEN), 1.0 - planes[3]
        way = np.moveaxis(most[:2], 0, -1)
        if flow is not None:
            soft = left[..., None] * flow[rows] + np.moveaxis(planes[:2], 0, -1)
            found["flow"] = np.where(seen[..., None], way, flow[rows]).astype(np.float32)
            found["soft_flow"] = soft.astype(np.float32)
        if depth is not None:
            with np.errstate(divide="ignore"):
                own, where = _rows(depth, rows), 1.0 / most[2]
                nearer = np.where(seen & (where < own), where, own)
                soft = 1.0 / (left / own + planes[2])
            if came is not None:
                holes = np.isnan(came[rows]) | (came[rows] == 0.0)
                np.copyto(nearer, came[rows], where=holes & ~seen)
                np.copyto(soft, came[rows], where=holes)
            found["depth"], found["soft_depth"] = nearer, soft
            if parallax:
                found["disparity"] = np.float32(parallax) / np.where(nearer == 0.0, np.nan, nearer)
        if parallax:
            found["weather_disparity"] = np.float32(parallax) * most[2]
        if motion:
            found["motion"], found["falling"] = way, np.moveaxis(planes, 0, -1)
        return found

    step = max(_BLOCK // width, 1)
    blocks = [block(slice(start, start + step)) for start in range(0, height, step)]
    return {name: np.concatenate([one[name] for one in blocks]) for name in blocks[0]}


def falling_of(here: Here, parts: list[Slice], fps: float, rows: slice) -> tuple[Array, Array]:
    """Return some rows of `Weathered.falling`, and the same of the densest slice of a pixel."""
    # (4, h, w) both; of the densest motion and nearness are not premultiplied.
    height, width = here.view.shape
    planes, most = np.zeros((2, 4, len(range(height)[rows]), width), np.float32)
    left, (near, chosen) = 1.0 - planes[3], np.zeros((2, *planes.shape[1:]), np.float32)
    if here.kind == "fog" and here.extinction > 0.0:
        # Fog moves as the mean of its patches and is nowhere in particular.
        most[0], most[1] = here.drift(fps)
    for whole, values, depth in parts:
        opacity, own = whole[rows], _rows(values, rows)
        weight, denser = left * opacity, opacity > most[3]
        left -= weight
        np.maximum(most[3], opacity, out=most[3])
        if depth is None:
            planes[:3] += weight * own
            np.copyto(most[:3], own, where=denser)
        else:
            # Before a wall inside the layer its flakes are nearer than the wall.
            nearness = 1.0 / np.minimum(depth, _rows(here.distances.plane, rows))
            near += weight * nearness
            np.copyto(chosen, nearness, where=denser)
    if parts and depth is not None:
        planes[:3] += values * near
        np.copyto(most[:3], values * chosen, where=chosen > 0.0)
    planes[3] = 1.0 - left
    return planes, most


def _rows(plane: Array, rows: slice) -> Array:
    """Return rows of planes, which may have one for all."""
    return plane if plane.shape[-2] == 1 else plane[..., rows, :]


def slices(here: Here, fps: float) -> list[Slice]:
    """Return all that falls, near slices first: drawn flakes, then layers of sheets."""
    found, shape, request = [], here.view.shape, here.request(steps=(-0.5 / fps, 0.5 / fps))
    if request is not None:
        flakes = _core.fall(request)
        _, rows, others = _core.flake_rows(flakes)
        plane, number = np.empty(shape, np.float32), np.zeros(shape, np.int32)
        _core.particle_draw(plane, flakes, request.window, here.depth, number)
        _core.sheet_read(plane, (0, 0), [], None, True, (plane.copy(), here.falling.gain))
        # At each pixel the one that it shows most; one without any has no opacity either.
        own = np.column_stack([others[:, 2:] - others[:, :2], 1.0 / rows[:, 5]]).astype(np.float32)
        if len(rows):
            found.append((plane, np.moveaxis(own[number], -1, 0), None))
    pace = here.view.focal / fps
    speed = np.array([*here.velocity, 1.0 / pace], np.float32).reshape(3, 1, 1) * pace
    for (near, far), layers in itertools.groupby(here.layers, lambda layer: layer[4:]):
        plane, depth = np.empty(shape, np.float32), np.float32(math.sqrt(near * far))
        _core.sheet_read(plane, (0, 0), list(layers), here.depth, True)
        found.append((plane, speed, depth))
    return found

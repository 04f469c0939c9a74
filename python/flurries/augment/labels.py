"""Labels that know about the weather: what it hides, how it moves, how far away it is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64, pixels, rectangular, shares, table
from flurries.augment.air import Here
from flurries.augment.pictures import layer_of
from flurries.effects.air import Air

# From this opacity on a flake, not what is behind it, is what is seen at a pixel.
SEEN = 0.5

# Depths that drawn flakes are sorted into.
_SLABS = 8

# Flakes at about one depth: how opaque, (H, W); their motion, (H, W, 2) or (1, 1, 2), pixels (x, y)
# per frame; and their depth, (H, W) or (1, 1), metres.
Slice: TypeAlias = tuple[Array, Array, Array]


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


def mixture_of(
    here: Here, alpha: Array, flow: Array | None, motion: bool, fps: float
) -> dict[str, Any]:
    """Return the labels of what is seen of picture and weather; holes stay holes."""
    planes, (most, way, where) = falling_of(here, fps)
    depth, came, found = here.distances.given, here.distances.came, dict[str, Any]()
    # A layer of the texture alone may be denser than all of them, which are smoother.
    seen = (most > SEEN) & (alpha > SEEN)
    left = 1.0 - planes[3]
    if flow is not None:
        soft = left[..., None] * flow + np.moveaxis(planes[:2], 0, -1)
        found["flow"] = np.where(seen[..., None], way, flow).astype(np.float32)
        found["soft_flow"] = soft.astype(np.float32)
    if depth is not None:
        nearer = np.where(seen, np.minimum(where, depth), depth)
        nearness = left / depth + planes[2]
        soft = np.divide(1.0, nearness, out=np.full_like(nearness, np.inf), where=nearness > 0.0)
        if came is not None:
            holes = np.isnan(came) | (came == 0.0)
            np.copyto(nearer, came, where=holes & ~seen)
            soft[holes] = came[holes]
        found["depth"] = nearer.astype(np.float32)
        found["soft_depth"] = soft.astype(np.float32)
    if here.view.eyes:
        parallax = here.view.focal * 2.0 * here.view.eyes
        found["weather_disparity"] = np.asarray(parallax / where, np.float32)
        if depth is not None:
            known = np.where(nearer == 0.0, np.nan, nearer)
            found["disparity"] = np.asarray(parallax / known, np.float32)
    if motion:
        found["motion"] = way
        found["falling"] = np.ascontiguousarray(np.moveaxis(planes, 0, -1))
    return found


def falling_of(here: Here, fps: float) -> tuple[Array, Slice]:
    """Return the planes of `Weathered.falling`, and at each pixel the slice that is densest."""
    shape = here.view.shape
    left, densest = np.ones(shape, np.float32), np.zeros(shape, np.float32)
    planes, most = np.zeros((4, *shape), np.float32), np.zeros((3, *shape), np.float32)
    most[2] = np.inf
    if here.kind == "fog" and here.extinction > 0.0:
        # Fog moves as the mean of its patches and is nowhere in particular.
        most[0], most[1] = here.drift(fps)
    for opacity, motion, depth in slices(here, fps):
        weight = left * opacity
        left -= weight
        across, down = motion[..., 0], motion[..., 1]
        planes[0] += weight * across
        planes[1] += weight * down
        planes[2] += weight / depth
        seen = opacity > densest
        np.copyto(densest, opacity, where=seen)
        for known, value in zip(most, (across, down, depth), strict=True):
            np.copyto(known, value, where=seen)
    planes[3] = 1.0 - left
    return planes, (densest, np.ascontiguousarray(np.moveaxis(most[:2], 0, -1)), most[2])


def slices(here: Here, fps: float) -> list[Slice]:
    """Return all that falls, near slices first."""
    found = []
    request = here.request(steps=(-0.5 / fps, 0.5 / fps))
    if request is not None:
        (one,) = request.classes
        first, full, last, end = one.shown
        inner = np.geomspace(full, last, _SLABS + 1)[1:-1].tolist()
        bounds = [(first, full), *((edge, edge) for edge in inner), (last, end)]
        for near, far in itertools.pairwise(bounds):
            part = _drawn(here, request._replace(classes=[one._replace(shown=(*near, *far))]))
            found += [] if part is None else [part]
    focal, speed = here.view.focal, np.asarray(here.velocity)
    for layer, own in zip(here.layers, here.sheets.layers if here.layers else (), strict=True):
        plane = np.empty(here.view.shape, np.float32)
        _core.sheet_read(plane, (0, 0), [layer], here.depth, True)
        depth = here.near * own.depth
        step = (speed * (focal / depth / fps)).astype(np.float32)
        # Before a wall inside the layer its flakes are nearer than the wall.
        near = np.minimum(np.float32(depth), here.distances.plane)
        found.append((plane, step.reshape(1, 1, 2), near))
    return found


def _drawn(here: Here, request: Air) -> Slice | None:
    """Return some of the drawn flakes: at each pixel the one that it shows most says how fast."""
    flakes = _core.fall(request)
    _, rows, others = _core.flake_rows(flakes)
    if len(rows) == 0:
        return None
    shape = here.view.shape
    plane, number = np.empty(shape, np.float32), np.empty(shape, np.int32)
    _core.particle_draw(plane, flakes, request.window, here.depth, number)
    opacity = np.empty(shape, np.float32)
    _core.sheet_read(opacity, (0, 0), [], None, True, (plane, here.falling.gain))
    motion = (others[:, 2:] - others[:, :2]).astype(np.float32)
    # A pixel without any has no opacity either.
    return opacity, motion[number], rows[:, 5].astype(np.float32)[number]

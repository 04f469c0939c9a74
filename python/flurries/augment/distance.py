"""The depth of a picture: given, or a plane with a horizon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, Float64, depths, real, rectangular, suggesting
from flurries._kept import kept
from flurries._warnings import warn_of_units
from flurries.effects.strength import BACKDROP
from flurries.io.color import to_unit
from flurries.scene.depth import DepthMap

Depth: TypeAlias = Any

# Depths that stand for all of a picture's when its mean loss of contrast is worked out.
QUANTILES = 64
_MIDDLES = np.arange(1, 2 * QUANTILES, 2)

# Between depths of infinity no other could be found, metres.
_FARTHEST = np.float32(1e9)

# How wide the bend at the horizon is: edges that no picture has would show in fog.
_BEND = 0.1


@suggesting
@dataclass(frozen=True, kw_only=True)
class Ground:
    """A plane with a horizon: a depth for pictures whose depth is unknown.

    Parameters
    ----------
    horizon : float
        Place of the horizon, as a share of the picture's height from the top.
    height : float
        Height of the camera above the plane, metres.
    far : float
        Depth of everything above the horizon, metres: between a sky's and that of things before it.

    Notes
    -----
    A row y px below the horizon is at ``1 / (y / (focal height) + 1 / far)``, with the bend at the
    horizon rounded over a tenth of the picture's height. This is plausible for pictures that are
    taken outdoors at eye level. Give the depth where it is known.
    """

    horizon: float = 0.45
    height: float = 1.6
    far: float = 25.0

    def __post_init__(self) -> None:
        limits = {"horizon": (-10.0, 10.0), "height": (1e-3, 1e6), "far": (1e-3, 1e9)}
        for name, (low, high) in limits.items():
            vars(self)[name] = real(name, vars(self)[name], low=low, high=high)

    def rows(self, shape: tuple[int, int], focal: float) -> Array:
        """Return the depth of each row, (H, 1) float32 metres; `focal` in pixels."""
        below = _below(np.arange(shape[0]), self.horizon, shape[0])
        inverse = below / (focal * self.height) + 1.0 / self.far
        return np.asarray(1.0 / inverse[:, None], np.float32)

    @classmethod
    def from_depth(cls, depth: npt.ArrayLike, *, focal: float = 1.2) -> Ground:
        """Return the plane that a depth shows, for other pictures of the same camera.

        Parameters
        ----------
        depth : (H, W)
            Metres; infinity where nothing stands, 0 or NaN where it is not known.
        focal : float
            Focal length, in lengths of the picture's longer side.

        Returns
        -------
        Ground
            Its `far` is the median of the known depths in the upper quarter, or the depth of a sky.

        Notes
        -----
        Medians of the lower half's rows are fitted with planes of all horizons in steps of 0.005 of
        the height by least squares of 1 / depth; rows farthest from the best are left out once.
        """
        given = rectangular("depth", depth)
        if given.ndim != 2 or given.dtype.kind != "f" or min(given.shape) < 8:
            raise ValueError(
                f"depth must be (H, W) float of 8 px at least, got {given.dtype} {given.shape}"
            )
        lens = real("focal", focal, low=0.05, high=1e3) * max(given.shape)
        plane = given.astype(np.float64)
        plane[plane == 0.0] = np.nan
        if (plane < 0.0).any():
            raise ValueError(f"depth must not be negative, got {np.nanmin(plane):g}")
        height = len(plane)
        upper = plane[: height // 4]
        upper = upper[np.isfinite(upper)]
        far = float(np.median(upper)) if upper.size else BACKDROP
        lower = np.isfinite(plane[height // 2 :]).mean(axis=1) > 0.5
        rows = height // 2 + np.flatnonzero(lower)
        if len(rows) < 4:
            raise ValueError("depth must be known in the lower rows of the picture")
        near = np.array([np.nanmedian(1.0 / plane[row]) for row in rows]) - 1.0 / far
        horizons = np.arange(0.0, 0.95, 0.005)
        for share in (0.75, 1.0):
            below = np.stack([_below(rows, horizon, height) for horizon in horizons])
            slopes = (below * near).sum(axis=1) / (below**2).sum(axis=1)
            errors = (near - slopes[:, None] * below) ** 2
            best = int(errors.sum(axis=1).argmin())
            kept = errors[best] <= np.quantile(errors[best], share)
            rows, near = rows[kept], near[kept]
        spread = float(((near - near.mean()) ** 2).sum())
        if not slopes[best] > 0.0 or float(errors[best].sum()) > 0.1 * spread:
            raise ValueError("depth must show a plane in its lower rows: none was found")
        return cls(horizon=float(horizons[best]), height=1.0 / (slopes[best] * lens), far=far)


def _below(rows: Array, horizon: float, height: int) -> Float64:
    """Return the pixels of rows below the horizon, with the bend rounded."""
    bend = _BEND * height
    return np.asarray(bend * np.logaddexp(0.0, (rows + 0.5 - horizon * height) / bend))


def ground_of(value: Any) -> Ground | None:
    """Return a ground, also from its fields as JSON and YAML have them."""
    if value is None or isinstance(value, Ground):
        return value
    if not isinstance(value, Mapping):
        raise TypeError(f"ground must be a Ground, a dict of its fields, or None, got {value!r}")
    return Ground(**value)


@dataclass(frozen=True)
class Distances:
    """The depth of one picture."""

    # (H, W), (H, 1) or (1, 1) float32, metres.
    plane: Array
    # What the caller gave, infinity and all, its holes filled; and as it came where it has holes.
    given: Array | None = None
    came: Array | None = None

    @cached_property
    def quantiles(self) -> Float64:
        """Depths of equally many pixels each, (n,) metres."""
        if self.plane.size <= QUANTILES:
            return np.asarray(self.plane.reshape(-1), np.float64)
        # An even sample: to sort all depths would cost more than the weather.
        step = max(int((self.plane.size / 1024) ** 0.5), 1)  # Some thousand pixels.
        sample = self.plane[::step, ::step] if self.plane.shape[1] > 1 else self.plane
        ordered = np.sort(sample, axis=None)[_MIDDLES * sample.size // (2 * QUANTILES)]
        return np.asarray(np.minimum(ordered, _FARTHEST), np.float64)

    @property
    def end(self) -> float:
        """The depth of a sky: twice the farthest finite depth, metres."""
        far = self.farthest
        if far == np.inf:
            far = float(np.max(self.plane, where=self.plane < np.inf, initial=0.0))
        return max(BACKDROP, 2.0 * far)

    @cached_property
    def farthest(self) -> float:
        return float(self.plane.max())

    def full(self, shape: tuple[int, int]) -> Array:
        """Return (H, W) float32, contiguous."""
        kept: Array = vars(self).get("_full", self.plane)
        if kept.shape != shape:
            kept = vars(self)["_full"] = np.ascontiguousarray(np.broadcast_to(self.plane, shape))
        return kept


def distances_of(
    depth: Depth, shape: tuple[int, int], ground: Ground | None, focal: float
) -> Distances:
    """Return the depth of a picture; infinity is a sky."""
    if depth is None:
        return _grounded(shape, ground, focal)
    if isinstance(depth, DepthMap):
        if not isinstance(depth.source, np.ndarray):
            raise TypeError("depth must hold its greys as an array, got a DepthMap of a file")
        plane = np.ascontiguousarray(depth.depth_of(to_unit(depth.source)))
    elif not isinstance(depth, (np.ndarray, list, tuple)) and np.ndim(depth) == 0:
        plane = np.full((1, 1), real("depth", depth, low=1e-6, high=1e9), np.float32)
        return Distances(plane, plane)
    elif (given := rectangular("depth", depth)).dtype.kind != "f":
        raise TypeError(
            "depth must be a number, an array of float in metres or a DepthMap, got "
            f"{given.dtype}; relative depths become metres through flurries.scene.DepthMap"
        )
    else:
        with np.errstate(over="ignore"):
            plane = np.ascontiguousarray(given, np.float32)
    if plane.shape != shape:
        raise ValueError(f"depth must have shape {shape}, got {plane.shape}")
    if not isinstance(depth, DepthMap):
        warn_of_units("depth", plane)
    # The least is NaN where any is.
    came = None if plane.min(initial=np.inf) > 0.0 else plane
    if came is not None:
        holes: Array = np.isnan(plane) | (plane == 0.0)
        plane = depths("depth", filled(plane, holes) if holes.any() else plane)
    return Distances(plane, plane, came)


def filled(plane: Array, holes: Array) -> Array:
    """Return depths with holes filled from their row; rows of holes are as the nearest other."""
    if holes.all():
        raise ValueError("depth must be known somewhere: 0 and NaN are holes, got nothing else")
    rows = np.flatnonzero(~holes.all(axis=1))
    columns = _nearest(~holes[rows])
    whole = np.take_along_axis(plane[rows], columns, axis=1)
    there = np.zeros((1, len(plane)), bool)
    there[0, rows] = True
    return np.asarray(whole[np.searchsorted(rows, _nearest(there)[0])])


def _nearest(known: Array) -> Array:
    """Return for each place of each row the nearest known one, the lower of two."""
    count = known.shape[1]
    places = np.arange(count)
    before = np.maximum.accumulate(np.where(known, places, -2 * count), axis=1)
    after = np.minimum.accumulate(np.where(known, places, 3 * count)[:, ::-1], axis=1)[:, ::-1]
    return np.where(places - before <= after - places, before, after)


@kept(32)
def _grounded(shape: tuple[int, int], ground: Ground | None, focal: float) -> Distances:
    plane = np.full((1, 1), BACKDROP, np.float32) if ground is None else ground.rows(shape, focal)
    plane.flags.writeable = False
    return Distances(plane)

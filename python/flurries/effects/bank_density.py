"""The density of a bank of mist: slices of depth with a profile and structure, solved for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flurries import gas
from flurries._contract import Array, Float64
from flurries.effects.bank_texture import COARSE, MARGIN, Waves, coarse_shape
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Slices of a gas that is not even, and groups of them whose short waves are one texture.
SLICES, GROUPS = 6, 2

# A bank's density is a Gaussian with this many sigma to a side of its box, and ends at 1.5 sides.
SIGMAS = 3.6

# Samples along each side of a picture by which its mean transmittance is found, and steps to it.
SAMPLES, STEPS = 64, 8


class Slices(NamedTuple):
    edges: list[float]  # Where they begin and end, planar depth.
    places: list[float]  # The depths that stand for them.
    dense: Array  # (n, rows, columns) extinction on the coarse grid, per metre.
    lumps: list[Array | None]  # Of each slice its structure there, over its mean.
    detail: tuple[Array, float] | None = None  # Short waves (H, W) and their strength.


@dataclass(frozen=True, eq=False)
class Density:
    mist: Any  # A `Mist`, settled.
    frame: Frame
    extinction: float  # Of an even gas of the same mean transmittance, per metre.
    reference: float  # That by which slices are chosen: each takes as much of the light.

    def slices(self) -> Iterator[Slices]:
        """Yield the slices of a frame, near ones first, by groups."""
        edges, places = self._cut()
        shown, waves = self._shown(edges), self._waves
        long: list[Any] = [waves.long(at, n) if waves else None for n, at in enumerate(places)]
        mean = np.float32(self.extinction * self._gain(edges, long))
        for group, numbers in enumerate(np.array_split(np.arange(len(places)), GROUPS)):
            seen = [number for number in numbers.tolist() if shown[number + 1] > shown[number]]
            if not seen:
                continue
            dense = np.empty((len(seen), *coarse_shape(self.frame)), np.float32)
            for slot, number in enumerate(seen):
                dense[slot] = mean * self.profile(self.rays, places[number])
                if waves is not None:
                    dense[slot] *= long[number]
            middle = float(np.mean([places[number] for number in numbers]))
            yield Slices(
                shown[seen[0] : seen[-1] + 2].tolist(), [places[number] for number in seen], dense,
                [long[number] for number in seen], waves.short(middle, group) if waves else None,
            )  # fmt: skip

    @cached_property
    def rays(self) -> Rays:
        """The rays of the coarse grid."""
        return Rays(self.frame, COARSE, MARGIN)

    @cached_property
    def _waves(self) -> Waves | None:
        mist = self.mist
        if mist.structure == 0.0:
            return None
        # The outer scale: no waves are longer than a bank, or than one sees.
        outer = mist.farthest if mist.center is None else min(mist.box)
        return Waves(self.frame, mist.wind, mist.structure, outer)

    def _cut(self) -> tuple[Float64, list[float]]:
        """Return the edges of all slices, planar depth, and the depths that stand for them."""
        mist, frame = self.mist, self.frame
        if mist.center is not None:
            away = np.array(mist.center) - frame.path.place(frame.t, fps=frame.fps)
            middle = float(frame.to_camera(away)[2])
            reach = 0.75 * float(np.linalg.norm(mist.box)) / math.sqrt(3.0) * 1.2
            edges = np.linspace(max(middle - reach, 0.0), max(middle + reach, 0.0), SLICES + 1)
            return edges, (0.5 * (edges[:-1] + edges[1:])).tolist()
        far, count = float(mist.box[2]), SLICES
        if self._waves is None and mist.top is None:
            count = 1
        share = np.arange(2 * count) / (2 * count) * -np.expm1(-self.reference * far)
        at = -np.log1p(-share) / self.reference
        return np.append(at[::2], far), at[1::2].tolist()

    def _shown(self, edges: Float64) -> Float64:
        """Return the edges of what is asked for and lies before a wall that nobody told of."""
        low, high = self.mist.depths or (0.0, math.inf)
        if self.mist.center is None and self.frame.depth is None:
            high = min(high, self.mist.backdrop)
        return np.clip(edges, low, max(high, low))

    def _gain(self, edges: Float64, long: list[Any]) -> float:
        """Return how much more gas a stirred mist has than an even one of the same visibility."""
        mist = self.mist
        if self._waves is None or mist.center is not None:
            return 1.0
        rows, columns = (slice(MARGIN, -MARGIN, 1 + side // SAMPLES) for side in long[0].shape)
        slant = np.sqrt(1.0 + self.rays.x**2 + self.rays.y**2)[rows, columns].astype(np.float64)
        visible = float(value_at(mist.visibility, self.frame.t))
        reach = np.minimum(visible / slant, edges[-1])
        thick = sum(
            np.clip(reach - edges[number], 0.0, edges[number + 1] - edges[number])
            * wave[rows, columns]
            for number, wave in enumerate(long)
        )
        per_metre, gain = gas.visibility(visible), 1.0
        thick, wanted = per_metre * slant * thick, np.exp(-per_metre * slant * reach).mean()
        for _ in range(STEPS):
            left = np.exp(-gain * thick)
            # Newton's steps come from below: the mean is a convex function of the gain.
            gain += float((left.mean() - wanted) / (left * thick).mean())
        return gain

    def profile(self, rays: Rays, depth: float) -> Array:
        """Return the mean density at a depth over the extinction, for each ray or row of them."""
        density: Any = np.float32(1.0)
        if self.mist.center is not None:
            squared = sum(part * part for part in self.from_middle(rays, depth))
            # The Gaussian holds as much gas as the box did.
            peak = SIGMAS**3 / math.tau**1.5
            density = np.float32(peak) * np.exp(np.float32(-0.5) * squared)
        if self.mist.top is not None:
            density = density / (1.0 + np.exp(self.height(rays, depth)))
        return np.asarray(density, np.float32)

    def height(self, rays: Rays, depth: float) -> Any:
        """Return how far rays at a depth are above the top, in its falloffs."""
        frame = self.frame
        height = -(frame.path.place(frame.t, fps=frame.fps)[1] + rays.along(1) * depth)
        return np.clip((height - self.mist.top) / self.mist.falloff, -60.0, 60.0)

    def from_middle(self, rays: Rays, depth: float) -> list[Any]:
        """Return the distance of rays at a depth from the bank's middle, house axes, in sigma."""
        place = self.frame.path.place(self.frame.t, fps=self.frame.fps)
        center, sides = self.mist.center, self.mist.box
        return [
            (place[axis] + rays.along(axis) * depth - center[axis]) * (SIGMAS / sides[axis])
            for axis in range(3)
        ]


class Rays:
    """Slopes of the rays of a frame's samples: x of columns (1, W), y of rows (H, 1)."""

    def __init__(self, frame: Frame, step: int = 1, margin: int = 0) -> None:
        # A sample every `step` px, and `margin` of them beyond each border.
        down, across = (
            (np.arange(-(-side // step) + 2 * margin) - margin + 0.5) * step for side in frame.shape
        )
        cx, cy = frame.camera.principal(frame.shape)
        self.x = ((across - cx) / frame.camera.focal).astype(np.float32)[None, :]
        self.y = ((down - cy) / frame.camera.focal).astype(np.float32)[:, None]
        self._matrix = frame.camera.matrix()

    @property
    def slopes(self) -> tuple[Array, Array]:
        """Slopes of columns (W,) and rows (H,)."""
        return self.x[0], np.ascontiguousarray(self.y[:, 0])

    def along(self, axis: int) -> Any:
        """Return the way of rays along a house axis for a depth of 1, (H, W), a row or a column."""
        across, down, ahead = self._matrix[axis].astype(np.float32)
        # Plain zeros keep a camera that is not rolled at a row or a column.
        sideways = across * self.x if across else 0.0
        return sideways + (down * self.y if down else 0.0) + ahead

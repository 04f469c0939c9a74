"""Mist with structure: slices of gas whose density has the spectrum of turbulence, k^(-11/3)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.effects.bank_texture import COARSE, MARGIN, Waves, coarse_shape
from flurries.effects.lighting import Base, add_light, lamp_shade, whole
from flurries.effects.sunlight import optics_of, scattered
from flurries.frame.layer import Shade
from flurries.frame.view import Frame
from flurries.io.color import srgb_to_linear

# Slices of what lies around the camera, and of a bank that is looked at from outside.
AROUND, OUTSIDE = 4, 6

# Groups of slices whose short waves are one texture.
HALVES = 2

# A bank's density is a Gaussian with this many sigma to a side of its box, and ends at 1.5 sides.
SIGMAS = 3.6

# Pixels of the cells in which the sun's light is found.
CELL = 8

# The sine of the lowest sun: light that comes in flatter takes no longer way through mist.
LOWEST = 0.1

# Cells along the longer side of a picture, in which the sky's light is found.
SKY_CELLS = 64

# The length over which gas dims what is below it, of the picture's height.
REACH = 1.0 / 16.0

# The share of the light that gas takes from what lies deep below it, and how thick it must be for
# that: both by eye, on dark, bright and busy photographs. With more of either mist is smoke.
TAKEN, STEEP = 0.45, 0.5


@dataclass(frozen=True, eq=False)
class Bank:
    """A bank of mist in the box of its particles; without a center it is all around the camera."""

    mist: Any  # A `Mist`, settled.
    # That by which slices are chosen, per metre: a slice takes as much of the light as another.
    extinction: float

    def draw(
        self, frame: Frame, extinction: float, base: Base, *, lit: bool
    ) -> tuple[Array, Array | None, Skylight]:
        """Return opacity (h, w) and light (h, w, 3) of the window as `Vapor` does, and the sky."""
        alpha, light, sky = frame.once_each(
            self, "bank", lambda: self._whole(frame, extinction, base, lit=lit)
        )
        plane = np.ascontiguousarray(frame.crop(alpha))
        return plane, None if light is None else np.ascontiguousarray(frame.crop(light)), sky

    def _whole(
        self, frame: Frame, extinction: float, base: Base, *, lit: bool
    ) -> tuple[Array, Array | None, Skylight]:
        """Return opacity and light of the whole frame, and its share of the sky's light."""
        has_top = self.mist.top is not None or self.mist.center is not None
        sky = Skylight(frame, extinction, has_top=has_top)
        if lit or frame.lights:
            return *self._lit(frame, extinction, base if lit else None, sky), sky
        slopes, depth = _Rays(frame).slopes, frame.depth
        total = np.zeros(frame.shape, np.float32)
        for edges, dense, detail in self._groups(frame, extinction):
            _core.gas_slices(total, dense, edges, detail, depth, slopes)
            sky.add(edges, dense)
        # In float32 the exponential is on vector lanes, that less one is not.
        np.exp(np.negative(total, out=total), out=total)
        return np.subtract(np.float32(1.0), total, out=total), None, sky

    def _groups(
        self, frame: Frame, extinction: float
    ) -> Iterator[tuple[list[float], Array, tuple[Array, float]]]:
        """Yield edges of some slices, their coarse extinction, and the short waves of all."""
        rays, edges = _Rays(frame, COARSE, MARGIN), self._edges(frame)
        places = (0.5 * (edges[:-1] + edges[1:])).tolist()
        # A bank has no waves that are longer than itself.
        mist = self.mist
        outer = math.inf if mist.center is None else min(mist.box)
        waves = Waves(frame, mist.wind, mist.structure, outer)
        fine = np.empty(frame.shape, np.float32)
        for half, part in enumerate(np.array_split(np.arange(len(places)), HALVES)):
            numbers = part.tolist()
            if not numbers:
                continue
            dense = np.empty((len(numbers), *coarse_shape(frame)), np.float32)
            for slot, number in enumerate(numbers):
                mean = np.float32(extinction) * self._density(frame, rays, places[number])
                dense[slot] = mean * waves.long(places[number], number)
            detail = waves.short([places[number] for number in numbers], half, fine)
            yield edges[numbers[0] : numbers[-1] + 2].tolist(), dense, detail

    def _lit(
        self, frame: Frame, extinction: float, base: Base | None, sky: Skylight
    ) -> tuple[Array, Array]:
        """Return opacity and light where the sun lights it, as bright as `base`, or lamps do."""
        slopes, grid = _Rays(frame).slopes, _Rays(frame, CELL)
        through = np.ones(frame.shape, np.float32)
        light = np.zeros((*frame.shape, 3), np.float32)
        for edges, dense, detail in self._groups(frame, extinction):
            sky.add(edges, dense)
            for number in range(len(dense)):
                ends = edges[number : number + 2]
                place = 0.5 * (ends[0] + ends[1])
                passed = np.zeros(frame.shape, np.float32)
                _core.gas_slices(passed, dense[number][None], ends, detail, frame.depth, slopes)
                np.exp(np.negative(passed, out=passed), out=passed)
                passed *= through
                taken = np.subtract(through, passed, out=through)
                if base is not None:
                    add_light(light, taken, self._sunny(frame, grid, place, extinction, base))
                if frame.lights:
                    glow = lamp_shade(whole(frame), [place], [1.0], optics_of(self.mist))
                    add_light(light, taken, glow)
                through = passed
        return np.subtract(np.float32(1.0), through, out=through), light

    def _edges(self, frame: Frame) -> Float64:
        """Return the edges of slices, planar depth."""
        mist, sides = self.mist, np.array(self.mist.box)
        if mist.center is None:
            low, high, count = mist.near, float(sides[2]), AROUND
        else:
            away = np.array(mist.center) - frame.path.place(frame.t, fps=frame.fps)
            middle = float(frame.to_camera(away)[2])
            reach = 0.75 * float(np.linalg.norm(sides)) / math.sqrt(3.0) * 1.2
            low, high, count = max(middle - reach, mist.near), middle + reach, OUTSIDE
        if mist.depths is not None:
            low, high = max(low, mist.depths[0]), min(high, mist.depths[1])
        if not high > low:
            return np.zeros(1)
        share = np.arange(count + 1) / count
        if mist.center is not None or self.extinction <= 0.0:
            return np.asarray(low + (high - low) * share)
        taken = -np.expm1(-self.extinction * (high - low))
        return np.append(low - np.log1p(-share[:-1] * taken) / self.extinction, high)

    def _density(self, frame: Frame, rays: _Rays, depth: float) -> Array:
        """Return the mean density at a depth, of the extinction, for each ray or row of them."""
        density: Any = np.float32(1.0)
        if self.mist.center is not None:
            squared = sum(part * part for part in self._from_middle(frame, rays, depth))
            # The Gaussian holds as much gas as the box did.
            peak = SIGMAS**3 / math.tau**1.5
            density = np.float32(peak) * np.exp(np.float32(-0.5) * squared)
        if self.mist.top is not None:
            density = density / (1.0 + np.exp(self._height(frame, rays, depth)))
        return np.asarray(density, np.float32)

    def _height(self, frame: Frame, rays: _Rays, depth: float) -> Any:
        """Return how far rays at a depth are above the top, in its falloffs."""
        height = -(frame.path.place(frame.t, fps=frame.fps)[1] + rays.along(1) * depth)
        return np.clip((height - self.mist.top) / self.mist.falloff, -60.0, 60.0)

    def _sunny(
        self, frame: Frame, rays: _Rays, depth: float, extinction: float, base: Base
    ) -> Shade:
        """Return the light of a slice of opaque gas."""
        assert frame.sun is not None
        sun, x, y = frame.sun, rays.x, rays.y
        way = frame.to_camera(sun.unit())
        cosine = -(x * way[0] + y * way[1] + way[2]) / np.sqrt(1.0 + x * x + y * y)
        thick = extinction * self._sunward(frame, rays, depth)
        reaches = np.exp((self.mist.forward - 1.0) * thick) * scattered(self.mist, cosine)
        white = (1.0 - sun.ambient) * srgb_to_linear(np.asarray(sun.color, np.float64))
        colors = sun.ambient * base.dim + reaches[..., None] * (white * base.sunny)
        return Shade(colors.astype(np.float32), float(CELL), (0, 0))

    def _sunward(self, frame: Frame, rays: _Rays, depth: float) -> Array:
        """Return the metres of the sun's light through the mean gas to a depth, (rows, columns)."""
        assert frame.sun is not None
        sun, way = frame.sun.unit(), np.zeros((len(rays.y), rays.x.size), np.float32)
        if self.mist.center is not None:
            # Through a Gaussian it is the tail of the normal law over its density (Mills' ratio).
            slant = -sun * SIGMAS / np.array(self.mist.box)
            along = np.linalg.norm(slant)
            parts = self._from_middle(frame, rays, depth)
            place = sum(part * to for part, to in zip(parts, slant / along, strict=True))
            way += _mills(np.maximum(place, -6.0)) / along
        elif self.mist.top is not None:
            height = self._height(frame, rays, depth)
            thick = self.mist.falloff * np.log1p(np.exp(-height)) * (1.0 + np.exp(height))
            way += thick / max(sun[1], LOWEST)
        # What the structure adds evens out: a lump that shaded itself would be a hole.
        way *= self._density(frame, rays, depth)
        return way

    def _from_middle(self, frame: Frame, rays: _Rays, depth: float) -> list[Any]:
        """Return the distance of rays at a depth from the bank's middle, house axes, in sigma."""
        place = frame.path.place(frame.t, fps=frame.fps)
        center, sides = self.mist.center, self.mist.box
        return [
            (place[axis] + rays.along(axis) * depth - center[axis]) * (SIGMAS / sides[axis])
            for axis in range(3)
        ]


def _mills(a: Any) -> Any:
    """Return the tail of the normal law from `a` on over its density, to 1 % (Boyd 1959)."""
    far = np.abs(a)
    ratio = math.pi / ((math.pi - 1.0) * far + np.sqrt(far * far + math.tau))
    return np.where(a < 0.0, math.sqrt(math.tau) * np.exp(0.5 * far * far) - ratio, ratio)


class _Rays:
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


class Skylight:
    """The sky's light in the slices of a bank, from the nearest on; without a top it is one."""

    def __init__(self, frame: Frame, extinction: float, *, has_top: bool) -> None:
        longest = max(frame.shape)
        self.cell = COARSE * math.ceil(longest / (COARSE * SKY_CELLS)) if has_top else longest
        self.extinction, self.has_top = extinction, has_top
        size = tuple(-(-side // self.cell) for side in frame.shape)
        self.ground: float | Array = math.inf
        if frame.depth is not None:
            rows, columns = (
                np.minimum(np.arange(count) * self.cell + self.cell // 2, side - 1)
                for count, side in zip(size, frame.shape, strict=True)
            )
            self.ground = frame.depth[rows[:, None], columns]
        # Where nothing is seen it has the sky's light.
        self.through, self.seen, self.bright = (np.full(size, v) for v in (1.0, 1e-6, 1e-6))

    def add(self, edges: list[float], density: Array) -> None:
        """Take slices behind the others, (n, rows, columns) extinction on the coarse grid."""
        if not self.has_top:
            return
        means = density[:, MARGIN:-MARGIN, MARGIN:-MARGIN]
        for axis in (1, 2):
            firsts = np.arange(0, means.shape[axis], self.cell // COARSE)
            counts = np.diff(firsts, append=means.shape[axis]).reshape(-1, *(1,) * (2 - axis))
            means = np.add.reduceat(means, firsts, axis=axis) / counts
        for number, mean in enumerate(np.asarray(means, np.float64)):
            thick = np.clip(self.ground - edges[number], 0.0, edges[number + 1] - edges[number])
            passed = self.through * np.exp(-mean * thick)
            taken = self.through - passed
            above = _above(len(mean)) @ (mean / self.extinction)
            self.bright += taken * (1.0 - TAKEN * -np.expm1(-STEEP * above))
            self.seen += taken
            self.through = passed

    def shade(self, frame: Frame, light: Float64) -> Shade:
        """Return the color of the gas in a sky of a light, (3,) linear."""
        colors = ((self.bright / self.seen)[..., None] * light).astype(np.float32)
        return Shade(colors, float(self.cell), (frame.window[0], frame.window[2]))


@kept(8)
def _above(rows: int) -> Float64:
    """Return the matrix of the mean of what is above each row, by the exponential law."""
    keep = math.exp(-1.0 / (REACH * rows))
    down = np.subtract.outer(np.arange(rows), np.arange(rows))
    matrix = np.where(down >= 0, (1.0 - keep) * keep ** np.maximum(down, 0), 0.0)
    # Above the picture it goes on as at its upper border.
    matrix[:, 0] += keep ** np.arange(1, rows + 1)
    return np.asarray(matrix)

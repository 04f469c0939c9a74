"""Mist with structure: a bank of gas with soft ends, in slices whose density varies at every scale.

A passive gas that turbulence stirs has a spectrum of density that falls as k^(-11/3) in three
dimensions (Kolmogorov 1941, Obukhov 1949), and the optical depth of a slab that is thicker than the
scales seen has the same slope in two. Each slice has a texture of that slope as the logarithm of
its density; its mean stays what the extinction says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from flurries import _core, gas
from flurries._contract import Array, Float64
from flurries.camera.tiles import tile_drift, tile_shift
from flurries.effects.sunlight import Scatter
from flurries.frame.needs import Cost
from flurries.frame.view import Frame
from flurries.io.color import srgb_to_linear
from flurries.motion.keys import Vector
from flurries.spectral.request import request

# Amplitudes of the texture fall as k^(-11/6), their squares as k^(-11/3), down to waves of 4 px.
EXPONENT, SHORTEST = 11.0 / 6.0, 4.0

# The largest tile of the texture, and what tiles share, px.
TILE, OVERLAP = 512, 64

# Slices of what lies around the camera, and of a bank that is looked at from outside.
AROUND, OUTSIDE = 4, 6

# A bank's density is a Gaussian with this many sigma to a side of its box, and ends at 1.5 sides.
SIGMAS = 3.6

# Seeds of the slices lie this far apart.
_STRIDE = 7919


@dataclass(frozen=True, eq=False, kw_only=True)
class Bank:
    """A bank of mist.

    Attributes
    ----------
    wind : Vector
        Metres per second, house axes.
    sides : (3,)
        Of its box, metres.
    center : (3,), optional
        Its middle in the world; it goes with the camera, and all around it, if not given.
    depths : (near, far), optional
        Only what lies between, metres.
    near : float
        Where it begins, metres.
    extinction : float
        That by which slices are chosen, per metre: a slice takes as much of the light as another.
    structure : float
        Root mean square of the logarithm of a slice's density.
    top : float, optional
        Height in the world above which it thins, metres, up; endless if not given.
    falloff : float
        How fast it thins there, metres.
    scatter : Scatter
        How it is lit.
    """

    wind: Vector
    sides: tuple[float, float, float]
    center: tuple[float, float, float] | None
    depths: tuple[float, float] | None
    near: float
    extinction: float
    structure: float
    top: float | None
    falloff: float
    scatter: Scatter

    def draw(self, frame: Frame, extinction: float, color: Any, *, lit: bool) -> Array:
        """Return opacity over the window (h, w), or premultiplied linear light (h, w, 4) if lit."""
        made = frame.once_each(
            self, "bank", lambda: self._whole(frame, extinction, color if lit else None)
        )
        top, bottom, left, right = frame.window
        return np.ascontiguousarray(made[top:bottom, left:right])

    def cost(self, frame: Frame, *, lit: bool) -> Cost:
        """Return what a frame's slices take."""
        slices, pixels = len(self._edges(frame)) - 1, frame.shape[0] * frame.shape[1]
        work = {"gas pixel": (4.0 if lit else 2.5) * slices * pixels, "mask pixel": float(pixels)}
        return Cost(work, f"{slices} slices", 4 * pixels, 40 * pixels)

    def _whole(self, frame: Frame, extinction: float, color: Any) -> Array:
        """Return the whole frame."""
        height, width = frame.shape
        rays = _Rays.of(frame)
        through = np.ones(frame.shape, np.float32)
        light = None if color is None else np.zeros((height, width, 3), np.float32)
        for place, thickness, density in self._slices(frame, rays):
            dense = self._texture(frame, place, rays.slice) * density
            depth = np.multiply(dense, thickness * rays.length, dtype=np.float32)
            passed = np.exp(np.float32(-extinction) * depth)
            if light is not None:
                shade = self._light(frame, rays, extinction, place, dense)
                own = srgb_to_linear(np.asarray(color, np.float64))
                taken = through * (1.0 - passed)
                light += taken[..., None] * (shade * own.astype(np.float32))
            through *= passed
            rays.slice += 1
        alpha = 1.0 - through
        if light is None:
            return alpha
        return np.concatenate([light, alpha[..., None]], axis=2)

    def _slices(self, frame: Frame, rays: _Rays) -> Iterator[tuple[float, Any, Array]]:
        """Yield each slice's depth, its thickness before what stands there, and its density."""
        edges = self._edges(frame)
        for first, last in pairwise(edges.tolist()):
            thickness: Any = np.float32(last - first)
            if frame.depth is not None:
                thickness = np.clip(frame.depth, first, last) - np.float32(first)
            place = 0.5 * (first + last)
            yield place, thickness, self._density(frame, rays, place)

    def _edges(self, frame: Frame) -> Float64:
        """Return where slices begin and end, planar depth."""
        if self.center is None:
            low, high, count = self.near, self.sides[2], AROUND
        else:
            away = np.array(self.center) - frame.path.place(frame.t, fps=frame.fps)
            middle = float(frame.to_camera(away)[2])
            reach = 0.75 * float(np.linalg.norm(self.sides)) / math.sqrt(3.0) * 1.2
            low, high, count = max(middle - reach, self.near), middle + reach, OUTSIDE
        if self.depths is not None:
            low, high = max(low, self.depths[0]), min(high, self.depths[1])
        if not high > low:
            return np.zeros(1)
        share = np.arange(count + 1) / count
        if self.center is not None or self.extinction <= 0.0:
            return low + (high - low) * share
        taken = -np.expm1(-self.extinction * (high - low))
        return np.append(low - np.log1p(-share[:-1] * taken) / self.extinction, high)

    def _density(self, frame: Frame, rays: _Rays, depth: float) -> Any:
        """Return the mean density at a depth, of the extinction, for each pixel or row."""
        place = frame.path.place(frame.t, fps=frame.fps)
        density: Any = np.float32(1.0)
        if self.center is not None:
            squared: Any = 0.0
            for axis in range(3):
                away = place[axis] + rays.along(axis) * depth - self.center[axis]
                squared = squared + (away * (SIGMAS / self.sides[axis])) ** 2
            # The Gaussian holds as much gas as the box did.
            peak = SIGMAS**3 / math.tau**1.5
            density = np.float32(peak) * np.exp(np.float32(-0.5) * squared)
        if self.top is not None:
            height = -(place[1] + rays.along(1) * depth)
            density = density / (1.0 + np.exp(np.clip((height - self.top) / self.falloff, -60, 60)))
        return np.asarray(density, np.float32)

    def _texture(self, frame: Frame, depth: float, slice_: int) -> Array:
        """Return the density of a slice over its mean, (H, W)."""
        if self.structure == 0.0:
            return np.ones(frame.shape, np.float32)
        side = min(max(16, 1 << (max(frame.shape) - 1).bit_length()), TILE)
        overlap = OVERLAP if max(frame.shape) > side else 0
        shift = self._shift(frame, depth, side, overlap)
        seed = (frame.seed + _STRIDE * slice_) % 2**62
        asked = request(
            frame.shape, drift=(0.0, 0.0), shift=shift, seed=seed,
            wavelengths=(SHORTEST, float(side)), exponent=EXPONENT, tile=side, overlap=overlap,
        )  # fmt: skip
        if frame.lap is not None:
            times = (frame.lap.first, frame.lap.end)
            begin, end = (
                self._shift(frame.later(t - frame.t), depth, side, overlap) for t in times
            )
            whole = np.ascontiguousarray((end - begin)[:, :, None])
            asked = asked._replace(lap=(np.zeros_like(whole), whole, frame.lap.part(frame.t)))
        field = np.empty(frame.shape, np.float32)
        _core.field(field, asked, None, False)
        # A logarithm of mean -s^2/2 and variance s^2 has the mean 1.
        spread = np.float32(self.structure)
        field *= spread
        field -= np.float32(0.5) * spread * spread
        return np.exp(field, out=field)

    def _shift(self, frame: Frame, depth: float, side: int, overlap: int) -> Float64:
        """Return how far a slice has moved at each tile, (rows, cols, 2) px."""
        moved = frame.travel(wind=self.wind) + np.array(frame.camera.offset)
        tiles: dict[str, Any] = {"tile": side, "overlap": overlap}
        shift = tile_drift(frame.shape, moved, frame.camera, near_depth=depth, **tiles)
        if frame.path.turns:
            shift = shift + tile_shift(frame.shape, frame.rotation(), frame.camera, **tiles)
        return np.asarray(shift)

    def _light(
        self, frame: Frame, rays: _Rays, extinction: float, depth: float, dense: Array
    ) -> Array:
        """Return the light that a slice sends here for each that it holds, linear (H, W, 3)."""
        assert frame.sun is not None
        sun, way = frame.sun, frame.to_camera(frame.sun.unit())
        white = srgb_to_linear(np.asarray(sun.color, np.float64)).astype(np.float32)
        scattered: Any = np.exp(
            np.float32(-(1.0 - self.scatter.forward) * extinction * self._above(frame)) * dense
        )
        if self.scatter.kind != "even":
            cosine = -(rays.x * way[0] + rays.y * way[1] + way[2]) / rays.length
            phase = gas.phase(
                np.clip(cosine, -1.0, 1.0),
                kind=self.scatter.kind, asymmetry=self.scatter.asymmetry,
            )  # fmt: skip
            scattered = scattered * phase.astype(np.float32)
        share = np.float32(1.0 - sun.ambient)
        return np.asarray(np.float32(sun.ambient) + share * scattered[..., None] * white)

    def _above(self, frame: Frame) -> float:
        """Return the way of the sun's light through gas of the slice's own density, metres."""
        if self.center is not None:
            return 0.35 * min(self.sides)
        return 0.0 if self.top is None else self.falloff


@dataclass
class _Rays:
    """Slopes of the pixels' rays, and which slice comes next."""

    x: Array
    y: Array
    length: Array
    matrix: Float64
    slice: int = 0

    @staticmethod
    def of(frame: Frame) -> _Rays:
        height, width = frame.shape
        cx, cy = frame.camera.principal(frame.shape)
        x = ((np.arange(width) + 0.5 - cx) / frame.camera.focal).astype(np.float32)[None, :]
        y = ((np.arange(height) + 0.5 - cy) / frame.camera.focal).astype(np.float32)[:, None]
        return _Rays(x, y, np.sqrt(1.0 + x * x + y * y), frame.camera.matrix())

    def along(self, axis: int) -> Any:
        """Return how far rays go along a house axis for a depth of 1, (H, W), a row or a column."""
        across, down, ahead = self.matrix[axis].astype(np.float32)
        # Plain zeros keep a camera that is not rolled at a row or a column.
        sideways = across * self.x if across else 0.0
        return sideways + (down * self.y if down else 0.0) + ahead

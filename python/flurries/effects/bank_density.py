"""The density of a bank of mist: slices of depth with a profile and structure, solved for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flurries import _core, gas
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.tiles import tile_drift, tile_shift
from flurries.effects.motion import comes_nearer
from flurries.frame.view import Frame
from flurries.motion.keys import value_at
from flurries.spectral.frame import request
from flurries.spectral.texture import Texture

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
            dense = np.empty((len(seen), *coarse_shape(self.frame.shape)), np.float32)
            for slot, number in enumerate(seen):
                share = mean * self.profile(self.rays, places[number])
                np.multiply(share, long[number] if waves else np.float32(1.0), out=dense[slot])
            middle = float(np.mean([places[number] for number in numbers]))
            yield Slices(
                shown[seen[0] : seen[-1] + 2].tolist(), [places[number] for number in seen], dense,
                [long[number] for number in seen], waves.short(middle, group) if waves else None,
            )  # fmt: skip

    @cached_property
    def rays(self) -> Rays:
        return Rays(self.frame, COARSE, MARGIN)

    @cached_property
    def _waves(self) -> Waves | None:
        mist = self.mist
        if mist.structure == 0.0:
            return None
        # The outer scale: no waves are longer than a bank, or than one sees.
        outer = mist.farthest if mist.center is None else min(mist.box)
        return Waves(self.frame, mist, outer, self._cut()[1][0])

    def _cut(self) -> tuple[Float64, list[float]]:
        """Return the edges of all slices, planar depth, and the depths that stand for them."""
        mist, frame = self.mist, self.frame
        if mist.center is not None:
            away = np.array(mist.center) - frame.path.place(frame.t, fps=frame.fps)
            middle = float(frame.to_camera(away)[2])
            reach = 0.75 * float(np.linalg.norm(mist.box)) / math.sqrt(3.0) * 1.2
            edges = np.linspace(max(middle - reach, 0.0), max(middle + reach, 0.0), SLICES + 1)
            # No depth is that of the eye, where all of the bank lies behind it.
            return edges, np.maximum(0.5 * (edges[:-1] + edges[1:]), 1e-3).tolist()
        far, count = float(mist.box[2]), 1 if mist.structure == 0.0 and mist.top is None else SLICES
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
        counts = (-(-side // step) + 2 * margin for side in frame.shape)
        down, across = ((np.arange(count) - margin + 0.5) * step for count in counts)
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


EXPONENT = 11.0 / 6.0  # Amplitudes fall as k^(-11/6), their squares as k^(-11/3).

# The shortest wave, and those between which the finer grid hands over to the coarser one, px.
SHORTEST, LOWER, UPPER = 2.0, 16.0, 32.0

COARSE = 4  # Pixels to a coarse sample.

# Tiles and what they share, px of their grid: the largest of the coarse one, and where the air
# comes nearer and flows apart; those of the short waves, and the same.
TILE, APART = 1024, (128, 32)
FINE, FINE_APART = ((256, 256), 32), ((64, 64), 10)

# One tile is so much larger than the frame: waves are longer, and the wind brings it back later.
ROOM = 1.12

MARGIN = 1  # Coarse samples beyond the frame on each side, as the kernel reads them.

# Rings of waves that have one gain: in an octave of the hand-over, and beyond it.
HANDED, RINGS = 8, 24

# Edges of the rings in which the grids hand over, and of all that the finer one has, px.
_HANDOVER = np.geomspace(LOWER, UPPER, HANDED + 1)
_FINE_RINGS = np.append([SHORTEST, 4.0, 8.0], _HANDOVER)

# Seeds of the slices lie this far apart; those of short waves begin beyond them.
_STRIDE, _SHORT = 7919, 1_000_003

# By so many focal lengths at most an eye sees aside what both eyes share; phases hold the rest.
ASIDE = 0.125


def coarse_shape(shape: tuple[int, int]) -> tuple[int, int]:
    rows, columns = (-(-side // COARSE) + 2 * MARGIN for side in shape)
    return rows, columns


@dataclass(frozen=True, eq=False)
class Waves:
    frame: Frame
    mist: Any  # A `Mist`, settled.
    scale: float  # The longest waves' length, metres.
    nearest: float  # The depth of the first slice, metres.

    @cached_property
    def _flows(self) -> bool:
        """Whether the view does not move as one."""
        path, axis = self.frame.path, self.frame.camera.matrix()[:, 2]
        return path.turns or path.zooms or comes_nearer(path, axis, 0.0, self.mist.wind)

    def _aside(self, depth: float) -> tuple[float, float]:
        """Return px to the right at which an eye sees what both share of a depth, and the rest."""
        camera, x = self.frame.camera, self.frame.camera.offset[0]
        aside, most = camera.center_shift[0] - camera.focals[0] * x / depth, ASIDE * camera.focal
        part = min(max(aside, -most), most) if x else 0.0
        return part, aside - part

    @cached_property
    def _wide(self) -> tuple[int, int]:
        """The picture with room on either side for what an eye beside the camera sees."""
        most = max(abs(self._aside(depth)[0]) for depth in (self.nearest, math.inf))
        room = COARSE * math.ceil(most / COARSE + 2.0) if most else 0
        return self.frame.shape[0], self.frame.shape[1] + 2 * room

    @cached_property
    def _tiles(self) -> tuple[tuple[int, int], int]:
        """The tile of the coarse grid and what tiles share, its px."""
        rows, columns = coarse_shape(self._wide)
        if max(rows, columns) <= (APART[0] if self._flows else TILE):
            return (_quick(ROOM * rows), _quick(ROOM * columns)), 0
        return (APART[0], APART[0]), APART[1]

    def long(self, depth: float, number: int) -> Array:
        """Return the density of a slice over its mean in its long waves, coarse, float32."""
        edges, outer = _rings(self._tiles[0]), self.frame.camera.focal * self.scale / depth
        gains = _gains(edges, outer)[0] / _spline(edges)
        field, at = self._field(COARSE, depth, self._tiles, edges, gains, _STRIDE * number)
        variance = self.mist.structure**2 * _variances(self._tiles[0], outer)[0]
        found: Any = np.float32(-0.5 * variance)
        columns, taps, part = coarse_shape(self.frame.shape)[1], [1.0], at % 1.0
        if at:
            # Between samples by Catmull and Rom: the first and the last of four are taken off.
            first, last = 0.5 * part * (1.0 - part) ** 2, 0.5 * part * part * (1.0 - part)
            taps = [-first, 1.0 - part + 2.0 * first - last, part + 2.0 * last - first, -last]
        for left, tap in enumerate(taps, max(int(at) - 1, 0)):
            found = found + np.float32(math.sqrt(variance) * tap) * field[:, left : left + columns]
        return np.asarray(np.exp(found, out=found))

    def short(self, depth: float, half: int) -> tuple[Array, float]:
        """Return short waves of slices about a depth, (H, W) of variance 1, and their size."""
        outer = self.frame.camera.focal * self.scale / depth
        gains, tiles = _gains(_FINE_RINGS, outer)[1], FINE_APART if self._flows else FINE
        field, at = self._field(1, depth, tiles, _FINE_RINGS, gains, _STRIDE * half + _SHORT)
        # The slices that they stand for lie farther apart than what whole pixels leave out.
        field = field[:, round(at) : round(at) + self.frame.shape[1]]
        return field, self.mist.structure * math.sqrt(_variances(self._tiles[0], outer)[1])

    def _field(
        self, step: int, depth: float, tiles: tuple[tuple[int, int], int],
        edges: Float64, gains: Float64, stream: int,
    ) -> tuple[Array, float]:  # fmt: skip
        """Return a field of variance 1 that moves as air at a depth, and the eye's first column."""
        # Eyes side by side look at one field: tiles of their own would move by their own middles,
        # and what both see would part as the camera flies.
        eye, (aside, rest) = self.frame.camera, self._aside(depth)
        room, margin = (self._wide[1] - self.frame.shape[1]) // 2, MARGIN if step > 1 else 0
        sizes: dict[str, Any] = {"tile": tiles[0], "overlap": tiles[1]}
        if room:
            center = eye.center and (eye.center[0] + room, eye.center[1])
            offset, shifted = (0.0, *eye.offset[1:]), (rest, eye.center_shift[1])
            eye = eye.derive(offset=offset, center_shift=shifted, center=center)
        frame = self.frame.derive(camera=eye, shape=self._wide)
        shape = coarse_shape(self._wide) if margin else self._wide

        def shift(then: Frame) -> Float64:
            # The eye before the grid.
            eye, (x, y) = then.camera, then.camera.principal(then.shape)
            u, v = eye.center_shift
            center, aside = ((x - u) / step + margin, (y - v) / step + margin), (u / step, v / step)
            camera = eye.derive(focal=eye.focal / step, center=center, center_shift=aside)
            travel = then.travel(wind=self.mist.wind)
            moved = tile_drift(shape, travel, camera, near_depth=depth, **sizes)
            if then.path.turns:
                moved = moved + tile_shift(shape, then.rotation(), camera, **sizes)
            return np.asarray(moved + aside)

        def make() -> Array:
            ends, seed = edges / step, (frame.seed + stream) % 2**62
            texture = Texture(
                wavelengths=(float(ends[0]), float(ends[-1])), exponent=EXPONENT, ring_edges=ends,
                ring_gains=gains, **sizes,
            )  # fmt: skip
            asked = request(shape, texture, shift=shift(frame), seed=seed)
            if lap := frame.lap:
                begin, end = (shift(frame.later(t - frame.t)) for t in (lap.first, lap.end))
                whole = np.ascontiguousarray((end - begin)[:, :, None])
                asked = asked._replace(lap=(np.zeros_like(whole), whole, lap.part(frame.t)))
            out = np.empty(shape, np.float32)
            _core.field(out, asked, None, False)
            return out

        return frame.once(self.mist, (stream, eye, room), make), (room - aside) / step


@kept(32)
def _rings(tile: tuple[int, int]) -> Float64:
    """Return the edges of the coarse grid's rings, px."""
    return np.append(_HANDOVER, np.geomspace(UPPER, COARSE * max(tile), RINGS + 1)[1:])


def _gains(edges: Float64, outer: float) -> tuple[Float64, Float64]:
    """Return amplitudes of waves in rings of both grids over k^(-11/6), with an outer scale, px."""
    wave = np.sqrt(edges[1:] * edges[:-1])
    part = np.clip(np.log(wave / LOWER) / math.log(UPPER / LOWER), 0.0, 1.0) * (0.5 * math.pi)
    falls = (1.0 + (wave / outer) ** 2) ** (-0.5 * EXPONENT)
    return falls * np.sin(part), falls * np.cos(part)


def _spline(edges: Float64) -> Float64:
    """Return what the kernel's quadratic spline leaves of the amplitude of waves in rings."""
    return np.asarray(np.sinc(COARSE / np.sqrt(edges[1:] * edges[:-1])) ** 3)


@kept(32)
def _variances(tile: tuple[int, int], outer: float) -> tuple[float, float]:
    """Return the variances of long waves on their grid and of short ones, over that of the sum."""
    height, width = (side * COARSE for side in tile)
    ky = np.arange(-(height // LOWER), height // LOWER + 1.0) / height
    kx = np.arange(-(width // LOWER), width // LOWER + 1.0) / width
    k = np.hypot(ky[:, None], kx[None, :])
    wave = 1.0 / k[(k > 0.0) & (k < 1.0 / LOWER)]
    edges = _rings(tile)
    ring = np.clip(np.searchsorted(edges, wave) - 1, 0, len(edges) - 2)
    # As much for each wave as there is room for in the plane of waves.
    power = wave ** (2.0 * EXPONENT) * _gains(edges, outer)[0][ring] ** 2 / (height * width)
    made = float((power / _spline(edges)[ring] ** 2).sum())
    fall = 2.0 * EXPONENT - 2.0
    areas = 2.0 * math.pi / fall * np.diff(_FINE_RINGS**fall)
    short = float((areas * _gains(_FINE_RINGS, outer)[1] ** 2).sum())
    total = float(power.sum()) + short
    return made / total, short / total


def _quick(length: float) -> int:
    """Return the next even size that a Fourier transform is quick for."""
    side = max(2 * math.ceil(math.ceil(length) / 2), 16)
    while 60**20 % side:
        side += 2
    return side

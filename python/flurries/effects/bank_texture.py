"""The texture of a slice of mist: one spectrum, k^(-11/3) from an outer scale down to the pixel.

It is sampled at two resolutions. Nearly all of the power is in long waves, which are made on a grid
of a quarter of the frame's size, where one tile holds all of it and has no seams; the kernel finds
the pixels between (`src/gas/slices.rs`). Short ones are made by tiles at the frame's own size, for
half of the slices at a time. Between two wavelengths one fades out as the other fades in: their
powers sum to that of the spectrum, what the kernel's spline takes of long ones included.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.tiles import tile_drift, tile_shift
from flurries.effects.motion import comes_nearer
from flurries.frame.view import Frame
from flurries.motion.keys import Vector
from flurries.spectral.frame import request
from flurries.spectral.texture import Texture

# Amplitudes fall as k^(-11/6), their squares as k^(-11/3).
EXPONENT = 11.0 / 6.0

# The shortest wave, and those between which the finer grid hands over to the coarser one, px.
SHORTEST, LOWER, UPPER = 2.0, 16.0, 32.0

# Pixels to a coarse sample.
COARSE = 4

# Tiles and what they share, px of their grid: the largest of the coarse one, and where the air
# comes nearer and flows apart; those of the short waves, and the same.
TILE, APART = 1024, (128, 32)
FINE, FINE_APART = ((256, 256), 32), ((64, 64), 10)

# One tile is so much larger than the frame: waves are longer, and the wind brings it back later.
ROOM = 1.12

# Coarse samples beyond the frame on each side, as the kernel reads them.
MARGIN = 1

# Rings of waves that have one gain: in an octave of the hand-over, and beyond it.
HANDED, RINGS = 8, 24

# Edges of the rings in which the grids hand over, and of all that the finer one has, px.
_HANDOVER = np.geomspace(LOWER, UPPER, HANDED + 1)
_FINE_RINGS = np.append([SHORTEST, 4.0, 8.0], _HANDOVER)

# Seeds of the slices lie this far apart; those of short waves begin beyond them.
_STRIDE, _SHORT = 7919, 1_000_003


def coarse_shape(frame: Frame) -> tuple[int, int]:
    height, width = (-(-side // COARSE) + 2 * MARGIN for side in frame.shape)
    return height, width


@dataclass(frozen=True, eq=False)
class Waves:
    """The waves of a gas' slices."""

    frame: Frame
    wind: Vector
    spread: float  # Root mean square of the logarithm of the density.
    scale: float  # The longest waves' length, metres.

    @cached_property
    def _flows(self) -> bool:
        """Whether the view does not move as one."""
        path, axis = self.frame.path, self.frame.camera.matrix()[:, 2]
        return path.turns or path.zooms or comes_nearer(path, axis, 0.0, self.wind)

    @cached_property
    def _tiles(self) -> tuple[tuple[int, int], int]:
        """The tile of the coarse grid and what tiles share, its px."""
        rows, columns = coarse_shape(self.frame)
        if max(rows, columns) <= (APART[0] if self._flows else TILE):
            return (_quick(ROOM * rows), _quick(ROOM * columns)), 0
        return (APART[0], APART[0]), APART[1]

    def long(self, depth: float, number: int) -> Array:
        """Return the density of a slice over its mean in its long waves, coarse, float32."""
        field, tile = np.empty(coarse_shape(self.frame), np.float32), self._tiles[0]
        edges, outer = _rings(tile), self._outer(depth)
        gains = _gains(edges, outer)[0] / _spline(edges)
        self._fill(field, depth, self._tiles, edges / COARSE, gains, _STRIDE * number)
        variance = self.spread * self.spread * _variances(tile, outer)[0]
        field *= np.float32(math.sqrt(variance))
        field -= np.float32(0.5 * variance)
        return np.asarray(np.exp(field, out=field))

    def short(self, depth: float, half: int) -> tuple[Array, float]:
        """Return short waves of slices about a depth, (H, W) of variance 1, and their size."""
        out, outer = np.empty(self.frame.shape, np.float32), self._outer(depth)
        gains, tiles = _gains(_FINE_RINGS, outer)[1], FINE_APART if self._flows else FINE
        self._fill(out, depth, tiles, _FINE_RINGS, gains, _STRIDE * half + _SHORT)
        return out, self.spread * math.sqrt(_variances(self._tiles[0], outer)[1])

    def _outer(self, depth: float) -> float:
        """Return the outer scale at a depth, px."""
        return float(self.frame.camera.focal * self.scale / depth)

    def _fill(
        self, out: Array, depth: float, tiles: tuple[tuple[int, int], int],
        edges: Float64, gains: Float64, stream: int,
    ) -> None:  # fmt: skip
        """Fill a grid with a field of variance 1 that moves as the air does at a depth."""
        frame = self.frame
        sizes: dict[str, Any] = {"tile": tiles[0], "overlap": tiles[1]}
        scale, margin = (1.0, 0) if out.shape == frame.shape else (1.0 / COARSE, MARGIN)

        def shift(then: Frame) -> Float64:
            eye = camera = then.camera
            if margin:
                # The eye before the coarse grid.
                (x, y), (u, v) = eye.principal(then.shape), eye.center_shift
                center = scale * (x - u) + margin, scale * (y - v) + margin
                aside = scale * u, scale * v
                camera = eye.derive(focal=scale * eye.focal, center=center, center_shift=aside)
            travel = then.travel(wind=self.wind)
            moved = tile_drift(out.shape, travel, camera, near_depth=depth, **sizes)
            if then.path.turns:
                moved = moved + tile_shift(out.shape, then.rotation(), camera, **sizes)
            return np.asarray(moved + scale * np.array(eye.center_shift))

        texture = Texture(
            wavelengths=(float(edges[0]), float(edges[-1])), exponent=EXPONENT, ring_edges=edges,
            ring_gains=gains, **sizes,
        )  # fmt: skip
        seed = (frame.seed + stream) % 2**62
        asked = request(out.shape, texture, shift=shift(frame), seed=seed)
        if frame.lap is not None:
            begin, end = (shift(frame.later(t - frame.t)) for t in (frame.lap.first, frame.lap.end))
            whole = np.ascontiguousarray((end - begin)[:, :, None])
            asked = asked._replace(lap=(np.zeros_like(whole), whole, frame.lap.part(frame.t)))
        _core.field(out, asked, None, False)


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

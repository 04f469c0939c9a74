"""The texture of a slice of mist: one slope from the size of a frame down to four pixels.

The amplitudes of its waves fall as k^(-11/6), so that nearly all of the power is in long waves.
These are made at a quarter of the frame's size, where one tile holds all of it and has no seams,
and the kernel finds the pixels between (`src/gas/slices.rs`); what is shorter, one or two per cent
of the power, is made by tiles at the frame's own size, for half of the slices at a time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.tiles import tile_drift, tile_shift
from flurries.effects.motion import comes_nearer
from flurries.frame.view import Frame
from flurries.motion.keys import Vector
from flurries.spectral.request import request
from flurries.spectral.texture import Texture

# Amplitudes fall as k^(-11/6), their squares as k^(-11/3), down to waves of 4 px.
EXPONENT, SHORTEST = 11.0 / 6.0, 4.0

# Waves of at least so many pixels are made on a coarse grid, one of whose samples is 4 px.
LONG, COARSE = 32.0, 4

# Tiles and what they share, px of their grid: the largest of the coarse one, and where the air
# comes nearer and flows apart; those of the short waves, and the same.
TILE, APART = 1024, (128, 32)
FINE, FINE_APART = ((256, 256), 32), ((64, 64), 10)

# One tile is so much larger than the frame: waves are longer, and the wind brings it back later.
ROOM = 1.12

# Coarse samples beyond the frame on each side, as the kernel reads them.
MARGIN = 1

# Rings of waves, each of which has one gain where the gas has an outer scale.
RINGS = 24

# Seeds of the slices lie this far apart; those of short waves begin beyond them.
_STRIDE, _SHORT = 7919, 1_000_003


def coarse_shape(frame: Frame) -> tuple[int, int]:
    """Return the shape of the coarse samples, (rows, columns)."""
    height, width = (-(-side // COARSE) + 2 * MARGIN for side in frame.shape)
    return height, width


class Waves:
    """The waves of the slices of a gas: `spread` is the root mean square of the logarithm of the
    density, `outer` the outer scale in units of depth (von Karman 1948).
    """

    def __init__(self, frame: Frame, wind: Vector, spread: float, outer: float) -> None:
        self._frame, self._wind, self._spread, self._outer = frame, wind, spread, outer
        path, axis = frame.path, frame.camera.matrix()[:, 2]
        # Whether the view does not move as one.
        self._flows = path.turns or path.zooms or comes_nearer(path, axis, 0.0, wind)
        shape = coarse_shape(frame)
        self._tile, self._overlap = (APART[0], APART[0]), APART[1]
        if max(shape) <= (APART[0] if self._flows else TILE):
            self._tile, self._overlap = (_quick(ROOM * shape[0]), _quick(ROOM * shape[1])), 0

    def long(self, depth: float, number: int) -> Array:
        """Return the density of a slice over its mean in its long waves, coarse, float32."""
        seed = (self._frame.seed + _STRIDE * number) % 2**62
        band = (LONG / COARSE, float(max(self._tile)))
        field = np.empty(coarse_shape(self._frame), np.float32)
        size = self._frame.camera.focal * self._outer / depth
        self._fill(field, depth, (self._tile, self._overlap), band, seed, 1.0 / COARSE, size)
        variance = self._spread * self._spread * (1.0 - _short_share(self._tile, size))
        field *= np.float32(math.sqrt(variance))
        np.exp(field, out=field)
        inside = field[MARGIN:-MARGIN, MARGIN:-MARGIN]
        field /= inside.mean() if math.isinf(self._outer) else np.float32(math.exp(0.5 * variance))
        return field

    def short(self, depths: list[float], half: int, out: Array) -> tuple[Array, float]:
        """Fill `out` (H, W) with the short waves of slices, variance 1; add their size."""
        # Long waves of n slices have a variance n times as small as those of one, which waves that
        # all of them share must be told.
        depth = sum(depths) / len(depths)
        share = _short_share(self._tile, self._frame.camera.focal * self._outer / depth)
        seed = (self._frame.seed + _STRIDE * half + _SHORT) % 2**62
        tiles = FINE_APART if self._flows else FINE
        self._fill(out, depth, tiles, (SHORTEST, LONG), seed, 1.0, math.inf)
        return out, self._spread * math.sqrt(share / len(depths))

    def _fill(
        self, out: Array, depth: float, tiles: tuple[tuple[int, int], int],
        band: tuple[float, float], seed: int, scale: float, outer: float,
    ) -> None:  # fmt: skip
        """Fill a grid with a field of variance 1 that moves as the air does at a depth."""
        frame = self._frame
        sizes: dict[str, Any] = {"tile": tiles[0], "overlap": tiles[1]}

        def shift(then: Frame) -> Float64:
            eye = then.camera
            camera = eye if scale == 1.0 else _coarse(eye, then.shape, scale)
            travel = then.travel(wind=self._wind)
            moved = tile_drift(out.shape, travel, camera, near_depth=depth, **sizes)
            if then.path.turns:
                moved = moved + tile_shift(out.shape, then.rotation(), camera, **sizes)
            return np.asarray(moved + scale * np.array(eye.center_shift))

        edges = gains = None
        if not math.isinf(outer):
            edges = np.geomspace(*band, RINGS + 1)
            gains = _gain(np.sqrt(edges[1:] * edges[:-1]), scale * outer)
        texture = Texture(
            wavelengths=band, exponent=EXPONENT, ring_edges=edges, ring_gains=gains, **sizes
        )
        asked = request(out.shape, texture, shift=shift(frame), seed=seed)
        lap = frame.lap
        if lap is not None:
            begin, end = (shift(frame.later(t - frame.t)) for t in (lap.first, lap.end))
            whole = np.ascontiguousarray((end - begin)[:, :, None])
            asked = asked._replace(lap=(np.zeros_like(whole), whole, lap.part(frame.t)))
        _core.field(out, asked, None, False)


@kept(32)
def _short_share(tile: tuple[int, int], outer: float) -> float:
    """Return the share of the power below `LONG`, of a coarse tile and an outer scale, px."""
    height, width = (side * COARSE for side in tile)
    ky = np.arange(-(height // LONG), height // LONG + 1.0) / height
    kx = np.arange(-(width // LONG), width // LONG + 1.0) / width
    k = np.hypot(ky[:, None], kx[None, :])
    k = k[(k > 0.0) & (k <= 1.0 / LONG)]
    # As much for each wave as there is room for in the plane of waves.
    room = 1.0 / (height * width)
    long_power = room * float((k ** (-2.0 * EXPONENT) * _gain(1.0 / k, outer) ** 2).sum())
    power = 2.0 - 2.0 * EXPONENT
    short_power = 2.0 * math.pi / -power * (LONG**-power - SHORTEST**-power)
    return float(short_power / (short_power + long_power))


def _gain(wavelength: Float64, outer: float) -> Float64:
    """Return by how much an outer scale lowers the amplitude of waves."""
    return np.asarray((1.0 + (wavelength / outer) ** 2) ** (-0.5 * EXPONENT))


def _quick(length: float) -> int:
    """Return the next even size that a Fourier transform is quick for."""
    side = max(2 * math.ceil(math.ceil(length) / 2), 16)
    while 60**20 % side:
        side += 2
    return side


def _coarse(eye: Camera, shape: tuple[int, int], scale: float) -> Camera:
    """Return the eye before the coarse grid."""
    cx, cy = (
        scale * (at - aside) + MARGIN
        for at, aside in zip(eye.principal(shape), eye.center_shift, strict=True)
    )
    aside = (scale * eye.center_shift[0], scale * eye.center_shift[1])
    return eye.derive(focal=scale * eye.focal, center=(cx, cy), center_shift=aside)

"""The tent's field of waves for a frame: its band, its tiles and its motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries._trace import current
from flurries._warnings import warn
from flurries.camera.path import CameraPath
from flurries.camera.tiles import drift_at, shift_at, tile_middles
from flurries.effects.maps import TUNED
from flurries.effects.motion import Motion, Way
from flurries.effects.uneven import wind_at
from flurries.frame.bands import by_tiles
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.spectral.frame import Map, Request
from flurries.spectral.motion import tile_motions
from flurries.spectral.tables import Aliasing, warn_far, warn_long, wave_depth
from flurries.spectral.texture import Texture
from flurries.spectral.tiles import Blend, power_shares, starts


@dataclass(frozen=True, eq=False, kw_only=True)
class Field:
    """Waves that move; the fields are those of `TentSnow` and `TentRain` but for these."""

    motion: Motion  # What moves them.
    exponent: float
    wavelengths: tuple[float, float] | None
    # (shortest, longest): pixels on a picture 1024 px wide, where `wavelengths` does not say.
    tuned: tuple[float, float]
    near_depth: float
    tile: int | None
    overlap: int | None
    blend: Blend
    alias: Aliasing
    jitter: bool
    streaks: bool = False  # Whether tiles are as large as streaks need to move.

    def band(self, shape: tuple[int, int]) -> tuple[float, float]:
        if self.wavelengths is not None:
            return self.wavelengths
        scale = shape[1] / TUNED
        return max(self.tuned[0] * scale, 2.0), max(self.tuned[1] * scale, 3.0)

    @property
    def far_depth(self) -> float:
        """The depth that the shortest wave stands for, metres, shown or not."""
        shortest, longest = self.tuned if self.wavelengths is None else self.wavelengths
        return float(wave_depth([shortest], near_depth=self.near_depth, longest=longest)[0])

    def cycles(self, frame: Frame, way: Way) -> float:
        """Return the rate of the middle of the longest wave's tent, cycles per frame."""
        fx, fy = frame.camera.focals
        speed = float(np.hypot(fx * way.rate[0], fy * way.rate[1])) / self.near_depth
        return speed / self.band(frame.shape)[1]

    def layout(self, frame: Frame) -> Layout:
        rotation, focal = frame.camera.rotation, frame.camera.focal
        return _layout(self, frame.shape, frame.path, rotation, focal, frame.fps)

    def pixels(
        self, frame: Frame, way: Way, mapped: Map | None, keep: bool = False, *,
        shortest: Float64 | None = None,
    ) -> Array:  # fmt: skip
        """Return opacity over the window whatever the depth, (h, w); without a map the field."""
        # `keep` adds the mean opacity that blur takes; a tile has no waves up to its `shortest`.
        result = plane(frame.size)
        made = _core.field(result, self.request(frame, way, shortest), mapped, keep)
        current.get().count("tiles", made)
        return result

    def shares(self, frame: Frame) -> tuple[tuple[Float64, Float64], tuple[Float64, Float64]]:
        """Return shares of the tiles and the field's power along the frame's rows and columns."""
        tile, overlap = self.layout(frame).tiling
        down, across = (
            power_shares(length, tile=one, overlap=overlap, blend=self.blend)
            for length, one in zip(frame.shape, tile, strict=True)
        )
        return down, across

    def request(self, frame: Frame, way: Way, shortest: Float64 | None = None) -> Request:
        """Return the field of a frame as the kernel reads it."""
        layout = self.layout(frame)
        (tile, overlap), band, edges = layout.tiling, layout.band, layout.edges
        x, y = tile_middles(frame.shape, frame.camera, tile, overlap)
        (drift, shift), (velocity, shift_rate) = (
            (along[:, :, None] / self.near_depth, alike[:, :, None])
            for along, alike in _flow(frame, self.motion, way, x, y)
        )
        if edges is not None:
            extra = self._ring_drift(frame, x, y, edges)
            drift, velocity = drift + extra[0], velocity + extra[1]
        if layout.needed:
            warn(
                f"rain: with tiles of {tile[0]} px a tenth of the streaks or more stands still; "
                f"take tile={math.ceil(layout.needed)}, or leave it out, or jitter=True"
            )
        warn_long(tile, band)
        warn_far(max(float(drift.max()), -float(drift.min())) / band[1])
        visible, lap, whole = frame.visible, frame.lap, None
        if lap is not None:
            # Drift and shift over a film that begins again, and how much of it has passed.
            ends = [replace(frame.later(t - frame.t), lap=None) for t in (lap.first, lap.end)]
            begin, end = (self.request(at, self.motion.way(at), shortest) for at in ends)
            moved = (end.drift - begin.drift, end.shift - begin.shift)
            whole = *map(np.ascontiguousarray, moved), lap.part(frame.t)
        if visible is not None:
            # No waves are left of tiles of which nothing can be seen.
            shown = visible.tiles(*layout.tiling)
            shortest = np.where(shown, 0.0 if shortest is None else shortest, band[1])
        rings = None if edges is None else tuple(edges.tolist())
        texture = _texture(self, layout.tiling, band, rings, way.shutter)
        return Request(
            texture, frame.shape, frame.seed, drift=drift, shift=shift, velocity=velocity,
            shift_rate=shift_rate, shortest=shortest, window=frame.window, lap=whole,
        )  # fmt: skip

    def _ring_drift(
        self, frame: Frame, x: Float64, y: Float64, edges: Float64
    ) -> tuple[Float64, Float64]:
        """Return drift and velocity (rows, cols, rings, 2) px beyond those of the mean wind."""
        camera, longest = frame.camera, self.band(frame.shape)[1]
        waves, near = np.sqrt(edges[1:] * edges[:-1]), self.near_depth
        depth = wave_depth(waves, near_depth=near, longest=longest)
        rows, cols, z = np.meshgrid(y, x, depth, indexing="ij")
        fx, fy = camera.focals
        ahead = np.stack([cols * z / fx, rows * z / fy, z], axis=-1)
        aside = np.stack([cols, rows], axis=-1)
        # Both eyes feel the wind of one place, that before the camera.
        moved, rate = wind_at(self.motion, frame, ahead)
        # The air moves, so the camera moves the other way through it.
        drift, velocity = (
            (camera.focals * v[..., :2] - v[..., 2:] * aside) / near for v in (moved, rate)
        )
        return drift, velocity

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        layout, longest, shortest = self.layout(frame), self.band(frame.shape)[1], None
        if frame.depth is not None:
            with np.errstate(divide="ignore"):
                ends = layout.farthest(frame.depth).astype(np.float64)
                shortest = wave_depth(ends, near_depth=self.near_depth, longest=longest)
        now = self.request(frame, self.motion.way(frame), shortest)
        later = [self.request(at, self.motion.way(at)) for at in others]
        motions, length = tile_motions(now, later)
        depth = wave_depth(length, near_depth=self.near_depth, longest=longest)
        top, bottom, left, right = frame.window
        (down, _), (across, _) = self.shares(frame)
        rows = np.ascontiguousarray(down[top:bottom], np.float32)
        columns = np.ascontiguousarray(across[left:right].T, np.float32)
        far = plane(frame.size)
        moves = [plane((*far.shape, 2)) for _ in others]
        for given, out in [(depth[..., None], far[..., None]), *zip(motions, moves, strict=True)]:
            if (given == given[:1, :1]).all():
                # Shares of tiles sum to 1. Rows are copied: pair by pair it takes twice as long.
                out[0] = given[0, 0]
                out[1:] = out[0]
                continue
            part = np.moveaxis(np.moveaxis(given, 2, 1).astype(np.float32) @ columns, 1, 2)
            np.matmul(rows, part.reshape(len(part), -1), out=out.reshape(len(out), -1))
        return moves, far


def _flow(
    frame: Frame, motion: Motion, way: Way, x: Float64, y: Float64
) -> tuple[tuple[Float64, Float64], tuple[Float64, Float64]]:
    """Return motion since frame 0 and per frame: pixels times metres, and pixels at all depths."""
    path, camera = frame.path, frame.camera
    moved, rate, _ = way
    if path.turns or path.zooms:
        moved = frame.travel(fall=motion.fall, wind=motion.mean_wind)
    shift, shift_rate = np.array(camera.center_shift).reshape(1, 1, 2), np.zeros((1, 1, 2))
    if path.turns:
        # An eye beside the axis is carried round it; its place in the air stays that of the camera
        # plus the offset, so that two eyes keep their disparities.
        rate = rate + np.cross(frame.spin(), camera.offset)
        turned, turning = (
            shift_at(x, y, angle, camera, np.empty((len(y), len(x), 2)))
            for angle in (frame.rotation(), frame.spin())
        )
        shift, shift_rate = shift + turned, shift_rate + turning
    if path.zooms:
        grown, grows = path.zoom(frame.t)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        shift, shift_rate = shift + grown * places, shift_rate + grows * places
    gone = drift_at(x, y, moved + camera.offset, camera.focals)
    return (gone, shift), (drift_at(x, y, rate, camera.focals), shift_rate)


@kept(64)
def _layout(
    field: Field, shape: tuple[int, int], path: CameraPath, rotation: tuple[float, float, float],
    focal: float, fps: float,
) -> Layout:  # fmt: skip
    """Return the tiles of a film, the same for all its frames and windows."""
    motion, band, needed, edges = field.motion, field.band(shape), 0.0, None
    if field.streaks and not (field.alias == "keep" or field.jitter):
        cycles = focal * motion.fastest(path, fps) / field.near_depth / band[1]
        needed = streaks_tile(cycles, band)
    tile = field.tile or max(8 * math.ceil(band[1] / 3.0 - 1e-9), 16)
    # The flow differs from tile to tile when the camera goes forward: mix more of them.
    gusty = motion.varied is not None and motion.varied.waves is not None
    overlap = tile // 2 if gusty or motion.spreads(path, rotation) else tile // 6
    if field.streaks and field.tile is None:
        tile = max(tile, 8 * math.ceil(min(needed, LARGEST_TILE) / 8.0))
        overlap = tile // 6
    if field.overlap is not None:
        overlap = min(field.overlap, tile - 1)
    if motion.varied is not None:
        # Rings of a half or a quarter octave.
        finer = 4.0 if motion.varied.profile is not None else 2.0
        rings = max(round(finer * math.log2(band[1] / band[0])), 1)
        edges = np.asarray(band[0] * (band[1] / band[0]) ** (np.arange(rings + 1) / rings))
    small = field.tile is not None and field.tile < needed
    return Layout(((tile, tile), overlap), shape, band, edges, needed if small else 0.0)


@kept(64)
def _texture(
    field: Field, tiling: tuple[tuple[int, int], int], band: tuple[float, float],
    rings: tuple[float, ...] | None, shutter: float,
) -> Texture:  # fmt: skip
    return Texture(
        tile=tiling[0], overlap=tiling[1], blend=field.blend, wavelengths=band, alias=field.alias,
        exponent=field.exponent, jitter=field.jitter, ring_edges=rings, shutter=shutter,
    )  # fmt: skip


# The share of what is left of rain's texture that stands still is 13.5 c / M for wavelengths of 4
# to 32 px, c the cycles of the longest wave in a frame: M = 144 c is a tenth, with some to spare.
PIXELS_PER_CYCLE = 144.0 / (28.0 / math.log(8.0))

# A larger tile costs memory that a picture does not; from here on `jitter` would do.
LARGEST_TILE = 2048


class Layout(NamedTuple):
    tiling: tuple[tuple[int, int], int]  # (rows, cols) of a tile, and what neighbours share, px.
    shape: tuple[int, int]  # (H, W) of the picture.
    band: tuple[float, float]  # Wavelengths in pixels.
    edges: Float64 | None  # Wavelengths between rings, for a wind of places.
    needed: float  # The tile that the motion needs, where a smaller one was asked for; else 0.

    @property
    def grid(self) -> tuple[int, int]:
        (height, width), ((tall, wide), overlap) = self.shape, self.tiling
        return len(starts(height, tall, overlap)), len(starts(width, wide, overlap))

    def farthest(self, depth: Array) -> Array:
        return by_tiles(depth, *self.tiling, np.max)


def streaks_tile(cycles: float, band: tuple[float, float]) -> float:
    """Return the tile in pixels from which on less than a tenth of the streaks stands still."""
    shortest, longest = band
    if cycles <= 0.5:
        return 0.0
    return PIXELS_PER_CYCLE * cycles * (longest - shortest) / math.log(longest / shortest)

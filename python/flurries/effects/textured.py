"""The texture of all that is far: its band, tiles and motion, as one request for the kernel."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.camera.tiles import tile_drift, tile_shift, tile_zoom
from flurries.effects.moving import Moving, of_rings
from flurries.effects.resolution import TUNED, power_share
from flurries.effects.tiling import Tiling, torus_for
from flurries.frame.layer import Frame
from flurries.motion.keys import Number, value_at
from flurries.motion.wind import Wind
from flurries.spectral.frame import Request, request
from flurries.spectral.tiles import tile_starts
from flurries.trace import count

Mapped = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Textured(Moving):
    """A texture that moves. The fields are described where they are used."""

    shutter: Number = 0.5
    exponent: float = 0.75
    wavelengths: tuple[float, float] | None = None
    near_depth: float = 12.0
    tile: int | None = None
    overlap: int | None = None
    blend: str = "power"
    alias: str = "soft"
    jitter: bool = False

    # Wavelengths in pixels on a picture 1024 px wide.
    _BAND = (3.0, 24.0)

    def band(self, shape: tuple[int, int]) -> tuple[float, float]:
        """Return the texture's wavelengths in pixels on a picture of that shape."""
        if self.wavelengths is not None:
            return self.wavelengths
        scale = shape[1] / TUNED
        return max(self._BAND[0] * scale, 2.0), max(self._BAND[1] * scale, 3.0)

    def power_share(self, shape: tuple[int, int]) -> float:
        """Return how much of its power a picture shows, against one 1024 px wide."""
        if self.wavelengths is not None:
            return 1.0
        return power_share(self._BAND, self.exponent, shape[1])

    def far_depth(self, shape: tuple[int, int]) -> float:
        """Return the depth that the shortest wave stands for, metres, shown or not."""
        shortest, longest = self._BAND if self.wavelengths is None else self.band(shape)
        return self.near_depth * longest / shortest

    def tiling(self, shape: tuple[int, int], forward: bool) -> tuple[int, int]:
        """Return tile and overlap in pixels."""
        longest = self.band(shape)[1]
        tile = self.tile or max(8 * math.ceil(longest / 3.0 - 1e-9), 16)
        if self.overlap is not None:
            return tile, min(self.overlap, tile - 1)
        # The flow differs from tile to tile when the camera goes forward: mix more of them.
        return tile, tile // 2 if forward else tile // 6

    def tiles(self, frame: Frame) -> tuple[int, int]:
        """Return tile and overlap in pixels for the film that a frame belongs to."""
        return self.tiling(frame.shape, self.spreads(frame) or self.gusty)

    def least_tile(self, frame: Frame) -> float:
        """Return the tile in pixels that the motion of the film needs."""
        return 0.0

    def layout(self, frame: Frame) -> tuple[Tiling, str]:
        """Return the tiles of the film's texture, and why it is them and not one torus.

        The decision is one for all frames: it must not depend on the time or on the window.
        """
        tile, overlap = self.tiles(frame)
        tiling = Tiling((tile, tile), overlap)
        if self.tile is not None or self.overlap is not None:
            return tiling, "the tiles were asked for"
        if frame.path.turns or frame.path.zooms or self.spreads(frame):
            return tiling, "the flow differs from tile to tile"
        if isinstance(self.wind, Wind):
            return tiling, "the wind may differ from tile to tile"
        if frame.deep or frame.depth is not None:
            return tiling, "the depth differs from tile to tile"
        torus, why = torus_for(frame.shape, tiling, self.band(frame.shape), self.least_tile(frame))
        return torus or tiling, why

    @property
    def gusty(self) -> bool:
        """Whether the wind differs from place to place across the view."""
        return isinstance(self.wind, Wind) and self.wind.waves is not None

    def cycles(self, frame: Frame) -> float:
        """Return how fast the middle of the longest wave's tent turns, cycles per frame."""
        rate = frame.to_camera(self.velocity(frame))
        fx, fy = frame.camera.focals
        speed = float(np.hypot(fx * rate[0], fy * rate[1])) / self.near_depth
        return speed / self.band(frame.shape)[1]

    def warn_ambiguous(
        self, shape: tuple[int, int], focal: float, distance: float, index: int
    ) -> None:
        """Warn if two eyes see the longest wave, and so every wave, half a cycle apart or more."""
        cycles = focal * distance / (self.near_depth * self.band(shape)[1])
        if cycles < 0.5 or getattr(self, "texture", 1.0) == 0.0:
            return
        warnings.warn(
            f"effects[{index}]: eyes {distance:g} apart see its texture {cycles:.2g} cycles apart, "
            f"which is ambiguous from 0.5 on; take near_depth above "
            f"{2.0 * cycles * self.near_depth:.3g}, or longer waves, or eyes closer together",
            UserWarning,
            stacklevel=3,
        )

    def texture_request(self, frame: Frame, **more: Any) -> Request:
        """Return the field that the texture of a frame is made of; `more` goes to the request."""
        shape, camera = frame.shape, frame.camera
        (tile, overlap), _ = self.layout(frame)
        more["shortest"] = self._limits(frame, tile, overlap, more.get("shortest"))
        place = frame.travel(fall=self.fall, wind=self.mean_wind)
        # A velocity has no eye: take away what tile_drift adds for one.
        rate = frame.to_camera(self.velocity(frame)) - camera.offset
        shift: Any = camera.center_shift
        shift_rate: Any = None
        if frame.path.turns:
            # An eye beside the axis is carried round it; its place in the air stays that of the
            # camera plus the offset, so that two eyes keep their disparities.
            rate = rate + np.cross(frame.spin(), camera.offset)
            shift, shift_rate = (
                tile_shift(shape, angle, camera, tile=tile, overlap=overlap)
                for angle in (frame.turned(), frame.spin())
            )
            shift = shift + camera.center_shift
        if frame.path.zooms:
            grown, grows = (
                tile_zoom(shape, growth, camera, tile=tile, overlap=overlap)
                for growth in frame.path.zoom(frame.t)
            )
            shift = shift + grown
            shift_rate = grows if shift_rate is None else shift_rate + grows
        drift, velocity = (
            tile_drift(
                shape, vector, camera, near_depth=self.near_depth, tile=tile, overlap=overlap
            )
            for vector in (place, rate)
        )
        edges = self._ring_edges(shape)
        if edges is not None:
            extra = self._ring_drift(frame, tile, overlap, edges)
            drift, velocity = drift[:, :, None] + extra[0], velocity[:, :, None] + extra[1]
            more["ring_edges"] = edges
        return request(
            shape,
            drift=drift,
            shift=shift,
            velocity=velocity,
            shift_rate=shift_rate,
            seed=frame.seed,
            tile=tile,
            overlap=overlap,
            wavelengths=self.band(shape),
            exponent=self.exponent,
            alias=self.alias,
            shutter=value_at(self.shutter, frame.t),
            jitter=self.jitter,
            blend=self.blend,
            window=frame.window,
            **more,
        )

    def drawn(
        self, frame: Frame, mapped: Mapped | None, *, name: str = "texture", **more: Any
    ) -> Array:
        """Return the texture's opacity over the window, (h, w) float32, or its field.

        Parameters
        ----------
        mapped : (mean, spread, power, amount), optional
            The map to opacity; if not given, the field.
        name : str
            Of this one among the effect's textures.
        **more
            Goes to the request.
        """
        top, bottom, left, right = frame.window
        result = np.empty((bottom - top, right - left), np.float32)
        keep = mapped is not None and self.preserves_mean
        if not frame.banded:
            count("tiles", _core.field(result, self.texture_request(frame, **more), mapped, keep))
            return result
        # Bands are lower than tiles: each is made once, and what it leaves to the next is kept.
        whole = frame.around
        bands = frame.once_each(
            self,
            name,
            lambda: _core.field_bands(self.texture_request(whole, **more), mapped, keep),
        )
        count("tiles", _core.field_take(bands, result, top))
        return result

    @property
    def preserves_mean(self) -> bool:
        """Whether what blur takes of the texture's mean opacity is added again."""
        return True

    def _limits(
        self, frame: Frame, tile: tuple[int, int], overlap: int, shortest: Float64 | None
    ) -> Float64 | None:
        """Return the shortest waves of the tiles; none are left where nothing can be seen."""
        visible = None if frame.run is None else frame.run.visible
        if visible is None:
            return shortest
        seen = visible.tiles(tile, overlap)
        base = np.zeros(seen.shape) if shortest is None else shortest
        return np.where(seen, base, self.band(frame.shape)[1])

    def _ring_edges(self, shape: tuple[int, int]) -> Float64 | None:
        """Return wavelengths between rings of a half or a quarter octave, if the wind differs."""
        if not isinstance(self.wind, Wind) or (self.wind.profile is None and not self.gusty):
            return None
        shortest, longest = self.band(shape)
        finer = 4.0 if self.wind.profile is not None else 2.0
        rings = max(round(finer * math.log2(longest / shortest)), 1)
        return np.asarray(shortest * (longest / shortest) ** (np.arange(rings + 1) / rings))

    def _ring_drift(
        self, frame: Frame, tile: tuple[int, int], overlap: int, edges: Float64
    ) -> tuple[Float64, Float64]:
        """Return drift and velocity (rows, cols, rings, 2) px beyond those of the mean wind."""
        camera, shape = frame.camera, frame.shape
        cx, cy = camera.principal(shape)
        y = tile_starts(shape[0], tile=tile[0], overlap=overlap) + 0.5 * tile[0] - cy
        x = tile_starts(shape[1], tile=tile[1], overlap=overlap) + 0.5 * tile[1] - cx
        middles = np.sqrt(edges[1:] * edges[:-1])
        depth = self.near_depth * self.band(shape)[1] / middles
        rows, cols, z = np.meshgrid(y, x, depth, indexing="ij")
        fx, fy = camera.focals
        ahead = np.stack([cols * z / fx, rows * z / fy, z], axis=-1)
        aside = np.stack([cols, rows], axis=-1)
        # Both eyes feel the wind of one place, that before the camera.
        moved, rate = of_rings(self, frame, ahead)
        # The air moves, so the camera moves the other way through it.
        drift, velocity = (
            (camera.focals * v[..., :2] - v[..., 2:] * aside) / self.near_depth
            for v in (moved, rate)
        )
        return drift, velocity

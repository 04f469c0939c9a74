"""The far flakes of a population: a texture that has the phases of flakes, layer by layer.

Every layer moves as its depth moves, and shows two generations of patterns while the air comes
nearer, since flakes pass through a depth and do not stay in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries.camera.tiles import tile_middles
from flurries.effects.checks import DepthMode
from flurries.effects.defocus import circles_of
from flurries.effects.flake_patterns import LONGEST_STREAK, Patterns, Streaks, patterns_of
from flurries.effects.flake_terms import LADDER, Flight, stops_of, terms_of, tile_counts
from flurries.effects.flow import flow_of, gusts_of
from flurries.effects.gusts import flakes_in_profile
from flurries.effects.lighting import lamp_shade
from flurries.effects.motion import Way
from flurries.effects.passes import Other
from flurries.effects.sheets import read_sheets
from flurries.effects.weather import WRAPS, Film, Layer, Weather
from flurries.frame.layer import Shade
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.light.phase import Optics
from flurries.motion.keys import value_at
from flurries.spectral.flake_frames import Before, Request, bands_of, frame_of
from flurries.trace import count

# Before a scene's depth layers that lie near each other are one group, of so many.
GROUPS = 4

# Blurred streaks are longer by this factor. Flakes below a pixel have waves beyond half a cycle,
# which pixels show as longer ones, and a blur of the longer wave takes too little of them: in the
# finest octave 7 % less of the squared streak.
LONGER = 1.035

# Focal lengths of a zoom have patterns of their own in steps of this ratio.
_FOCAL_STEP = 1.05


@dataclass(frozen=True, eq=False)
class FlakeTexture:
    """The texture.

    Attributes
    ----------
    weather : Weather
    depth_mode : {"pixel", "tile"}
        How exactly it follows a scene's depth.
    """

    weather: Weather
    depth_mode: DepthMode = "pixel"

    name = "texture"

    def _layers(self, film: Film) -> tuple[Layer, ...]:
        return () if self.weather.simulated else film.layers

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none."""
        film = self.weather.film(frame)
        layers = self._layers(film)
        if not layers:
            why = "all flakes are drawn one by one"
            return Needs((), (LeftOut("texture", why),), most=0.0)
        still = frame.settled and self.weather.motion.still and not has_keys(self.weather.emission)
        return Needs((Step("texture", once=still),), most=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float, way: Way) -> Array:
        """Return its opacity over the window, (h, w) float32."""
        film = self.weather.film(frame)
        if film.rigid:
            return read_sheets(self.weather, frame, film, amount)
        patterns = self._patterns(frame, film, amount)
        # Of what the scene cuts tiles are made again for each band.
        if frame.banded and not self._cut(frame):
            whole = frame.around
            if film.across:
                made = frame.once_each(
                    self, "texture", lambda: self._made(whole, film, patterns, amount)
                )
                return frame.part_of(made)
            bands = frame.once_each(
                self,
                "texture",
                lambda: bands_of(
                    patterns.ready, self.request(whole, film, patterns, amount), opacity=True
                ),
            )
            top, bottom, left, right = frame.window
            result = np.empty((bottom - top, right - left), np.float32)
            _core.flake_take(bands, result, top)
            return result
        return self._made(frame, film, patterns, amount)

    def _made(self, frame: Frame, film: Film, patterns: Patterns, amount: float) -> Array:
        request = self.request(frame, film, patterns, amount)
        count("tiles", request.mean.size)
        return self._turned(film, frame_of(patterns.ready, request, opacity=True))

    def _cut(self, frame: Frame) -> bool:
        """Whether the scene's depth hides it pixel by pixel."""
        return frame.depth is not None and self.depth_mode == "pixel"

    @staticmethod
    def _turned(film: Film, pixels: Array) -> Array:
        """Return the picture of a lattice that lies across."""
        return np.ascontiguousarray(pixels.T) if film.across else pixels

    def request(self, frame: Frame, film: Film, patterns: Patterns, amount: float) -> Request:
        """Return the tiles of a frame as the kernel reads them."""
        layers = film.layers
        x, y = tile_middles(frame.shape, frame.camera, (film.tile, film.tile), film.overlap)
        there = self._there(frame, film, amount, x, y)
        if film.constant:
            # All tiles move alike.
            x, y = x[:1], y[:1]
        moved, streak, turns, pace = self._motion(frame, film, x, y)
        if frame.depth is not None and self.depth_mode == "tile":
            there = there * self._seen_by_tiles(frame, film, layers)
        gains = np.ones((1, 1, len(layers)))
        if patterns.gains is not None:
            lengths = np.hypot(streak[..., 0], streak[..., 1])
            each = [patterns.gain(index, lengths[..., index]) for index in range(len(layers))]
            gains = np.stack(each, axis=-1)
        if film.across:
            moved, streak = (
                np.ascontiguousarray(part.transpose(1, 0, 2, 3)[..., ::-1])
                for part in (moved, streak)
            )
            turns, pace, there, gains = (
                part.transpose(1, 0, 2) for part in (turns, pace, there, gains)
            )
        tiles = tile_counts(frame.shape[::-1] if film.across else frame.shape, film)
        # Where streaks are drawn into patterns their flakes are shown once.
        drawn = patterns.gains is None
        lengths = np.hypot(streak[..., 0], streak[..., 1]).max(axis=(0, 1))
        stops = stops_of(np.zeros_like(lengths) if drawn else lengths, patterns.places > 1)
        terms = terms_of(
            Flight(moved, turns, pace, there, gains, streak),
            film,
            patterns,
            tiles,
            frame.seed,
            self._rungs(amount),
            stops,
        )
        mean = (there if len(self._rungs(amount)) > 1 else self._rungs(amount)[0]) * gains
        mean = mean * patterns.depths
        height, width = frame.shape
        top, bottom, left, right = frame.window
        window, shape = (top, bottom, left, right), (height, width)
        if film.across:
            window, shape = (left, right, top, bottom), (width, height)
        streak = LONGER * (streak * stops.blurred[:, None])[:, :, terms.layer]
        before = None
        if self._cut(frame):
            assert frame.depth is not None
            depth = frame.depth.T if film.across else frame.depth
            before = _before(layers, depth, terms.layer, mean / film.tile**2)
        return Request(
            shape=shape,
            overlap=film.overlap,
            pattern=terms.pattern,
            gain=np.ascontiguousarray(terms.gain),
            shift=terms.shift,
            streak=streak if stops.blurred.any() else None,
            mean=np.ascontiguousarray(mean.sum(axis=2) / film.tile**2),
            window=window,
            before=before,
        )

    def _motion(
        self, frame: Frame, film: Film, x: Float64, y: Float64
    ) -> tuple[Float64, Float64, Float64, Float64]:
        """Return the layers' displacements and streaks, px, generations, and these per frame."""
        layers = film.layers
        shape = (len(y), len(x), len(layers))
        moved, streak = np.empty((*shape, 2)), np.empty((*shape, 2))
        turns, pace = np.empty(shape), np.empty(shape)
        wrap = WRAPS * film.tile
        exposure = value_at(self.weather.motion.shutter, frame.t)
        for share, own, depths, passages in film.classes:
            way = share.motion.way(frame)
            now, rate, nearer = flow_of(frame, share.motion, way, x, y)
            moved[:, :, own] = now.along[:, :, None] / depths + now.shift[:, :, None]
            speed = rate.along[:, :, None] / depths + rate.shift[:, :, None]
            streak[:, :, own] = exposure * speed
            turns[:, :, own] = nearer / passages
            comes = abs(float(way.rate[2])) / passages
            pace[:, :, own] = comes + np.abs(speed[..., 0 if film.across else 1]) / wrap
        if self.weather.motion.varied is not None:
            for index, (share, slab) in enumerate(layers):
                extra = gusts_of(frame, share, slab.depth, x, y)
                moved[:, :, index] += extra[0]
                streak[:, :, index] += exposure * extra[1]
        return moved, streak, turns, pace

    def _there(self, frame: Frame, film: Film, amount: float, x: Float64, y: Float64) -> Float64:
        """Return the share of each layer's flakes that is there, (rows, cols, L) or (1, 1, L)."""
        weather = self.weather
        if weather.steady:
            return np.full((1, 1, len(film.layers)), amount * float(weather.emission))  # type: ignore[arg-type]
        down = np.array([0.0, 1.0, 0.0]) @ frame.camera.matrix()
        fx, fy = frame.camera.focals
        rays = down[0] * x[None, :] / fx + down[1] * y[:, None] / fy + down[2]
        each = [
            weather.amounts(frame, share, amount, (slab.depth * rays).ravel())
            for share, slab in film.layers
        ]
        return np.stack(each, axis=-1).reshape(*rays.shape, len(film.layers))

    @property
    def _opacity(self) -> float:
        return self.weather.population.opacity

    def _rungs(self, amount: float) -> tuple[float, ...]:
        """Return the amounts that patterns are made for: one where it never changes."""
        if self.weather.steady and not self.keyed_amount:
            return (amount * float(self.weather.emission),)  # type: ignore[arg-type]
        return LADDER

    keyed_amount: bool = False

    def _seen_by_tiles(self, frame: Frame, film: Film, layers: Sequence[Layer]) -> Float64:
        """Return the share of each layer that lies before the farthest of tiles."""
        assert frame.depth is not None
        x, y = tile_middles(frame.shape, frame.camera, (film.tile, film.tile), film.overlap)
        cx, cy = frame.camera.principal(frame.shape)
        half = film.tile // 2
        farthest = np.empty((len(y), len(x)), np.float32)
        for row, top in enumerate(np.round(y + cy).astype(int) - half):
            strip = frame.depth[max(top, 0) : top + film.tile].max(axis=0)
            for col, left in enumerate(np.round(x + cx).astype(int) - half):
                farthest[row, col] = strip[max(left, 0) : left + film.tile].max()
        return np.stack([_seen_before([layer], farthest) for layer in layers], axis=-1)

    def lamp_shade(self, frame: Frame, optics: Optics) -> Shade:
        """Return the light of the frame's lamps on it, by places."""
        layers = self.weather.film(frame).layers
        depths = np.array([layer.slab.depth for layer in layers])
        weights = np.array([layer.slab.coverage for layer in layers])
        return lamp_shade(frame, depths, weights, optics)

    def passes(self, frame: Frame, way: Way, others: Sequence[Other]) -> tuple[list[Array], Array]:
        """Return motions to other frames (h, w, 2) and depth (h, w) of what the window shows.

        They are means over the layers, each weighed by what it covers.
        """
        film = self.weather.film(frame)
        layers = self._layers(film)
        coverage = np.array([layer.slab.coverage for layer in layers])
        depths = np.array([layer.slab.depth for layer in layers])
        top, bottom, left, right = frame.window
        cx, cy = frame.camera.principal(frame.shape)
        x = np.arange(left, right, dtype=np.float64) + (0.5 - cx)
        y = np.arange(top, bottom, dtype=np.float64) + (0.5 - cy)
        # Unless the camera turns, x of the motion is of the column alone, and y of the row.
        zero = np.zeros(1)
        grids = [(x, y)] if frame.path.turns else [(x, zero), (zero, y)]
        motions = [np.zeros((len(down), len(across), 2)) for across, down in grids]
        for share in film.shares:
            own = np.array([one.share is share for one in layers])
            if not own.any():
                continue
            part = coverage[own] / coverage.sum()
            felt = np.zeros(2)
            if self.weather.motion.varied is not None:
                _, rates = flakes_in_profile(share.motion, frame, depths[own])
                felt = (part / depths[own]) @ rates[:, :2] * np.array(frame.camera.focals)
            for motion, grid in zip(motions, grids, strict=True):
                _, rate, _ = flow_of(frame, share.motion, share.motion.way(frame), *grid)
                motion += rate.along * float((part / depths[own]).sum()) + rate.shift * part.sum()
                motion += felt
        moves = [plane((len(y), len(x), 2)) for _ in others]
        for move, (other, _) in zip(moves, others, strict=True):
            across, down = (
                ((other.t - frame.t) * motion[..., axis]).astype(np.float32)
                for axis, motion in enumerate((motions[0], motions[-1]))
            )
            # Both numbers of a pixel at once, as one complex number: a quarter of the time.
            both = move.view(np.complex64)[..., 0]
            np.add(across.astype(np.complex64), 1j * down, out=both)
        depth = plane((len(y), len(x)))
        depth.fill(coverage @ depths / coverage.sum())
        return moves, depth

    def _patterns(self, frame: Frame, film: Film, amount: float) -> Patterns:
        scale = 1.0
        if frame.path.zooms:
            step = math.log(_FOCAL_STEP)
            scale = math.exp(round(math.log(frame.camera.focal) / step) * step)
            scale /= frame.path.longest_focal
        streaks = self._streaks(frame, film)
        circles = circles_of(frame.blur, [layer.slab.depth for layer in film.layers])
        rungs = self._rungs(amount)
        exposure = value_at(self.weather.motion.shutter, 0.0)
        return patterns_of(
            film.layers, film, self._opacity, frame.seed, rungs, scale, streaks, exposure, circles
        )

    def _streaks(self, frame: Frame, film: Film) -> Streaks | None:
        """Return the streaks of all layers where no tile and no frame has others."""
        if not film.constant:
            return None
        zero = np.zeros(1)
        streak = self._motion(frame, film, zero, zero)[1]
        lengths = np.hypot(streak[0, 0, :, 0], streak[0, 0, :, 1])
        if lengths.max(initial=0.0) > LONGEST_STREAK:
            return None
        both = streak[0, 0, :, ::-1] if film.across else streak[0, 0]
        # Rounding of a frame's time must not make other patterns.
        return tuple((round(float(u), 9), round(float(v), 9)) for u, v in both)


def _before(
    layers: Sequence[Layer], depth: Array, term: npt.NDArray[np.int64], mean: Float64
) -> Before:
    """Return terms of layers before a scene, grouped by their depths."""
    order = np.argsort([slab.depth for _, slab in layers], kind="stable")
    groups = [part for part in np.array_split(order, GROUPS) if len(part)]
    edges = np.array(sorted({edge for _, slab in layers for edge in (slab.near, slab.far)}))
    group = np.empty(len(layers), np.int32)
    for index, part in enumerate(groups):
        group[part] = index
    return Before(
        depth=depth,
        group=group[term],
        edges=edges,
        shares=np.stack([_seen_before([layers[i] for i in part], edges) for part in groups]),
        mean=np.stack([mean[..., part].sum(axis=2) for part in groups], axis=-1),
    )


def _seen_before(layers: Sequence[Layer], depth: Array) -> Float64:
    """Return the share of some layers' optical depth that lies before depths, 0 to 1."""
    edges = np.array(sorted({edge for _, slab in layers for edge in (slab.near, slab.far)}))
    whole = sum(slab.coverage for _, slab in layers)
    before = np.zeros(len(edges))
    for _, slab in layers:
        before += slab.coverage * slab.before(edges)
    return np.interp(depth, edges, before / whole)

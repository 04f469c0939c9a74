"""The far flakes of a population: a texture that has the phases of flakes, layer by layer.

Every layer moves as its depth moves, and shows two generations of patterns while the air comes
nearer, since flakes pass through a depth and do not stay in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries.camera.tiles import shift_at, tile_middles
from flurries.effects.checks import DepthMode
from flurries.effects.gain import gain_of
from flurries.effects.gusts import wind_at
from flurries.effects.motion import Way
from flurries.effects.weather import Film, Share, Weather
from flurries.frame.needs import Cost, LeftOut, Needs, Step, has_keys, omission
from flurries.frame.view import Frame
from flurries.motion.keys import value_at
from flurries.particles.population import Slab
from flurries.spectral.flakes import Request, bands_of, choices, frame_of, patterns_of, prepare
from flurries.trace import count

# How much the torus of a pattern is sheared: it comes back near its first place after 13 turns.
SHEAR = 5 / 13

# Patterns of each layer, by the tile: a larger one repeats less.
PATTERNS = {64: 8, 128: 4, 256: 4}

# Parts of equal number of a layer's diameters; within a part they lie evenly.
PARTS = 8

# Flakes of a layer that are drawn for each pixel of a tile, at most. Of more, whose images are
# small, a part is drawn, and what differs from the mean is made as large as that of all.
MOST_A_PIXEL = 0.1

# Amounts that patterns are kept for, where the amount of flakes changes.
LADDER = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)

# A torus comes back to a place near the first one after this many of its lengths.
WRAPS = 12.0

# Layers are joined into this many groups before a scene's depth.
GROUPS = 4

# Focal lengths of a zoom have patterns of their own in steps of this ratio.
_FOCAL_STEP = 1.05


class Layer(NamedTuple):
    """A slab with the class that it belongs to.

    Attributes
    ----------
    share : Share
    slab : Slab
    """

    share: Share
    slab: Slab


class Flow(NamedTuple):
    """How the picture moves at the middles of tiles.

    Attributes
    ----------
    along : (rows, cols, 2)
        Pixels times metres: over a depth it is a displacement, (x, y).
    shift : (rows, cols, 2)
        Pixels, at all depths alike.
    """

    along: Float64
    shift: Float64


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

    def layers(self, film: Film) -> list[Layer]:
        """Return the layers of a film, near ones first."""
        if self.weather.simulated:
            return []
        found = [Layer(share, slab) for share in film.shares for slab in share.slabs]
        return sorted(found, key=lambda layer: layer.slab.depth)

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none."""
        film = self.weather.film(frame)
        layers = self.layers(film)
        if not layers:
            why = "all flakes are drawn one by one"
            return Needs((), (LeftOut("texture", why),), most=0.0)
        still = frame.settled and self.weather.motion.still and not has_keys(self.weather.emission)
        step = Step("texture", lambda: self._cost(frame, film, len(layers)), once=still)
        most = 1.0 - 1e-6
        return Needs((step,), most=most, savings=(omission(step, most),))

    def alpha(self, frame: Frame, amount: float, way: Way) -> Array:
        """Return its opacity over the window, (h, w) float32."""
        film = self.weather.film(frame)
        patterns = self._patterns(frame, film, amount)
        if frame.depth is not None and self.depth_mode == "pixel":
            return self._before(frame, film, patterns, amount)
        request = self.request(frame, film, amount)
        if frame.banded:
            whole = frame.around
            if film.across:
                made = frame.once_each(
                    self, "texture", lambda: self._made(whole, film, patterns, amount)
                )
                return np.ascontiguousarray(whole_crop(made, whole, frame))
            bands = frame.once_each(
                self,
                "texture",
                lambda: bands_of(patterns, self.request(whole, film, amount), opacity=True),
            )
            top, bottom, left, right = frame.window
            result = np.empty((bottom - top, right - left), np.float32)
            _core.flake_take(bands, result, top)
            return result
        count("tiles", request.mean.size)
        return self._turned(film, frame_of(patterns, request, opacity=True))

    def _made(
        self, frame: Frame, film: Film, patterns: _core.PreparedFlakes, amount: float
    ) -> Array:
        request = self.request(frame, film, amount)
        return self._turned(film, frame_of(patterns, request, opacity=True))

    @staticmethod
    def _turned(film: Film, pixels: Array) -> Array:
        """Return the picture of a lattice that lies across."""
        return np.ascontiguousarray(pixels.T) if film.across else pixels

    def _before(
        self, frame: Frame, film: Film, patterns: _core.PreparedFlakes, amount: float
    ) -> Array:
        """Return its opacity before a scene: groups of layers, each as far as a pixel sees it."""
        assert frame.depth is not None
        depth = frame.crop(frame.depth)
        layers = self.layers(film)
        parts = [part for part in np.array_split(np.arange(len(layers)), GROUPS) if len(part)]
        result: Array | None = None
        for number, part in enumerate(parts):
            group = [layers[index] for index in part]
            mask = _seen_before(group, depth)
            request = self.request(frame, film, amount, part)
            result = frame_of(
                patterns,
                request,
                opacity=number + 1 == len(parts),
                mask=np.ascontiguousarray(mask.T) if film.across else mask,
                out=result,
                add=number > 0,
            )
        assert result is not None
        return self._turned(film, result)

    def request(
        self,
        frame: Frame,
        film: Film,
        amount: float,
        which: npt.NDArray[Any] | None = None,
    ) -> Request:
        """Return the tiles of a frame as the kernel reads them; `which` chooses layers."""
        layers = self.layers(film)
        rungs = self._rungs(amount)
        y, x = self._middles(frame, film)
        flows: dict[int, tuple[Flow, Flow, float]] = {}
        for layer in layers:
            if id(layer.share) not in flows:
                flows[id(layer.share)] = self._flow(frame, layer.share, x, y)
        shape = (len(y), len(x), len(layers))
        moved, streak = np.empty((*shape, 2)), np.empty((*shape, 2))
        turns, there = np.empty(shape), np.empty(shape)
        exposure = value_at(self.weather.motion.shutter, frame.t)
        gains = np.empty(len(layers))
        down = np.array([0.0, 1.0, 0.0]) @ frame.camera.matrix()
        fx, fy = frame.camera.focals
        rays = down[0] * x[None, :] / fx + down[1] * y[:, None] / fy + down[2]
        for index, (share, slab) in enumerate(layers):
            now, rate, nearer = flows[id(share)]
            moved[:, :, index] = now.along / slab.depth + now.shift
            speed = rate.along / slab.depth + rate.shift
            streak[:, :, index] = exposure * speed
            turns[:, :, index] = 2.0 * nearer / (slab.far - slab.near)
            varied = self.weather.motion.varied
            if varied is not None:
                extra = self._gusts(frame, share, slab, x, y)
                moved[:, :, index] += extra[0]
                streak[:, :, index] += exposure * extra[1]
            length = float(np.hypot(*streak[:, :, index].reshape(-1, 2).mean(axis=0)))
            gains[index] = gain_of(tuple(slab.diameters.tolist()), self._opacity, round(length, 1))
            if self.weather.steady:
                there[:, :, index] = amount * float(self.weather.emission)  # type: ignore[arg-type]
            else:
                heights = (slab.depth * rays).ravel()
                there[:, :, index] = self.weather.amounts(frame, share, amount, heights).reshape(
                    shape[:2]
                )
        if frame.depth is not None and self.depth_mode == "tile":
            there = there * self._seen_by_tiles(frame, film, layers)
        if film.across:
            moved, streak = (
                np.ascontiguousarray(part.transpose(1, 0, 2, 3)[..., ::-1])
                for part in (moved, streak)
            )
            turns, there = turns.transpose(1, 0, 2), there.transpose(1, 0, 2)
        return self._terms(frame, film, layers, which, moved, streak, turns, there, gains, rungs)

    def _terms(
        self,
        frame: Frame,
        film: Film,
        layers: list[Layer],
        which: npt.NDArray[Any] | None,
        moved: Float64,
        streak: Float64,
        turns: Float64,
        there: Float64,
        gains: Float64,
        rungs: tuple[float, ...],
    ) -> Request:
        """Return the request of layers that move: generations and rungs become terms."""
        rows, cols, number = turns.shape
        tiles = (rows, cols)
        grid = np.meshgrid(np.arange(rows), np.arange(cols), np.arange(number), indexing="ij")
        # By golden and other sections: tiles must not all pulse together.
        offset = np.modf(
            0.6180339887 * grid[0]
            + 0.7548776662 * grid[1]
            + 0.5698402910 * grid[2]
            + (frame.seed % 1009) * 0.1234567
        )[0]
        # A torus that is sheared comes back near its first place after so many lengths.
        wraps = moved[..., 1] / (WRAPS * film.tile)
        if film.comes:
            place = turns + wraps + offset
            first = np.floor(place)
            part = place - first
        else:
            place = wraps + offset
            first = np.floor(place)
            # Only the last length of them gives way to the next generation.
            part = np.clip((place - first - 1.0 + 1.0 / WRAPS) * WRAPS, 0.0, 1.0)
        weights = [np.cos(0.5 * math.pi * part), np.sin(0.5 * math.pi * part)]
        low = np.clip(np.searchsorted(rungs, there, side="right") - 1, 0, max(len(rungs) - 2, 0))
        ladder = np.array(rungs)
        if len(rungs) == 1:
            mixes = [(low, np.ones_like(there))]
        else:
            upper = (there - ladder[low]) / (ladder[low + 1] - ladder[low])
            mixes = [(low, 1.0 - upper), (low + 1, upper)]
        coverage = np.array([layer.slab.coverage for layer in layers])
        chosen = np.arange(number) if which is None else which
        pattern, gain, shift, streaks = [], [], [], []
        for generation, weight in enumerate(weights):
            if generation and not weight.any():
                continue
            taken = choices(
                frame.seed,
                tiles,
                layers=number,
                patterns=PATTERNS[film.tile],
                tile=film.tile,
                generation=np.ascontiguousarray(first + generation, dtype=np.int64),
            )
            for rung, mix in mixes:
                if not mix.any():
                    continue
                factor = weight * mix * gains
                named = taken.pattern + rung * (number * PATTERNS[film.tile])
                pattern.append(np.where(factor > 0.0, named, -1)[..., chosen])
                gain.append(factor[..., chosen])
                shift.append((taken.shift + moved)[:, :, chosen])
                streaks.append(streak[:, :, chosen])
        mirror = taken.mirror
        mean = (there if len(rungs) > 1 else np.full_like(there, rungs[0])) * gains * coverage
        height, width = frame.shape
        top, bottom, left, right = frame.window
        window, shape = (top, bottom, left, right), (height, width)
        if film.across:
            window, shape = (left, right, top, bottom), (width, height)
        exposed = value_at(self.weather.motion.shutter, frame.t) > 0.0
        return Request(
            shape=shape,
            overlap=film.overlap,
            pattern=np.ascontiguousarray(np.concatenate(pattern, axis=2), dtype=np.int32),
            gain=np.ascontiguousarray(np.concatenate(gain, axis=2)),
            shift=np.ascontiguousarray(np.concatenate(shift, axis=2)),
            streak=np.ascontiguousarray(np.concatenate(streaks, axis=2)) if exposed else None,
            mirror=mirror,
            mean=np.ascontiguousarray(mean[..., chosen].sum(axis=2) / film.tile**2),
            window=window,
        )

    @property
    def _opacity(self) -> float:
        return self.weather.population.opacity

    def _rungs(self, amount: float) -> tuple[float, ...]:
        """Return the amounts that patterns are made for: one where it never changes."""
        if self.weather.steady and not self.keyed_amount:
            return (amount * float(self.weather.emission),)  # type: ignore[arg-type]
        return LADDER

    keyed_amount: bool = False

    def _middles(self, frame: Frame, film: Film) -> tuple[Float64, Float64]:
        """Return where the middles of tiles are, px from the principal point: down, and across."""
        tile = (film.tile, film.tile)
        x, y = tile_middles(frame.shape, frame.camera, tile, film.overlap)
        return y, x

    def _flow(self, frame: Frame, share: Share, x: Float64, y: Float64) -> tuple[Flow, Flow, float]:
        """Return the flow since frame 0 and per frame, and how far the air has come nearer, m."""
        path, camera, motion = frame.path, frame.camera, share.motion
        way = motion.way(frame)
        moved = motion.travel(frame) if path.turns or path.zooms else way.moved
        rate = way.rate
        fx, fy = camera.focals
        shift = np.broadcast_to(np.array(camera.center_shift), (len(y), len(x), 2)).copy()
        shift_rate = np.zeros((len(y), len(x), 2))
        eye = np.array(camera.offset)
        if path.turns:
            rate = rate + np.cross(frame.spin(), camera.offset)
            shift += shift_at(x, y, frame.rotation(), camera, np.empty(shift.shape))
            shift_rate += shift_at(x, y, frame.spin(), camera, np.empty(shift.shape))
        if path.zooms:
            grown, grows = path.zoom(frame.t)
            places = np.stack(np.meshgrid(x, y), axis=-1)
            shift += grown * places
            shift_rate += grows * places

        def along(vector: Float64) -> Float64:
            result = np.empty((len(y), len(x), 2))
            result[..., 0] = (vector[2] * x - fx * vector[0])[None, :]
            result[..., 1] = (vector[2] * y - fy * vector[1])[:, None]
            return result

        return Flow(along(moved + eye), shift), Flow(along(rate), shift_rate), float(moved[2])

    def _gusts(
        self, frame: Frame, share: Share, slab: Slab, x: Float64, y: Float64
    ) -> tuple[Float64, Float64]:
        """Return what a wind that differs adds at the tiles of a layer: pixels, and per frame."""
        fx, fy = frame.camera.focals
        across, down = np.meshgrid(x / fx, y / fy)
        ahead = slab.depth * np.stack([across, down, np.ones_like(across)], axis=-1)
        moved, rate = wind_at(share.motion, frame, ahead)
        focal = np.array([fx, fy]) / slab.depth
        return moved[..., :2] * focal, rate[..., :2] * focal

    def _seen_by_tiles(self, frame: Frame, film: Film, layers: list[Layer]) -> Float64:
        """Return which part of each layer lies before the farthest of tiles."""
        assert frame.depth is not None
        y, x = self._middles(frame, film)
        cx, cy = frame.camera.principal(frame.shape)
        half = film.tile // 2
        farthest = np.empty((len(y), len(x)), np.float32)
        for row, top in enumerate(np.round(y + cy).astype(int) - half):
            strip = frame.depth[max(top, 0) : top + film.tile].max(axis=0)
            for col, left in enumerate(np.round(x + cx).astype(int) - half):
                farthest[row, col] = strip[max(left, 0) : left + film.tile].max()
        return np.stack([_seen_before([layer], farthest) for layer in layers], axis=-1)

    def passes(self, frame: Frame, later: Frame, way: Way, next_way: Way) -> tuple[Array, Array]:
        """Return motion (h, w, 2) and depth (h, w) of what the window shows of the texture.

        Both are means over the layers, each weighed by what it covers.
        """
        film = self.weather.film(frame)
        layers = self.layers(film)
        coverage = np.array([layer.slab.coverage for layer in layers])
        depths = np.array([layer.slab.depth for layer in layers])
        top, bottom, left, right = frame.window
        cx, cy = frame.camera.principal(frame.shape)
        x = np.arange(left, right, dtype=np.float64) + (0.5 - cx)
        y = np.arange(top, bottom, dtype=np.float64) + (0.5 - cy)
        motion = np.zeros((len(y), len(x), 2))
        for share in film.shares:
            own = np.array([one.share is share for one in layers])
            if own.any():
                _, rate, _ = self._flow(frame, share, x, y)
                part = coverage[own] / coverage.sum()
                motion += rate.along * float((part / depths[own]).sum()) + rate.shift * part.sum()
        depth = np.full((len(y), len(x)), float(coverage @ depths / coverage.sum()), np.float32)
        if frame.depth is not None:
            depth = np.minimum(depth, frame.crop(frame.depth))
        return (motion * (later.t - frame.t)).astype(np.float32), depth

    def _patterns(self, frame: Frame, film: Film, amount: float) -> _core.PreparedFlakes:
        focal = frame.camera.focal
        if frame.path.zooms:
            step = math.log(_FOCAL_STEP)
            focal = math.exp(round(math.log(focal) / step) * step)
        return _patterns_of(
            self, film, frame.seed, self._rungs(amount), focal / _focal_of(self, film, frame)
        )

    def _cost(self, frame: Frame, film: Film, layers: int) -> Cost:
        top, bottom, left, right = frame.window
        step = film.tile - film.overlap
        tiles = (math.ceil((bottom - top) / step) + 1) * (math.ceil((right - left) / step) + 1)
        passes = GROUPS if frame.deep and self.depth_mode == "pixel" else 1
        terms = layers * (2 if film.comes else 1)
        plane = (bottom - top) * (right - left)
        work = {
            "flake term": float(tiles * terms * film.tile**2 // 2),
            "flake tile": float(tiles * passes * film.tile**2),
        }
        size = f"{tiles} tiles of {film.tile} px, {layers} layers"
        return Cost(work, size, 4 * plane, 8 * plane)


def _focal_of(texture: FlakeTexture, film: Film, frame: Frame) -> float:
    """Return the focal length that a film's slabs were made for."""
    return frame.path.longest_focal if frame.path.zooms else frame.camera.focal


def _seen_before(layers: list[Layer], depth: Array) -> Array:
    """Return which part of some layers' optical depth lies before depths, 0 to 1 float32."""
    edges = np.array(sorted({edge for _, slab in layers for edge in (slab.near, slab.far)}))
    whole = sum(slab.coverage for _, slab in layers)
    before = np.zeros(len(edges))
    for _, slab in layers:
        before += slab.coverage * slab.before(edges)
    return np.interp(depth, edges, before / whole).astype(np.float32)


@lru_cache(maxsize=4)
def _patterns_of(
    texture: FlakeTexture, film: Film, seed: int, rungs: tuple[float, ...], scale: float
) -> _core.PreparedFlakes:
    """Return the patterns of a film's layers, ready for frames; rung after rung."""
    layers = texture.layers(film)
    counts, sizes, wider = [], [], []
    for _, slab in layers:
        shares = np.linspace(0.0, 1.0, len(slab.diameters))
        edges = scale * np.interp(np.linspace(0.0, 1.0, PARTS + 1), shares, slab.diameters)
        number = slab.count / scale**2
        drawn = min(number, MOST_A_PIXEL * film.tile**2)
        wider.append(math.sqrt(number / drawn) if drawn > 0.0 else 1.0)
        counts += [drawn / PARTS] * PARTS
        sizes += list(pairwise(edges.tolist()))
    made = []
    for rung in rungs:
        found = patterns_of(
            film.tile,
            counts=counts,
            diameters=sizes,
            opacity=texture.weather.population.opacity,
            patterns=PATTERNS[film.tile],
            shear=SHEAR,
            seed=seed,
            amount=rung,
        )
        summed = found.reshape(len(layers), PARTS, *found.shape[1:]).sum(axis=1)
        # The parts stand for a curve by straight pieces: what they cover is set right.
        for index, (_, slab) in enumerate(layers):
            mean, wanted = float(summed[index, 0, 0, 0].real), slab.coverage * rung
            if mean > 0.0:
                summed[index] *= wanted / mean / wider[index]
                summed[index, :, 0, 0] = wanted
        made.append(summed)
    return prepare(np.ascontiguousarray(np.concatenate(made)), shear=SHEAR, dtype=np.float32)


def whole_crop(made: Array, whole: Frame, frame: Frame) -> Array:
    """Return the part of a frame's window out of that of a larger one."""
    top, _, left, _ = whole.window
    rows = slice(frame.window[0] - top, frame.window[1] - top)
    return made[rows, frame.window[2] - left : frame.window[3] - left]

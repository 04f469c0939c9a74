"""The far ones of what falls, as a texture of flakes: patterns once, then a transform by tile.

Patterns are kept for rungs of density and of focal length, so that pictures of any size and
amount share them; what differs from a rung is made up for by the gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._threads import kept_by_mode
from flurries.augment.falling import Falling, Streaks, covered_by, ein, population_of
from flurries.particles.population import Slab, slabs_of
from flurries.spectral.flake_frames import Request, choices, prepare
from flurries.spectral.flakes import patterns_of

# How much the torus of a pattern is sheared.
_SHEAR = 5 / 13

_PATTERNS = 6

# Layers are coarse: nothing comes nearer here, so that they only differ in how they move.
_RATIO = 2.2

# Rungs, as ratios.
_DENSITY = 2.0**0.5
_REACH = 1.25
_FOCAL = 1.06
WAY = 1.3
_THICK = 1.15

# Opacity of the middle of a pattern's flakes.
_MIDDLE = 0.9

# What flakes are wider by, px^2 of variance: narrow ones end a transform in ripples of two pixels,
# which the least opacity of 0 turns into a lattice of dark dots.
_SOFT = 0.15

# What this, a pixel and the sprite's least width add to the variance of a flake's image, px^2.
_LEAST = 0.17 + _SOFT

# Parts of a layer's diameters, even within; and the most flakes that are drawn for a pixel.
_PARTS = 4
_MOST_A_PIXEL = 0.1

# Tiles along the side of the frame that means are measured of.
_SAMPLE = 4

# A shorter way leaves no streak, metres.
_LEAST_WAY = 1e-3

SEED = 7004


def tile_of(shape: tuple[int, int]) -> int:
    """Return the size of tiles: some four to eight along the picture's longer side."""
    longer = max(shape)
    return 64 if longer <= 320 else 128 if longer <= 1280 else 256


def overlap_of(tile: int) -> int:
    """Return the overlap of tiles, pixels: streaks that all end within a few make a line."""
    return 3 * tile // 16


class Rungs(NamedTuple):
    """The key of kept textures: whole powers of ratios, except the look and the tile.

    Attributes
    ----------
    look : (kind, sizes, far)
    density : int
        Flakes per cubic metre.
    tile : int
        Pixels.
    reach, lens, way, thick : int
    """

    look: tuple[str, tuple[float, float, float], float]
    density: int
    tile: int
    reach: int
    lens: int
    way: int
    thick: int


@dataclass(frozen=True, eq=False)
class Patterns:
    """The texture of one rung.

    Attributes
    ----------
    tile : int
        Pixels.
    density : float
        Flakes per cubic metre.
    depths : (L,)
        That layers move as, metres.
    slabs : list of Slab
    coverage : (L,)
        Of a tile by the patterns' flakes, square pixels.
    prepared : PreparedFlakes
    focal : float
        Pixels.
    mean : float
        Mean optical depth.
    """

    tile: int
    density: float
    depths: Float64
    slabs: list[Slab]
    coverage: Float64
    prepared: _core.PreparedFlakes
    focal: float
    mean: float


@dataclass(frozen=True, eq=False)
class Texture:
    """The part of a weather that is a texture.

    Attributes
    ----------
    patterns : Patterns
    more : float
        Its density over the rung's.
    opaque : float
        Optical depth of its flakes' middles over that of the patterns'.
    covered : float
        What they cover, over the sum of their optical depths.
    gains : (L,)
        Of layers whose flakes are less than a pixel wide: spread over one they are thinner, and
        would cover more.
    own : float
        Mean optical depth of patterns with these gains.
    lift : float
        What the mean of the optical depth is multiplied by, so that the mean opacity is right:
        blended tiles are less than 0 here and there, which is taken for 0.
    rungs : Rungs, optional
        That everything but `more`, `opaque` and `covered` follows from.
    """

    patterns: Patterns
    more: float
    opaque: float
    covered: float
    gains: Float64
    own: float
    lift: float = 1.0
    rungs: Rungs | None = None

    @property
    def gain(self) -> float:
        """The factor of all layers' gains."""
        return math.sqrt(self.more) * self.opaque

    @property
    def mean(self) -> float:
        """Mean optical depth."""
        return self.lift * self.more * self.opaque * self.own

    @property
    def shares(self) -> Float64:
        """Of the mean by layer, (L,)."""
        covered = self.gains * self.patterns.coverage
        return np.asarray(covered / covered.sum())

    @property
    def far(self) -> float:
        """Depth of its end, metres."""
        return self.patterns.slabs[-1].far

    @property
    def left(self) -> float:
        """The share of light that all of the texture lets through."""
        return math.exp(-self.more * self.opaque * self.covered * self.patterns.mean)

    def before(self, depth: Float64) -> Float64:
        """Return the share of light from depths that the texture lets through."""
        found = self.patterns
        total = np.zeros(len(depth))
        for slab, covered in zip(found.slabs, found.coverage, strict=True):
            total += covered * slab.before(depth)
        total *= -self.more * self.opaque * self.covered / found.tile**2
        return np.asarray(np.exp(total))

    def request(
        self, shape: tuple[int, int], focal: float, *, seed: int, moved: Float64, streak: Float64
    ) -> Request:
        """Return the texture of a frame.

        Parameters
        ----------
        moved : (2,)
            Metres (x, y) since time 0, less what the eye is aside.
        streak : (2,)
            Metres (x, y) while the shutter is open.
        """
        found = self.patterns
        overlap = overlap_of(found.tile)
        tiles = tuple(_core.tile_count(length, found.tile, overlap) for length in shape)
        count = len(found.depths)
        chosen = choices(seed, tiles, layers=count, patterns=_PATTERNS, tile=found.tile)  # type: ignore[arg-type]
        pixels = (focal / found.depths)[:, None]
        return Request(
            shape=shape,
            overlap=overlap,
            pattern=chosen.pattern,
            gain=(self.gain * self.gains).reshape(1, 1, count),
            shift=chosen.shift + pixels * moved,
            streak=(pixels * streak).reshape(1, 1, count, 2) if streak.any() else None,
            mean=np.array([[self.mean]]),
            window=(0, shape[0], 0, shape[1]),
        )

    def drawn(
        self, request: Request, *, opacity: bool, mask: Array | None = None, out: Array, add: bool
    ) -> Array:
        """Write a request's optical depth, or the opacity of all of it."""
        _core.flake_frame(out, self.patterns.prepared, request, opacity, add, mask)
        return out

    def layers(self, request: Request) -> list[Request]:
        """Return each layer's own request."""
        shares, own = self.shares, []
        for index in range(len(shares)):
            one = slice(index, index + 1)
            blur = request.streak
            own.append(request._replace(
                pattern=np.ascontiguousarray(request.pattern[..., one]),
                gain=np.ascontiguousarray(request.gain[..., one]),
                shift=np.ascontiguousarray(request.shift[:, :, one]),
                streak=None if blur is None else np.ascontiguousarray(blur[:, :, one]),
                mean=shares[index] * request.mean,
            ))  # fmt: skip
        return own


class Base(NamedTuple):
    """The part that textures of like weather share: all that a rung of the way decides.

    Attributes
    ----------
    reach : float
        Depth up to which flakes are drawn, metres.
    patterns : Patterns or None
        None where all flakes are drawn.
    gains, own, lift, rungs
        As in the texture.
    """

    reach: float
    patterns: Patterns | None
    gains: Float64
    own: float
    lift: float
    rungs: Rungs


def base_of(
    falling: Falling, way: float, shape: tuple[int, int], focal: float, least: float
) -> Base:
    """Return the base of streaks of a way in metres: the flakes drawn, and those of a texture."""
    rung = round(math.log(max(way, _LEAST_WAY)) / math.log(WAY))
    return _base_of(falling, rung, tile_of(shape), focal, least)


@kept_by_mode(256)
def _base_of(falling: Falling, far: int, tile: int, focal: float, least: float) -> Base:
    way = WAY**far
    reach = falling.reach(way, focal, tile, least=least)
    step = math.ceil(math.log(reach) / math.log(_REACH) - 0.3)
    reach = falling.far if reach >= falling.far else min(_REACH**step, falling.far)
    rung = round(math.log(falling.streaks(way).density) / math.log(_DENSITY))
    lens = round(math.log(focal) / math.log(_FOCAL))
    dense = round(math.log(falling.thick(way)) / math.log(_THICK))
    rungs = Rungs((falling.kind, falling.sizes, falling.far), rung, tile, step, lens, far, dense)
    if reach >= falling.far:
        return Base(reach, None, np.zeros(0), 0.0, 1.0, rungs)
    found = _patterns_of(rungs.look, rung, lens, tile, step)
    return Base(reach, found, *_settled(found, lens, far, dense, falling.sizes[1]), rungs)


def texture_of(base: Base, streaks: Streaks) -> Texture | None:
    """Return the texture of what falls beyond the reach; None where all of it is drawn."""
    found = base.patterns
    if found is None:
        return None
    more, opaque, covered = (
        streaks.density / found.density,
        streaks.thick / _MIDDLE,
        streaks.covered,
    )
    return Texture(found, more, opaque, covered, base.gains, base.own, base.lift, base.rungs)


@kept_by_mode(48)
def _patterns_of(
    look: tuple[str, tuple[float, float, float], float], rung: int, lens: int, tile: int,
    step: int,
) -> Patterns:  # fmt: skip
    kind, law, far = look
    density, focal, reach = _DENSITY**rung, _FOCAL**lens, _REACH**step
    population, each = population_of(kind, law, density, _MIDDLE)
    slabs = slabs_of(population, each, focal, tile, reach=reach, far=far, ratio=_RATIO)
    counts, sizes, wider, weights = [], [], [], []
    for slab in slabs:
        shares = np.linspace(0.0, 1.0, len(slab.diameters))
        edges = np.interp(np.linspace(0.0, 1.0, _PARTS + 1), shares, slab.diameters)
        # Of many, whose images are small, a part is drawn, and what differs from the mean made
        # as large as that of all.
        drawn = min(slab.count, _MOST_A_PIXEL * tile**2)
        wider.append(math.sqrt(slab.count / drawn))
        counts += [drawn / _PARTS] * _PARTS
        soft = np.sqrt(edges**2 + 8.0 * _SOFT)
        sizes += list(pairwise(soft.tolist()))
        weights.append(_mean_square(edges) / _mean_square(soft))
    made = patterns_of(
        tile, counts=counts, diameters=sizes, opacity=_MIDDLE, patterns=_PATTERNS,
        shear=_SHEAR, seed=SEED,
    )  # fmt: skip
    parts = made.reshape(len(slabs), _PARTS, *made.shape[1:])
    # As dense as before they were made wider; all together are brought to their coverage below.
    summed = np.einsum("lp,lp...->l...", np.array(weights), parts)
    for index, slab in enumerate(slabs):
        mean = float(summed[index, 0, 0, 0].real)
        summed[index] *= slab.coverage / mean / wider[index]
        summed[index, :, 0, 0] = slab.coverage
    coverage = np.array([slab.coverage for slab in slabs])
    return Patterns(
        tile, density, np.array([slab.depth for slab in slabs]), slabs, coverage,
        prepare(np.ascontiguousarray(summed), shear=_SHEAR, dtype=np.float32),
        focal, float(coverage.sum()) / tile**2,
    )  # fmt: skip


def _mean_square(edges: Float64) -> Float64:
    """Return the means of squares that are even between each two edges."""
    return np.asarray((edges[:-1] ** 2 + edges[:-1] * edges[1:] + edges[1:] ** 2) / 3.0)


@kept_by_mode(1024)
def _settled(
    patterns: Patterns, lens: int, far: int, dense: int, diameter: float
) -> tuple[Float64, float, float]:
    """Return the gains, their mean depth and the lift that make a texture cover what its flakes do.

    The numbers are rungs, of flakes of a mean diameter.
    """
    way, focal, thick = WAY**far, _FOCAL**lens, _THICK**dense
    covered = covered_by(thick, way, diameter)
    gains = np.array([
        _gain_of(slab, thick, way * focal / slab.depth, covered) for slab in patterns.slabs
    ])  # fmt: skip
    own = float((gains * patterns.coverage).sum()) / patterns.tile**2
    texture = Texture(patterns, 1.0, thick / _MIDDLE, covered, gains, own)
    size = _SAMPLE * patterns.tile
    streak = np.array([0.0, way])
    asked = texture.request((size, size), focal, seed=SEED, moved=np.zeros(2), streak=streak)
    depth = np.empty((size, size), np.float32)
    texture.drawn(asked, opacity=False, out=depth, add=False)
    mean, lift = float(asked.mean[0, 0]), 1.0
    for _ in range(3):
        left = float(np.exp(-np.maximum(depth + (lift - 1.0) * mean, 0.0)).mean(dtype=np.float64))
        lift += math.log(left / texture.left) / mean
    return gains, own, lift


def _gain_of(slab: Slab, thick: float, streak: float, covered: float) -> float:
    """Return the gain by which flakes of a layer cover what they would if pixels were small."""
    variance = slab.coverage / (slab.count * _MIDDLE * 2.0 * math.pi)
    wide = variance + _LEAST
    peak = thick * variance / wide / math.hypot(1.0, streak / math.sqrt(2.0 * math.pi * wide))
    gain = 1.0
    for _ in range(8):
        gain = covered * gain * peak / ein(gain * peak)
    return gain

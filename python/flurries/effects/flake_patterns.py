"""The patterns of a film's layers: optical depths of their flakes, at places within a pixel.

Where the air passes every tile alike and always at one speed, flakes are drawn with the streaks
that the shutter makes of them, and depths are exact. Elsewhere they rest, and frames blur their
depths; as that averages depths and not opacities, a gain sets right what they cover.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries._threads import kept_by_mode
from flurries.effects.defocus import disc_factor
from flurries.effects.gain import STREAKS, gains_of, part_shown
from flurries.effects.weather import Film, Layer
from flurries.spectral.flake_frames import prepare

# Patterns of each layer, by the tile: a larger one repeats less.
PATTERNS = {63: 8, 128: 4, 256: 4}

# Places within a pixel, by the tile: flakes in large tiles are fast, and their streaks hide places.
PLACES = {63: 16, 128: 16, 256: 1}

# Flakes of a layer that are drawn for each pixel of a tile, at most. Of more, whose images are
# small, a part is drawn, and what differs from the mean is made as large as that of all.
MOST_A_PIXEL = {63: 1.0, 128: 0.6, 256: 0.1}

# Streaks up to so many pixels are drawn into patterns.
LONGEST_STREAK = 24.0


class Slab(NamedTuple):
    """A layer as the kernel draws it.

    Attributes
    ----------
    drawn, number : float
        Flakes that are drawn in a tile, and that there are.
    coverage : float
        Of all of them in a tile, px2.
    diameters : tuple of float
        Quantiles of their images at even shares, px.
    streak : (x, y)
        Pixels that they move by while the shutter is open.
    thin : float
        The part of a flake that a pixel shows where the pattern is moved instead, 0 to 1.
    """

    drawn: float
    number: float
    coverage: float
    diameters: tuple[float, ...]
    streak: tuple[float, float]
    thin: float


@dataclass(frozen=True, eq=False)
class Patterns:
    """The patterns of a film.

    Attributes
    ----------
    ready : PreparedFlakes
        Rung after rung of the amounts, layer after layer.
    depths : (L,)
        Mean optical depth of a tile of each layer, px2, where all flakes are there.
    gains : (L, n) or None
        Of each layer, for streaks of `gain.STREAKS` px; None where streaks are drawn.
    number, places : int
        Patterns of a layer, and places of a pattern.
    """

    ready: _core.PreparedFlakes
    depths: Float64
    gains: Float64 | None
    number: int
    places: int

    @property
    def each(self) -> int:
        """The number of ready patterns that a layer has."""
        return self.number * self.places

    def gain(self, index: int, streak: Float64) -> Float64:
        """Return the gains of a layer for lengths of streaks, px."""
        assert self.gains is not None
        return np.asarray(np.interp(streak, STREAKS, self.gains[index]))


Streaks = tuple[tuple[float, float], ...]


@kept_by_mode(2)
def _waves(
    slabs: tuple[Slab, ...],
    tile: int,
    law: tuple[int, float, int],
    rungs: tuple[float, ...],
) -> tuple[Array, Float64]:
    """Return waves of the patterns as a lens without an opening sees them, and mean depths.

    All is asked for by value: another scene of the same weather finds what the first one made.
    """
    shear, opacity, seed = law
    shape = (len(rungs), len(slabs), PATTERNS[tile], PLACES[tile], tile, tile // 2 + 1)
    made = np.empty(shape, np.complex64)
    depths: list[float] = []
    for rung, out in zip(rungs, made, strict=True):
        depths = _core.flake_population(out, slabs, (shear, opacity, rung, seed))
    return made, np.array(depths)


def _thin(diameters: Float64, streak: float) -> float:
    """Return the part of flakes that moved patterns show, in steps that few films differ in."""
    return max(round(part_shown(diameters, streak), 1), 0.05)


@kept_by_mode(2)
def patterns_of(
    layers: tuple[Layer, ...],
    film: Film,
    opacity: float,
    seed: int,
    rungs: tuple[float, ...],
    scale: float,
    streaks: Streaks | None,
    exposure: float,
    circles: tuple[float, ...] = (),
) -> Patterns:
    """Return the patterns of a film.

    Parameters
    ----------
    rungs : tuple of float
        Shares of the flakes that patterns are made for.
    scale : float
        Of the images, for a lens that has zoomed since the layers were made.
    streaks : tuple of (x, y), optional
        Of each layer, px; without them flakes rest, and patterns are moved.
    exposure : float
        Of the film's first frame, frames.
    circles : tuple of float
        Circles of confusion of each layer, px; () where all are sharp.
    """
    slabs = _slabs_of(layers, film.tile, scale, streaks, exposure)
    law = (film.shear, opacity, seed)
    return _patterns(slabs, film.tile, law, rungs, streaks is None, circles)


@lru_cache(maxsize=16)
def _slabs_of(
    layers: tuple[Layer, ...],
    tile: int,
    scale: float,
    streaks: Streaks | None,
    exposure: float,
) -> tuple[Slab, ...]:
    return tuple(
        Slab(
            drawn=min(count := slab.count / scale**2, MOST_A_PIXEL[tile] * tile**2),
            number=count,
            coverage=slab.coverage,
            diameters=tuple((scale * slab.diameters).tolist()),
            streak=(0.0, 0.0) if streaks is None else streaks[index],
            thin=1.0 if streaks else _thin(slab.diameters, exposure * share.flow / slab.depth),
        )
        for index, (share, slab) in enumerate(layers)
    )


@kept_by_mode(4)
def _patterns(
    slabs: tuple[Slab, ...],
    tile: int,
    law: tuple[int, float, int],
    rungs: tuple[float, ...],
    resting: bool,
    circles: tuple[float, ...],
) -> Patterns:
    """Return patterns by value, as their waves are: scenes of the same weather share them."""
    (shear, opacity, _), places = law, PLACES[tile]
    diameters = np.array([slab.diameters for slab in slabs])
    made, depths = _waves(slabs, tile, law, rungs)
    sharp = np.ones(len(slabs))
    if circles:
        factors = np.stack([disc_factor(tile, shear / tile, circle) for circle in circles])
        wide = 0.5 * np.array(circles) ** 2
        square = (diameters**2).mean(axis=1)
        sharp = square / (square + wide)
        # Blurred depths cover as much as they sum up to: of opacities, not of sharp depths.
        area = np.array([slab.coverage for slab in slabs]) / np.maximum(depths, 1e-12)
        share = sharp + (1.0 - sharp) * area
        factors = (factors * share[:, None, None]).astype(np.float32)
        made = made * factors[None, :, None, None]
        depths = depths * share
    ready = prepare(
        made.reshape(-1, places, tile, tile // 2 + 1), shear=shear / tile, dtype=np.float32
    )
    gains = None
    if resting:
        each = zip(diameters, slabs, strict=True)
        gains = np.stack([gains_of(own[::8], opacity, slab.thin) for own, slab in each])
        gains = 1.0 + (gains - 1.0) * sharp[:, None]
    return Patterns(ready, depths, gains, PATTERNS[tile], places)

"""Far flakes of pictures: sheets that are kept, one for each layer, read from places of their own.

Pictures of about one weather share sheets: each reads every layer from a random place on, so that
what two pictures see has nothing in common. Sheets are of rungs of the amount, of the focal length
and of the way; what a picture's weather differs by from its rungs its gains make up for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import ALL, Kept
from flurries._threads import reproducible
from flurries.augment.draws import uniforms
from flurries.augment.falling import OPACITY, Falling, Look, law_of, seen_by, square
from flurries.effects.sheets import diameters_of, hash_of
from flurries.particles.population import FADE, Population, SizeClass, layer_edges, slabs_of

# Bytes of all sheets of a process, at most: the oldest go.
MOST_BYTES = 64 << 20

LAYERS = 6

# Rungs, as ratios.
_FOCAL, _WAY, _TIMES = 1.06, 1.6, 2.0**0.5

# A shorter way over the mean diameter leaves no streak in sheets.
_REST = 0.35

# Between two directions of streaks, radians: the ends, and times a flake's diameter over its way.
_TURN, _TURNS = (0.16, 0.7), 1.5

# Flakes that are drawn for each pixel of a picture, by itself and of a film or pair; pictures by
# themselves that are no larger than sheets have all their flakes from them.
_DRAWN, _DRAWN_MOVING, _SHEETS_ALONE = 0.0001, 0.0015, 600

# Diameter in px of the largest flakes of sheets, and their longest streak.
_LARGEST, _LONGEST = 30.0, 192.0

# Pixels of a sheet's sides, before a layer's own factor, how much larger than the picture they are
# at most, and the flakes that it has at least.
_SIDE, _LARGER, _FLAKES = (240.0, 512.0), 1.0, 60.0

# Sizes of flakes in a sheet.
_SIZES = 4

# Flakes for each pixel of a sheet at most: of a picture of a few pixels they cannot be told apart.
_MOST = 100.0

# Factors of the optical depth for which the light that sheets leave is known, about their own.
_GAINS = 1.4 ** np.arange(-8.0, 9.0)

SEED = 7004
_STREAM = 7005

_SHEETS = ALL[__name__] = Kept(most_bytes=MOST_BYTES)


class Rungs(NamedTuple):
    """What decides sheets."""

    falling: Falling
    # Numbers of rungs: of how many more flakes there are, of the focal length, of the way, and of
    # the direction, whose steps the way decides.
    times: int
    lens: int
    way: int
    turn: int
    # Focal length over the picture's longer side.
    ratio: float
    # Whether the picture is of a film or pair.
    moving: bool
    # Whether sheets are larger than the picture, which then has no drawn flakes.
    alone: bool


@dataclass(frozen=True, eq=False)
class Sheets:
    """The sheets of all layers of one rung; none where all flakes are drawn."""

    # Depth up to which flakes are drawn, metres.
    reach: float
    sheets: list[_core.FlakeSheet]
    # Metres.
    edges: list[tuple[float, float]]
    # (L, 1) metres that layers move as, and (L, 2) pixels, across and down.
    depths: Float64
    periods: Float64
    # (n,) logarithms of optical depths per metre, at even steps; and (n, L) factors of the sheets'
    # optical depth that bring these about.
    thickness: Float64
    gains: Float64

    @property
    def bytes(self) -> int:
        """What is kept of them now."""
        return sum(sheet.bytes for sheet in self.sheets)

    def layers(self, falling: Falling, focal: float, seed: int, moved: Float64 | None) -> list[Any]:
        """Return the layers before a picture, for `_core.sheet_read`, `moved` by metres."""
        count = len(self.sheets)
        if count == 0:
            return []
        shift = np.floor(uniforms(seed, _STREAM, 2 * count).reshape(count, 2) * self.periods)
        if moved is not None:
            shift += focal / self.depths * moved
        # Between two steps, and as at the nearest one beyond them but for their ratio.
        first, last = self.thickness[0], self.thickness[-1]
        wanted = math.log(falling.thickness)
        place = (wanted - first) / (last - first) * (len(self.thickness) - 1)
        step = min(max(int(place), 0), len(self.thickness) - 2)
        part = min(max(place - step, 0.0), 1.0)
        gains = self.gains[step] + part * (self.gains[step + 1] - self.gains[step])
        if place < 0.0:
            gains = gains * math.exp(wanted - first)
        return [
            (sheet, (x, y), (gain, 0.0), near, far)
            for sheet, (x, y), gain, (near, far) in zip(
                self.sheets, shift.tolist(), gains.tolist(), self.edges, strict=True
            )
        ]  # fmt: skip


def sheets_of(
    rung: Falling, times: float, velocity: tuple[float, float], way: float, longer: int,
    focal: float, moving: bool,
) -> Sheets:  # fmt: skip
    """Return the sheets of a weather that goes a `way` in metres while the shutter is open."""
    number, turn = 0, 0
    ratio = way / rung.sizes[1]
    if ratio > _REST:
        number = 1 + round(math.log(ratio / _REST) / math.log(_WAY))
        turn = round(math.atan2(*velocity) / _turn_of(number))
    rungs = Rungs(
        rung, round(math.log(times) / math.log(_TIMES)), round(math.log(focal) / math.log(_FOCAL)),
        number, turn, focal / longer, moving, longer <= _SHEETS_ALONE and not moving,
    )  # fmt: skip
    key = (rungs, reproducible())
    made: list[Sheets] = []

    def make() -> Sheets:
        made.append(_made(rungs))
        return made[0]

    found = _SHEETS.once(key, make)
    if made or moving:
        # Places of sheets are made as they are visited.
        _SHEETS.trim()
    return found


def _turn_of(way: int) -> float:
    """Return the step between directions of streaks of a way."""
    return min(max(_TURNS / (_REST * _WAY ** (way - 1)), _TURN[0]), _TURN[1])


def _made(rungs: Rungs) -> Sheets:
    focal = _FOCAL**rungs.lens
    longer = focal / rungs.ratio
    falling = seen_by(rungs.falling, longer, _TIMES**rungs.times)
    way = falling.sizes[1] * _REST * _WAY ** (rungs.way - 1) if rungs.way else 0.0
    look = falling.look(way)
    reach = _reach_of(falling, look, way, longer, focal, rungs)
    none = np.zeros((0, 2))
    if reach >= falling.far:
        return Sheets(falling.far, [], [], none, none, np.zeros(2), none)
    law, mean = law_of(falling.sizes), square(falling.sizes)
    ends = law.smallest, law.largest
    one = SizeClass(look.density, *ends, 0.0, law.nodes(*ends))
    population = Population(look.density, law, OPACITY, np.ones_like)
    slabs = slabs_of(
        population, one, focal, reach=reach, far=falling.far,
        edges=layer_edges(reach, falling.far, LAYERS),
    )  # fmt: skip
    angle = rungs.turn * _turn_of(rungs.way)
    sheets, periods, gains = [], [], []
    # What lies beyond the steps is as rare as amounts beside their rungs.
    thickness = math.log(falling.thickness) + np.linspace(-1.2, 1.2, 25)
    metres = np.array([slab.coverage for slab in slabs]) / (
        look.density * OPACITY * 0.25 * math.pi * mean
    )
    most = min(max(_LARGER * longer, _SIDE[0]), _SIDE[1])
    for number, slab in enumerate(slabs):
        least = math.sqrt(_FLAKES / max(slab.count, 1e-9))
        side = min(max(least, _SIDE[0]), most) * (1.0 + 0.2 * ((0.618_034 * (number + 1)) % 1.0))
        rows, columns = round(side), round(side * (1.0 + 0.1 * ((0.414_214 * (number + 1)) % 1.0)))
        length = way * focal / slab.depth
        sheet = _core.FlakeSheet(
            hash_of(SEED, number), (rows, columns), 0, min(slab.count, _MOST),
            diameters_of(slab, _SIZES).tolist(),
            (length * math.sin(angle), length * math.cos(angle)), 0.0, OPACITY, (0.0, 1.0),
        )  # fmt: skip
        factors = look.gain * _GAINS
        taken = -np.log(sheet.left(factors.tolist()))
        wanted = thickness + math.log(metres[number])
        gains.append(np.exp(np.interp(wanted, np.log(taken), np.log(factors))))
        sheets.append(sheet)
        periods.append((columns, rows))
    return Sheets(
        reach, sheets, [(slab.near, slab.far) for slab in slabs],
        np.array([[slab.depth] for slab in slabs]), np.array(periods, np.float64), thickness,
        np.stack(gains, axis=1),
    )  # fmt: skip


def _reach_of(
    falling: Falling, look: Look, way: float, longer: float, focal: float, rungs: Rungs
) -> float:
    """Return the depth up to which flakes are drawn, metres."""
    images = max(falling.sizes[2] * focal / _LARGEST, way * focal / _LONGEST)
    # Beyond it sheets fade in: half of the way they take all.
    first = falling.near / (1.0 + 0.5 * FADE)
    if rungs.alone and images <= first:
        return first
    share = _DRAWN_MOVING if rungs.moving else _DRAWN
    cost = (3.0 * share * focal**2 / look.density) ** (1.0 / 3.0)
    reach = max(cost, images, 1.5 * falling.near)
    return falling.far if reach > 0.8 * falling.far else reach

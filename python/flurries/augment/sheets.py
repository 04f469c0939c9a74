"""Far flakes of pictures: sheets by what they look like in pixels, kept, and read anywhere.

A layer of depth looks for the sheet whose flakes and streaks have about its pixels: pictures of all
sizes, severities and lenses share a few. It reads it from random places on, more often where it has
more flakes, and drops lean with the wind as they are read; factors of the optical depth make up for
what a sheet differs by. Depths are in units of the nearest one.
"""

import itertools
import math
from typing import NamedTuple, TypeAlias

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import ALL, Kept, kept
from flurries._threads import reproducible
from flurries.augment.calibration import APART, Kind, area_of, sizes_of
from flurries.effects.sheets import hash_of
from flurries.effects.strength import OPACITY
from flurries.particles.population import FADE, layer_edges
from flurries.particles.sizes import Sizes

# Bytes of all sheets of a process, at most: the oldest go.
MOST_BYTES = 128 << 20

# Layers of depth, and sizes of flakes in each.
_LAYERS, _SIZES = 5, 4

# Rungs of flakes' widths, as a ratio, and their least in pixels: of narrower ones none is seen.
_WIDTHS, _NARROW = (1.36, 1.05), 0.3

# Between two directions of streaks, radians: the ends, and times a flake's width over its way.
_TURN, _TURNS = (0.16, 0.8), 1.5

# Drops lean as they are read, up to this tangent; a flake would be seen to be no ball.
_LEAN = 0.6

# Flakes that are drawn for each pixel of a picture, by itself and of a film or pair; pictures by
# themselves that are no larger than this have all their flakes from sheets.
_DRAWN, _DRAWN_MOVING, _SHEETS_ALONE = 0.0001, 0.0015, 600

# A picture by itself has none where so many would reach less far, of the nearest depth.
_NONE = 0.75

# Diameter in px of the largest flakes of sheets, and their longest streak.
_LARGEST, _LONGEST = 30.0, 192.0

# Large pictures, and those up to so many pixels, have sheets of their own. Those of small ones are
# fewer, sooner made, and read oftener: ends of a side, pixels; ratios of two rungs of streaks and
# of the number of flakes, and how many times those of a sheet there are at least.
_SMALL, _SIDES = 160, ((240.0, 512.0), (144.0, 200.0))
_STREAKS, _COUNTS, _READS = (1.7, 2.0), (1.15, 3.5), (0.93, 1.25)

# Where hard weather has more flakes for each pixel than the first, they are fewer and denser.
_FEWER = 0.01, 0.66

# Flakes that a sheet has at least if it can; and for each pixel at most, narrow and wide ones: more
# are as many that are stronger.
_FLAKES, _MOST = 60.0, (0.5, 2.0)

_SHEETS = ALL[__name__] = Kept(most_bytes=MOST_BYTES)


class Falling(NamedTuple):
    """What falls before a picture, in units of its nearest depth."""

    kind: Kind
    tenths: int  # Of the amount whose sizes they have; 0 for those of the hard profile.
    deep: float  # The farthest depth.
    gain: float  # Of the optical depth of each.
    thickness: float  # Optical depth per unit.
    lens: float  # Pixels that a metre at the nearest depth has.
    velocity: tuple[float, float]  # Metres per second.
    exposure: float  # Seconds.

    @property
    def law(self) -> Sizes:
        return _laws(self.kind, self.tenths)[0]

    @property
    def density(self) -> float:
        """Flakes per square metre and unit of depth."""
        one = self.gain * _laws(self.kind, self.tenths)[1]
        return self.thickness / (one if self.tenths else one * APART[self.kind])


class Look(NamedTuple):
    """What decides a sheet."""

    kind: Kind
    hard: bool
    width: int  # Rung of it.
    streak: int  # Rung of it over the width; -1 for none.
    turn: float  # Of the streak, radians.
    flakes: int  # Rung of their number for each pixel.
    small: bool  # Whether it is for small pictures.
    leans: bool  # Whether it is read so.

    def make(self) -> "Sheet":
        """Return the sheet."""
        width, longer = _WIDTHS[self.hard] ** self.width, _STREAKS[self.small] ** self.streak
        length = max(width, 1.0) * longer if self.streak >= 0 else 0.0
        count = _COUNTS[self.small] ** self.flakes
        least, most = _SIDES[self.small]
        side = min(max(math.sqrt(_FLAKES / count), least), most)
        number = 1 + self.width + 5 * self.streak - 3 * self.flakes
        rows, columns = (
            round(side * (1.0 + part * ((step * number) % 1.0)))
            for part, step in ((0.2, 0.618_034), (0.3, 0.414_214))
        )
        made = _core.FlakeSheet(
            hash_of(7019, number % 256), (rows, columns), 0, count,
            (width * _shape(self.kind, self.hard)).tolist(),
            (length * math.sin(self.turn), length * math.cos(self.turn)), 0.0, OPACITY, (0.0, 1.0),
        )  # fmt: skip
        _SHEETS.trim()
        return Sheet(made, (columns, rows), count)


class Sheet(NamedTuple):
    made: _core.FlakeSheet
    period: tuple[int, int]  # (across, down): pixels.
    flakes: float  # For each pixel.

    @property
    def bytes(self) -> int:
        return self.made.bytes


# A sheet, the depths of the slab whose flakes it stands for, pixels to the right that it leans by
# for each row down, a factor of its optical depth, and an even part.
Layer: TypeAlias = tuple[Sheet, float, float, float, tuple[float, float]]


def sheets_of(falling: Falling, longer: int, moving: bool) -> tuple[float, list[Layer]]:
    """Return the depth up to which flakes are drawn, and the layers of all others.

    For a picture of a longer side in pixels, by itself or of a film or pair.
    """
    kind, tenths, deep, _, thickness, lens, (across, down), exposure = falling
    small, hard = longer <= _SMALL and not moving, tenths == 0
    wide, lean, way = _laws(kind, tenths)[2], 0.0, math.hypot(across, down) * exposure
    reach = _reach_of(falling, way, longer, moving)
    if reach >= deep:
        return deep, []
    angle = math.atan2(across, down)
    if kind == "rain" and not moving and abs(across) <= _LEAN * down:
        lean, angle, way = across / down, 0.0, down * exposure
    found, density = list[Layer](), falling.density
    for near, far in _edges(reach, deep):
        pixels = lens / math.sqrt(near * far)
        # Those of one depth that have the slab's coverage and variance.
        count, width, ratio = density * (far - near) / pixels**2, pixels * wide, _WIDTHS[hard]
        rung = round(math.log(max(width, _NARROW)) / math.log(ratio))
        if hard and count > _FEWER[0]:
            count *= _FEWER[1]
        if width > _NARROW:
            # Flakes of another size are as many others.
            count *= (width / ratio**rung) ** 2
        length, turn = max(pixels * way / max(ratio**rung, 1.0), 1e-9), 0.0
        streak = max(round(math.log(length) / math.log(_STREAKS[small])), -1)
        if streak >= 0 and angle:
            turn = min(max(_TURNS / _STREAKS[small] ** streak, _TURN[0]), _TURN[1])
            turn *= round(angle / turn)
        most = _MOST[width > 2.0 * _NARROW]
        few = max(min(count, most), 1e-12)
        number = math.floor(math.log(few / _READS[small]) / math.log(_COUNTS[small]))
        leans = lean != 0.0 and streak >= 0
        look = Look(kind, hard, rung, streak, turn, min(number, 0), small, leans)
        sheet: Sheet = _SHEETS.once((look, reproducible()), look.make)
        reads, many = max(round(few / sheet.flakes), 1), max(count / most, 1.0)
        # Fewer flakes that vary as much as all, and an even part that the others make.
        each, even = many**0.5, (many - many**0.5) * sheet.made.mean
        factor = sheet.made.factor(thickness * (far - near) / reads, (each, even), leans)
        found += [(sheet, near, far, lean * leans, (factor * each, factor * even))] * reads
    return reach, found


@kept(64)
def _laws(kind: Kind, tenths: int) -> tuple[Sizes, float, float]:
    """Return the sizes of flakes, what one covers, square metres, and how wide such a one is."""
    sizes = sizes_of(kind, tenths)
    return sizes, area_of(sizes), math.sqrt(sizes.moment(2.0))


@kept(8)
def _shape(kind: Kind, hard: bool) -> Float64:
    """Return the diameters that cover what their shares of flakes do, over the quadratic mean."""
    law = sizes_of(kind, 0 if hard else 6)
    squares = law.quantile(np.arange(0.5, 4096.0) / 4096) ** 2
    edges = np.rint(4096 * (1.0 - np.linspace(1.0, 0.0, _SIZES + 1) ** 2)).astype(int)
    means = np.array([squares[i:j].mean() for i, j in itertools.pairwise(edges)])
    return np.asarray(np.sqrt(means / squares.mean()))


@kept(64)
def _edges(reach: float, deep: float) -> list[tuple[float, float]]:
    edges = layer_edges(reach * (1.0 + 0.5 * FADE), deep, _LAYERS).tolist()
    return list(itertools.pairwise(edges))


def _reach_of(falling: Falling, way: float, longer: int, moving: bool) -> float:
    """Return the depth up to which flakes are drawn; then sheets take over."""
    lens, wide = falling.lens, _laws(falling.kind, falling.tenths)[2]
    largest = wide * float(_shape(falling.kind, falling.tenths == 0)[-1])
    images = lens * max(largest / _LARGEST, way / _LONGEST)
    # Half of the way over which they fade in.
    first = 1.0 / (1.0 + 0.5 * FADE)
    share = _DRAWN_MOVING if moving else _DRAWN
    cost = (3.0 * share * lens**2 / falling.density) ** (1.0 / 3.0)
    if images <= first and not moving and (longer <= _SHEETS_ALONE or cost < _NONE):
        return first
    reach = max(cost, images, 1.5 if moving else 1.2)
    return falling.deep if reach > 0.8 * falling.deep else reach

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
from flurries.particles.population import FADE
from flurries.particles.sizes import Sizes

# Bytes of all sheets of a process, at most: the oldest go.
MOST_BYTES = 128 << 20

# Layers of depth, of what moves and of pictures by themselves, even parts of speed by so much, else
# of depth; and sizes of flakes in each.
_LAYERS, _SPEED, _SIZES = (5, 3), 0.75, 4

# Rungs of flakes' widths, as a ratio, and their least in pixels: of narrower ones none is seen.
_WIDTHS, _NARROW = (1.36, 1.05), 0.3

# Between two directions of streaks, radians: the ends, and times a flake's width over its way.
_TURN, _TURNS = (0.16, 0.8), 1.5

# Drops lean as they are read, up to this tangent; a flake would be seen to be no ball.
_LEAN = 0.6

# Flakes that are drawn for each pixel of a picture, by itself and of a film or pair; pictures by
# themselves that are no larger than this have all their flakes from sheets, and those where so many
# would reach less far, of the nearest depth.
_DRAWN, _SHEETS_ALONE, _NONE = (0.0001, 0.0015), 600, 0.75

# Diameter in px of the largest flakes of sheets, and their longest streak.
_LARGEST, _LONGEST = 30.0, 192.0

# Large pictures and small ones have sheets of their own, whose sides have so many pixels at most;
# ratios of two rungs of streaks, and of those that are stretched as they are read.
_LARGEST_SIDE, _STREAKS, _STRETCHED = 400.0, (1.7, 2.5), 4.0

# Up to which size a picture is small; the ratio of two rungs of the number of flakes; how many
# times those of a sheet there are at least, and what this is rounded up by, since drops may be
# fainter; and pixels of a side, at least. Large pictures come first.
_SHARED = {
    "snow": (160, (1.15, 3.5), (0.93, 1.0), 0.0, (230.0, 132.0)),
    "rain": (160, (6.0, 6.0), (0.5, 0.55), 0.5, (200.0, 132.0)),
}

# Where hard weather has more flakes for each pixel than the first, they are fewer and denser.
_FEWER = 0.012, 0.66

# Flakes that a sheet has at least if it can; and for each pixel at most, narrow and wide ones: more
# are as many that are stronger.
_FLAKES, _MOST = 24.0, (0.2, 2.0)

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
    def density(self) -> float:
        """Flakes per square metre and unit of depth."""
        one = self.gain * _laws(self.kind, self.tenths)[1]
        return self.thickness / (one if self.tenths else one * APART[self.kind])


class Look(NamedTuple):
    """What decides a sheet."""

    kind: Kind
    hard: bool
    width: int  # Rung of it.
    streak: float  # Over the width, of one pixel at least; 0 for none.
    turn: float  # Of the streak, radians.
    flakes: int  # Rung of their number for each pixel.
    small: bool  # Whether it is for small pictures.

    def make(self) -> "Sheet":
        width = _WIDTHS[self.hard] ** self.width
        length = max(width, 1.0) * self.streak
        _, counts, _, _, sides = _SHARED[self.kind]
        count = counts[self.small] ** self.flakes
        side = min(max(math.sqrt(_FLAKES / count), sides[self.small]), _LARGEST_SIDE)
        number = 1 + self.width + round(8.0 * self.streak) - 3 * self.flakes
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


# A sheet, the depths of its slab, pixels to the right that it leans by for each row down and its
# rows in one of the picture's, a factor of its optical depth, and an even part.
Layer: TypeAlias = tuple[Sheet, float, float, tuple[float, float], tuple[float, float]]


def sheets_of(falling: Falling, longer: int, moving: bool) -> tuple[float, list[Layer]]:
    """Return the depth up to which a picture's flakes are drawn, and the layers of all others."""
    kind, tenths, deep, _, thickness, lens, (across, down), exposure = falling
    size, counts, times, more, _ = _SHARED[kind]
    small, hard = longer <= size and not moving, tenths == 0
    lean, way = 0.0, math.hypot(across, down) * exposure
    reach, density = _reach_of(falling, way, longer, moving), falling.density
    if reach >= deep:
        return deep, []
    angle, ratio = math.atan2(across, down), _STREAKS[small]
    if leans := kind == "rain" and not moving and abs(across) <= _LEAN * down:
        lean, angle, way, ratio = across / down, 0.0, down * exposure, _STRETCHED
    found, mode = list[Layer](), reproducible()
    slabs = _slabs(kind, tenths, density, lens, reach, deep, _LAYERS[not moving])
    for near, far, pixels, rung, few, many in slabs:
        length, turn = max(pixels * way / max(_WIDTHS[hard] ** rung, 1.0), 1e-9), 0.0
        step, scale = round(math.log(length, ratio)), 1.0
        streak = ratio**step if step >= 0 else 0.0
        if leans and streak:
            scale = streak / length
        elif streak and angle:
            turn = min(max(_TURNS / streak, _TURN[0]), _TURN[1])
            turn *= round(angle / turn)
        few = max(few / scale, _FLAKES / _LARGEST_SIDE**2)
        number = min(math.floor(math.log(few / times[small], counts[small])), 0)
        look = Look(kind, hard, rung, streak, turn, number, small)
        sheet: Sheet = _SHEETS.once((look, mode), look.make)
        reads = max(round(few / sheet.flakes + more), 1)
        # Fewer flakes that vary as much as all, and an even part that the others make.
        each, even = many**0.5, (many - many**0.5) * sheet.made.mean
        factor = sheet.made.factor(thickness * (far - near) / reads, (each, even))
        own, gain = (lean if streak else 0.0, scale), (factor * each, factor * even)
        found += [(sheet, near, far, own, gain)] * reads
    return reach, found


@kept(64)
def _slabs(
    kind: Kind, tenths: int, density: float, lens: float, reach: float, deep: float, layers: int
) -> list[tuple[float, float, float, int, float, float]]:
    """Return slabs' depths, pixels of a metre, and of their flakes rung, number and strength."""
    hard, found = tenths == 0, []
    first = reach * (1.0 + 0.5 * FADE)
    speed, depth = _SPEED / (1.0 / first - 1.0 / deep), (1.0 - _SPEED) / (deep - first)
    parts = (speed / first - depth * first - part / layers for part in range(layers + 1))
    edges = [(math.hypot(b, 2.0 * math.sqrt(depth * speed)) - b) / (2.0 * depth) for b in parts]
    for near, far in itertools.pairwise(edges):
        pixels = lens / math.sqrt(near * far)
        # Those of one depth that have the slab's coverage and variance.
        count, width = density * (far - near) / pixels**2, pixels * _laws(kind, tenths)[2]
        rung = round(math.log(max(width, _NARROW), _WIDTHS[hard]))
        count *= _FEWER[1] if hard and count > _FEWER[0] else 1.0
        if width > _NARROW:
            # Flakes of another size are as many others.
            count *= (width / _WIDTHS[hard] ** rung) ** 2
        most = _MOST[width > 2.0 * _NARROW]
        found.append((near, far, pixels, rung, min(count, most), max(count / most, 1.0)))
    return found


@kept(64)
def _laws(kind: Kind, tenths: int) -> tuple[Sizes, float, float]:
    """Return the sizes of flakes, what one covers, square metres, and how wide such a one is."""
    sizes = sizes_of(kind, tenths)
    return sizes, area_of(sizes), math.sqrt(sizes.moment(2.0))


@kept(8)
def _shape(kind: Kind, hard: bool) -> Float64:
    """Return the diameters that cover what their shares of flakes do, over the quadratic mean."""
    squares = sizes_of(kind, 0 if hard else 6).quantile(np.arange(0.5, 4096.0) / 4096) ** 2
    edges = np.rint(4096 * (1.0 - np.linspace(1.0, 0.0, _SIZES + 1) ** 2)).astype(int)
    means = np.array([squares[i:j].mean() for i, j in itertools.pairwise(edges)])
    return np.asarray(np.sqrt(means / squares.mean()))


def _reach_of(falling: Falling, way: float, longer: int, moving: bool) -> float:
    """Return the depth up to which flakes are drawn; then sheets take over."""
    lens, wide = falling.lens, _laws(falling.kind, falling.tenths)[2]
    largest = wide * float(_shape(falling.kind, falling.tenths == 0)[-1])
    images = lens * max(largest / _LARGEST, way / _LONGEST)
    first = 1.0 / (1.0 + 0.5 * FADE)
    cost = (3.0 * _DRAWN[moving] * lens**2 / falling.density) ** (1.0 / 3.0)
    if images <= first and not moving and (longer <= _SHEETS_ALONE or cost < _NONE):
        return first
    reach = max(cost, images, 1.5 if moving else 1.2)
    return falling.deep if reach > 0.8 * falling.deep else reach

"""Far flakes of pictures: the sheets of scenes, kept for rungs and read from places of their own.

Pictures of about one weather share sheets: each reads every layer from a random place on, so that
what two pictures see has nothing in common. What a picture's weather differs by from its rungs the
layers' gains make up for. Depths are in units of the nearest one: what is twice as far away before
a lens twice as long looks the same.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flurries import _core
from flurries._kept import ALL, Kept, kept
from flurries._threads import reproducible
from flurries.augment.calibration import Kind, area_of, sizes_of
from flurries.effects.sheets import diameters_of, hash_of
from flurries.effects.strength import OPACITY
from flurries.particles.population import FADE, Population, SizeClass, layer_edges, slabs_of
from flurries.particles.sizes import Sizes

# Bytes of all sheets of a process, at most: the oldest go.
MOST_BYTES = 128 << 20

_LAYERS = 6

# Rungs of the focal length, of the way and of the density, as ratios.
_FOCAL, _WAY, _MANY = 1.06, 1.6, 2.0**0.5

# A shorter way over a flake's width leaves no streak in sheets.
_REST = 0.35

# Between two directions of streaks, radians: the ends, and times a flake's width over its way.
_TURN, _TURNS = (0.16, 0.7), 1.5

# Flakes that are drawn for each pixel of a picture, by itself and of a film or pair; pictures by
# themselves that are no larger than sheets have all their flakes from them.
_DRAWN, _DRAWN_MOVING, _SHEETS_ALONE = 0.0001, 0.0015, 600

# A picture by itself has none where so many would reach less far, of the nearest depth.
_NONE = 0.75

# Diameter in px that a tenth of the flakes of sheets are above, and their longest streak.
_LARGEST, _LONGEST = 30.0, 192.0

# Pixels of a sheet's sides, before a layer's own factor, and the flakes that it has at least.
_SIDE, _FLAKES = (240.0, 512.0), 60.0

# Sizes of flakes in a sheet, and flakes for each pixel of it at most.
_SIZES, _MOST = 4, 2.0

# A sheet that has so much more or less than it should is made once more.
_CLOSE = 0.1

SEED = 7004

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
        return self.thickness / (self.gain * _laws(self.kind, self.tenths)[1])


class Rungs(NamedTuple):
    """What decides sheets: of what falls the nearest rungs."""

    kind: Kind
    tenths: int
    deep: float
    gain: float
    density: float
    lens: float
    way: float  # Of a flake while the shutter is open, metres at the nearest depth.
    angle: float  # Of its streak, radians.
    moving: bool  # Whether the picture is of a film or pair.
    alone: bool  # Whether sheets are larger than the picture, which then has no drawn flakes.


class Layer(NamedTuple):
    """A sheet, and how it stands for the flakes of a slab."""

    sheet: _core.FlakeSheet
    near: float
    far: float
    depth: float  # That it moves as.
    period: tuple[int, int]  # (across, down): pixels.
    units: float  # Of depth through which the slab's flakes are all there.
    # Optical depth that it has with a factor of the sheet's and an even part, and the power of the
    # factor that it goes with.
    own: float
    gain: float
    base: float
    power: float

    def at(
        self, falling: Falling, near: float, shift: tuple[float, float]
    ) -> tuple[_core.FlakeSheet, tuple[float, float], tuple[float, float], float, float]:
        """Return it for what falls, moved by pixels, for `_core.sheet_read`."""
        ratio = falling.thickness * self.units / self.own
        gain = self.gain * ratio ** (1.0 / self.power), self.base * ratio
        return self.sheet, shift, gain, near * self.near, near * self.far


@dataclass(frozen=True, eq=False)
class Sheets:
    """The sheets of all layers of one rung; none where all flakes are drawn."""

    reach: float  # Depth up to which flakes are drawn.
    cover: float = 1.0  # What they cover over what as many opacities would.
    layers: tuple[Layer, ...] = ()

    @property
    def bytes(self) -> int:
        """What is kept of them now."""
        return sum(layer.sheet.bytes for layer in self.layers)


def sheets_of(falling: Falling, longer: int, moving: bool) -> Sheets:
    """Return the sheets of what falls before a picture of a longer side in pixels."""
    way, angle, velocity, law = 0.0, 0.0, falling.velocity, falling.law
    lens = _rung(falling.lens, _FOCAL)
    ratio = math.hypot(*velocity) * falling.exposure / _width(law, falling.lens)
    if ratio > _REST:
        longer_by = _WAY ** round(math.log(ratio / _REST) / math.log(_WAY))
        way = _width(law, lens) * _REST * longer_by
        turn = min(max(_TURNS / (_REST * longer_by), _TURN[0]), _TURN[1])
        angle = round(math.atan2(*velocity) / turn) * turn
    rungs = Rungs(
        *falling[:4], _rung(falling.density, _MANY), lens, way, angle, moving,
        longer <= _SHEETS_ALONE and not moving,
    )  # fmt: skip
    made: list[Sheets] = []

    def make() -> Sheets:
        made.append(_made(rungs))
        return made[0]

    found = _SHEETS.once((rungs, reproducible()), make)
    if made or moving:
        # Places of sheets are made as they are visited.
        _SHEETS.trim()
    return found


def _rung(value: float, ratio: float) -> float:
    return ratio ** round(math.log(value) / math.log(ratio))


def _width(law: Sizes, lens: float) -> float:
    """Return the width of a mean flake's image, a pixel at least, metres at the nearest depth."""
    return max(law.mean, 1.0 / lens)


@kept(64)
def _laws(kind: Kind, tenths: int) -> tuple[Sizes, float]:
    """Return the sizes of flakes, and what one covers, square metres."""
    sizes = sizes_of(kind, tenths)
    return sizes, area_of(sizes)


def _made(rungs: Rungs) -> Sheets:
    kind, tenths, deep, gain, density, lens, way, angle, *_ = rungs
    law, area = _laws(kind, tenths)
    reach = _reach_of(law, rungs)
    if reach >= deep:
        return Sheets(deep)
    ends = law.smallest, law.largest
    one = SizeClass(density, *ends, 0.0, law.nodes(*ends))
    slabs = slabs_of(
        Population(density, law, OPACITY, np.ones_like), one, lens,
        layer_edges(reach, deep, _LAYERS),
    )  # fmt: skip
    alone, layers = 0.0, []
    for number, slab in enumerate(slabs):
        side = min(max(math.sqrt(_FLAKES / max(slab.count, 1e-9)), _SIDE[0]), _SIDE[1])
        rows, columns = (
            round(side * (1.0 + part * ((step * (number + 1)) % 1.0)))
            for part, step in ((0.2, 0.618_034), (0.3, 0.414_214))
        )
        length, wanted, count = way * lens / slab.depth, gain * slab.coverage, slab.count
        streak = length * math.sin(angle), length * math.cos(angle)
        # A sheet of few flakes has some more or less than the mean of all such sheets, and bright
        # drops that hide one another are as many more.
        for last in (False, True):
            used, many = count, max(count / _MOST, 1.0)
            sheet = _core.FlakeSheet(
                hash_of(SEED, number), (rows, columns), 0, count / many,
                diameters_of(slab, _SIZES).tolist(), streak, 0.0, OPACITY, (0.0, 1.0),
            )  # fmt: skip
            # Fewer flakes that vary as much as all, and an even part that the others make.
            each, even = gain * many**0.5, gain * (many - many**0.5) * sheet.mean
            light = sheet.left([0.9 * each, each, 1.1 * each])
            less, own, more = (-math.log(left) for left in light)
            if own == 0.0:
                break  # It has no flakes.
            ratio = wanted / (even + own)
            if last or abs(ratio - 1.0) < _CLOSE:
                power = math.log(more / less) / math.log(1.1 / 0.9)
                units = slab.coverage / (density * area)
                layers.append(Layer(sheet, slab.near, slab.far, slab.depth, (columns, rows),
                                    units, even + own, each, even, power))  # fmt: skip
                break
            count *= ratio
        alone += wanted * slab.count / used
    whole = gain * sum(slab.coverage for slab in slabs)
    return Sheets(reach, alone / whole if gain > 1.0 else 1.0, tuple(layers))


def _reach_of(law: Sizes, rungs: Rungs) -> float:
    """Return the depth up to which flakes are drawn."""
    lens = rungs.lens
    images = max(float(law.quantile(0.9)) * lens / _LARGEST, rungs.way * lens / _LONGEST)
    # Beyond it sheets fade in: half of the way they take all.
    first = 1.0 / (1.0 + 0.5 * FADE)
    share = _DRAWN_MOVING if rungs.moving else _DRAWN
    cost = (3.0 * share * lens**2 / rungs.density) ** (1.0 / 3.0)
    if images <= first and (rungs.alone or (cost < _NONE and not rungs.moving)):
        return first
    reach = max(cost, images, 1.5 if rungs.moving else 1.2)
    return rungs.deep if reach > 0.8 * rungs.deep else reach

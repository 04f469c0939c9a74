"""Textures of pictures by themselves, made once and read from another place on for each picture.

A picture of a data set is followed by no other, so that its far flakes need not be its own: they
are part of a sheet that goes on at its ends, of a streak whose way is about that of the picture's
flakes. A sheet costs what one picture's own texture would, and takes the memory of half of one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries._threads import reproducible
from flurries.augment.draws import uniforms
from flurries.augment.texture import SEED, WAY, Rungs, Texture, overlap_of

# Bytes of all sheets of a process, at most: the oldest go.
_MOST = 64 << 20

# The least and the most between two directions of streaks, radians; between them, the end of a
# streak is off by a quarter of a flake's diameter.
_TURN = (0.1, 0.5)

# Means that are added while a sheet is made, and taken off again: frames end at 0, and blended
# tiles go to some means below it.
_MEANS = 4.0

# The largest number of a sheet.
_LARGEST = 32767.0

_STREAM = 7005

_KEPT: dict[Any, Sheet] = {}


class Sheet(NamedTuple):
    """Optical depth without its mean.

    Attributes
    ----------
    values : (H, W) int16
    unit : float
        Optical depth of 1.
    """

    values: Array
    unit: float


class Part(NamedTuple):
    """A picture's part of sheets.

    Attributes
    ----------
    texture : Texture
    rungs : Rungs
    key : tuple
        Of the sheets: tiles (rows, columns), and the direction of streaks in steps.
    turn : float
        A step, radians.
    place : (row, column)
        Of the picture's first pixel.
    back : (rows, columns)
        Whether each is read backwards.
    """

    texture: Texture
    rungs: Rungs
    key: tuple[int, int, int]
    turn: float
    place: tuple[int, int]
    back: tuple[bool, bool]

    def read(self, layer: int | None = None, mask: Array | None = None) -> Any:
        """Return all of it or one layer, as `_core.sheet_fall` reads it."""
        texture = self.texture
        sheet = self.sheet(layer)
        mean = texture.mean if layer is None else texture.mean * float(texture.shares[layer])
        return sheet.values, self.place, self.back, (texture.gain * sheet.unit, mean), mask

    def sheet(self, layer: int | None) -> Sheet:
        """Return a sheet of all layers or of one."""
        key = (self.rungs, *self.key, layer, reproducible())
        # Taken out and put in again: the dict's order is that of use. No lock, which a fork in
        # another thread would leave closed; two that make the same sheet make the same bits.
        found = _KEPT.pop(key, None)
        if found is None:
            found = self._made(layer)
            room = _MOST - found.values.nbytes
            while _KEPT and sum(sheet.values.nbytes for sheet in list(_KEPT.values())) > room:
                _KEPT.pop(next(iter(_KEPT)), None)
        _KEPT[key] = found
        return found

    def _made(self, layer: int | None) -> Sheet:
        if layer is None:
            plane = self._depths(None)
            unit = max(float(np.abs(plane).max()), 1e-9) / _LARGEST
            return Sheet(_rounded(plane / np.float32(unit)), unit)
        # In the unit of all, and the last is what the others leave of all: rounded layers by
        # themselves would not sum up to them.
        whole = self.sheet(None)
        if layer < len(self.texture.shares) - 1:
            return Sheet(_rounded(self._depths(layer) / np.float32(whole.unit)), whole.unit)
        rest = whole.values.astype(np.int32)
        for before in range(layer):
            rest -= self.sheet(before).values
        return Sheet(_rounded(rest), whole.unit)

    def _depths(self, layer: int | None) -> Array:
        texture, rungs = self.texture, self.rungs
        rows, cols, step = self.key
        overlap = overlap_of(rungs.tile)
        size = tuple((rungs.tile - overlap) * count for count in (rows, cols))
        way = WAY**rungs.way
        streak = way * np.array([math.sin(step * self.turn), math.cos(step * self.turn)])
        asked = texture.request(
            (size[0] + overlap, size[1] + overlap), texture.patterns.focal, seed=SEED,
            moved=np.zeros(2), streak=streak,
        )._replace(
            mean=np.array([[_MEANS * texture.own]]), gain=texture.gains.reshape(1, 1, -1)
        )  # fmt: skip
        if layer is not None:
            asked = texture.layers(asked)[layer]
        whole = np.empty(asked.shape, np.float32)
        texture.drawn(asked, opacity=False, out=whole, add=False)
        whole -= np.float32(asked.mean[0, 0])
        found: Array = _joined(_joined(whole, rungs.tile).T, rungs.tile).T
        return found


def _rounded(values: Array) -> Array:
    kept = np.clip(np.rint(values), -_LARGEST, _LARGEST)
    return np.ascontiguousarray(kept, np.int16)


def part_of(
    texture: Texture, shape: tuple[int, int], velocity: tuple[float, float], seed: int
) -> Part:
    """Return the part of sheets that a picture's far flakes are.

    Parameters
    ----------
    velocity : (x, y)
        Of what falls, in any unit.
    """
    rungs = texture.rungs
    assert rungs is not None
    turn = min(max(rungs.look[1][1] / WAY**rungs.way, _TURN[0]), _TURN[1])
    x, y = velocity
    step = round(math.atan2(abs(x), abs(y)) / turn)
    # Streaks to the other side are the same sheet in a mirror; turned by half, streaks stay.
    u = uniforms(seed, _STREAM, 3)
    half, side = bool(u[2] < 0.5), x * y < 0.0
    # A picture may be larger than its sheet by what tiles share, which then stands at both ends.
    overlap = overlap_of(rungs.tile)
    rows, cols = (_core.tile_count(length, rungs.tile, overlap) for length in shape)
    stride = rungs.tile - overlap
    place = int(u[0] * stride * rows), int(u[1] * stride * cols)
    return Part(texture, rungs, (rows, cols, step), turn, place, (half, half ^ side))


def _joined(plane: Array, tile: int) -> Array:
    """Return a plane whose last rows are blended into its first as two tiles are, without them."""
    overlap = overlap_of(tile)
    shares = np.empty((2 * tile - overlap, 2))
    _core.tile_shares(shares, tile, overlap, "power")
    shared = np.sqrt(shares[tile - overlap : tile, :, None]).astype(np.float32)
    found: Array = plane[:-overlap].copy()
    found[:overlap] = shared[:, 1] * plane[:overlap] + shared[:, 0] * plane[-overlap:]
    return found

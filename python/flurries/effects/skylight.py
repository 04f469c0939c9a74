"""The sky's light in a bank of mist that has a top: each billow is bright above and dimmer below.

Fog scatters light on without loss, so that it is nowhere dark: under any amount of gas a share of
the light is left. What dims a place is the gas over it, up to a length that is a share of the
picture, since from farther up light comes in from the sides. All of it is found in coarse cells.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from flurries._contract import Array, Float64
from flurries.effects.bank_texture import COARSE, MARGIN
from flurries.frame.layer import Shade
from flurries.frame.view import Frame

# Cells along the longer side of a picture.
CELLS = 64

# The length over which gas dims what is below it, of the picture's height.
REACH = 1.0 / 16.0

# The share of the light that gas takes from what lies deep below it, and how thick it must be for
# that: both by eye, on dark, bright and busy photographs. With more of either mist is smoke.
TAKEN, STEEP = 0.45, 0.5


class Skylight:
    """The sky's light in the slices of a bank of a mean extinction, from the nearest on.

    Gas that has no top has the same light everywhere.
    """

    def __init__(self, frame: Frame, extinction: float, *, has_top: bool) -> None:
        longest = max(frame.shape)
        self.cell = COARSE * math.ceil(longest / (COARSE * CELLS)) if has_top else longest
        self.extinction, self.has_top = extinction, has_top
        size = tuple(-(-side // self.cell) for side in frame.shape)
        self.ground: float | Array = math.inf
        if frame.depth is not None:
            rows, columns = (
                np.minimum(np.arange(count) * self.cell + self.cell // 2, side - 1)
                for count, side in zip(size, frame.shape, strict=True)
            )
            self.ground = frame.depth[rows[:, None], columns]
        # Where nothing is seen it has the sky's light.
        self.through, self.seen, self.bright = (np.full(size, v) for v in (1.0, 1e-6, 1e-6))

    def add(self, edges: list[float], density: Array) -> None:
        """Take slices behind the others, (n, rows, columns) extinction on the coarse grid."""
        if not self.has_top:
            return
        means = density[:, MARGIN:-MARGIN, MARGIN:-MARGIN]
        for axis in (1, 2):
            firsts = np.arange(0, means.shape[axis], self.cell // COARSE)
            counts = np.diff(firsts, append=means.shape[axis]).reshape(-1, *(1,) * (2 - axis))
            means = np.add.reduceat(means, firsts, axis=axis) / counts
        for number, mean in enumerate(np.asarray(means, np.float64)):
            thick = np.clip(self.ground - edges[number], 0.0, edges[number + 1] - edges[number])
            passed = self.through * np.exp(-mean * thick)
            taken = self.through - passed
            above = _above(len(mean)) @ (mean / self.extinction)
            self.bright += taken * (1.0 - TAKEN * -np.expm1(-STEEP * above))
            self.seen += taken
            self.through = passed

    def shade(self, frame: Frame, light: Float64) -> Shade:
        """Return the color of the gas in a sky of a light, (3,) linear."""
        colors = ((self.bright / self.seen)[..., None] * light).astype(np.float32)
        return Shade(colors, float(self.cell), (frame.window[0], frame.window[2]))


@lru_cache(maxsize=8)
def _above(rows: int) -> Float64:
    """Return the matrix of the mean of what is above each row, by the exponential law."""
    keep = math.exp(-1.0 / (REACH * rows))
    down = np.subtract.outer(np.arange(rows), np.arange(rows))
    matrix = np.where(down >= 0, (1.0 - keep) * keep ** np.maximum(down, 0), 0.0)
    # Above the picture it goes on as at its upper border.
    matrix[:, 0] += keep ** np.arange(1, rows + 1)
    return np.asarray(matrix)

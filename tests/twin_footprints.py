"""The pictures of flakes in plain NumPy and float64: each is a ball, seen over an exposure.

The opacity of a flake at r of its radius R is 1 - exp(-tau0 sqrt(1 - (r/R)^2)), and `opacity` is
the mean over its disc. A pixel shows the mean over its square and over the exposure, in which a
flake moves in two straight halves from its place at the opening over that in the middle to that at
the close. The pixels of all flakes are joined as 1 - prod(1 - a).

There are three ways by size, since millions of flakes are below a tenth of a pixel and a few are
large: a point on a line, cut exactly at the borders of pixels; points spread over the disc and the
line; and samples of every pixel. The energy of a flake is right within .01 in each.
"""

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Diameters in px at which the way changes: a point, many points, samples of pixels.
POINT, LARGE = 0.2, 2.0

# Points for each square pixel that a flake sweeps, at least so many; and samples along a pixel.
POINTS, LEAST_POINTS, SAMPLES = 64.0, 128, 4

_BATCH = 4_000_000  # Elements of the arrays that are made at a time.

# A Kronecker sequence in three dimensions: powers of the root of x^4 = x + 1.
_STEPS = 1.2207440846057596 ** -np.arange(1.0, 4.0)


def mean_opacity(tau0: float) -> float:
    """Return the mean opacity over the disc of a ball whose middle has the optical depth tau0."""
    if tau0 < 1e-4:
        return 2.0 / 3.0 * tau0
    return 1.0 - 2.0 * (1.0 - (1.0 + tau0) * math.exp(-tau0)) / tau0**2


def middle_depth(opacity: float) -> float:
    """Return tau0 of a mean opacity: halve an interval."""
    low, high = 0.0, 100.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if mean_opacity(middle) < opacity else (low, middle)
    return 0.5 * (low + high)


def profile(square: Floats, tau0: float) -> Floats:
    """Return the opacity of a ball at squares of r/R."""
    return -np.expm1(-tau0 * np.sqrt(np.maximum(1.0 - square, 0.0)))


class Canvas:
    """A picture (H, W) that flakes of a mean opacity are added to, middle ones as points."""

    def __init__(self, shape: tuple[int, int], opacity: float, seed: int = 0) -> None:
        self.shape = shape
        self.opacity = opacity
        self.tau0 = middle_depth(opacity)
        self.depth = np.zeros(shape[0] * shape[1])
        self.chance = np.random.default_rng(seed)

    def alpha(self) -> Floats:
        return -np.expm1(-self.depth).reshape(self.shape)

    def add(self, way: Floats, diameter: Floats, share: Floats) -> None:
        """Add flakes (n,) by their ways, (x, y) px at opening, middle and close, (3, 2, n)."""
        seen = share > 0.0
        for axis in range(2):
            ends = way[0, axis], way[1, axis], way[2, axis]
            least, most = np.minimum.reduce(ends), np.maximum.reduce(ends)
            seen &= (most > -diameter) & (least < self.shape[1 - axis] + diameter)
        way, diameter, share = way[:, :, seen], diameter[seen], share[seen]
        sizes = np.searchsorted([POINT, LARGE], diameter, side="right")
        for size, draw in enumerate((self._points, self._middle, self._large)):
            own = np.flatnonzero(sizes == size)
            if len(own):
                draw(way[:, :, own], diameter[own], share[own])

    def _points(self, way: Floats, diameter: Floats, share: Floats) -> None:
        """Share flakes out over pixels of lines by the lengths inside; the depth is a + a^2/2."""
        area = share * self.opacity * 0.25 * math.pi * diameter**2
        start, end = way[0], way[2]
        first, step = np.floor(start), end - start
        steps = np.abs(np.floor(end) - first).astype(np.int64)
        crossings = steps[0] + steps[1]
        height, width = self.shape
        for count in np.flatnonzero(np.bincount(crossings)):
            own = np.flatnonzero(crossings == count)
            a, d, floor = start[:, own], step[:, own], first[:, own]
            cuts = np.zeros((count + 2, len(own)))
            cuts[-1] = 1.0
            for n in range(count):
                nth = n - steps[0, own]
                x = nth < 0
                nth = np.where(x, n, nth)
                at, by, low = (np.where(x, part[0], part[1]) for part in (a, d, floor))
                edge = np.where(by > 0.0, low + 1.0 + nth, low - nth)
                cuts[n + 1] = np.clip((edge - at) / by, 0.0, 1.0)
            if count > 1:
                cuts.sort(axis=0)
            for early, late in pairwise(cuts):
                part, middle = late - early, 0.5 * (late + early)
                col, row = (np.floor(a[axis] + middle * d[axis]) for axis in range(2))
                inside = (col >= 0.0) & (col < width) & (row >= 0.0) & (row < height)
                depth = part * area[own] * (1.0 + 0.5 * part * area[own])
                place = (row * width + col)[inside].astype(np.int64)
                np.add.at(self.depth, place, depth[inside])

    def _middle(self, way: Floats, diameter: Floats, share: Floats) -> None:
        length = np.hypot(*(np.diff(way, axis=0).transpose(1, 0, 2))).sum(axis=0)
        swept = diameter * (0.25 * math.pi * diameter + length)
        power = np.ceil(np.log2(np.maximum(POINTS * swept, LEAST_POINTS))).astype(np.int64)
        low = np.floor(way.min(axis=0) - 0.5 * diameter).astype(np.int64)
        high = np.floor(way.max(axis=0) + 0.5 * diameter).astype(np.int64)
        area = share * self.opacity * 0.25 * math.pi * diameter**2
        for one in np.unique(power):
            own = np.flatnonzero(power == one)
            wide, tall = (high - low)[:, own].max(axis=1) + 1
            most = max(_BATCH // max(2**one, wide * tall), 1)
            for first in range(0, len(own), most):
                some = own[first : first + most]
                args = way[:, :, some], diameter[some], area[some], low[:, some]
                self._scatter(2**one, (tall, wide), *args)

    def _scatter(
        self, count: int, box: tuple[int, int], way: Floats, diameter: Floats, area: Floats,
        low: Ints,
    ) -> None:  # fmt: skip
        """Add flakes by `count` points each, every flake in a box of its own from `low` on."""
        n = len(area)
        number = np.arange(1.0, count + 1.0)
        u, v, w = (
            (self.chance.random((n, 1)) + number * step) % 1.0 for step in _STEPS
        )  # fmt: skip
        weight = profile(v, self.tau0)
        weight *= (area / weight.sum(axis=1))[:, None]
        radius, angle = 0.5 * diameter[:, None] * np.sqrt(v), 2.0 * math.pi * w
        later, part = u >= 0.5, (2.0 * u) % 1.0
        cells = []
        for axis, aside in enumerate((radius * np.cos(angle), radius * np.sin(angle))):
            a, b, c = way[:, axis, :, None]
            at = np.where(later, b + part * (c - b), a + part * (b - a)) + aside
            cells.append(np.floor(at).astype(np.int64) - low[axis, :, None])
        key = (np.arange(n)[:, None] * box[0] + cells[1]) * box[1] + cells[0]
        found = np.bincount(key.ravel(), weight.ravel(), minlength=n * box[0] * box[1])
        flake, row, col = np.unravel_index(np.flatnonzero(found), (n, *box))
        row, col = row + low[1, flake], col + low[0, flake]
        inside = (row >= 0) & (row < self.shape[0]) & (col >= 0) & (col < self.shape[1])
        a = np.minimum(found[found != 0.0][inside], 1.0 - 1e-6)
        place = (row * self.shape[1] + col)[inside]
        self.depth -= np.bincount(place, np.log1p(-a), minlength=len(self.depth))

    def _large(self, way: Floats, diameter: Floats, share: Floats) -> None:
        picture = self.depth.reshape(self.shape)
        for n in range(len(diameter)):
            path, radius = way[:, :, n], 0.5 * diameter[n]
            low = np.maximum(np.floor(path.min(axis=0) - radius), 0.0).astype(int)
            high = np.floor(path.max(axis=0) + radius).astype(int) + 1
            high = np.minimum(high, self.shape[::-1])
            if (low >= high).any():
                continue
            length = np.hypot(*np.diff(path, axis=0).T).sum()
            times = max(math.ceil(length / min(0.25 * radius, 1.0) / 2.0), 1)
            u = (np.arange(times) + 0.5) / times
            halves = [(path[0], path[1]), (path[1], path[2])]
            points = np.concatenate([a + u[:, None] * (b - a) for a, b in halves])
            grid = [
                (np.arange(SAMPLES * (high[axis] - low[axis])) + 0.5) / SAMPLES + low[axis]
                for axis in range(2)
            ]
            total = np.zeros((len(grid[1]), len(grid[0])))
            for x, y in points:
                square = ((grid[0] - x) / radius) ** 2 + (((grid[1] - y) / radius) ** 2)[:, None]
                total += profile(square, self.tau0)
            tall, wide = high[1] - low[1], high[0] - low[0]
            a = total.reshape(tall, SAMPLES, wide, SAMPLES).mean(axis=(1, 3)) / len(points)
            a = np.minimum(share[n] * a, 1.0 - 1e-6)
            picture[low[1] : high[1], low[0] : high[0]] -= np.log1p(-a)

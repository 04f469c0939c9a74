"""The population whose waves are the clip's: its number, sizes and exposure, by least squares.

In the space-time spectrum flakes make a fan of planes, one for each depth, that share the line of
waves across the motion. Flakes of diameter D at depth Z are f D / Z px wide and move by f v(D) / Z:
the fan's opening is v / D, which the law of fall turns into metres. What varies is the optical
density of a Poisson process, whose spectrum is the sum of those of its flakes.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.matching.direction import WINDOW, Direction, Spectra
from flurries.particles.sizes import SNOW, Sizes

# Depths in metres between which snow is taken to be, and the opacity of its flakes, which is that
# of balls whose middle has the optical depth: those of `Snow`. So is how far flakes swing, metres,
# at radians a second and each with a phase of its own.
NEAR, FAR, OPACITY, _MIDDLE = 0.4, 60.0, 0.9, 4.3096
_SWAY, _RATE = 0.02, 4.0
# Depths and sizes that stand for all; so many depths are one group with each of the sizes.
_DEPTHS, _SIZES, _FEWER = 40, 5, 10
GROUPS = _FEWER * _SIZES
# Waves in cycles per diameter that a ball is tabled at.
_WAVES = np.linspace(0.0, 12.0, 481)


class Lens(NamedTuple):
    """What is known of a clip: the focal length in px, frames a second, their number and size."""

    focal: float
    fps: float
    frames: int
    size: tuple[int, int]  # (width, height)


class Air(NamedTuple):
    """What is looked for: sizes and how they move before a camera."""

    sizes: Sizes
    wind: float  # m/s to the right.
    shutter: float  # Frames.
    floor: float  # Opacity of a flake's brightest place of which half its power is lost.


@cache
def ball() -> Float64:
    """Return the transform of a ball of diameter 1 at `_WAVES`."""
    r, angles = 0.5 * (np.arange(96) + 0.5) / 96, np.pi * (np.arange(64) + 0.5) / 64
    rings = -np.expm1(-_MIDDLE * np.sqrt(1.0 - 4.0 * r**2)) * 2.0 * np.pi * r * (0.5 / 96)
    turns = 2.0 * np.pi * _WAVES[:, None] * r
    return np.asarray(np.cos(turns[..., None] * np.cos(angles)).mean(axis=-1) @ rings)


def held(shift: Array) -> Array:
    """Return the share of what moved by px along a side that is in both of its Hann windows."""
    x = np.minimum(np.abs(shift) / WINDOW, 1.0)
    turn = 2.0 * np.pi * x
    return np.asarray((1.0 - x) * (2.0 + np.cos(turn)) / 3.0 + np.sin(turn) / (2.0 * np.pi))


def _sinc(x: Array) -> Array:
    """Return NumPy's `sinc`, in half its passes."""
    x = np.float32(math.pi) * x + np.float32(1e-9)
    return np.asarray(np.sin(x) / x)


def fan(
    air: Air, lens: Lens, angle: float, waves: tuple[Float64, Float64], lags: range
) -> tuple[Float64, Float64]:
    """Return spectra of one flake per m3 (lags, n, `GROUPS`), and the flakes of each group."""
    # Real parts, px^2, at waves (n,) in cycles per pixel, along an angle and across it.
    sizes, cos, sin = air.sizes, math.cos(angle), math.sin(angle)
    edges = np.linspace(sizes.smallest, sizes.largest, _SIZES + 1)
    nodes = [sizes.nodes(low, high) for low, high in pairwise(edges.tolist())]
    power = np.array([share @ at**4 for at, share in nodes])
    shares = np.array([share.sum() for _, share in nodes])
    diameter = (power / shares) ** 0.25
    ends = np.geomspace(NEAR, FAR, _DEPTHS + 1)
    depth, thick = np.sqrt(ends[1:] * ends[:-1]), math.log(ends[1] / ends[0])
    # Of each depth and size: px that a metre has, a flake's width, its velocity, and their power.
    scale, deep = lens.focal / depth[:, None], np.diff(ends)[:, None]
    image = (scale * diameter).ravel()
    x, y = (scale / lens.fps * speed for speed in (np.full(_SIZES, air.wind), SNOW.speed(diameter)))
    weight = (deep * scale**2 * power).ravel()
    # A codec drops what is faint.
    disc = 0.25 * math.pi * image**2
    width = np.sqrt(disc + 1.0)
    peak = OPACITY * disc / (width * (width + np.hypot(x, y).ravel() * air.shutter))
    weight /= 1.0 + (air.floor / peak) ** 2
    # Sines of many waves: half as wide numbers do.
    several = cos * x + sin * y, cos * y - sin * x, *waves, image, weight, np.repeat(scale, _SIZES)
    u, v, along, across, px, energy, far = (np.ravel(one).astype(np.float32) for one in several)
    turns = along[:, None] * u + across[:, None] * v
    shape = np.interp(np.hypot(along, across)[:, None] * px, _WAVES, ball(), right=0.0)
    single = (shape.astype(np.float32) * _sinc(turns * air.shutter)) ** 2 * energy
    # Pixels are squares.
    kx, ky = along * cos - across * sin, along * sin + across * cos
    box = (np.sinc(kx) * np.sinc(ky)) ** 2
    # What stands still goes with the mean of a film, or moves by whole waves between frames.
    part = turns - np.rint(turns)
    still = (_sinc(lens.frames * part) / _sinc(part)) ** 2 * (lens.frames > 1)
    found = []
    for lag in lags:
        # Depths that one stands for differ in what they turn by, and each flake swings.
        seen = np.cos(2.0 * np.pi * lag * turns) * _sinc(lag * thick * turns)
        if lag:
            swing = 2.0 * np.pi * _SWAY * math.sin(0.5 * _RATE * lag / lens.fps)
            seen *= np.exp(-((swing * kx[:, None] * far) ** 2))
            seen *= held(lag * u * cos) * held(lag * u * sin)
        planes = (single * (seen - still)).reshape(len(along), _FEWER, -1, _SIZES).sum(axis=2)
        found.append(box[:, None] * planes.reshape(len(along), -1))
    wide, high = lens.size
    area = wide * high + (lens.frames - 1) * (np.abs(x) * high + np.abs(y) * wide)
    number = (area / scale**2 * deep * shares).reshape(_FEWER, -1, _SIZES).sum(axis=1)
    return np.array(found), number.ravel()


# Waves that are looked at, cycles/px, in bands; and borders of those along the motion.
_BANDS = np.geomspace(0.03, 0.3, 9)
_ALONG = np.array([0.0, 0.004, 0.008, 0.012, 0.018, 0.026, 0.036, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3])
# A window's own spread of waves, cycles/px; and four places in a cell in parts of the spread there,
# along the motion and across it.
_OWN = 3.0**-0.5 / WINDOW
_PLACES = np.array([[[-1.0], [-1.0], [1.0], [1.0]], [[-1.0], [1.0], [-1.0], [1.0]]])
# Waves that a cell has at least; smallest and largest diameter over the mean: of the looks.
_LEAST, _SPREAD = 12.0, (0.43, 3.1)
# What the law is not right by, a share of the spectrum; what leaks of the strongest waves of a
# length to others; and what the mean opacity over a plate is right by. Steps of least squares.
_LAW, _LEAK, _VEIL, _STEPS, _STEP = 0.03, 0.01, 0.1, 14, 0.02

# What is looked for: logarithms of density, mean size, shutter, and the opacity that a codec drops;
# the turn of the motion; logarithms of what a codec leaves of all waves, and besides of those of
# `_BANDS[-1]`; of the share that leaks evenly; of noise for each lag; and of the power of groups.
# Where they begin and end:
_LOW = np.array([*np.log([1e-3, 1e-4, 0.01, 1e-3]), -0.2, -1.0, -1.0, -9.0, *[math.log(1e-9)] * 3])
_HIGH = np.array([*np.log([1e5, 0.1, 2.0, 0.5]), 0.2, 1.0, 1.0, -0.2, *[1.0] * 3])
_NOISE = 8
_LOW, _HIGH = (np.append(end, np.full(GROUPS, most)) for end, most in ((_LOW, -4.0), (_HIGH, 4.0)))
# What is usual, and how much it differs: sizes are those of the looks, what a codec leaves is that
# of h264 at crf 18 (`docs/internals/match.md`).
_USUAL = (
    (1, math.log(0.007), 0.35), (3, math.log(0.02), 1.0), (5, -0.05, 0.08), (6, -0.08, 0.07),
    (7, math.log(0.03), 1.0),
)  # fmt: skip


class Fit(NamedTuple):
    density: float  # Per m3.
    air: Air
    errors: Float64  # Of the logarithms of density, size and shutter.
    misfit: float  # What is left over what is expected, root of the mean square.


def cells(
    found: Spectra, way: Direction, focal: float
) -> tuple[Float64, tuple[Float64, Float64], Float64, Array]:
    """Return means of spectra (lags, n) in cells of waves, along the motion and across it."""
    # And four places inside, (4 n,) along and across; the number of waves; and the band.
    kx, ky = np.meshgrid(np.fft.rfftfreq(WINDOW), np.fft.fftfreq(WINDOW))
    k, columns = np.hypot(kx, ky), len(_ALONG) - 1
    half = (len(_BANDS) - 1) * columns
    sums = np.zeros((5 + found.cross.shape[1], 2 * half))
    for weight, place, cross in zip(found.weights, found.places, found.cross.real, strict=True):
        vx, vy = (math.cos(way.angle), math.sin(way.angle)) - way.approach / focal * place
        along, across = (kx * vx + ky * vy, ky * vx - kx * vy) / np.hypot(vx, vy)
        inside = (k > _BANDS[0]) & (k < _BANDS[-1]) & (along != 0.0) & (across != 0.0)
        cell = (np.searchsorted(_BANDS, k) - 1) * columns
        cell += np.searchsorted(_ALONG, np.abs(along)) - 1 + half * (across * along > 0.0)
        rows = np.ones_like(k), np.abs(along), np.abs(across), along**2, across**2, *cross
        sums += [weight * np.bincount(cell[inside], row[inside], 2 * half) for row in rows]
    number = sums[0] / (found.weights**2).sum()
    used = np.flatnonzero(number > _LEAST)
    parts = sums[1:, used] / sums[0, used]
    spread = np.sqrt(np.maximum(parts[2:4] - parts[:2] ** 2, 0.0) + _OWN**2)
    along, across = (parts[:2, None] + _PLACES * spread[:, None]).reshape(2, 4, -1)
    across *= np.where(used < half, -1.0, 1.0)
    return parts[4:], (along.ravel(), across.ravel()), number[used], used % half // columns


def sizes_of(mean: float) -> Sizes:
    return Sizes.with_mean(_SPREAD[0] * mean, mean, _SPREAD[1] * mean)


def air_of(values: Float64, angle: float) -> Air:
    """Return what mean size, shutter, floor and turn stand for, before a motion at an angle."""
    mean, shutter, floor = np.exp(values[:3]).tolist()
    sizes = sizes_of(mean)
    # What is seen best are the larger ones, and these fall in the direction that was seen.
    fall = float(SNOW.speed(np.array([sizes.moment(4.0) / sizes.moment(3.0)]))[0])
    return Air(sizes, fall / math.tan(angle + values[3]), shutter, floor)


def least_squares(left: Callable[[Float64], Float64], values: Float64) -> list[Float64]:
    """Return where squares of what is left are least, that, and its slopes (Marquardt)."""
    off, damp = left(values), 1e-2
    for _ in range(_STEPS):
        tried = values + _STEP * np.eye(len(values))
        with ThreadPoolExecutor(2) as both:
            slopes = (np.array(list(both.map(left, tried))) - off) / _STEP
        square = slopes @ slopes.T
        scale = np.diag(np.diag(square) + 1e-6 * square.max())
        for _ in range(6):
            change = np.linalg.solve(square + damp * scale, -slopes @ off)
            new = np.clip(values + np.clip(change, -0.7, 0.7), _LOW, _HIGH)
            less = left(new)
            gain = 1.0 - float(less @ less) / float(off @ off)
            if gain > 0.0:
                values, off, damp = new, less, 0.3 * damp
                break
            damp *= 5.0
        if gain < 5e-3:
            break
    return [values, off, slopes]


def fit(found: Spectra, way: Direction, lens: Lens, veil: float | None) -> Fit:
    """Return the population whose spectra, and veil if known, are nearest to those found."""
    measured, waves, number, band = cells(found, way, lens.focal)
    lags = range(len(measured))
    most = np.zeros(len(_BANDS))
    np.maximum.at(most, band, measured[0])
    free = number / 8.0 * max(lens.frames / 3.0, 1.0)
    sure = np.sqrt(measured[0] ** 2 * (1.0 / free + _LAW**2) + (_LEAK * most[band]) ** 2)
    numbers = np.maximum(np.bincount(band, number), 1.0)
    long = np.hypot(*waves).reshape(4, -1).mean(axis=0) / _BANDS[-1]

    @cache
    def single(*values: float) -> tuple[Float64, float, Float64]:
        """Return the spectra, the optical depth, and the flakes in groups of one flake per m3."""
        air = air_of(np.array(values), way.angle)
        planes, many = fan(air, lens, way.angle, waves, lags)
        planes = planes.reshape(len(lags), 4, -1, GROUPS).mean(axis=1)
        area = 0.25 * math.pi * OPACITY * air.sizes.moment(2.0)
        return planes, area * (FAR - NEAR), many

    def left(values: Float64) -> Float64:
        planes, depth, many = single(*values[1:5].tolist())
        # Logarithms of the power of groups are as much spread as numbers of flakes are.
        square, own = np.log1p(math.exp(-values[0]) / many), values[_NOISE + 3 :]
        more = np.exp(np.sqrt(square) * own - 0.5 * square)
        planes = np.exp(values[0] + values[5] + values[6] * long) * (planes @ more)
        even = np.bincount(band, number * planes[0]) / numbers
        planes += np.exp(values[_NOISE : _NOISE + len(lags)])[:, None]
        planes[0] += math.exp(values[7]) * even[band]
        usual = [(values[n] - mean) / share for n, mean, share in _USUAL]
        if veil is not None:
            usual.append((math.log(veil / depth) - values[0]) / _VEIL)
        return np.concatenate([((measured - planes) / sure).ravel(), own, usual])

    level = math.log(max(float(measured[0].min()) * 0.2, 1e-9))
    start = np.zeros(len(_LOW))
    start[: _NOISE + 3] = 0, -5.0, -1.0, -4.0, 0, 0, 0, -3.0, level, level - 1.0, level - 1.0
    first = single(*start[1:5].tolist())[0][0].sum(axis=1)
    start[0] = math.log(max(float(np.median(measured[0] / first)), 1e-3))
    values, off, slopes = least_squares(left, np.clip(start, _LOW, _HIGH))
    square = slopes @ slopes.T
    inverse = np.linalg.inv(square + 1e-6 * np.diag(np.diag(square) + 1e-6 * square.max()))
    errors, misfit = np.sqrt(np.diag(inverse))[:3], math.sqrt(float(off @ off) / len(off))
    return Fit(math.exp(values[0]), air_of(values[1:5], way.angle), errors, misfit)

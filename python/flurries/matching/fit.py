"""The population whose fan is the clip's: its number, sizes and exposure, by least squares."""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.matching.direction import WINDOW, Direction, Spectra
from flurries.matching.fan import FAR, NEAR, OPACITY, Air, Lens, fan
from flurries.particles.sizes import SNOW, Sizes

# Waves that are looked at, cycles/px, in bands; and borders of those along the motion.
_BANDS = np.geomspace(0.03, 0.3, 9)
_ALONG = np.array([0.0, 0.004, 0.008, 0.012, 0.018, 0.026, 0.036, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3])
# Places in a cell along the motion, and their weights.
_INSIDE, _NODES = np.array([[0.113], [0.5], [0.887]]), np.array([5.0, 8.0, 5.0]) / 18.0

# Smallest and largest diameter over the mean: of the looks.
_SPREAD = 0.43, 3.1

# What the law is not right by, a share of the spectrum; what codecs and windows bring from the
# strongest waves of a length to others; and what the mean opacity over a plate is right by.
_LAW, _LEAK, _VEIL = 0.03, 0.01, 0.1

# What usually leaks, a logarithm, and how much that differs.
_USUAL = math.log(0.15), 0.1

_STEPS, _STEP = 14, 0.02

# Logarithms of density, mean size, shutter and the opacity that the codec drops; the turn of the
# motion; a logarithm of what leaks evenly, and of noise for each lag: where they begin and end.
_LOW = np.array([*np.log([1e-3, 1e-4, 0.01, 1e-3]), -0.2, -9.0, *[math.log(1e-9)] * 3])
_HIGH = np.array([*np.log([1e5, 0.1, 2.0, 0.5]), 0.2, -0.2, *[1.0] * 3])


class Fit(NamedTuple):
    """What was found, and how sure it is."""

    density: float  # Per m3.
    air: Air
    errors: Float64  # Of the logarithms of density, size and shutter.
    misfit: float  # What is left over what is expected, root of the mean square.


class Cells(NamedTuple):
    """Means of spectra over cells of waves."""

    quarters: Float64  # (4, lags, n): of quarters of the places.
    along: Float64  # (3, n): at three places inside.
    across: Float64  # (n,)
    number: Float64  # Of waves.
    band: npt.NDArray[np.int64]  # Its number.


def cells(found: Spectra, way: Direction, focal: float) -> Cells:
    """Return means of spectra in cells of waves, along the motion at each place and across it."""
    kx, ky = np.meshgrid(np.fft.rfftfreq(WINDOW), np.fft.fftfreq(WINDOW))
    k, columns = np.hypot(kx, ky), len(_ALONG) - 1
    half = (len(_BANDS) - 1) * columns
    sums = np.zeros((4, 2 + found.cross.shape[1], 2 * half))
    for n, (x, y) in enumerate(found.places / focal):
        vx, vy = math.cos(way.angle) - way.approach * x, math.sin(way.angle) - way.approach * y
        along, across = (kx * vx + ky * vy, ky * vx - kx * vy) / np.hypot(vx, vy)
        inside = (k > _BANDS[0]) & (k < _BANDS[-1]) & (along != 0.0) & (across != 0.0)
        cell = (np.searchsorted(_BANDS, k) - 1) * columns
        cell += np.searchsorted(_ALONG, np.abs(along)) - 1 + half * (across * along > 0.0)
        rows = np.ones_like(k), np.abs(across), *found.cross[n].real
        sums[n % 4] += [np.bincount(cell[inside], row[inside], 2 * half) for row in rows]
    used = np.flatnonzero(sums[:, 0].min(axis=0) > 3)
    sums = sums[:, :, used]
    number, away = sums[:, :2].sum(axis=0)
    band, column = np.divmod(used % half, columns)
    return Cells(
        sums[:, 2:] / sums[:, :1], _ALONG[column] + np.diff(_ALONG)[column] * _INSIDE,
        np.where(used < half, -1.0, 1.0) * away / number, number, band,
    )  # fmt: skip


def air_of(values: Float64, angle: float) -> Air:
    """Return what mean size, shutter and floor stand for, before a motion at an angle."""
    mean, shutter, floor = np.exp(values[:3]).tolist()
    sizes = Sizes.with_mean(_SPREAD[0] * mean, mean, _SPREAD[1] * mean)
    # What is seen best are the larger ones, and these fall in the direction that was seen.
    fall = float(SNOW.speed(np.array([sizes.moment(4.0) / sizes.moment(3.0)]))[0])
    return Air(sizes, fall / math.tan(angle + values[3]), shutter, floor)


def least_squares(
    left: Callable[[Float64], Float64], values: Float64
) -> tuple[Float64, Float64, Float64]:
    """Return where the squares of what is left are least, that, and its slopes there.

    The way is Levenberg's and Marquardt's.
    """
    off, damp = left(values), 1e-2
    for _ in range(_STEPS):
        near = values + _STEP * np.eye(len(values))
        slopes = np.array([left(one) - off for one in near]) / _STEP
        square = slopes @ slopes.T
        scale = np.diag(np.diag(square) + 1e-6 * square.max())
        for _ in range(6):
            change = np.linalg.solve(square + damp * scale, -slopes @ off)
            new = np.clip(values + np.clip(change, -0.7, 0.7), _LOW, _HIGH)
            less = left(new)
            if less @ less < off @ off:
                break
            damp *= 5.0
        else:
            break
        gain = 1.0 - float(less @ less) / float(off @ off)
        values, off, damp = new, less, 0.3 * damp
        if gain < 1e-3:
            break
    return values, off, slopes


def fit(found: Spectra, way: Direction, lens: Lens, veil: float | None) -> Fit:
    """Return the population whose spectra, and veil if known, are nearest to those found."""
    seen = cells(found, way, lens.focal)
    measured, lags = seen.quarters.mean(axis=0), range(found.cross.shape[1])
    free = seen.number / 8.0 * max(lens.frames / 3.0, 1.0)
    most = np.zeros(len(_BANDS))
    np.maximum.at(most, seen.band, measured[0])
    sure = measured[0] ** 2 * (1.0 / free + _LAW**2) + (_LEAK * most[seen.band]) ** 2
    numbers = np.maximum(np.bincount(seen.band, seen.number), 1.0)
    waves = seen.along.ravel(), np.tile(seen.across, 3)

    @cache
    def single(*values: float) -> tuple[Float64, float]:
        """Return the spectra and the optical depth of one flake per m3."""
        air = air_of(np.array(values), way.angle)
        planes = fan(air, lens, way.angle, waves, lags).reshape(len(lags), 3, -1)
        area = 0.25 * math.pi * OPACITY * air.sizes.moment(2.0)
        return _NODES @ planes, area * (FAR - NEAR)

    def left(values: Float64) -> Float64:
        planes, depth = single(*values[1:5].tolist())
        planes = planes * math.exp(values[0])
        expected = planes + np.exp(values[6 : 6 + len(lags)])[:, None]
        even = np.bincount(seen.band, seen.number * planes[0]) / numbers
        expected[0] += math.exp(values[5]) * even[seen.band]
        off = [((measured - expected) / np.sqrt(sure)).ravel()]
        off.append(np.array([(values[5] - _USUAL[0]) / _USUAL[1]]))
        if veil is not None:
            off.append(np.array([(math.log(veil / depth) - values[0]) / _VEIL]))
        return np.concatenate(off)

    level = math.log(max(float(measured[0].min()) * 0.2, 1e-9))
    start = np.array([0.0, -5.0, -1.0, -4.0, 0.0, -3.0, level, level - 1.0, level - 1.0])
    first = single(*start[1:5].tolist())[0][0]
    start[0] = math.log(max(float(np.median(measured[0] / first)), 1e-3))
    values, off, slopes = least_squares(left, np.clip(start, _LOW, _HIGH))
    square = slopes @ slopes.T
    inverse = np.linalg.inv(square + 1e-6 * np.diag(np.diag(square) + 1e-6 * square.max()))
    parts = ((seen.quarters - measured) / np.sqrt(sure)).reshape(4, -1)
    moves = inverse @ slopes[:, : measured.size] @ parts.T
    errors = np.sqrt((moves**2).mean(axis=1) / 3.0)[:3]
    misfit = math.sqrt(float(off @ off) / len(off))
    return Fit(math.exp(values[0]), air_of(values[1:5], way.angle), errors, misfit)

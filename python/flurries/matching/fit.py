"""The population whose fan is the clip's: its number, sizes and exposure, by least squares."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.matching.direction import Direction
from flurries.matching.fan import Air, Lens, fan
from flurries.matching.spectra import WINDOW, Spectra
from flurries.particles.sizes import Sizes

# Waves that are looked at, cycles/px, in bands; and borders of those along the motion.
_BANDS = np.geomspace(0.03, 0.3, 9)
_ALONG = np.array([0.0, 0.004, 0.008, 0.012, 0.018, 0.026, 0.036, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3])
# Places in a cell along the motion, and their weights.
_INSIDE, _NODES = np.array([[0.113], [0.5], [0.887]]), np.array([5.0, 8.0, 5.0]) / 18.0

# Smallest and largest diameter over the mean: of the looks.
SPREAD = 0.43, 3.1

# What the law is not right by, a share of the spectrum; and what codecs and windows bring from the
# strongest waves of a length to others.
_LAW, _LEAK = 0.03, 0.01

# What the mean opacity over a plate is right by.
_VEIL = 0.1

# What usually leaks, a logarithm, and how much that differs.
_USUAL = math.log(0.15), 0.1

_STEPS, _STEP = 14, 0.02

# Logarithms of density, mean size, shutter and the opacity that the codec drops; the turn of the
# motion; logarithms of noise for each lag, and of what leaks evenly: where they begin and end.
_LOW = np.array([*np.log([1e-3, 1e-4, 0.01, 1e-3]), -0.2, *[math.log(1e-9)] * 3, -9.0])
_HIGH = np.array([*np.log([1e5, 0.1, 2.0, 0.5]), 0.2, *[1.0] * 3, -0.2])
_FAN = 5


@dataclass(frozen=True)
class Fit:
    """What was found, and how sure it is."""

    air: Air
    leak: float  # The share of power that codecs spread over all directions.
    errors: Float64  # Of the logarithms of density, size and shutter.
    misfit: float  # What is left over what is expected, root of the mean square.
    measured: Float64  # (lags, cells)
    fitted: Float64


@dataclass(frozen=True)
class Cells:
    """Means of spectra over cells of waves."""

    quarters: Float64  # (4, lags, n): of quarters of the places.
    along: Float64  # (3, n): at three places inside.
    across: Float64  # (n,)
    number: Float64  # Of waves.
    band: npt.NDArray[np.int64]

    @property
    def mean(self) -> Float64:
        return np.asarray(self.quarters.mean(axis=0))


def cells(found: Spectra, way: Direction, focal: float) -> Cells:
    """Return means of spectra in cells of waves, along the motion at each place and across it."""
    ky = np.fft.fftfreq(WINDOW)[:, None] + np.zeros(WINDOW // 2 + 1)
    kx = np.fft.rfftfreq(WINDOW) + np.zeros((WINDOW, 1))
    k = np.hypot(kx, ky)
    bands, columns = len(_BANDS) - 1, len(_ALONG) - 1
    many, lags = 2 * bands * columns, found.cross.shape[1]
    sums, number = np.zeros((4, lags, many)), np.zeros((4, many))
    away = np.zeros(many)
    for n, (x, y) in enumerate(found.places / focal):
        vx, vy = math.cos(way.angle) - way.approach * x, math.sin(way.angle) - way.approach * y
        along, across = (kx * vx + ky * vy) / math.hypot(vx, vy), ky * vx - kx * vy
        side = across * along > 0.0
        along = np.abs(along)
        inside = (k > _BANDS[0]) & (k < _BANDS[-1]) & (along > 0.0) & (across != 0.0)
        cell = (np.searchsorted(_BANDS, k) - 1) * columns + np.searchsorted(_ALONG, along) - 1
        own = (cell + side * (bands * columns))[inside]
        number[n % 4] += np.bincount(own, minlength=many)
        squares = np.maximum(k**2 - along**2, 0.0)[inside]
        away += np.bincount(own, np.sqrt(squares), many)
        for lag in range(lags):
            sums[n % 4, lag] += np.bincount(own, found.cross[n, lag].real[inside], many)
    used = number.min(axis=0) > 3
    total = number.sum(axis=0)[used]
    band, column = np.divmod(np.flatnonzero(used) % (bands * columns), columns)
    along = _ALONG[column] + np.diff(_ALONG)[column] * _INSIDE
    sign = np.where(np.flatnonzero(used) >= bands * columns, 1.0, -1.0)
    return Cells(
        sums[:, :, used] / number[:, None, used], along, sign * away[used] / total, total, band
    )


def air_of(values: Float64, way: Direction, lens: Lens, sway: float) -> Air:
    """Return the population that the first numbers stand for."""
    density, mean, shutter, floor = np.exp(values[:4])
    sizes = Sizes.with_mean(SPREAD[0] * mean, mean, SPREAD[1] * mean)
    # What is seen best are the larger ones, and these fall in the direction that was seen.
    large = sizes.moment(4.0) / sizes.moment(3.0)
    fall = float(lens.matter.speed(np.array([large]))[0])
    angle = way.angle + values[4]
    wind = fall * math.cos(angle) / math.sin(angle)
    return Air(float(density), sizes, (wind, 0.0), float(shutter), sway, float(floor))


def fit(
    found: Spectra, way: Direction, lens: Lens, sway: float = 0.02, veil: float | None = None
) -> Fit:
    """Return the population whose spectra, and veil if known, are nearest to those found."""
    seen = cells(found, way, lens.focal)
    measured, lags = seen.mean, tuple(range(seen.quarters.shape[1]))
    free = seen.number / 8.0 * max(found.frames / 3.0, 1.0)
    most = np.zeros(len(_BANDS))
    np.maximum.at(most, seen.band, measured[0])
    weight = 1.0 / np.sqrt(
        measured[0] ** 2 * (1.0 / free + _LAW**2) + (_LEAK * most[seen.band]) ** 2
    )
    waves = seen.along.ravel(), np.tile(seen.across, 3)
    numbers = np.maximum(np.bincount(seen.band, seen.number), 1.0)

    def planes(values: Float64) -> tuple[Float64, float]:
        air = air_of(values, way, lens, sway)
        got = fan(air, lens, way.angle, waves, lags).reshape(len(lags), 3, -1)
        area = 0.25 * math.pi * lens.opacity * air.density * air.sizes.moment(2.0)
        return _NODES @ got, math.log(area * (lens.far - lens.near))

    def left(values: Float64, got: tuple[Float64, float]) -> tuple[Float64, Float64]:
        expected = got[0] + np.exp(values[_FAN : _FAN + len(lags)])[:, None]
        even = np.bincount(seen.band, seen.number * got[0][0]) / numbers
        expected[0] += np.exp(values[8]) * even[seen.band]
        off = (weight * (measured - expected)).ravel()
        off = np.append(off, (values[8] - _USUAL[0]) / _USUAL[1])
        if veil is not None:
            off = np.append(off, (math.log(veil) - got[1]) / _VEIL)
        return expected, off

    level = math.log(max(float(measured[0].min()) * 0.2, 1e-9))
    values = np.array([0.0, -5.0, -1.0, -4.0, 0.0, level, level - 1.0, level - 1.0, -3.0])
    values[0] = math.log(max(float(np.median(measured[0] / planes(values)[0][0])), 1e-3))
    values = np.clip(values, _LOW, _HIGH)
    got, damp = planes(values), 1e-2
    expected, off = left(values, got)
    for _ in range(_STEPS):
        slopes = []
        for n in range(len(values)):
            near = values.copy()
            near[n] += _STEP
            other = got if n >= _FAN else planes(near)
            if n == 0:
                other = got[0] * math.exp(_STEP), got[1] + _STEP
            slopes.append((off - left(near, other)[1]) / _STEP)
        jac = np.array(slopes)
        square = jac @ jac.T
        scale = np.diag(np.diag(square) + 1e-6 * square.max())
        for _ in range(6):
            change = np.clip(np.linalg.solve(square + damp * scale, jac @ off), -0.7, 0.7)
            new = np.clip(values + change, _LOW, _HIGH)
            now = planes(new)
            expected, less = left(new, now)
            if less @ less < off @ off:
                break
            damp *= 5.0
        else:
            expected = left(values, got)[0]
            break
        gain = 1.0 - float(less @ less) / float(off @ off)
        values, got, off, damp = new, now, less, 0.3 * damp
        if gain < 1e-3:
            break
    inverse = np.linalg.inv(square + 1e-6 * scale)
    rows = jac[:, : measured.size]
    moves = [inverse @ (rows @ (weight * (part - measured)).ravel()) for part in seen.quarters]
    errors = np.sqrt((np.array(moves) ** 2).mean(axis=0) / 3.0)[:3]
    misfit = math.sqrt(float(off @ off) / len(off))
    air = air_of(values, way, lens, sway)
    return Fit(air, float(np.exp(values[8])), errors, misfit, measured, expected)

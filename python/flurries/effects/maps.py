"""The tent's maps from waves to opacity: at every size of the picture, and before a wall.

A larger picture looks as if it had been made smaller. Waves below 2 px have no pixels, and a pixel
averages what is longer: at another width the map is the one whose opacity has the mean and variance
of the averages of one 1024 px wide.

Before a wall the waves of nearer depths are left with the contrast that they have before the sky,
and the mean goes with the share of the air, so a wall has a map of its own. Its harmonics count:
held are .7 of the logarithm of what opacity and waves have in common, .3 of that of the variance.
"""

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept

TUNED = 1024  # The width that looks are tuned for.

# Hermite polynomials in which maps are expanded, and steps of Newton's.
_TERMS = 24
_STEPS, _TINY = 40, 1e-5


@kept(64)
def power_share(wavelengths: tuple[float, float], exponent: float, width: int) -> float:
    """Return the power that a picture shows of a band, against that of one 1024 px wide."""
    if width == TUNED:
        return 1.0
    return _shown(wavelengths, exponent, width / TUNED) / _shown(wavelengths, exponent, 1.0)


def _shown(wavelengths: tuple[float, float], exponent: float, scale: float) -> float:
    # Up to the band's end: what a pixel leaves of waves shorter than two of them is seen as longer
    # ones.
    first, last = 1.0 / wavelengths[1], 1.0 / wavelengths[0]
    # Even in the logarithm, at the middles.
    steps = 256
    octaves = math.log(last / first)
    k = first * np.exp(octaves * (np.arange(steps) + 0.5) / steps)
    angle = 0.5 * np.pi * (np.arange(32) + 0.5) / 32
    left = np.sinc(np.outer(k, np.cos(angle)) / scale) * np.sinc(np.outer(k, np.sin(angle)) / scale)
    power = k ** (2.0 - 2.0 * exponent) * (left**2).mean(axis=1)
    return float(power.mean() * octaves)


@kept(256)
def map_at(mean: float, spread: float, power: float, share: float) -> tuple[float, float]:
    """Return mean and spread of a map for a picture that shows a share of the tuned one's power."""
    if share == 1.0:
        return mean, spread
    deviation, of = 0.5 / spread, 1.0 if share < 1.0 else 1.0 / share
    target = _moments(mean, deviation, power, min(share, 1.0))
    if share <= 1e-6 or target[1] <= 1e-12:
        # Nothing but the mean is seen.
        return target[0] ** (1.0 / power), 1e3
    guess = np.array([mean, math.log(deviation * math.sqrt(share))])
    for _ in range(_STEPS):
        now = _errors(guess, power, of, target)
        if np.abs(now).max() < 1e-10:
            break
        ahead = [_errors(guess + step, power, of, target) for step in _TINY * np.eye(2)]
        slopes = (np.stack(ahead, axis=1) - now[:, None]) / _TINY
        try:
            step = np.linalg.solve(slopes, now)
        except np.linalg.LinAlgError:
            break
        guess = guess - step * min(1.0, 0.2 / float(np.abs(step).max()))
    if np.abs(_errors(guess, power, of, target)).max() > 1e-3:
        return mean, spread / math.sqrt(share)
    return float(guess[0]), 0.5 / math.exp(float(guess[1]))


def _errors(guess: Float64, power: float, of: float, target: tuple[float, float]) -> Float64:
    """Return the errors of a map, in logarithms: both moments may be small."""
    mean, variance = _moments(float(guess[0]), math.exp(min(float(guess[1]), 5.0)), power, of)
    pairs = zip((mean, variance), target, strict=True)
    return np.array([math.log(max(got, 1e-300) / max(wanted, 1e-300)) for got, wanted in pairs])


def _moments(mean: float, deviation: float, power: float, share: float) -> tuple[float, float]:
    """Return the mean of a map, and the variance of its mean given a share of the field's power."""
    z, weights = _hermite()
    value = np.clip(mean + deviation * z, 0.0, 1.0)
    first, *others = (weights @ value**power).tolist()
    if share == 1.0:
        # All there are, without cutting the series.
        return first, max(float(weights[0] @ value ** (2.0 * power)) - first**2, 0.0)
    return first, float((np.array(others) ** 2) @ share ** np.arange(1, _TERMS))


def variances(mean: float, deviation: float, power: float, shares: Float64) -> Float64:
    """Return the variances of a map's mean given shares (n,) of the field's power."""
    z, weights = _hermite()
    value = np.clip(mean + deviation * z, 0.0, 1.0) ** power
    squares = (weights[1:] @ value) ** 2
    whole = float(weights[0] @ (value - weights[0] @ value) ** 2)
    powers = np.power.outer(shares, np.arange(1, _TERMS))
    return np.asarray(powers @ squares + (whole - squares.sum()) * shares**_TERMS)


@kept(1)
def _hermite() -> tuple[Float64, Float64]:
    """Return nodes, and the normalised Hermite polynomials there times the normal's weights."""
    z = np.linspace(-8.0, 8.0, 1601)
    weight = np.exp(-0.5 * z * z)
    weight /= weight.sum()
    terms = [np.ones_like(z), z]
    for n in range(2, _TERMS):
        terms.append((z * terms[-1] - math.sqrt(n - 1.0) * terms[-2]) / math.sqrt(n))
    return z, np.stack(terms) * weight


# Shares are tabulated evenly in their fourth root: near none the map changes fastest.
_SHARES, _FIRST = 160, 1e-4
_ENTRIES = 4097
# Fields blended linearly have less power at seams: sky's maps for so many roots of it.
_LEVELS = 9
# The largest share of the contrast that an opacity of that mean can have, all or nothing.
_MOST = 0.9
_NORMAL = NormalDist()
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class WallMaps(NamedTuple):
    """Maps to opacity by the share of the air before a wall."""

    # (levels,): of the sky's power, that of a field whose tiles are blended linearly; (1,) else.
    roots: Float64
    # (levels, entries), even in the fourth root of the share; deviations in terms of the sky's.
    means: Float64
    deviations: Float64

    def at(self, share: Float64, root: Float64 | None) -> tuple[Float64, Float64]:
        """Return mean and deviation of the maps for shares and roots of the sky's power."""
        entry = (np.sqrt(np.sqrt(share)) * (_ENTRIES - 1) + 0.5).astype(np.intp)
        if root is None:
            return self.means[0][entry], self.deviations[0][entry]
        place = (root - self.roots[0]) / (self.roots[-1] - self.roots[0]) * (len(self.roots) - 1)
        low = np.clip(place.astype(np.intp), 0, len(self.roots) - 2)
        part = place - low
        mean, deviation = (
            (1.0 - part) * table[low, entry] + part * table[low + 1, entry]
            for table in (self.means, self.deviations)
        )
        return mean, deviation


def wall_maps(
    sky: tuple[float, float, float], least: float, shares: tuple[float, ...],
    left: Callable[[Float64], Float64],
) -> WallMaps:  # fmt: skip
    grid = np.linspace(_FIRST**0.25, 1.0, _SHARES) ** 4
    nodes = np.unique(np.concatenate([grid, [s for s in shares if _FIRST < s < 1.0]]))
    return _maps(sky, least, tuple(nodes), tuple(left(nodes)))


@kept(32)
def _maps(
    sky: tuple[float, float, float], least: float, nodes: tuple[float, ...], left: tuple[float, ...]
) -> WallMaps:
    mean, deviation, power = sky
    roots = np.ones(1) if least == 1.0 else np.linspace(math.sqrt(least), 1.0, _LEVELS)
    whole, common, _ = _clipped_moments(np.full(len(roots), mean), deviation * roots, power)
    left_of = np.array(left)
    spread = np.stack([variances(mean, deviation * root, power, left_of) for root in roots])
    contrast = _contrast(np.outer(common, np.sqrt(left_of)), spread)
    # The sky's own map where all air is left; then ever less of it, each from the one before.
    means, deviations = np.empty((2, len(roots), len(nodes)))
    means[:, -1], deviations[:, -1] = mean, 1.0
    guess = np.stack([np.full(len(roots), mean), np.log(deviation * roots)])
    for number in range(len(nodes) - 2, -1, -1):
        wanted = nodes[number] * whole
        # No more than opacities that are all or nothing have.
        some = np.clip(wanted, 1e-12, 1.0 - 1e-12)
        common = np.array([_NORMAL.pdf(_NORMAL.inv_cdf(share)) for share in some])
        most = _contrast(common, some * (1.0 - some))
        shown = np.minimum(contrast[:, number], _MOST * most)
        # Without waves an even veil.
        even = shown <= 1e-6 * wanted
        if (wavy := ~even).any():
            guess[:, wavy] = _solve(guess[:, wavy], power, np.log([wanted[wavy], shown[wavy]]))
        means[:, number] = np.where(even, wanted ** (1.0 / power), guess[0])
        deviations[:, number] = np.where(even, 0.0, np.exp(guess[1]) / (deviation * roots))
    entries = np.linspace(0.0, 1.0, _ENTRIES)
    # A share that was asked for takes the nearest entry with it.
    at = np.array(nodes) ** 0.25
    at[:-1] = np.rint(at[:-1] * (_ENTRIES - 1)) / (_ENTRIES - 1)
    tables = [np.stack([np.interp(entries, at, row) for row in t]) for t in (means, deviations)]
    none = entries < _FIRST**0.25
    tables[0][:, none], tables[1][:, none] = -1.0, 0.0
    return WallMaps(roots, *tables)


def _contrast(common: Float64, spread: Float64) -> Float64:
    """Return the contrast of opacities by their means with waves and their variances."""
    return np.asarray(np.maximum(common, 0.0) ** 0.7 * np.maximum(spread, 0.0) ** 0.15)


def _solve(guess: Float64, power: float, wanted: Float64) -> Float64:
    """Return means and logarithms of deviations (2, n) of maps."""

    def errors(at: Float64) -> Float64:
        mean, common, spread = _clipped_moments(at[0], np.exp(at[1]), power)
        found = np.stack([mean, _contrast(common, spread)])
        return np.asarray(np.log(np.maximum(found, 1e-300)) - wanted)

    tiny, now = 1e-6, errors(guess)
    for _ in range(60):
        if np.abs(now).max() < 1e-9:
            break
        scale = np.exp(guess[1])
        # Steps of the mean in terms of the deviation: a far threshold moves in these.
        by_mean = (errors(guess + np.stack([tiny * scale, 0.0 * scale])) - now) / tiny
        by_scale = (errors(guess + np.array([[0.0], [tiny]])) - now) / tiny
        det = by_mean[0] * by_scale[1] - by_mean[1] * by_scale[0]
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        of_mean = now[0] * by_scale[1] - now[1] * by_scale[0]
        of_scale = now[1] * by_mean[0] - now[0] * by_mean[1]
        step = np.stack([of_mean, of_scale]) / det
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=0), 1e-300))
        guess = guess - step * np.stack([scale, np.ones_like(scale)])
        now = errors(guess)
    return guess


def _clipped_moments(mean: Float64, deviation: Float64, power: float) -> Float64:
    """Return moments (3, n) of a = clip(mean + deviation * z, 0, 1)^power, z normal."""
    low = np.clip(-mean / deviation, -9.0, 9.0)
    high = np.clip((1.0 - mean) / deviation, -9.0, 9.0)
    half = 0.5 * (high - low)
    z = 0.5 * (high + low) + half * _NODES[:, None]
    weight = half * _WEIGHTS[:, None] * _density(z)
    value = np.clip(mean + deviation * z, 0.0, 1.0) ** power
    below, above = (np.array([_NORMAL.cdf(end) for end in ends]) for ends in (low, -high))
    first = (weight * value).sum(axis=0) + above
    common = (weight * value * z).sum(axis=0) + _density(high)
    spread = (weight * (value - first) ** 2).sum(axis=0)
    spread += below * first**2 + above * (1.0 - first) ** 2
    return np.stack([first, common, spread])


def _density(z: Float64) -> Float64:
    return np.asarray(np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi))

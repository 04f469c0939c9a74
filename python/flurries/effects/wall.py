"""The tent's map to opacity before a scene that ends: another one for each share of the air.

Before a wall the waves that stand for nearer depths are left, and keep the contrast that they have
before the sky. The mean goes with the share of the air. One factor on the sky's map would take that
share of the waves' contrast, too, and less variance alone would leave the even veil that the map's
mean makes, even before a wall that no snow is in front of.

So a wall has a map of its own, clip(mean + deviation * z, 0, 1)^power of a field z of variance 1.
A map that is no straight line makes of waves their harmonics, too. Held by what opacity and waves
have in common, the power in the waves' band is up to 1.3^2 of the sky's; held by the variance of
all that the waves show, .78^2 (looks before a wall at twice `near_depth`). So what is held is .7 of
the logarithm of the first and .3 of the second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept
from flurries.effects.resolution import variances

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
    whole, common, _ = _moments(np.full(len(roots), mean), deviation * roots, power)
    left_of = np.array(left)
    spread = np.stack([variances(mean, deviation * root, power, left_of) for root in roots])
    contrast = _contrast(np.outer(common, np.sqrt(left_of)), spread)
    # The sky's own map where all air is left; then ever less of it, each from the one before.
    means, deviations = np.empty((2, len(roots), len(nodes)))
    means[:, -1], deviations[:, -1] = mean, 1.0
    guess = np.stack([np.full(len(roots), mean), np.log(deviation * roots)])
    for number in range(len(nodes) - 2, -1, -1):
        wanted = nodes[number] * whole
        shown = np.minimum(contrast[:, number], _MOST * _largest(wanted))
        even = shown <= 1e-6 * wanted
        shown = np.where(even, 1e-6 * wanted, shown)
        guess = _solve(guess, power, np.log(np.stack([wanted, shown])))
        # Without waves an even veil.
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


def _largest(mean: Float64) -> Float64:
    """Return the contrast of opacities (n,) of that mean that are all or nothing."""
    some = np.clip(mean, 1e-12, 1.0 - 1e-12)
    common = np.array([_NORMAL.pdf(_NORMAL.inv_cdf(share)) for share in some])
    return _contrast(common, some * (1.0 - some))


def _solve(guess: Float64, power: float, wanted: Float64) -> Float64:
    """Return means and logarithms of deviations (2, n) of maps."""

    def errors(at: Float64) -> Float64:
        mean, common, spread = _moments(at[0], np.exp(at[1]), power)
        found = np.stack([mean, _contrast(common, spread)])
        return np.asarray(np.log(np.maximum(found, 1e-300)) - wanted)

    tiny = 1e-6
    now = errors(guess)
    for _ in range(60):
        if np.abs(now).max() < 1e-9:
            break
        scale = np.exp(guess[1])
        # Steps of the mean in terms of the deviation: a far threshold moves in these.
        by_mean = (errors(guess + np.stack([tiny * scale, 0.0 * scale])) - now) / tiny
        by_scale = (errors(guess + np.array([[0.0], [tiny]])) - now) / tiny
        det = by_mean[0] * by_scale[1] - by_mean[1] * by_scale[0]
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        step = (
            np.stack([
                now[0] * by_scale[1] - now[1] * by_scale[0],
                now[1] * by_mean[0] - now[0] * by_mean[1],
            ])
            / det
        )  # fmt: skip
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=0), 1e-300))
        guess = guess - step * np.stack([scale, np.ones_like(scale)])
        now = errors(guess)
    return guess


def _moments(mean: Float64, deviation: Float64, power: float) -> Float64:
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

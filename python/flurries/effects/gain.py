"""The gain by which optical depths that a shutter blurs cover as much as the flakes do.

A flake that hides a part a of a pixel has the depth -ln(1 - a). A pattern that is moved while the
shutter is open shows only a part q of each flake in a pixel, so its depths are those of thinner
flakes, -ln(1 - q a) / q: the mean of resting ones along the way would be too much in the middle and
too little beside it, as the logarithm is convex. The gain g makes the integral of
1 - exp(-g mean depth) that of a for all lengths of streaks. It is 1 for a resting flake where q is
1, and near 1 where q is that of the streak.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss

from flurries._contract import Float64
from flurries.particles.population import exact_variance

# Lengths of streaks that gains are given for, px.
STREAKS = np.array(
    [0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0, 256.0]
)

# Of the table of gains: opacities of a resting flake's middle, and lengths over sigma.
_PEAKS = np.array([0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.88, 0.94, 0.98, 0.995])
_LENGTHS = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 24.0, 100.0])

# And parts that moved patterns show.
_PARTS = np.array([0.02, 0.1, 0.25, 0.5, 0.75, 1.0])

# Steps of Newton's.
_STEPS = 5


def part_shown(diameters: Float64, streak: float) -> float:
    """Return the part q of flakes that a pixel shows of patterns moved along a streak.

    The mean of a Gaussian along a way, over its middle; of the deviation that a layer's flakes have
    by their areas.

    Parameters
    ----------
    diameters : (k,)
        Quantiles of the flakes' images at even shares, px.
    streak : float
        Pixels.
    """
    squares = diameters**2
    raw = math.sqrt(float(squares @ squares) / float(squares.sum()) / 8.0)
    sigma = math.sqrt(float(exact_variance(np.array([raw]))[0]))
    half = streak / (2.0 * math.sqrt(2.0) * sigma)
    return math.sqrt(math.pi) / 2.0 * math.erf(half) / half if half > 1e-6 else 1.0


def gains_of(diameters: Float64, opacity: float, thin: float = 1.0) -> Float64:
    """Return the gains of a layer for each of `STREAKS`, (n,).

    Parameters
    ----------
    diameters : (k,)
        Quantiles of the flakes' images at even shares, px.
    opacity : float
        Of a resting flake's middle.
    thin : float
        The part q that its patterns are made for.
    """
    raw = np.asarray(diameters, np.float64) / np.sqrt(8.0)
    sigma = np.sqrt(exact_variance(raw))
    peak = opacity * raw**2 / sigma**2
    weight = peak * sigma**2
    weight[[0, -1]] *= 0.5
    found = np.zeros(len(STREAKS))
    upper = int(np.clip(np.searchsorted(_PARTS, thin), 1, len(_PARTS) - 1))
    between = float(np.clip((thin - _PARTS[upper - 1]) / np.diff(_PARTS)[upper - 1], 0.0, 1.0))
    table = (1.0 - between) * _table(upper - 1) + between * _table(upper)
    for one, wide, share in zip(
        peak, sigma, weight / max(float(weight.sum()), 1e-300), strict=True
    ):
        row = np.array([np.interp(one, _PEAKS, column) for column in table.T])
        found += share * np.interp(STREAKS / wide, _LENGTHS, row)
    return found if weight.any() else np.ones(len(STREAKS))


@lru_cache(maxsize=len(_PARTS))
def _table(part: int) -> Float64:
    """Return the gain for each of the peaks and lengths; all lengths are in deviations."""
    thin = float(_PARTS[part])
    nodes, weights = leggauss(20)
    across = 5.5 * 0.5 * (nodes + 1.0)
    step = 0.05
    along = np.arange(-6.0, 6.0 + step / 2, step)
    bell = np.exp(-0.5 * (along[:, None] ** 2 + across[None, :] ** 2))
    found = np.ones((len(_PEAKS), len(_LENGTHS)))
    for row, peak in enumerate(_PEAKS[1:], start=1):
        hidden = peak * bell
        depth = -np.log1p(-thin * hidden) / thin
        upto = np.concatenate(
            [np.zeros((1, 20)), np.cumsum(0.5 * (depth[1:] + depth[:-1]), axis=0)]
        )
        upto *= step
        wanted = float((hidden @ weights).sum()) * step
        for column, length in enumerate(_LENGTHS):
            at, mean = along, depth
            if length > 0.0:
                at = np.linspace(-6.0 - 0.5 * length, 6.0 + 0.5 * length, 257)
                ends = [
                    np.stack(
                        [np.interp(at + side * 0.5 * length, along, one) for one in upto.T], axis=1
                    )
                    for side in (1.0, -1.0)
                ]
                mean = (ends[0] - ends[1]) / length
            share = (at[1] - at[0]) * weights
            gain = 1.0
            for _ in range(_STEPS):
                left = np.exp(-gain * mean)
                gain -= float(((1.0 - left) @ share).sum() - wanted) / float(
                    ((mean * left) @ share).sum()
                )
            # Of what the sums round, nothing: a resting flake's gain is 1.
            found[row, column] = round(gain, 12)
    return found

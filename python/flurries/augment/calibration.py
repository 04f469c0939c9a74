"""One knob for how much weather: the share of the picture's own contrast that it takes.

A layer of opacity a leaves (1 - a) of each difference in the picture. So the contrast that is lost,
1 - cov(seen, clear) / var(clear), is the layer's mean opacity wherever the layer does not depend on
the picture: known in closed form for what falls, whatever the picture's size. What falls has a
fixed share of it, and an even veil takes the rest.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from flurries._contract import Float64, choice, real
from flurries.effects.severity import SEVERITIES

Profile = Literal["natural", "hard"]

# Newton's, at most; eight are usual.
_STEPS = 60

# The share of contrast that severities 1 to 5 take.
LOSS = (0.06, 0.14, 0.25, 0.38, 0.55)

# The contrast that is lost at the amounts 0, 0.2, ..., 1. The hard scale leaves the structural
# similarity that corruptions do which results are published with: 0.66 to 0.42 and for fog 0.79 to
# 0.63, in even steps, of ten photographs of 512 px (tests/test_augment_similarity.py).
_HARD = {
    "snow": (0.0, 0.062, 0.077, 0.099, 0.124, 0.152),
    "rain": (0.0, 0.092, 0.121, 0.161, 0.208, 0.262),
    "fog": (0.0, 0.31, 0.38, 0.45, 0.53, 0.6),
}
PROFILES = ("natural", "hard")


def contrast_loss(
    amount: float, *, profile: Profile = "natural", weather: Literal["snow", "rain", "fog"] = "snow"
) -> float:
    """Return the share of a picture's contrast that weather of an amount takes.

    Parameters
    ----------
    amount : float
        0 to 1. Severity n is the amount n / 5.
    profile : {"natural", "hard"}
        "natural" is weather as it is, "hard" takes as much as the corruptions of published
        benchmarks.
    weather : {"snow", "rain", "fog"}
        The weather that the hard profile is of.

    Returns
    -------
    float
        Natural: 0.06, 0.14, 0.25, 0.38 and 0.55 for the severities 1 to 5, linear between. Hard:
        snow 0.062 to 0.152, rain 0.092 to 0.262, fog 0.31 to 0.6.
    """
    wanted = real("amount", amount, low=0.0, high=1.0)
    kind = choice("weather", weather, tuple(_HARD))
    hard = choice("profile", profile, PROFILES) == "hard"
    losses = _HARD[kind] if hard else (0.0, *LOSS)
    return float(np.interp(SEVERITIES * wanted, range(SEVERITIES + 1), losses))


# `depth` (n,): of equally many pixels each. `clear` (n, 1): what all but the veil leaves before it.
# `density` (m,): factors of the extinction, each equally likely at every pixel.
def extinction(loss: float, depth: Float64, clear: Float64, density: Float64) -> float:
    """Return the extinction per metre with which a mean loss is what is wanted, or 0."""
    if depth.size == density.size == 1:
        return max(math.log(float(clear[0, 0]) / (1.0 - loss)) / float(depth[0] * density[0]), 0.0)
    way = depth[:, None] * density[None, :]
    # Sums: a call of `mean` takes longer than all the rest of a step.
    wanted = (1.0 - loss) * way.size
    total = np.add.reduce
    if float(total(clear, axis=None)) * (way.size / clear.size) <= wanted:
        return 0.0
    # What is left is convex and falls, so Newton's steps from 0 never go too far; and the loss is
    # less than that of all at the farthest depth.
    found = 0.0
    for _ in range(_STEPS):
        left = clear * np.exp(-found * way)
        step = (float(total(left, axis=None)) - wanted) / float(total(left * way, axis=None))
        found += step
        if step <= 1e-9 * found:
            break
    return found

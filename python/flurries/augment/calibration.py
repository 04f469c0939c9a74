"""One knob for how much weather: the share of the picture's own contrast that it takes.

A layer of opacity a leaves (1 - a) of each difference in the picture. So the contrast that is lost,
1 - cov(seen, clear) / var(clear), is the layer's mean opacity wherever the layer does not depend on
the picture: known in closed form for the texture and the flakes, whatever the picture's size. What
they do not take up to the wanted loss, an even veil takes.
"""

from __future__ import annotations

import numpy as np

from flurries._contract import Float64, real
from flurries.effects.looks import LOSS, SEVERITIES, mean_square

__all__ = ["SEVERITIES", "at_amount", "contrast_loss", "extinction", "mean_square"]

# Newton's, at most; eight are usual.
_STEPS = 60
_LOSS = (0.0, *LOSS)


def contrast_loss(amount: float) -> float:
    """Return the share of a picture's contrast that weather of an amount takes.

    Parameters
    ----------
    amount : float
        0 to 1. Severity n is the amount n / 5.

    Returns
    -------
    float
        0.06, 0.14, 0.25, 0.38 and 0.55 for the severities 1 to 5, linear between.

    Raises
    ------
    ValueError, TypeError
        If it is not a number from 0 to 1.
    """
    wanted = real("amount", amount, low=0.0, high=1.0)
    return float(np.interp(SEVERITIES * wanted, range(SEVERITIES + 1), _LOSS))


def at_amount(amount: float, levels: tuple[float, ...]) -> float:
    """Return a number of a look that is given at the amounts 0, 0.2, ..., 1."""
    return float(np.interp(SEVERITIES * amount, range(SEVERITIES + 1), levels))


def extinction(loss: float, depth: Float64, clear: Float64, density: Float64) -> float:
    """Return the extinction of a veil that brings the mean loss of contrast to what is wanted.

    Parameters
    ----------
    loss : float
        Wanted, 0 to less than 1.
    depth : (n,)
        Depths of equally many pixels each, metres.
    clear : (n, 1)
        What everything but the veil leaves before each depth.
    density : (m,)
        Of the veil, as factors of its extinction, each equally likely at every pixel.

    Returns
    -------
    float
        Per metre; 0 where the rest takes as much already.
    """
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

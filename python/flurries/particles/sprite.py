"""The laws of a flake's image where Python needs them: how wide it is, and how much it shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries._contract import Float64

# A pixel is a box, which adds this to the variance of what it sees; no flake's is less than LEAST,
# so that its energy does not depend on where it lies in a pixel.
PIXEL_VARIANCE = 1.0 / 12.0
LEAST_VARIANCE = 0.38

# Over this share of the flakes the last one fades in while the amount rises, so that none pops.
FADE_IN = 0.1


def sprite_variance(sigma: Any) -> Any:
    """Return the variance, px^2, with which a flake of a sigma in pixels is drawn."""
    return np.maximum(sigma**2 + PIXEL_VARIANCE, LEAST_VARIANCE)


def smoothstep(part: Any) -> Any:
    """Return 3 x^2 - 2 x^3 of x cut to 0 to 1."""
    x = np.clip(part, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def flake_weight(rank: Float64, amount: float) -> Float64:
    """Return how much flakes of a rank from 0 to 1 show at an amount: none pops as it rises."""
    return np.clip((amount - rank * (1.0 - FADE_IN)) / FADE_IN, 0.0, 1.0)


def size_fade(sigma: Float64, low: float, high: float) -> Float64:
    """Return how much flakes of a sigma show: all up to `low` pixels, nothing from `high` on."""
    return np.asarray(1.0 - smoothstep((sigma - low) / (high - low)))

"""How a lens blurs the layers of the texture: each by its own circle of confusion."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from flurries._contract import Float64
from flurries.camera.optics import Blur

# Circles are told apart in steps of this, px: patterns are kept for each.
STEP = 0.125

# Narrower circles than this, px, blur nothing.
LEAST = 0.25

# Points of the integral of a Bessel function: exact to rounding for arguments below half of them.
_POINTS = 512


def circles_of(blur: Blur | None, depths: list[float]) -> tuple[float, ...]:
    """Return the circles of confusion at depths, px, in steps; () where all is sharp."""
    if blur is None:
        return ()
    found = [STEP * round(blur.circle(depth) / STEP) for depth in depths]
    sharp = all(circle < LEAST for circle in found)
    return () if sharp else tuple(found)


@lru_cache(maxsize=64)
def disc_factor(tile: int, shear: float, circle: float) -> Float64:
    """Return the gains of a pattern's waves by a disc of a diameter in px, (M, M // 2 + 1).

    2 J1(x) / x of x = pi * circle * |k|: the Fourier transform of an even disc whose integral is 1.
    Its mean is 1 at wave 0, so that what a layer covers stays.
    """
    a = np.arange(tile // 2 + 1)
    b = np.fft.fftfreq(tile, 1.0 / tile)
    across, down = a / tile, (b[:, None] - shear * a[None, :]) / tile
    x = math.pi * circle * np.hypot(across[None, :], down)
    # Most of the waves come in few lengths; J1 by its integral, on a fine table.
    table = np.linspace(0.0, float(x.max()) + 1e-9, 4096)
    angle = (np.arange(_POINTS) + 0.5) * (math.pi / _POINTS)
    first = np.cos(angle[None, :] - table[:, None] * np.sin(angle)[None, :]).mean(axis=1)
    table_factor = np.ones_like(table)
    table_factor[1:] = 2.0 * first[1:] / table[1:]
    result = np.interp(x, table, table_factor)
    result.flags.writeable = False
    return result

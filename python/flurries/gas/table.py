"""The footprint table (Johnson 2005, Eqs 1-4)."""

from __future__ import annotations

import numpy as np

from flurries._contract import Float64, integer, output

__all__ = ["footprint_table"]


def footprint_table(size: int, *, intervals: int = 100, out: Float64 | None = None) -> Float64:
    """Return the line integrals of the kernel over a square of [-3, 3] sigma.

    Parameters
    ----------
    size : int
        n, 1 to 8192. With an even n no entry lies at the origin.
    intervals : int
        Intervals of the composite trapezoid rule along the line, from -3 to 3 sigma, 1 to
        1,000,000. The kernel is separable, so the rule is a common factor and the scaled table does
        not depend on it.

    Returns
    -------
    (n, n) float64
        Entry [j, i] is the integral of exp(-(x^2 + y^2 + z^2)/2) over z at x = -3 + 6 i / (n - 1),
        y likewise from j, over its value at the origin: exp(-(x^2 + y^2)/2), at most 1. A table of
        one entry is the origin.

    Notes
    -----
    Johnson 2005, Eq. 4. The paper scales by the largest entry, which for even n is not the value
    at the origin: all entries would be too large by exp(9 / (n - 1)^2): see
    ``docs/internals/deviations.md``.
    """
    n = integer("size", size, low=1, high=8192)
    steps = integer("intervals", intervals, low=1, high=1_000_000)
    x = np.linspace(-3.0, 3.0, n) if n > 1 else np.zeros(1)
    # The two halves of the axis mirror each other exactly.
    x = 0.5 * (x - x[::-1])
    w = np.linspace(-3.0, 3.0, steps + 1)
    heights = np.exp(-0.5 * w * w)
    line = (heights.sum() - 0.5 * (heights[0] + heights[-1])) * (6.0 / steps)
    across = np.exp(-0.5 * x * x)
    result = output(out, (n, n), np.dtype(np.float64))
    np.multiply(np.outer(across, across), line, out=result)
    result /= line
    return result

"""Hard cases of the spectral texture: transform, tent, phases, band, filter, opacity, tiles."""

from __future__ import annotations

import math
import warnings
from functools import cache
from typing import Any

import mpmath
import numpy as np

import flurries as fl
import twin
from hard.case import Case, worst

S = fl.spectral
M = (64, 64)
BAND = (4.0, 32.0)


# The tent and the phases --------------------------------------------------------------------------


def phase_at(t: float) -> Any:
    """The largest error of a phase in cycles after t frames of (3.2, 1.6) px, against mpmath."""

    def measure(dtype: Any) -> float:
        shape, drift = (12, 12), (3.25 * t, 1.625 * t)
        start = twin.random_phase(shape, seed=5)
        got = S.advance_phase(start, drift)
        ky, kx = twin.wave_numbers(shape)
        error = 0.0
        with mpmath.workdps(50):
            for y, x in np.argwhere((ky != 0) | (kx != 0)):
                k = (int(ky[y, x]), int(kx[y, x]))
                along = 0 if k[1] == -6 else k[1], 0 if k[0] == -6 else k[0]
                length = mpmath.sqrt(k[0] ** 2 + k[1] ** 2)
                moved = (mpmath.mpf(drift[0]) * along[0] + mpmath.mpf(drift[1]) * along[1]) / 32
                exact = mpmath.mpf(float(start[y, x])) - moved / length
                off = mpmath.mpf(float(got[y, x])) - exact
                error = max(error, float(abs(off - mpmath.nint(off))))
        return error

    return measure


def far_away(dtype: Any) -> float:
    """A frame after 10^6 frames at 1/4 px: the twin's, each in its own arithmetic."""
    about: Any = {"drift": (0.25e6, 1e6), "seed": 2, "tile": 32, "overlap": 6,
                  "wavelengths": (4.0, 16.0)}  # fmt: skip
    return worst(S.field((70, 70), dtype=dtype, **about) - twin.field((70, 70), **about))


# The band -----------------------------------------------------------------------------------------


def bins(size: int, low: float = 4.0, high: float = 32.0) -> Any:
    def measure(dtype: Any) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return float(np.count_nonzero(S.band_amplitude((size, size), wavelengths=(low, high))))

    return measure


@cache
def lattice(size: int, low: float, high: float, axis_only: bool) -> float:
    """The sum of 1/k^2 over signed k with low < size/|k| <= high, on the x axis or everywhere."""
    total = 0.0
    for ky in range(-size // 2, size // 2):
        for kx in range(-size // 2, size // 2):
            square = ky * ky + kx * kx
            if square and square * low**2 < size**2 <= square * high**2:
                total += (1.0 / square) * (not axis_only or ky == 0)
    return total


# Aliasing and the shutter -------------------------------------------------------------------------


def kept(c: float, theta: float, size: int = 64, **options: Any) -> Any:
    def measure(dtype: Any) -> float:
        velocity = (32.0 * c * math.cos(theta), 32.0 * c * math.sin(theta))
        amplitude = S.band_amplitude((size, size))
        return float(np.sum(np.square(S.temporal_filter(amplitude, velocity, **options))))

    return measure


def diagonal_kept(dtype: Any) -> float:
    """Waves (n, n) at 45 degrees and half a cycle: all on the limit, whatever rounding says."""
    speed = 16.0 / math.sqrt(2.0)
    left = S.temporal_filter(S.band_amplitude(M), (speed, speed))
    n = np.arange(2, 12)
    return float(np.count_nonzero(left[n, n]) + np.count_nonzero(left[-n, -n]))


def nothing_left(dtype: Any) -> float:
    z = S.field(M, drift=(1e5, 1e5), velocity=(32e6, 24.1e6), alias="cut", tile=64, overlap=0,
                seed=1, dtype=dtype)  # fmt: skip
    return worst(z)


def nothing_renormalised(dtype: Any) -> float:
    return worst(S.temporal_filter(S.band_amplitude(M), (32e6, 24.1e6), renormalise=True))


def negative_lobe(dtype: Any) -> float:
    """One wave straight along the motion at half a cycle, exposed for 3 frames: sinc(3/2)."""
    amplitude = np.zeros(M)
    amplitude[0, 2] = amplitude[0, -2] = math.sqrt(0.5)
    left = S.temporal_filter(amplitude, (16.0, 0.0), alias="keep", shutter=3.0)
    return float(left[0, 2] / amplitude[0, 2])


# Opacity ------------------------------------------------------------------------------------------


def opacity_of(value: float, **options: Any) -> Any:
    def measure(dtype: Any) -> float:
        return float(S.opacity(np.full((3, 3), value, dtype), **options)[1, 1])

    return measure


BINS = "a count"
CASES = [
    *[
        Case(f"phase after {t:.0e} frames of 3.25 px, cycles", phase_at(t), 0.0, tol,
             "eps of the drift in cycles, t x 0.11, halved and doubled by two products",
             "float64 phases, the finished phase is reduced")
        for t, tol in ((1e3, 1e-12), (1e6, 1e-9), (1e9, 1e-6))
    ],
    Case("a frame after 10^6 frames is the twin's", far_away, 0.0, (3e-6, 1e-8),
         "5.5 sigma for each cycle of phase error, 6e4 cycles x eps; float32 pixels on top",
         "float64 phases under float32 pixels"),
    *[
        Case(f"waves in the band, {n} x {n}", bins(n), expected, 0.0, BINS,
             "the band compares integers, no square roots")
        for n, expected in ((5, 4), (8, 8), (9, 20), (64, 784), (128, 3160), (512, 50636))
    ],
    *[
        Case(f"waves of the octave {low:g}-{high:g} px, 64 x 64", bins(64, low, high), expected,
             0.0, BINS, "the band is half open, so octaves share no wave")
        for low, high, expected in ((16.0, 32.0, 36), (8.0, 16.0, 148), (4.0, 8.0, 600))
    ],
    Case("exactly half a cycle, straight down: power kept", kept(0.5, math.pi / 2),
         1.0 - lattice(64, 4.0, 32.0, True) / lattice(64, 4.0, 32.0, False), 1e-12,
         "the waves on the axis go: a lattice sum", "the equal case is cut"),
    Case("exactly half a cycle, diagonal: waves (n, n) kept", diagonal_kept, 0.0, 0.0, BINS,
         "a margin of 1e-12 under half a cycle"),
    Case("a motion that leaves no wave gives a zero field", nothing_left, 0.0, 0.0, "exact",
         "nothing is divided by the kept power"),
    Case("renormalising nothing gives nothing", nothing_renormalised, 0.0, 0.0, "exact",
         "nothing is divided by a power of 0"),
    Case("the shutter's negative lobe, sinc(3/2)", negative_lobe, -2.0 / (3.0 * math.pi), 1e-15,
         "4 eps", "lobes are kept"),
    Case("opacity of 1e30 sigma", opacity_of(1e30), 1.0, 0.0, "exact", "clip above"),
    Case("opacity of -1e30 sigma", opacity_of(-1e30), 0.0, 0.0, "exact",
         "clip below, before the power"),
    Case("opacity 1e-3 sigma above the lower clip", opacity_of(-2.999), (1e-3 / 6.0) ** 2,
         (1e-11, 1e-18), "x is off by eps/2, the square by 2 x eps/2", "clip before the power"),
    Case("opacity with exponent 1/2 at the lower clip", opacity_of(-3.0, power=0.5), 0.0, 0.0,
         "exact", "no power of a negative number"),
]  # fmt: skip

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
from hard.case import EPS, Case, worst

S = fl.spectral
M = (64, 64)
BAND = (4.0, 32.0)


# The transform ------------------------------------------------------------------------------------


def against_the_sum(shape: tuple[int, int]) -> Any:
    def measure(dtype: Any) -> float:
        amplitude = twin.band_amplitude(shape, wavelengths=(2.0, float(max(shape))))
        phase = twin.random_phase(shape, seed=3)
        got = S.inverse_transform(amplitude, phase, dtype=dtype)
        return worst(got - twin.direct_sum(amplitude, phase))

    return measure


def nyquist(dtype: Any) -> float:
    # Every bin of an even tile, self-conjugate ones too, which no band of ours would hold.
    amplitude = np.full((8, 8), 1.0 / 8.0)
    phase = twin.random_phase((8, 8), seed=1)
    got = S.inverse_transform(amplitude, phase, dtype=dtype)
    return worst(got - twin.direct_sum(amplitude, phase))


def torus(t: float) -> Any:
    amplitude, phase = twin.band_amplitude(M), twin.random_phase(M, seed=9)
    return amplitude, S.advance_phase(phase, (3.0 * t, 1.0 * t))


def mean(dtype: Any) -> float:
    return float(np.mean(S.inverse_transform(*torus(3.0), dtype=dtype), dtype=np.float64))


def variance(dtype: Any) -> float:
    z = S.inverse_transform(*torus(3.0), dtype=dtype).astype(np.float64)
    return float(np.mean(z * z))


def deviation_over_time(dtype: Any) -> float:
    found = [np.std(S.inverse_transform(*torus(7919.0 * i), dtype=dtype), dtype=np.float64)
             for i in range(64)]  # fmt: skip
    return float(max(found) - min(found))


# The tent and the phases --------------------------------------------------------------------------


def oddness(shape: tuple[int, int]) -> Any:
    def measure(dtype: Any) -> float:
        rate = S.tent_rate(shape, np.array([3.7, -1.3], dtype))
        return worst(rate + twin.mirror(rate))

    return measure


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


def hash_differs(seed: int, tile: tuple[int, int]) -> Any:
    def measure(dtype: Any) -> float:
        for shape in ((16, 16), (9, 14)):
            got = S.random_phase(shape, seed=seed, tile=tile)
            if not np.array_equal(got, twin.random_phase(shape, seed=seed, tile=tile)):
                return 1.0
        return 0.0

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


def octave_power(low: float, high: float) -> float:
    return lattice(64, low, high, False) / lattice(64, 4.0, 32.0, False)


def share_between(low: float, high: float) -> Any:
    def measure(dtype: Any) -> float:
        inside = twin.band(M, (low, high))
        return float(np.sum(np.square(S.band_amplitude(M)[inside])))

    return measure


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


def shutter_is_subframes(dtype: Any) -> float:
    about: Any = {"seed": 4, "tile": 64, "overlap": 0}
    v = np.array([4.0, 2.0])
    blurred = S.field(M, drift=(0.0, 0.0), velocity=v, shutter=1.0, dtype=dtype, **about)
    parts = [S.field(M, drift=v * ((i + 0.5) / 256 - 0.5), dtype=dtype, **about)
             for i in range(256)]  # fmt: skip
    return worst(blurred - np.mean(np.array(parts, np.float64), axis=0))


def negative_lobe(dtype: Any) -> float:
    """One wave straight along the motion at half a cycle, exposed for 3 frames: sinc(3/2)."""
    amplitude = np.zeros(M)
    amplitude[0, 2] = amplitude[0, -2] = math.sqrt(0.5)
    left = S.temporal_filter(amplitude, (16.0, 0.0), alias="keep", shutter=3.0)
    return float(left[0, 2] / amplitude[0, 2])


def no_shutter(dtype: Any) -> float:
    amplitude = S.band_amplitude(M)
    return worst(S.temporal_filter(amplitude, (9.0, 1.0), alias="keep", shutter=0.0) - amplitude)


def standing(dtype: Any) -> float:
    rate = S.tent_rate(M, np.array([0.0, 5.0], dtype))
    return float(np.sum(np.square(S.band_amplitude(M)[rate == 0.0])))


def standing_jittered(dtype: Any) -> float:
    """The variance of the mean of 2,000 frames far apart, for jittered directions."""
    about: Any = {"seed": 8, "tile": 64, "overlap": 0, "jitter": True, "dtype": dtype}
    total = np.zeros(M)
    for i in range(2000):
        total += S.field(M, drift=(0.0, 977.0 * i), **about)
    return float(np.mean(np.square(total / 2000)))


# Opacity ------------------------------------------------------------------------------------------


def quantiles(dtype: Any) -> Any:
    """200,000 values that share the unit Gaussian out equally."""
    from scipy.special import ndtri

    return ndtri((np.arange(200_000) + 0.5) / 200_000).astype(dtype).reshape(400, 500)


def opacity_mean(dtype: Any) -> float:
    return float(np.mean(S.opacity(quantiles(dtype)), dtype=np.float64))


def opacity_of(value: float, **options: Any) -> Any:
    def measure(dtype: Any) -> float:
        return float(S.opacity(np.full((3, 3), value, dtype), **options)[1, 1])

    return measure


# Tiles --------------------------------------------------------------------------------------------


def weights_sum(overlap: int) -> Any:
    def measure(dtype: Any) -> float:
        off = 0.0
        for length in (1, 23, 24, 25, 47, 100):
            count = len(S.tile_starts(length, tile=24, overlap=overlap))
            ones = np.ones((count, count, 24, 24), dtype)
            got = S.blend_tiles(ones, (length, length), overlap=overlap, blend="linear")
            off = max(off, worst(got - 1.0))
        return off

    return measure


def power_weights(dtype: Any) -> float:
    """The sum of squares of the weights, tile by tile."""
    count = len(S.tile_starts(100, tile=24, overlap=10))
    total = np.zeros((100, 100))
    for row in range(count):
        for col in range(count):
            tiles = np.zeros((count, count, 24, 24), dtype)
            tiles[row, col] = 1.0
            total += np.square(S.blend_tiles(tiles, (100, 100), overlap=10), dtype=np.float64)
    return worst(total - 1.0)


def growth(dtype: Any) -> float:
    small, large = (S.field(s, drift=(5.0, 1.0), seed=6, dtype=dtype)
                    for s in ((200, 200), (300, 400)))  # fmt: skip
    return float(np.count_nonzero(small[:150, :150] != large[:150, :150]))


BINS = "a count"
# A sum of n terms of size a, pairwise: a few eps times the sum of their sizes.
TRANSFORM = (2e-6, 1e-13)

CASES = [
    *[
        Case(f"the transform of {h} x {w} is the sum of cosines, wave by wave",
             against_the_sum((h, w)), 0.0, TRANSFORM,
             "log2(n) eps times the sum of amplitudes, 8 at most; sincos adds 2 eps",
             "Hermitian fill of the kx = 0 column")
        for h, w in ((16, 16), (15, 15), (8, 8), (12, 8), (9, 14))
    ],
    Case("Nyquist and self-conjugate bins of the caller", nyquist, 0.0, (4e-6, 1e-12),
         "the same with 64 amplitudes of 1/8", "the imaginary part of elements 0 and M/2 is 0"),
    Case("mean of a torus", mean, 0.0, (2e-7, 1e-14), "eps of the terms",
         "no amplitude at dc"),
    Case("variance of a torus", variance, 1.0, (2e-6, 1e-13), "Parseval; 8 eps and the transform",
         "normalised by the sum of squares"),
    Case("standard deviation of a torus over 64 far frames, largest less smallest",
         deviation_over_time, 0.0, (1e-6, 1e-13), "Parseval: no frame differs",
         "the scale is known and never taken from the frame"),
    *[
        Case(f"the tent of {h} x {w} is odd", oddness((h, w)), 0.0, 0.0, "exact",
             "no numerator on an axis' own Nyquist line")
        for h, w in ((8, 8), (9, 9), (12, 7), (1, 6))
    ],
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
        Case(f"random phases of seed {label}", hash_differs(seed, tile), 0.0, 0.0, "exact",
             "words are int64 in two's complement")
        for label, seed, tile in (
            ("-2^63", -(2**63), (0, 0)), ("2^63 - 1, tile (-1, 2^40)", 2**63 - 1, (-1, 2**40)),
            ("0", 0, (3, 5)))
    ],
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
    *[
        Case(f"share of the power in {low:g}-{high:g} px", share_between(low, high),
             octave_power(low, high), 1e-13, "a sum over the lattice; eps times 784 terms",
             "amplitudes fall as 1/k")
        for low, high in ((16.0, 32.0), (8.0, 16.0), (4.0, 8.0))
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
    Case("the shutter is the mean of 256 sub-frames", shutter_is_subframes, 0.0, 3e-5,
         "the midpoint rule's error at .14 cycles per frame, (pi r)^2 / 6 n^2 x 5.5 sigma",
         "sinc takes the rate in cycles"),
    Case("the shutter's negative lobe, sinc(3/2)", negative_lobe, -2.0 / (3.0 * math.pi), 1e-15,
         "4 eps", "lobes are kept"),
    Case("no shutter changes nothing", no_shutter, 0.0, 0.0, "exact", "sinc(0) is 1"),
    Case("share of the power that stands still, straight down", standing,
         lattice(64, 4.0, 32.0, True) / lattice(64, 4.0, 32.0, False), 1e-13, "a lattice sum",
         "direction divides by |k|, so that axes are exact"),
    Case("share that stands still with jitter", standing_jittered, 0.0, 5e-3,
         "1/2000 of the power, times what random waves add: 4 of 392 in step",
         "directions are those of random points of the cells"),
    Case("mean opacity of a Gaussian field, k = 3", opacity_mean, twin.opacity_mean(), 1e-6,
         "midpoint rule over 200,000 quantiles", "both clips"),
    Case("opacity of 1e30 sigma", opacity_of(1e30), 1.0, 0.0, "exact", "clip above"),
    Case("opacity of -1e30 sigma", opacity_of(-1e30), 0.0, 0.0, "exact",
         "clip below, before the power"),
    Case("opacity 1e-3 sigma above the lower clip", opacity_of(-2.999), (1e-3 / 6.0) ** 2,
         (1e-11, 1e-18), "x is off by eps/2, the square by 2 x eps/2", "clip before the power"),
    Case("opacity with exponent 1/2 at the lower clip", opacity_of(-3.0, power=0.5), 0.0, 0.0,
         "exact", "no power of a negative number"),
    *[
        Case(f"linear weights sum to 1, overlap {v} of 24 px", weights_sum(v), 0.0,
             (n * EPS[np.float32], n * EPS[np.float64]), f"{n} tiles at a pixel, an eps each",
             "divided by the sum of all tiles at the pixel")
        for v, n in ((0, 1), (1, 4), (10, 4), (23, 576))
    ],
    Case("squares of the power weights sum to 1", power_weights, 0.0, (1e-6, 1e-14), "8 eps",
         "square roots of weights that sum to 1"),
    Case("pixels that differ when the picture grows", growth, 0.0, 0.0, "exact",
         "phases are keyed by tile"),
]  # fmt: skip

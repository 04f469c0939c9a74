"""What a film of countless flakes looks like on average, in closed form.

Flakes lie like rain drops on a pavement: a Poisson process for each depth and size, and the picture
lets through T = prod(1 - alpha_i). With the area that one flake covers, and the overlap of one with
its own shifted image, Campbell's theorem gives

    E T(x) = exp(-L),   E T(x) T(x + r) = exp(-2 L + C(r)),
    L = sum n a 2 pi s^2,   C(r, t) = sum n a^2 pi s^2 exp(-|r - v t|^2 / (4 s^2)),

for n flakes per square pixel with opacity a and deviation s that move by v. No picture is drawn.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, _came, real, table
from flurries.hybrid.population import Population, Seen, seen

# Pixels of the torus on which correlations become spectra; no image of a flake reaches round it.
GRID = 256


class Spectrum(NamedTuple):
    """Second-order statistics of a film of opacity, on a torus of `GRID` pixels a side."""

    mean: float
    """Mean opacity."""
    skewness: float
    """Of its values."""
    power: Float64
    """(GRID, GRID): variance per bin, fftfreq order."""
    flux: Float64
    """(GRID, GRID): the same times its mean phase rate, for motion along x: cycles per world unit
    of displacement."""


class Octaves(NamedTuple):
    """The result of :func:`statistics`."""

    mean_opacity: float
    power: Float64
    """(n,): variance of the opacity within each band of wavelengths."""
    speed: Float64
    """(n,): displacement in pixels of each band per world unit of displacement; power-weighted
    least squares over its waves."""


def frequencies() -> tuple[Float64, Float64]:
    """Return (fx, |f|) of the grid, cycles per pixel."""
    f = np.fft.fftfreq(GRID)
    return np.broadcast_to(f, (GRID, GRID)), np.hypot(f[:, None], f)


def correlation(flakes: Seen, focal: float, squares: Float64) -> tuple[Float64, Float64]:
    """Return C(r, 0) and its derivative by a displacement of one world unit along x.

    `squares` is the squared opacity of each class.
    """
    x = np.fft.fftfreq(GRID) * GRID
    bell = np.exp(-(x**2) / (4.0 * flakes.variance[:, None]))
    weight = flakes.number * squares * np.pi * flakes.variance
    step = weight * (focal / flakes.depth) / (2.0 * flakes.variance)
    return (bell.T * weight) @ bell, (bell.T * step) @ (bell * x)


def film_spectrum(
    flakes: Seen, focal: float, cover: Float64, squares: Float64, cubes: Float64
) -> Spectrum:
    """Return the statistics of flakes with the given opacities, their squares and cubes."""
    area = flakes.number * flakes.variance
    covered = float(2.0 * np.pi * np.sum(area * cover))
    overlap, change = correlation(flakes, focal, squares)
    clear = np.exp(-2.0 * covered)
    power = np.fft.fft2(clear * np.expm1(overlap)).real / GRID**2
    flux = -np.fft.fft2(clear * np.exp(overlap) * change).imag / (2.0 * np.pi) / GRID**2
    # The third moment of T from the overlap of a flake with itself, twice and three times.
    two, three = (
        float(2.0 * np.pi * np.sum(area * part / order))
        for part, order in ((squares, 2.0), (cubes, 3.0))
    )
    mean = np.exp(-covered)
    second = np.expm1(two)
    third = np.exp(3.0 * two - three) - 3.0 * np.exp(two) + 2.0
    skewness = -third / second**1.5 if second > 0.0 else 0.0
    return Spectrum(float(1.0 - mean), float(skewness), power, flux)


def by_band(spectrum: Spectrum, edges: Float64) -> tuple[Float64, Float64]:
    """Return (power, speed) of each band edges[i] < wavelength <= edges[i + 1]."""
    fx, f = frequencies()
    power, speed = np.zeros((2, len(edges) - 1))
    for i, (short, long) in enumerate(pairwise(edges)):
        inside = (f * short < 1.0) & (f * long >= 1.0)
        power[i] = spectrum.power[inside].sum()
        pull = np.sum(fx[inside] ** 2 * spectrum.power[inside])
        speed[i] = np.sum(fx[inside] * spectrum.flux[inside]) / pull if pull > 0.0 else 0.0
    return power, speed


def statistics(
    population: Population, focal: float, *, edges: npt.ArrayLike = (2.0, 4.0, 8.0, 16.0, 32.0)
) -> Octaves:
    """Mean opacity, power and speed of every band of wavelengths of fully simulated snow.

    Parameters
    ----------
    population : Population
        The flakes.
    focal : float
        Focal length of the camera, pixels.
    edges : (n + 1,)
        Increasing wavelengths, pixels, 2 to 128.

    Returns
    -------
    Octaves
        `mean_opacity`; `power` (n,), the variance of the opacity within each band; `speed` (n,), by
        how many pixels the band moves when camera and air move by one world unit past each other,
        across the view. For snow at rest in front of an open shutter of no length.

    Raises
    ------
    TypeError, ValueError
        For an argument that is not as described; the message names it.

    Notes
    -----
    Exact for flakes drawn by :func:`flurries.particles.splat` (but for the rim of its footprint,
    1e-3). Tents have speeds that double from octave to octave; those of evenly filled space do not,
    since flakes of every depth share the fine waves.

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.hybrid.Population(density=110, radius=(0.006, 0.014), depth=(1.5, 24))
    >>> found = fl.hybrid.statistics(snow, 1229.0)
    >>> f"{found.mean_opacity:.3f}"
    '0.143'
    """
    length = focal_of(focal)
    limits = edges_of(edges)
    flakes = seen(expect_population(population), length)
    a = flakes.amplitude
    found = film_spectrum(flakes, length, a, a**2, a**3)
    return Octaves(found.mean, *by_band(found, limits))


def focal_of(focal: object) -> float:
    return real("focal", focal, low=1e-9, high=1e9)


def edges_of(edges: npt.ArrayLike) -> Float64:
    limits = table("edges", edges, ndim=1)
    if len(limits) < 2 or not (np.diff(limits) > 0.0).all():
        raise ValueError(f"edges must be at least two increasing wavelengths, got {limits}")
    if limits[0] < 2.0 or limits[-1] > GRID / 2:
        raise ValueError(f"edges must lie from 2 to {GRID // 2} px, got {limits}")
    return limits


def expect_population(population: object) -> Population:
    if not isinstance(population, Population):
        raise TypeError(f"population must be a hybrid.Population, got {_came(population)}")
    return population

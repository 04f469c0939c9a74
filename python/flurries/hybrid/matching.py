"""The texture that stands for a population: band, contrast and speed from its statistics."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flurries._contract import Array, Float64, vector
from flurries.hybrid.opacity_map import orders, power_for, solved
from flurries.hybrid.population import Population, Seen, particle_share, seen
from flurries.hybrid.statistics import (
    GRID,
    Spectrum,
    by_band,
    expect_population,
    film_spectrum,
    focal_of,
    frequencies,
)

# Waves longer than the band hold at most this share of the texture's variance.
BEYOND = 0.04

# The longest band reaches to 32 px, an eighth of the grid.
MOST_OCTAVES = 4

# Rings of half an octave: with whole ones the speeds would climb in steps twice as high.
RINGS_PER_OCTAVE = 2

# Powers and speeds are solved for to this, relative; the kernels are right to 1e-6.
CLOSE = 1e-6


@dataclass(frozen=True, kw_only=True)
class Match:
    """A hybrid of particles and texture that looks like a population.

    Attributes
    ----------
    population : Population
    focal : float
        Pixels.
    handover : (low, high)
        Sigma in pixels: flakes above are particles, flakes below belong to the texture.
    near_depth : float
        Depth in world units that the longest wave stands for, where ring speeds are 1.
    wavelengths : (shortest, longest)
        The texture's band, pixels.
    exponent : float
        Of its spectrum.
    ring_edges, ring_gains, ring_speeds : tuple of float
        Half octaves of the band, their relative amplitudes, and the factor on the drift of each.
    mean, spread, power, amount : float
        The map to opacity, see :func:`flurries.spectral.opacity`.
    texture_opacity, particle_opacity : float
        Mean opacities of the halves; 1 - (1 - a)(1 - b) is the population's.
    """

    population: Population
    focal: float
    handover: tuple[float, float]
    near_depth: float
    wavelengths: tuple[float, float]
    exponent: float
    ring_edges: tuple[float, ...]
    ring_gains: tuple[float, ...]
    ring_speeds: tuple[float, ...]
    mean: float
    spread: float
    power: float
    texture_opacity: float
    particle_opacity: float
    amount: float = 1.0

    def before(self, depth: Array) -> Float64:
        """Return the share of the texture's coverage that lies nearer than depths, 0 to 1."""
        flakes = seen(self.population, self.focal)
        left = 1.0 - particle_share(flakes.sigma, self.handover)
        cover = flakes.number * flakes.variance * flakes.amplitude * left
        nodes, which = np.unique(flakes.depth, return_inverse=True)
        layers = np.bincount(which, cover)
        # Half of a node's layer lies before the node.
        share = (np.cumsum(layers) - 0.5 * layers) / layers.sum()
        near, far = self.population.depth
        return np.asarray(np.interp(depth, [near, *nodes, far], [0.0, *share, 1.0]))


def match(
    population: Population, focal: float, *, handover: tuple[float, float] = (0.8, 1.2)
) -> Match:
    """Choose band, contrast and speed of the texture so that it stands for the small flakes.

    A flake whose sigma in the picture is above ``handover[1]`` pixels is a particle, one below
    ``handover[0]`` belongs to the texture, between them its opacity is shared, so that the coverage
    is that of the population. The texture has the mean, the variance and the skewness of the
    opacity of its flakes, and per half octave their power and their speed.

    Parameters
    ----------
    population : Population
        The snow.
    focal : float
        Of the camera, pixels.
    handover : (low, high)
        Sigma in pixels.

    Returns
    -------
    Match
        To be drawn with :func:`render`.

    Raises
    ------
    TypeError, ValueError
        For an argument that is not as described, or where hardly a flake is left to the texture.

    Notes
    -----
    Nothing is drawn: both sides are known in closed form (:mod:`flurries.hybrid.statistics`). What
    cannot be matched: in a film of real flakes the waves of one length move at many speeds, those
    of a texture at one. See ``docs/matching.md``.

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.hybrid.Population(density=110, radius=(0.006, 0.014), depth=(1.5, 24))
    >>> made = fl.hybrid.match(snow, 1229.0)
    >>> made.wavelengths
    (2.0, 32.0)
    """
    length = focal_of(focal)
    limits = handover_of(handover)
    flakes = seen(expect_population(population), length)
    share = particle_share(flakes.sigma, limits)
    wanted = left_to_texture(flakes, length, share)
    whole = float(wanted.power.sum())
    if wanted.mean < 1e-9 or whole <= 0.0:
        raise ValueError(
            f"handover leaves no flake of this population to a texture, got {limits}: "
            "the smallest has more pixels"
        )
    edges = _band(wanted.power)
    power, speed = by_band(wanted, edges)
    exponent = _slope(wanted.power, edges)
    shares, drifts, map_ = _fitted(wanted, edges, exponent, power, speed)
    mean, deviation, steepness = map_
    near = length / float(np.sum(shares * drifts))
    cover = flakes.number * flakes.variance * flakes.amplitude * share
    amplitude = np.sqrt(shares / _plain_shares(edges, exponent))
    return Match(
        population=population,
        focal=length,
        handover=limits,
        near_depth=near,
        wavelengths=(float(edges[0]), float(edges[-1])),
        exponent=exponent,
        ring_edges=tuple(edges.tolist()),
        ring_gains=tuple((amplitude / amplitude.max()).tolist()),
        ring_speeds=tuple((drifts * near / length).tolist()),
        mean=mean,
        spread=0.5 / deviation,
        power=steepness,
        texture_opacity=wanted.mean,
        particle_opacity=float(-np.expm1(-2.0 * np.pi * np.sum(cover))),
    )


def handover_of(handover: object) -> tuple[float, float]:
    low, high = vector("handover", handover, 2).tolist()
    if not 0.0 < low < high <= 1e6:
        raise ValueError(f"handover must be 0 < low < high, pixels of sigma, got {(low, high)}")
    return low, high


def left_to_texture(flakes: Seen, focal: float, share: Float64) -> Spectrum:
    """Return what the texture must have so that both halves together are the whole.

    The coverage left is a (1 - w). Of the power a^2 the particles show (a w)^2, so that the texture
    takes a^2 (1 - w^2): both halves of a flake in transition would be drawn apart and show less.
    """
    a = flakes.amplitude
    return film_spectrum(
        flakes, focal, a * (1.0 - share), a**2 * (1.0 - share**2), a**3 * (1.0 - share**3)
    )


def _band(power: Float64) -> Float64:
    """Return the edges of half octaves from 2 px on that hold nearly all of the power."""
    _, f = frequencies()
    for count in range(1, MOST_OCTAVES + 1):
        if power[f * 2.0 ** (count + 1) < 1.0].sum() <= BEYOND * power.sum():
            break
    rings = count * RINGS_PER_OCTAVE
    edges = np.exp2(1.0 + np.arange(rings + 1) / RINGS_PER_OCTAVE)
    # Whole octaves exactly, however the library rounds powers.
    edges[::RINGS_PER_OCTAVE] = [2.0 ** (1 + i) for i in range(count + 1)]
    return edges


def _slope(power: Float64, edges: Float64) -> float:
    """Return the exponent of the amplitudes that fits the power's fall within the band."""
    _, f = frequencies()
    inside = (f * edges[0] < 1.0) & (f * edges[-1] >= 1.0)
    # Every octave counts alike: bins of frequency f are as many as f.
    fall, _ = np.polyfit(
        np.log(f[inside]), np.log(np.maximum(power[inside], 1e-300)), 1, w=1.0 / f[inside]
    )
    return float(-0.5 * fall)


def _rings(edges: Float64) -> Float64:
    """Return the ring of each bin; -1 outside the band."""
    _, f = frequencies()
    ring = np.full(f.shape, -1)
    for i, (short, long) in enumerate(pairwise(edges)):
        ring[(f * short < 1.0) & (f * long >= 1.0)] = i
    return ring


def _plain_shares(edges: Float64, exponent: float) -> Float64:
    """Return the share of the variance that each ring has without gains."""
    _, f = frequencies()
    ring = _rings(edges)
    power = np.array([np.sum(f[ring == i] ** (-2.0 * exponent)) for i in range(len(edges) - 1)])
    return np.asarray(power / power.sum())


def _fitted(
    wanted: Spectrum, edges: Float64, exponent: float, power: Float64, speed: Float64
) -> tuple[Float64, Float64, tuple[float, float, float]]:
    """Return the rings' shares of the field's variance, their drifts (px of the longest wave per
    world unit) and the map (mean, deviation, power) that give the wanted powers and speeds.

    The map mixes the waves a little, so the answer is found by repeated proportion.
    """
    rings = len(edges) - 1
    variances = power.copy()
    drifts = speed * edges[-1] / np.sqrt(edges[1:] * edges[:-1])
    steepness = power_for(wanted.mean, float(power.sum()), wanted.skewness)
    for _ in range(100):
        whole = float(variances.sum())
        mean, deviation = solved(wanted.mean, whole, steepness)
        shares = variances / whole
        made = texture_spectrum(edges, exponent, shares, drifts, orders(mean, deviation, steepness))
        got_power, got_speed = by_band(made, edges)
        off = max(np.abs(got_power / power - 1.0).max(), np.abs(got_speed / speed - 1.0).max())
        if off < CLOSE:
            return shares, drifts, (mean, deviation, steepness)
        variances = variances * power / got_power
        drifts = drifts * speed / got_speed
    raise ValueError(
        f"population: the powers of {rings} rings cannot be matched to better than {off:.1e}"
    )


def texture_spectrum(
    edges: Float64, exponent: float, shares: Float64, drifts: Float64, parts: Float64
) -> Spectrum:
    """Return the statistics of a texture: rings on tents of their own, through an opacity map."""
    fx, f = frequencies()
    ring = _rings(edges)
    power, rate = np.zeros((2, GRID, GRID))
    for i, (share, drift) in enumerate(zip(shares, drifts, strict=True)):
        inside = ring == i
        fall = f[inside] ** (-2.0 * exponent)
        power[inside] = share * fall / fall.sum()
        rate[inside] = drift / edges[-1] * fx[inside] / f[inside]
    rho = np.fft.ifft2(power).real * GRID**2
    change = np.fft.ifft2(-2j * np.pi * rate * power).real * GRID**2
    film, step = np.zeros_like(rho), np.zeros_like(rho)
    # Horner: sum p_n rho^n and its derivative, without the mean's n = 0.
    for n in range(len(parts) - 1, 0, -1):
        film = (film + parts[n]) * rho
        step = step * rho + n * parts[n]
    flux = -np.fft.fft2(step * change).imag / (2.0 * np.pi) / GRID**2
    return Spectrum(float(np.sqrt(parts[0])), 0.0, np.fft.fft2(film).real / GRID**2, flux)

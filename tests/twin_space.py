"""Flakes that fill a slab of space: drawn by `fl.particles`, and their statistics in closed form.

Flakes lie like rain drops on a pavement: a Poisson process for each depth and size, and the picture
lets through T = prod(1 - alpha_i). With the area that one flake covers, and the overlap of one with
its own shifted image, Campbell's theorem gives

    E T(x) = exp(-L),   E T(x) T(x + r) = exp(-2 L + C(r)),
    L = sum n a 2 pi s^2,   C(r, t) = sum n a^2 pi s^2 exp(-|r - v t|^2 / (4 s^2)),

for n flakes per square pixel with opacity a and deviation s that move by v: Gaussian flakes, as
`fl.particles.splat` draws them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike, NDArray

import flurries as fl

Floats = NDArray[np.float64]

# Over these shares of the nearest and of the farthest depth flakes fade in, so that none pops.
FADE = 0.1

# Nodes of the integrals over depth and radius; twice as many change no figure by 1e-6.
DEPTHS, RADII = 96, 8

# Pixels of the torus on which correlations become spectra; no image of a flake reaches round it.
GRID = 256


@dataclass(frozen=True, kw_only=True)
class Space:
    """Flakes in space: their number per m3, radii evenly spread, opacity of the middle, depths.

    A third of the radius is the Gaussian's sigma.
    """

    density: float
    radius: tuple[float, float]
    opacity: float = 0.9
    depth: tuple[float, float]

    def fade(self, depth: Floats) -> Floats:
        """Return the share of a flake at each depth that is shown, 0 to 1."""
        near, far = self.depth

        def smooth(x: Floats) -> Floats:
            x = np.clip(x, 0.0, 1.0)
            return x * x * (3.0 - 2.0 * x)

        return smooth((depth - near) / (FADE * near)) * smooth((far - depth) / (FADE * far))


class Seen(NamedTuple):
    """Flakes in the picture, by classes of depth and radius; (n,) each."""

    depth: Floats
    number: Floats
    """Flakes of the class per square pixel."""
    variance: Floats
    """Of the Gaussian that is drawn, px^2."""
    amplitude: Floats
    """Its opacity in the middle."""


def seen(space: Space, focal: float) -> Seen:
    """Return nodes and weights for integrals over flakes as a camera sees them."""
    (near, far), (small, large) = space.depth, space.radius
    x, wx = leggauss(DEPTHS)
    z = np.sqrt(near * far) * (far / near) ** (0.5 * x)
    share = 0.5 * np.log(far / near) * wx * z
    y, wy = leggauss(RADII)
    radius = 0.5 * (small + large) + 0.5 * (large - small) * y
    depth, size = (grid.ravel() for grid in np.meshgrid(z, radius, indexing="ij"))
    weight = np.outer(share, 0.5 * wy).ravel()
    sigma2 = (focal * size / (3.0 * depth)) ** 2
    # A pixel's box widens a flake, and one below a pixel is drawn as large as that and fainter.
    variance = np.maximum(sigma2 + 1.0 / 12.0, 0.38)
    narrow = sigma2 / variance * (1.0 + 4.8e-4 / variance)
    amplitude = space.opacity * space.fade(depth) * narrow
    number = space.density * (depth / focal) ** 2 * weight
    return Seen(depth, number, variance, amplitude)


class Octaves(NamedTuple):
    """The result of :func:`statistics`: mean opacity, power and speed of bands of wavelengths."""

    mean_opacity: float
    power: Floats
    """(n,): variance of the opacity within each band."""
    speed: Floats
    """(n,): px that a band moves when camera and air pass each other by a metre."""


def correlation(flakes: Seen, focal: float, squares: Floats) -> tuple[Floats, Floats]:
    """Return C(r, 0) and its derivative by a displacement of one metre along x."""
    x = np.fft.fftfreq(GRID) * GRID
    bell = np.exp(-(x**2) / (4.0 * flakes.variance[:, None]))
    weight = flakes.number * squares * np.pi * flakes.variance
    step = weight * (focal / flakes.depth) / (2.0 * flakes.variance)
    return (bell.T * weight) @ bell, (bell.T * step) @ (bell * x)


def statistics(
    space: Space, focal: float, *, edges: ArrayLike = (2.0, 4.0, 8.0, 16.0, 32.0)
) -> Octaves:
    """Return mean opacity, and power and speed of bands of wavelengths, in closed form."""
    flakes = seen(space, focal)
    a = flakes.amplitude
    covered = float(2.0 * np.pi * np.sum(flakes.number * flakes.variance * a))
    overlap, change = correlation(flakes, focal, a**2)
    clear = np.exp(-2.0 * covered)
    power = np.fft.fft2(clear * np.expm1(overlap)).real / GRID**2
    flux = -np.fft.fft2(clear * np.exp(overlap) * change).imag / (2.0 * np.pi) / GRID**2
    f = np.fft.fftfreq(GRID)
    fx, length = np.broadcast_to(f, (GRID, GRID)), np.hypot(f[:, None], f)
    powers, speeds = [], []
    for short, long in pairwise(np.asarray(edges, float)):
        inside = (length * short < 1.0) & (length * long >= 1.0)
        powers.append(power[inside].sum())
        speeds.append(np.sum((fx * flux)[inside]) / np.sum((fx**2 * power)[inside]))
    return Octaves(-float(np.expm1(-covered)), np.array(powers), np.array(speeds))


def simulate(
    shape: tuple[int, int],
    space: Space,
    camera: fl.Camera,
    *,
    seed: int,
    displacement: ArrayLike = (0.0, 0.0, 0.0),
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    shutter: float = 0.0,
) -> Floats:
    """Return the opacity of all flakes, (H, W), of a camera displaced from the air's own place.

    The box of flakes reaches beyond the view by the nearest depth: room for eyes and exposures.
    """
    near, far = space.depth
    height, width = shape
    cx, cy = (width / 2, height / 2) if camera.center is None else camera.center
    room = near + 4.0 * (space.radius[1] / 3.0 + far / camera.focal)
    across, down = (
        2.0 * (max(c, n - c) * far / camera.focal + room) for c, n in ((cx, width), (cy, height))
    )
    box = np.array([across, down, far - near])
    points = fl.particles.positions(
        round(space.density * float(np.prod(box))), box, seed=seed,
        velocity=-np.asarray(displacement), time=1.0, center=(0.0, 0.0, 0.5 * (near + far)),
    )  # fmt: skip
    small, large = space.radius
    radius = small + np.random.default_rng(seed).random(len(points)) * (large - small)
    weight = space.fade(points[:, 2])
    there = weight > 0.0
    return fl.particles.splat(
        shape, points[there], radius[there], camera, opacity=space.opacity * weight[there],
        velocity=-np.asarray(velocity), shutter=shutter, near=0.5 * near, dtype=np.float64,
    )  # fmt: skip

"""The twin of the 3-D method: the whole spectrum (H, W, T), in fftfreq order, and its inverse."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

import twin
from twin import Floats, Shape

CELL = 3  # The word between a wave's and a cell's number, so that their phases differ.


def nearest(rate: Floats, frames: int) -> NDArray[np.int64]:
    """The one cell of each column: rint(rate T), half to even, odd in k."""
    return np.rint(rate * frames).astype(np.int64)


def turning_points(shape: Shape, k: tuple[int, int], velocity: ArrayLike, longest: float) -> Floats:
    """(lowest, highest) rate over the square of side 1 around (ky, kx), by angles.

    The square is seen from dc under an interval of angles, its corners' least and greatest; the
    rate at the angle beta is -c cos(beta - theta), extreme at the ends or at theta and theta + pi.
    """
    a, b = np.asarray(velocity, dtype=np.float64) / longest
    c, theta = np.hypot(a, b), np.arctan2(b, a)
    middle = np.arctan2(k[0] / shape[0], k[1] / shape[1])
    corners = [
        np.arctan2((k[0] + dy) / shape[0], (k[1] + dx) / shape[1])
        for dy in (-0.5, 0.5)
        for dx in (-0.5, 0.5)
    ]
    # Angles from the middle's: a square that dc is not in spans less than half a turn.
    away = np.angle(np.exp(1j * (np.array(corners) - middle)))
    ends = middle + np.array([away.min(), away.max()])
    seen = list(-c * np.cos(ends - theta))
    for extreme in (theta, theta + np.pi):
        if away.min() < np.angle(np.exp(1j * (extreme - middle))) < away.max():
            seen.append(-c * np.cos(extreme - theta))
    return np.array([min(seen), max(seen)])


def spectrum(
    frames: int, shape: Shape, velocity: ArrayLike, *, seed: int,
    wavelengths: tuple[float, float] = (4.0, 32.0), cells: str = "one",
) -> NDArray[np.complex128]:  # fmt: skip
    """(H, W, T): amplitude times exp(2 pi i phase) in the cells on the tent, zero elsewhere."""
    amplitude = twin.band_amplitude(shape, wavelengths=wavelengths)
    phase = twin.random_phase(shape, seed=seed)
    cube = np.zeros((*shape, frames), dtype=np.complex128)
    ky, kx = twin.wave_numbers(shape)
    n = nearest(twin.tent_rate(shape, velocity, wavelength_max=wavelengths[1]), frames)
    for bin_ in map(tuple, np.argwhere((amplitude > 0.0) & twin.leaders(shape))):
        k = int(ky[bin_]), int(kx[bin_])
        if cells == "one":
            found = {int(n[bin_]): phase[bin_]}
        else:
            low, high = turning_points(shape, k, velocity, wavelengths[1]) * frames
            numbers = range(int(np.floor(low)) - 1, int(np.ceil(high)) + 2)
            through = [m for m in numbers if m - 0.5 < high and m + 0.5 > low]
            found = {m: float(twin.unit(twin.hashed(seed, 0, 0, *k, CELL, m))[0]) for m in through}
        for m, turn in found.items():
            value = amplitude[bin_] * np.exp(2j * np.pi * turn)
            cube[k[0], k[1], m % frames] += value
            # The mirror of a cell: minus every index, modulo the size.
            cube[-k[0], -k[1], -m % frames] += value.conj()
    return cube / np.sqrt(np.sum(np.abs(cube) ** 2))


def film(cube: NDArray[np.complex128]) -> Floats:
    """(T, H, W): the inverse 3-D transform, unnormalised; its imaginary part must vanish."""
    z = np.moveaxis(np.fft.ifftn(cube, norm="forward"), 2, 0)
    assert np.abs(z.imag).max() < 1e-12
    return z.real

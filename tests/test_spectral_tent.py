"""The tent and the band: rates, amplitudes and their lattice sums."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
import twin
from every import every

SHAPES = [(64, 64), (8, 8), (9, 9), (17, 17), (31, 31), (12, 8), (9, 14), (2, 2), (1, 1), (3, 4)]


@every("velocity", [(2.0, 0.0), (0.0, -1.5), (0.7, 1.9)])
@every("shape", SHAPES)
def test_tent_rate_is_the_twins(shape: twin.Shape, velocity: tuple[float, float]):
    got = fl.spectral.tent_rate(shape, velocity, wavelength_max=20.0)
    assert got.shape == shape and got.dtype == np.float64
    assert np.abs(got - twin.tent_rate(shape, velocity, wavelength_max=20.0)).max() < 1e-15


@every("size", [16, 15, 31, 50, 64])
def test_tent_is_exact_on_the_axes(size: int):
    # u must be exactly 1 there, so that a wave at exactly half a cycle is seen as such.
    rate = fl.spectral.tent_rate((size, size), (8.0, -4.0), wavelength_max=32.0)
    assert np.all(rate[0, 1 : (size + 1) // 2] == -0.25)
    assert np.all(rate[1 : (size + 1) // 2, 0] == 0.125)


@pytest.mark.parametrize("theta", [0.0, np.pi / 2, -2.2])
def test_velocity_from_paper(theta: float):
    # C tile widths per T frames for the wave as long as the tile: C = 4, T = 64 is 2 px at 32 px.
    vx, vy = fl.spectral.velocity_from_paper(4.0, theta, period=64.0)
    assert (vx, vy) == pytest.approx((2.0 * np.cos(theta), 2.0 * np.sin(theta)), abs=1e-15)
    vx, vy = fl.spectral.velocity_from_paper(1.875, theta, period=30, wavelength_max=16.0)
    assert np.hypot(vx, vy) == pytest.approx(1.0, abs=1e-15)


@every("exponent", [1.0, 0.0, 1.7])
@every("wavelengths", [(4.0, 32.0), (2.0, 16.0), (3.3, 21.7)])
@every("shape", [(64, 64), (48, 48), (33, 33), (47, 47), (40, 64)])
def test_band_amplitude_is_the_twins(shape: twin.Shape, wavelengths, exponent: float):
    got = fl.spectral.band_amplitude(shape, wavelengths=wavelengths, exponent=exponent)
    want = twin.band_amplitude(shape, wavelengths=wavelengths, exponent=exponent)
    assert got.dtype == np.float64
    assert np.array_equal(got > 0.0, want > 0.0)
    # eps times a sum of at most 4096 squares, added in another order
    assert np.abs(got - want).max() < 1e-14
    assert abs(np.sum(got**2) - 1.0) < 1e-13


@pytest.mark.parametrize(
    ("edge", "wave"), [(4.0, (0, 16)), (8.0, (8, 0)), (12.8, (3, 4)), (16.0, (0, 4))]
)
def test_band_is_half_open(edge: float, wave: tuple[int, int]):
    # A wave of exactly the edge's length, 64/|k|, belongs to the band below it, so that neighbours
    # partition the spectrum.
    coarse = fl.spectral.band_amplitude((64, 64), wavelengths=(edge, 32.0))
    fine = fl.spectral.band_amplitude((64, 64), wavelengths=(2.0, edge))
    whole = fl.spectral.band_amplitude((64, 64), wavelengths=(2.0, 32.0))
    assert coarse[wave] == 0.0 and fine[wave] > 0.0
    assert not np.any((coarse > 0) & (fine > 0))
    assert np.array_equal((coarse > 0) | (fine > 0), whole > 0)

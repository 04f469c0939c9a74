"""Phases: the hash to the bit, and phases that are still right after a million frames."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import flurries as fl
import twin
from every import every

SEEDS = [0, 1, 42, -1, -987654321, 2**63 - 1, -(2**63)]
SHAPES = [(64, 64), (8, 8), (9, 9), (17, 17), (31, 31), (12, 8), (9, 14), (7, 10), (1, 1), (2, 3)]


@every("seed", SEEDS)
@every("shape", SHAPES)
def test_random_phase_is_the_hash(shape: twin.Shape, seed: int):
    got = fl.spectral.random_phase(shape, seed=seed)
    assert got.shape == shape and got.dtype == np.float64
    assert np.array_equal(got, twin.random_phase(shape, seed=seed))


@pytest.mark.parametrize("tile", [(0, 1), (1, 0), (3, 7), (1000, 12)])
def test_random_phase_of_other_tiles(tile: tuple[int, int]):
    got = fl.spectral.random_phase((16, 16), seed=-3, tile=tile)
    assert np.array_equal(got, twin.random_phase((16, 16), seed=-3, tile=tile))
    assert not np.array_equal(got, fl.spectral.random_phase((16, 16), seed=-3))


def test_random_phase_default_tile_and_numpy_seed():
    got = fl.spectral.random_phase((16, 16), seed=np.int64(5))
    assert np.array_equal(got, fl.spectral.random_phase((16, 16), seed=5, tile=(0, 0)))


@every("shape", SHAPES)
def test_random_phase_is_odd_and_reduced(shape: twin.Shape):
    phase = fl.spectral.random_phase(shape, seed=11)
    assert phase.min() >= -0.5 and phase.max() < 0.5
    assert np.array_equal(twin.reduced(-twin.mirror(phase)), phase)
    assert np.isin(phase[twin.self_conjugate(shape)], (0.0, -0.5)).all()


@every("wavelength_max", [32.0, 20.0])
@every("shift", [(0.0, 0.0), (3.25, -7.5)])
@every("shape", SHAPES)
def test_advance_phase_is_the_twins(shape: twin.Shape, shift, wavelength_max: float):
    phase = twin.random_phase(shape, seed=2)
    arguments = {"shift": shift, "wavelength_max": wavelength_max}
    got = fl.spectral.advance_phase(phase, (5.0, -2.0), **arguments)
    want = twin.advance_phase(phase, (5.0, -2.0), **arguments)
    assert got.min() >= -0.5 and got.max() < 0.5
    # Phases are compared on the circle: at 1/2 rounding may decide which end stands there.
    assert np.abs(twin.reduced(got - want)).max() < 1e-14


@every("shape", SHAPES)
def test_advanced_phase_stays_odd(shape: twin.Shape):
    # Without this the field is not real; the Nyquist lines are where a literal formula breaks it.
    phase = twin.random_phase(shape, seed=4)
    moved = fl.spectral.advance_phase(phase, (11.0, 4.0), shift=(0.3, 0.7))
    assert np.abs(twin.reduced(moved + twin.mirror(moved))).max() < 1e-14


def test_phases_add_and_do_not_multiply():
    # The printed product is even in k and 0 at t = 0.
    phase = twin.random_phase((16, 16), seed=1)
    assert np.array_equal(fl.spectral.advance_phase(phase, (0.0, 0.0)), phase)
    moved = fl.spectral.advance_phase(phase, (2.0, 0.0))
    rate = fl.spectral.tent_rate((16, 16), (2.0, 0.0))
    assert np.abs(twin.reduced(moved - phase - rate)).max() < 1e-15


@every(
    ("cycles", "expected"),
    [(0.5, -0.5), (-0.5, -0.5), (1.5, -0.5), (0.75, -0.25), (7.0, 0.0), (-3.25, -0.25)],
)
def test_reduction_is_half_open(cycles: float, expected: float):
    phase = np.full((4, 4), cycles)
    assert np.array_equal(fl.spectral.advance_phase(phase, (0.0, 0.0)), np.full((4, 4), expected))


def exact_phase(phase: np.ndarray, drift: tuple[float, float], wavelength_max: float) -> np.ndarray:
    """Phases with 40 digits; the drift is taken as the float64 that was passed."""
    shape = phase.shape
    result = np.zeros(shape)
    ky, kx = twin.wave_numbers(shape)
    with mpmath.workdps(40):
        a, b = (mpmath.mpf(d) / mpmath.mpf(wavelength_max) for d in drift)
        for bin_ in np.ndindex(shape):
            fy, fx = mpmath.mpf(int(ky[bin_])) / shape[0], mpmath.mpf(int(kx[bin_])) / shape[1]
            length = mpmath.sqrt(fx * fx + fy * fy)
            top_y = 0 if 2 * ky[bin_] == -shape[0] else fy
            top_x = 0 if 2 * kx[bin_] == -shape[1] else fx
            rate = 0 if length == 0 else -(a * top_x + b * top_y) / length
            turns = mpmath.mpf(float(phase[bin_])) + rate
            result[bin_] = float(turns - mpmath.floor(turns + mpmath.mpf(1) / 2))
    return result


@every("sign", [1.0, -1.0])
@every(("frame", "limit"), [(1e3, 1e-12), (1e6, 1e-9), (1e9, 1e-6)])
def test_phase_never_drifts(frame: float, limit: float, sign: float):
    # c = 0.1 cycles per frame: 3.2 px of the 32 px wave, at 30 degrees.
    drift = (sign * 3.2 * np.cos(np.pi / 6) * frame, sign * 3.2 * 0.5 * frame)
    phase = twin.random_phase((12, 15), seed=8)
    got = fl.spectral.advance_phase(phase, drift)
    assert np.abs(twin.reduced(got - exact_phase(phase, drift, 32.0))).max() <= limit


def test_phase_in_single_precision_would_drift():
    # Negative control: the same drift through float32 is far outside the limit at frame 1e6.
    drift = (3.2 * np.cos(np.pi / 6) * 1e6, 1.6e6)
    rounded = tuple(float(np.float32(d)) for d in drift)
    phase = twin.random_phase((12, 15), seed=8)
    error = fl.spectral.advance_phase(phase, rounded) - exact_phase(phase, drift, 32.0)
    assert np.abs(twin.reduced(error)).max() > 1e-4


def test_random_access_is_the_recursion():
    # Varying velocity: 200 small steps against one jump by their sum.
    random = np.random.default_rng(6)
    steps = random.uniform(-3.0, 3.0, (200, 2))
    start = twin.random_phase((16, 16), seed=9)
    phase = start
    for step in steps:
        phase = fl.spectral.advance_phase(phase, step)
    jump = fl.spectral.advance_phase(start, steps.sum(axis=0))
    assert np.abs(twin.reduced(phase - jump)).max() < 1e-12


def test_backwards_undoes_forwards():
    start = twin.random_phase((31, 16), seed=9)
    there = fl.spectral.advance_phase(start, (123.4, -56.7), shift=(8.9, 1.2))
    back = fl.spectral.advance_phase(there, (-123.4, 56.7), shift=(-8.9, -1.2))
    assert np.abs(twin.reduced(back - start)).max() < 1e-13

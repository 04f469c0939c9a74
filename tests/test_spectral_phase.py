"""Phases: the hash to the bit, and phases that are still right after a million frames."""

from fractions import Fraction

import numpy as np

import flurries as fl
import twin
from every import every

SEEDS = [0, 1, 42, -1, -987654321, 2**63 - 1, -(2**63)]
SHAPES = [(64, 64), (8, 8), (9, 9), (17, 17), (31, 31), (12, 8), (9, 14), (7, 10), (1, 1), (2, 3)]


@every("seed", SEEDS)
@every("shape", SHAPES)
@every("tile", [(0, 0), (0, 1), (1000, 12)])
def test_random_phase_is_the_hash(shape: twin.Shape, seed: int, tile: tuple[int, int]):
    got = fl.spectral.random_phase(shape, seed=seed, tile=tile)
    assert got.shape == shape and got.dtype == np.float64
    assert np.array_equal(got, twin.random_phase(shape, seed=seed, tile=tile))


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


@every("frames", [1e3, 1e6, 1e9])
def test_a_phase_is_right_after_any_number_of_frames(frames: float):
    # Of a wave on an axis the tent moves the phase by the drift in longest waves: a rational.
    start, drift = twin.random_phase((12, 12), seed=5), (3.25 * frames, 1.625 * frames)
    got = fl.spectral.advance_phase(start, drift)
    for wave, moved in (((0, 2), drift[0]), ((3, 0), drift[1])):
        off = Fraction(got[wave]) - Fraction(start[wave]) + Fraction(moved) / 32
        # Half the last bit of the cycles, twice.
        assert abs(off - round(off)) <= np.spacing(moved / 32) + 1e-16

"""The inverse transform against the cosine sum, and against long double for large sizes."""

from __future__ import annotations

import numpy as np

import flurries as fl
import twin
from every import every

SMALL = [(16, 16), (15, 15), (8, 8), (12, 8), (9, 14), (1, 1), (1, 5), (6, 1), (2, 2), (3, 2)]
LARGE = [(1021, 6), (6, 1021), (1024, 12), (12, 1024), (97, 97), (127, 64), (64, 509), (48, 31)]


def symmetric(shape: twin.Shape) -> tuple[np.ndarray, np.ndarray]:
    """An even amplitude with all bins, dc and Nyquist too, and odd phases: unit variance."""
    amplitude = np.random.default_rng(1).uniform(0.1, 1.0, shape)
    amplitude = amplitude + twin.mirror(amplitude)
    return amplitude / np.sqrt(np.sum(amplitude**2)), twin.random_phase(shape, seed=6)


@every(("dtype", "limit"), [(np.float64, 1e-12), (np.float32, 4e-6)])
@every("shape", SMALL)
def test_tables_without_symmetry(shape: twin.Shape, dtype: type, limit: float):
    # Arbitrary tables, negative amplitudes, phases of many turns: all bins count as they are.
    random = np.random.default_rng(2)
    amplitude = random.standard_normal(shape)
    amplitude /= np.sqrt(np.sum(amplitude**2))
    phase = random.uniform(-20.0, 20.0, shape)
    got = fl.spectral.inverse_transform(amplitude, phase, dtype=dtype)
    assert np.abs(got - twin.direct_sum(amplitude, phase)).max() < limit


def long_double(amplitude: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """The transform in long double: 2 pi with 18 digits, and NumPy's long double FFT."""
    turn = 2 * np.arctan2(np.longdouble(0), np.longdouble(-1))
    angle = turn * phase.astype(np.longdouble)
    spectrum = amplitude.astype(np.longdouble) * (np.cos(angle) + 1j * np.sin(angle))
    return np.fft.ifft2(spectrum, norm="forward").real


@every(("dtype", "limit"), [(np.float64, 3e-15), (np.float32, 5e-7)])
@every("shape", [*SMALL, *LARGE])
def test_relative_rms_error(shape: twin.Shape, dtype: type, limit: float):
    amplitude, phase = symmetric(shape)
    exact = long_double(amplitude, phase)
    error = fl.spectral.inverse_transform(amplitude, phase, dtype=dtype) - exact
    assert np.sqrt(np.mean(error**2) / np.mean(exact**2)) <= limit

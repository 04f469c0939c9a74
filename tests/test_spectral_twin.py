"""The twin is judged by published constants, theory, and a second way to compute."""

import numpy as np
import pytest
from scipy import stats

import twin
from every import every

MASK = 2**64 - 1


def mix64_in_python(z: int) -> int:
    z = (z + 0x9E3779B97F4A7C15) & MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return z ^ (z >> 31)


def test_mix64_published_constant():
    # The first output of SplitMix64 from state 0.
    assert int(twin.mix64(0)[0]) == mix64_in_python(0) == 0xE220A8397B1DCDAF


@every("seed", [0, 1, -1, 2**63 - 1, -(2**63)])
def test_hash_in_python_integers(seed: int):
    words = (seed, 3, 0, -4, 31)
    h = 0
    for word in words:
        h = mix64_in_python(h ^ (word & MASK))
    assert int(twin.hashed(*words)[0]) == h
    assert twin.unit(twin.hashed(*words))[0] == (h >> 11) / 2**53


@every("shape", [(8, 8), (9, 9), (8, 9), (6, 4), (5, 12)])
def test_each_pair_has_one_leader(shape: twin.Shape):
    lead = twin.leaders(shape)
    count = lead.astype(int) + twin.mirror(lead)
    assert np.array_equal(count, np.where(twin.self_conjugate(shape), 0, 1))
    assert np.sum(twin.self_conjugate(shape)) == (2 - shape[0] % 2) * (2 - shape[1] % 2)


@every("shape", [(16, 16), (15, 15), (8, 8), (12, 8), (9, 14)])
def test_fft_is_the_cosine_sum(shape: twin.Shape):
    # Arbitrary, not symmetric, with dc and Nyquist: the sum is over all bins as they are. The error
    # is a small multiple of eps times the sum of the amplitudes.
    random = np.random.default_rng(20)
    amplitude, phase = random.standard_normal(shape), random.uniform(-0.5, 0.5, shape)
    error = twin.inverse_transform(amplitude, phase) - twin.direct_sum(amplitude, phase)
    assert np.abs(error).max() <= 1e-15 * np.abs(amplitude).sum()


@every(
    ("spread", "mean", "std"), [(2.0, 0.3075, 0.2497), (3.0, 0.2776, 0.1706), (4.0, 0.2656, 0.1269)]
)
def test_moments_of_an_opacity(spread: float, mean: float, std: float):
    alpha = twin.opacity(stats.norm.ppf((np.arange(100_000) + 0.5) / 100_000), spread=spread)
    assert (alpha.mean(), alpha.std()) == pytest.approx((mean, std), abs=6e-5)

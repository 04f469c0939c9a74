"""The judge is judged: the twin against published constants, theory, and a second way to compute.

Nothing here imports the package. A twin that is wrong would make every other test worthless.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats

import twin
import twin_camera
from every import every

MASK = 2**64 - 1


def mix64_in_python(z: int) -> int:
    """The hash once more, in Python's own integers."""
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


def test_leaders_are_those_of_the_text():
    ky, kx = twin.wave_numbers((8, 8))
    lead = twin.leaders((8, 8))
    assert np.all(lead[(kx > 0)])
    assert np.array_equal(lead[:, 0], ky[:, 0] > 0)
    assert np.array_equal(lead[:, 4], ky[:, 4] > 0)
    assert not np.any(lead[(kx < 0) & (kx > -4)])


@every("shape", [(16, 16), (15, 15), (8, 8), (12, 8), (9, 14)])
def test_fft_is_the_cosine_sum(shape: twin.Shape):
    # Arbitrary, not symmetric, with dc and Nyquist: the sum is over all bins as they are. The error
    # is a small multiple of eps times the sum of the amplitudes.
    random = np.random.default_rng(20)
    amplitude, phase = random.standard_normal(shape), random.uniform(-0.5, 0.5, shape)
    error = twin.inverse_transform(amplitude, phase) - twin.direct_sum(amplitude, phase)
    assert np.abs(error).max() <= 1e-15 * np.abs(amplitude).sum()


@pytest.mark.parametrize("size", [8, 9, 16, 64])
def test_unit_variance_zero_mean_and_real(size: int):
    wavelengths = (2.5, float(size))
    amplitude = twin.band_amplitude((size, size), wavelengths=wavelengths)
    phase = twin.random_phase((size, size), seed=3)
    spectrum = amplitude * np.exp(2j * np.pi * phase)
    picture = np.fft.ifft2(spectrum, norm="forward")
    assert np.abs(picture.imag).max() < 1e-13
    assert abs(picture.real.mean()) < 1e-13
    assert abs(picture.real.var() - 1.0) < 1e-13


def test_unit_variance_at_every_pixel_of_the_ensemble():
    # 2000 independent values: the variance is known to sqrt(2/2000) = 3.2 %, three times that.
    pixels = [
        twin.inverse_transform(twin.band_amplitude((16, 16), wavelengths=(4.0, 16.0)), phase)[3, 5]
        for phase in (twin.random_phase((16, 16), seed=seed) for seed in range(2000))
    ]
    assert abs(np.var(pixels) - 1.0) < 0.1
    assert abs(np.mean(pixels)) < 0.07


def test_phases_are_uniform():
    phase = twin.random_phase((64, 64), seed=-7)[twin.leaders((64, 64))]
    assert stats.kstest(phase, "uniform", args=(-0.5, 1.0)).pvalue > 0.01


def test_direct_field_is_the_fft_field():
    case = {"drift": (3.0, -1.0), "seed": 5, "tile": 16, "overlap": 6, "wavelengths": (2.5, 16.0)}
    error = twin.field((24, 21), **case, direct=True) - twin.field((24, 21), **case)
    assert np.abs(error).max() < 1e-13


@every("blend", ["power", "linear"])
@every("overlap", [0, 1, 10, 63])
@every("length", [1, 63, 64, 65, 130])
def test_axis_weights_add_up(length: int, overlap: int, blend: str):
    weights = twin.axis_weights(length, 64, overlap, blend)
    power = weights**2 if blend == "power" else weights
    starts = twin.tile_starts(length, tile=64, overlap=overlap)
    total = np.zeros(starts[-1] + 64)
    for start, share in zip(starts, power, strict=True):
        total[start : start + 64] += share
    assert starts[-1] + 64 >= length
    assert np.abs(total - 1.0).max() < 1e-14


def test_rotation_matrix_is_right_handed_and_orthonormal():
    turn = twin_camera.rotation_matrix((0.0, 0.0, np.pi / 2))
    assert np.allclose(turn @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    turn = twin_camera.rotation_matrix((0.3, -0.2, 0.9))
    assert np.allclose(turn.T @ turn, np.eye(3), atol=1e-15)
    assert np.isclose(np.linalg.det(turn), 1.0)


@pytest.mark.parametrize(
    ("spread", "mean", "std"),
    [(2.0, 0.3075, 0.2497), (2.5, 0.2891, 0.2044), (3.0, 0.2776, 0.1706), (4.0, 0.2656, 0.1269)],
)
def test_opacity_moments_by_three_ways(spread: float, mean: float, std: float):
    # The closed form, quadrature, and the numbers above to their last digit.
    def moment(power: int) -> float:
        inside, _ = integrate.quad(
            lambda z: (0.5 + z / (2 * spread)) ** power * stats.norm.pdf(z), -spread, spread
        )
        return inside + stats.norm.sf(spread)

    assert twin.opacity_mean(spread=spread) == pytest.approx(moment(2), abs=1e-12)
    assert moment(2) == pytest.approx(mean, abs=6e-5)
    assert np.sqrt(moment(4) - moment(2) ** 2) == pytest.approx(std, abs=6e-5)
    draws = stats.norm.ppf((np.arange(100_000) + 0.5) / 100_000)
    assert twin.opacity(draws, spread=spread).mean() == pytest.approx(mean, abs=6e-5)

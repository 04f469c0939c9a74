"""Every step of the texture against the twin, in one table, and what steps obey beside it."""

from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
from every import every
from flurries.spectral.tables import temporal_gain

S = fl.spectral
SHAPES = [(64, 64), (8, 8), (9, 9), (17, 17), (31, 31), (12, 8), (9, 14), (2, 2), (1, 1), (3, 4)]
BANDED = [(64, 64), (48, 48), (33, 33), (47, 47), (40, 64)]
SEEDS = [0, 1, 42, -1, -987654321, 2**63 - 1, -(2**63)]
ALIAS = ["cut", "soft", "keep"]
RANDOM = np.random.default_rng(1)

# Picture, tile and overlap.
GRIDS = [
    ((130, 70), (64, 64), 10), ((40, 50), (17, 17), 0), ((50, 41), (16, 24), 7),
    ((19, 18), (16, 16), 15), ((20, 20), (31, 31), 10), ((40, 33), (12, 12), 8),
]  # fmt: skip
MAPS: list[dict[str, float]] = [
    {}, {"mean": 0.3}, {"spread": 2.0}, {"power": 1.0}, {"amount": 0.0},
    {"power": 0.5, "amount": 0.8}, {"mean": 0.1, "spread": 5.0, "power": 3.5, "amount": 0.25},
]  # fmt: skip


def tables(shape: twin.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Tables without symmetry: negative amplitudes, phases of many turns, dc and Nyquist too."""
    amplitude = RANDOM.standard_normal(shape)
    return amplitude / np.sqrt(np.sum(amplitude**2)), RANDOM.uniform(-20.0, 20.0, shape)


def grid(shape: twin.Shape, tile: twin.Shape, overlap: int, dtype: type) -> np.ndarray:
    starts = [
        twin.tile_starts(n, tile=m, overlap=overlap) for n, m in zip(shape, tile, strict=True)
    ]
    return RANDOM.standard_normal((*map(len, starts), *tile)).astype(dtype)


# Of each step: arguments, options, and how far from the twin it may be.
STEPS: dict[str, list[tuple[tuple[Any, ...], dict[str, Any], float]]] = {
    "tent_rate": [
        ((shape, velocity), {"wavelength_max": 20.0}, 1e-15)
        for shape, velocity in product(SHAPES, [(2.0, 0.0), (0.0, -1.5), (0.7, 1.9)])
    ],
    # eps times a sum of at most 4096 squares, added in another order.
    "band_amplitude": [
        ((shape,), {"wavelengths": band, "exponent": exponent}, 1e-14)
        for shape, band, exponent in product(
            BANDED, [(4.0, 32.0), (2.0, 16.0), (3.3, 21.7)], [1.0, 0.0, 1.7]
        )
    ],
    "random_phase": [
        ((shape,), {"seed": seed, "tile": tile}, 0.0)
        for shape, seed, tile in product(SHAPES, SEEDS, [(0, 0), (0, 1), (1000, 12)])
    ],
    "advance_phase": [
        ((twin.random_phase(shape, seed=2), (5.0, -2.0)),
         {"shift": shift, "wavelength_max": longest}, 1e-14)
        for shape, shift, longest in product(SHAPES, [(0.0, 0.0), (3.25, -7.5)], [32.0, 20.0])
    ],
    "temporal_filter": [
        ((3.0 * twin.band_amplitude(shape, wavelengths=(3.0, 30.0)), (14.0, 9.0)),
         {"shift_rate": (0.9, -0.4), "alias": alias, "soft_from": 0.3, "shutter": shutter,
          "renormalise": renormalise, "wavelength_max": 30.0}, 1e-14)
        for shape, alias, shutter, renormalise in product(
            [(64, 64), (31, 31), (40, 33)], ALIAS, [0.0, 0.5, 1.0, 3.0], [False, True])
    ],
    "inverse_transform": [
        (tables(shape), {"dtype": dtype}, limit)
        for shape in [*SHAPES[1:], (16, 16), (15, 15), (1, 5), (6, 1), (3, 2)]
        for dtype, limit in ((np.float64, 1e-12), (np.float32, 4e-6))
    ],
    "tile_starts": [
        ((length,), {"tile": 64, "overlap": overlap}, 0.0)
        for length, overlap in product(
            [1, 2, 63, 64, 65, 117, 118, 119, 130, 200], [0, 1, 10, 32, 48, 63])
    ],
    "blend_tiles": [
        ((grid(*about, dtype), about[0]), {"overlap": about[2], "blend": blend}, limit)
        for about, blend in product(GRIDS, ["power", "linear"])
        for dtype, limit in ((np.float64, 1e-14), (np.float32, 2e-6))
    ],
    "opacity": [
        ((RANDOM.normal(0.0, 1.5, (33, 50)).astype(dtype),), options, limit)
        for options in MAPS for dtype, limit in ((np.float64, 1e-15), (np.float32, 1e-6))
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS)
def test_every_step_is_the_twins(name: str):
    for arguments, options, limit in STEPS[name]:
        got = getattr(S, name)(*arguments, **options)
        about = {key: value for key, value in options.items() if key != "dtype"}
        want = getattr(twin, name)(*arguments, **about)
        off = got - want
        if name == "advance_phase":
            # At 1/2 rounding may decide which end of the circle stands there.
            assert got.min() >= -0.5 and got.max() < 0.5
            off = twin.reduced(off)
        if name in ("band_amplitude", "temporal_filter"):
            assert np.array_equal(got == 0.0, want == 0.0)
        kept = options.get("dtype", getattr(arguments[0], "dtype", want.dtype))
        assert got.shape == want.shape and got.dtype == kept and got.flags.c_contiguous
        assert np.abs(off).max() <= limit, options


@every("size", [16, 15, 31, 50, 64])
def test_tent_is_exact_on_the_axes(size: int):
    # u must be exactly 1 there, so that a wave at exactly half a cycle is seen as such.
    rate = S.tent_rate((size, size), (8.0, -4.0), wavelength_max=32.0)
    assert np.all(rate[0, 1 : (size + 1) // 2] == -0.25)
    assert np.all(rate[1 : (size + 1) // 2, 0] == 0.125)


@every("theta", [0.0, np.pi / 2, -2.2])
def test_velocity_from_paper(theta: float):
    # C tile widths per T frames for the wave as long as the tile: C = 4, T = 64 is 2 px at 32 px.
    vx, vy = S.velocity_from_paper(4.0, theta, period=64.0)
    assert (vx, vy) == pytest.approx((2.0 * np.cos(theta), 2.0 * np.sin(theta)), abs=1e-15)
    vx, vy = S.velocity_from_paper(1.875, theta, period=30, wavelength_max=16.0)
    assert np.hypot(vx, vy) == pytest.approx(1.0, abs=1e-15)


@every(("edge", "wave"), [(4.0, (0, 16)), (8.0, (8, 0)), (12.8, (3, 4)), (16.0, (0, 4))])
def test_band_is_half_open(edge: float, wave: tuple[int, int]):
    # A wave of exactly the edge's length, 64/|k|, belongs to the band below it, so that neighbours
    # partition the spectrum.
    coarse, fine, whole = (
        S.band_amplitude((64, 64), wavelengths=band)
        for band in ((edge, 32.0), (2.0, edge), (2.0, 32.0))
    )
    assert coarse[wave] == 0.0 and fine[wave] > 0.0
    assert not np.any((coarse > 0) & (fine > 0))
    assert np.array_equal((coarse > 0) | (fine > 0), whole > 0)


@every("frames", [1e3, 1e6, 1e9])
def test_a_phase_is_right_after_any_number_of_frames(frames: float):
    # Of a wave on an axis the tent moves the phase by the drift in longest waves: a rational.
    start, drift = twin.random_phase((12, 12), seed=5), (3.25 * frames, 1.625 * frames)
    got = S.advance_phase(start, drift)
    for wave, moved in (((0, 2), drift[0]), ((3, 0), drift[1])):
        off = Fraction(got[wave]) - Fraction(start[wave]) + Fraction(moved) / 32
        # Half the last bit of the cycles, twice.
        assert abs(off - round(off)) <= np.spacing(moved / 32) + 1e-16


@every("shutter", [0.0, 0.5, 3.0])
@every("alias", ALIAS)
def test_the_gain_of_a_rate_is_the_equations(alias: str, shutter: float):
    rate = np.linspace(-0.9, 0.9, 1201)[:, None] * np.ones(2)
    want = twin.without_aliases(np.sinc(rate * shutter), rate, alias, 0.3)
    got = temporal_gain(rate, alias=alias, soft_from=0.3, shutter=shutter)
    assert got.shape == rate.shape
    np.testing.assert_allclose(got, want, atol=1e-15)
    # The half cycle itself has no direction.
    half = temporal_gain([0.5, -0.5, 0.5 - 1e-13], alias=alias, soft_from=0.3)
    assert (half == (1.0 if alias == "keep" else 0.0)).all()


LARGE = [(1021, 6), (6, 1021), (1024, 12), (12, 1024), (97, 97), (127, 64), (64, 509), (48, 31)]


@every(("dtype", "limit"), [(np.float64, 3e-15), (np.float32, 5e-7)])
@every("shape", [*SHAPES, *LARGE])
def test_the_transforms_error_is_that_of_rounding(shape: twin.Shape, dtype: type, limit: float):
    amplitude = np.random.default_rng(1).uniform(0.1, 1.0, shape)
    amplitude = amplitude + twin.mirror(amplitude)
    amplitude, phase = amplitude / np.sqrt(np.sum(amplitude**2)), twin.random_phase(shape, seed=6)
    # In long double: 2 pi with 18 digits, and NumPy's long double FFT.
    turn = 2 * np.arctan2(np.longdouble(0), np.longdouble(-1))
    angle = turn * phase.astype(np.longdouble)
    spectrum = amplitude.astype(np.longdouble) * (np.cos(angle) + 1j * np.sin(angle))
    exact = np.fft.ifft2(spectrum, norm="forward").real
    error = S.inverse_transform(amplitude, phase, dtype=dtype) - exact
    assert np.sqrt(np.mean(error**2) / np.mean(exact**2)) <= limit

"""Fields with a spectrum and a temporal law of the caller's own, judged by sums of cosines."""

from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
import twin

SHAPE, TILE, OVERLAP = (26, 31), (16, 12), 4
SIZES: dict[str, Any] = {"tile": TILE, "overlap": OVERLAP, "dtype": np.float64}


def waves(tile: tuple[int, int] = TILE) -> tuple[np.ndarray, np.ndarray]:
    fy, fx = np.meshgrid(np.fft.fftfreq(tile[0]), np.fft.fftfreq(tile[1]), indexing="ij")
    return fx, fy


def blob(tile: tuple[int, int] = TILE) -> np.ndarray:
    """An envelope of one half of the plane, as a Gabor's."""
    fx, fy = waves(tile)
    return np.exp(-((fx - 0.2) ** 2 + (fy - 0.1) ** 2) / (2 * 0.06**2))


def rates(tile: tuple[int, int] = TILE) -> np.ndarray:
    """Waves of deep water that run to the right; odd in k but where k is its own mirror."""
    fx, fy = waves(tile)
    return -0.4 * np.sign(fx) * np.sqrt(np.hypot(fx, fy))


def summed(envelope: np.ndarray, rate: np.ndarray, time: float, seed: int) -> np.ndarray:
    """The frame by the twin's cosines: no kernel and no transform."""
    even = envelope + twin.mirror(envelope)
    even[0, 0] = 0.0
    even /= np.sqrt((even**2).sum())
    odd = 0.5 * (rate - twin.mirror(rate))
    rows, cols = (
        len(twin.tile_starts(n, tile=m, overlap=OVERLAP)) for n, m in zip(SHAPE, TILE, strict=True)
    )
    tiles = np.zeros((rows, cols, *TILE))
    for place in np.ndindex(rows, cols):
        phase = twin.random_phase(TILE, seed=seed, tile=(place[0], place[1]))
        tiles[place] = twin.direct_sum(even, phase + odd * time)
    return twin.blend_tiles(tiles, SHAPE, overlap=OVERLAP)


@pytest.mark.parametrize("time", [0.0, 12.25, -3e6])
def test_a_field_is_the_sum_of_its_waves(time: float):
    want = summed(blob(), rates(), time, 5)
    got = textured.field(SHAPE, seed=5, envelope=blob(), rate=rates(), time=time, **SIZES)
    # Phases of 1e6 cycles keep 1e-10 of one.
    assert np.abs(got - want).max() < 1e-12 + 1e-14 * abs(time)
    single = textured.field(
        SHAPE, seed=5, envelope=3e-9 * blob(), rate=rates(), time=time, tile=TILE, overlap=OVERLAP
    )
    assert single.dtype == np.float32 and np.abs(single - want).max() < 1e-5


def test_the_paper_is_one_spectrum_and_one_law_of_many():
    v, t = (0.7, 1.9), 9.5
    options = {**SIZES, "wavelengths": (3.0, 12.0), "alias": "soft", "shutter": 0.7, "seed": 2}
    still = {"shift": (1.0, 2.5), "shift_rate": (0.1, -0.3), "shortest": np.full((2, 4), 4.0)}
    want = twin.field(
        SHAPE, drift=np.multiply(v, t), velocity=v,
        **{k: o for k, o in options.items() if k != "dtype"}, **still,
    )  # fmt: skip
    paper = twin.band_amplitude(TILE, wavelengths=(3.0, 12.0))
    law = twin.tent_rate(TILE, v, wavelength_max=12.0)
    got = textured.field(SHAPE, envelope=paper, rate=law, time=t, **options, **still)
    assert np.abs(got - want).max() < 1e-12
    # The spectrum alone, moved by drift and velocity as ever.
    got = textured.field(
        SHAPE, envelope=paper, drift=np.multiply(v, t), velocity=v, **options, **still
    )
    assert np.abs(got - want).max() < 1e-12


def test_an_alpha_is_the_opacity_of_its_field():
    own: dict[str, Any] = {"seed": 3, "envelope": blob(), "rate": rates(), "time": 2.0, **SIZES}
    alpha = textured.alpha(SHAPE, mean=0.3, power=1.5, amount=0.8, **own)
    field = textured.field(SHAPE, **own)
    assert np.array_equal(alpha, fl.spectral.opacity(field, mean=0.3, power=1.5, amount=0.8))
    out = np.empty(SHAPE)
    assert textured.field(SHAPE, out=out, **own) is out and np.array_equal(out, field)

"""Patterns of flakes, by an own drawing; the optical depth of layers of them, by a direct sum."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
import twin_flakes
from flurries import _core

DEPTH = fl.spectral.optical_depth


def case(number: int) -> dict[str, Any]:
    rng = np.random.default_rng(number)
    tile = int(rng.choice([1, 2, 3, 4, 5, 8, 9, 12, 16, 17, 20, 24, 31, 32, 40, 64]))
    layers = int(rng.integers(1, 7))
    overlap = int(rng.integers(0, tile)) if number % 3 else 0
    most = 2 * tile if tile - overlap < 4 else 3 * tile
    shape = tuple(int(n) for n in rng.integers(1, most + 2, 2))
    rows, cols = (len(twin.tile_starts(n, tile=tile, overlap=overlap)) for n in shape)
    spectra = rng.normal(size=(layers, 2, tile, tile // 2 + 1)) + 0j
    spectra += 1j * rng.normal(size=spectra.shape)
    spectra[:, :, 0, 0] = rng.uniform(0.5 * tile, 4.0 * tile, (layers, 1))
    size = (rows, cols, layers, 2) if number % 2 else (layers, 2)
    found: dict[str, Any] = {
        "shape": shape, "patterns": spectra, "drift": rng.normal(0.0, 100.0, size),
        "shear": float(rng.uniform(-1.0, 1.0)) if number % 4 else 0.0,
        "gain": rng.uniform(0.1, 1.5, layers) if number % 5 else None, "overlap": overlap,
    }  # fmt: skip
    if number % 3 != 1:
        found["velocity"] = rng.normal(0.0, 8.0, size[-2:] if number % 7 == 0 else size)
        found["shutter"] = float(rng.uniform(0.0, 1.0))
    return found


@pytest.mark.parametrize("number", range(40))
def test_depth_is_the_direct_sum(number: int):
    given = case(number)
    shape, spectra = given.pop("shape"), given.pop("patterns")
    want = twin_flakes.optical_depth(shape, spectra, **given)
    scale = max(1.0, np.abs(want).max())
    wide = DEPTH(shape, spectra, **given, seed=None, dtype=np.float64)
    assert wide.dtype == np.float64 and wide.shape == shape
    assert np.abs(wide - want).max() < 1e-10 * scale
    narrow = DEPTH(shape, spectra, **given, seed=None)
    assert narrow.dtype == np.float32
    assert np.abs(narrow - want).max() < 2e-5 * scale


SPECTRA = fl.spectral.flake_patterns(
    32, counts=[60, 200], diameters=[[1.5, 2.5], [0.5, 1.5]], shear=0.382, seed=2
)
SHAPE = (101, 111)
DRIFT = np.random.default_rng(8).normal(0.0, 30.0, (5, 5, 2, 2))
GIVEN: dict[str, Any] = {"drift": DRIFT, "shear": 0.382, "seed": 9, "overlap": 10}


def test_tiles_choose_by_the_hash():
    # Patterns and torus shifts of a tile, put together from the choices.
    pattern, chosen = np.empty((5, 5, 2), np.int32), np.empty((5, 5, 2, 2))
    _core.flake_choices(pattern, chosen, 9, 8, 32)
    spectra = SPECTRA.astype(np.complex128)
    mean = float(spectra[:, 0, 0, 0].real.sum()) / 32**2
    tiles = np.empty((5, 5, 32, 32))
    for at in np.ndindex(5, 5):
        numbers = pattern[at] - 8 * np.arange(2)
        assert ((numbers >= 0) & (numbers < 8)).all()
        shift = chosen[at] + DRIFT[at]
        taken = spectra[[0, 1], numbers]
        tile = twin_flakes.tile_of(taken, shift, np.zeros((2, 2)), np.ones(2), 0.382)
        tiles[at] = tile - mean
    want = np.maximum(0.0, mean + twin.blend_tiles(tiles, SHAPE, overlap=10))
    assert np.abs(DEPTH(SHAPE, SPECTRA, **GIVEN, dtype=np.float64) - want).max() < 1e-10


MAKE = fl.spectral.flake_patterns


def coverage(count: float, low: float, high: float, opacity: float) -> float:
    return count * opacity * math.pi / 12.0 * (low**2 + low * high + high**2)


@pytest.mark.parametrize("tile", [1, 2, 3, 4, 5, 7, 16, 33, 64])
@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_means_and_half_waves(tile: int, dtype: Any):
    counts, sizes = [0.3, 8.0, 21.7, 0.0], [[1.0, 2.0], [0.2, 0.4], [2.5, 2.5], [1.0, 3.0]]
    found = MAKE(
        tile, counts=counts, diameters=sizes, opacity=0.7, patterns=5, shear=0.382, seed=3,
        dtype=dtype,
    )  # fmt: skip
    assert found.shape == (4, 5, tile, tile // 2 + 1) and found.dtype == dtype
    for layer, (count, size) in enumerate(zip(counts, sizes, strict=True)):
        want = coverage(count, *size, 0.7)
        assert np.abs(found[layer, :, 0, 0] - want).max() <= 1e-7 * want + 1e-12
        assert np.ptp(found[layer, :, 0, 0].real) == 0.0
    if tile % 2 == 0:
        assert not found[:, :, tile // 2].any() and not found[..., tile // 2].any()


@pytest.mark.parametrize("tile, shear, diameter", [
    (6, 0.382, 0.4), (9, -0.7, 0.4), (16, 0.0, 1.0), (9, 0.382, 1.0), (6, -0.7, 3.0),
    (16, 0.382, 3.0), (9, 0.0, 11.0), (16, -0.7, 11.0),
])  # fmt: skip
def test_one_flake_is_its_sprite(tile: int, shear: float, diameter: float):
    # Whose place is read from the phases of the longest waves.
    found = MAKE(
        tile, counts=[1], diameters=[[diameter] * 2], patterns=3, shear=shear, seed=12,
        dtype=np.complex128,
    )[0]  # fmt: skip
    for spectrum in found:
        u = -np.angle(spectrum[0, 1]) / (2.0 * np.pi) * tile
        y = -np.angle(spectrum[1, 0]) / (2.0 * np.pi) * tile
        # Waves of the drawing beyond half a cycle come back and bend the phase.
        best = None
        for _ in range(30):
            drawn = twin_flakes.on_torus(tile, u + shear * y, y, diameter, 0.9, shear)
            best = twin_flakes.spectrum(drawn, shear)
            u -= np.angle(spectrum[0, 1] / best[0, 1]) / (2.0 * np.pi) * tile
            y -= np.angle(spectrum[1, 0] / best[1, 0]) / (2.0 * np.pi) * tile
        assert np.abs(spectrum - best).max() < 1e-9 * abs(spectrum[0, 0])


def test_power_is_that_of_poisson_flakes():
    # E |S|^2 = n (opacity pi d^2 / 4)^2 exp(-4 pi^2 sigma^2 k^2) box^2, and waves from beyond half
    # a cycle come back.
    tile, shear, count, diameter = 48, 0.382, 30, 1.5
    found = MAKE(
        tile, counts=[count], diameters=[[diameter] * 2], patterns=400, shear=shear, seed=6,
        dtype=np.complex128,
    )[0]  # fmt: skip
    b = np.fft.fftfreq(tile, 1.0 / tile)[:, None]
    a = np.arange(tile // 2 + 1)[None, :]
    want = np.zeros((tile, tile // 2 + 1))
    sigma = diameter / math.sqrt(8.0)
    for n in range(-2, 3):
        for m in range(-2, 3):
            kx, ky = a / tile + m, (b - shear * a) / tile + n
            box = np.sinc(kx) * np.sinc(ky)
            want += (box * np.exp(-2.0 * np.pi**2 * sigma**2 * (kx**2 + ky**2))) ** 2
    want *= count * (0.9 * math.pi * diameter**2 / 4.0) ** 2
    got = (np.abs(found) ** 2).mean(0)
    kept = (2 * np.abs(b) != tile) & (2 * a != tile) & ((a > 0) | (b != 0))
    ratio = got[kept] / want[kept]
    # Each is a mean of 400 exponentials: deviation .05; of 1000 and more none beyond 5.
    assert abs(ratio.mean() - 1.0) < 0.01
    assert np.abs(ratio - 1.0).max() < 0.3


def test_a_seed_names_its_patterns():
    law = {"counts": [20, 20], "diameters": [[1, 2], [1, 2]]}
    first = MAKE(32, **law, seed=1)
    assert np.array_equal(first, MAKE(32, **law, seed=1))
    assert len({plane.tobytes() for seed in (1, 2) for plane in
                MAKE(32, **law, seed=seed).reshape(16, -1)}) == 32  # fmt: skip
    more = MAKE(32, counts=[20, 20, 5], diameters=[[1, 2], [1, 2], [1, 1]], seed=1)
    assert np.array_equal(more[:2], first)

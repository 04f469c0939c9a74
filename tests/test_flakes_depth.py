"""Optical depth of layers of flakes: equal to a direct sum over waves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
import twin_flakes
from flurries import _core

DEPTH = fl.spectral.optical_depth


def case(number: int) -> dict[str, Any]:
    """A random set: layers, drifts, shutters, overlaps, odd sizes."""
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
        "shape": shape,
        "patterns": spectra,
        "drift": rng.normal(0.0, 100.0, size),
        "shear": float(rng.uniform(-1.0, 1.0)) if number % 4 else 0.0,
        "gain": rng.uniform(0.1, 1.5, layers) if number % 5 else None,
        "overlap": overlap,
    }
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


def test_a_larger_picture_keeps_its_tiles():
    small = DEPTH((60, 60), SPECTRA, drift=[(1, 2), (3, 4)], seed=3, shear=0.382)
    large = DEPTH((90, 140), SPECTRA, drift=[(1, 2), (3, 4)], seed=3, shear=0.382)
    # Up to the first tile that the small one lacks.
    assert np.array_equal(small[:54, :54], large[:54, :54])

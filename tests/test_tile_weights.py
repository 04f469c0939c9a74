"""The weights of tiles: those of the kernel's blend, at every pixel."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
from flurries.spectral.tiles import power_shares, tile_weights

CASES = ((100, 32, 8), (70, 16, 0), (95, 24, 12), (20, 32, 5), (90, 20, 19), (61, 60, 59))


@pytest.mark.parametrize("blend", ["power", "linear"])
@pytest.mark.parametrize(("length", "tile", "overlap"), CASES)
def test_weights_are_those_of_the_kernel(length: int, tile: int, overlap: int, blend: str):
    got = tile_weights(length, tile=tile, overlap=overlap, blend=blend)
    count = len(fl.spectral.tile_starts(length, tile=tile, overlap=overlap))
    assert got.shape == (length, count)
    # One row of tiles, of which one after the other is 1 and the rest 0. Down there is one tile.
    for number in range(count):
        tiles = np.zeros((count, 1, tile, tile))
        tiles[number] = 1.0
        shape = (length, 1)
        blended = fl.spectral.blend_tiles(tiles, shape, overlap=overlap, blend=blend)
        assert np.abs(blended[:, 0] - got[:, number]).max() < 1e-14


@pytest.mark.parametrize("blend", ["power", "linear"])
@pytest.mark.parametrize(("length", "tile", "overlap"), CASES)
def test_shares_are_of_the_power_of_independent_tiles(length, tile, overlap, blend):
    shares, power = power_shares(length, tile=tile, overlap=overlap, blend=blend)
    assert shares.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    if blend == "power" or overlap == 0 or shares.shape[1] == 1:
        assert power == pytest.approx(1.0, abs=1e-14)
    else:
        assert power.max() <= 1.0 + 1e-14 and power.min() < 0.76
    # Fields of unit variance in every tile: the variance of their blend.
    draws = np.random.default_rng(5).standard_normal((2000, shares.shape[1]))
    weights = tile_weights(length, tile=tile, overlap=overlap, blend=blend)
    assert (draws @ weights.T).var(axis=0) == pytest.approx(power, rel=0.15)

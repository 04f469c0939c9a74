"""How much of the field's power at a pixel is each tile's: by the kernel's own blend."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
from flurries.spectral.tiles import power_shares

CASES = ((100, 32, 8), (70, 16, 0), (95, 24, 12), (20, 32, 5), (90, 20, 19), (61, 60, 59))


@pytest.mark.parametrize("blend", ["power", "linear"])
@pytest.mark.parametrize(("length", "tile", "overlap"), CASES)
def test_power_is_that_of_independent_tiles(length: int, tile: int, overlap: int, blend: str):
    shares, power = power_shares(length, tile=tile, overlap=overlap, blend=blend)
    count = len(fl.spectral.tile_starts(length, tile=tile, overlap=overlap))
    assert shares.shape == (length, count)
    # Of independent tiles the variances add up: the squares of what the blend makes of each alone.
    for number in range(count):
        tiles = np.zeros((count, 1, tile, tile))
        tiles[number] = 1.0
        alone = fl.spectral.blend_tiles(tiles, (length, 1), overlap=overlap, blend=blend)[:, 0]
        # Across there is one tile, whose weight is 1.
        assert np.abs(alone**2 - shares[:, number] * power).max() < 1e-14
    assert shares.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    if blend == "linear" and overlap > 0 and count > 1:
        assert power.min() < 0.76

"""Tiles: that nobody sees their seams, and that those of a larger picture are the same."""

import numpy as np
import pytest

import flurries as fl
import textured
import twin
from every import every
from flurries.spectral.tiles import power_shares

# 5 x 5 tiles give 16 corners and 40 edges: with 400 seeds, 6400 nearly independent values at the
# corners, standard error of their variance 1.8 %; whole 10 x 10 patches and the edges do better.
STARTS = np.arange(1, 5) * 54
SEAM = np.concatenate([np.arange(s, s + 10) for s in STARTS])
MIDDLE = np.concatenate([[s + 4, s + 5] for s in STARTS])
PLAIN = np.concatenate([np.arange(s + 10, s + 54) for s in (0, *STARTS)])


@pytest.fixture(scope="module")
def variance() -> dict[str, np.ndarray]:
    """Variance of every pixel over 400 seeds, for both blends."""
    result = {}
    for blend in ("power", "linear"):
        squares = np.zeros((280, 280))
        for seed in range(400):
            z = textured.field((280, 280), drift=(3.0, 5.0), seed=seed, blend=blend)
            squares += z.astype(np.float64) ** 2
        result[blend] = squares / 400
    return result


@pytest.mark.parametrize("rows", [SEAM, MIDDLE, PLAIN], ids=["seam", "middle", "plain"])
@pytest.mark.parametrize("cols", [SEAM, MIDDLE, PLAIN], ids=["seam", "middle", "plain"])
def test_power_blending_keeps_the_variance(variance, rows: np.ndarray, cols: np.ndarray):
    assert np.mean(variance["power"][np.ix_(rows, cols)]) == pytest.approx(1.0, abs=0.03)


def test_linear_blending_dips(variance):
    # w^2 + (1 - w)^2 at w = 0.45 is 0.505: a half at the edges and a quarter at the corners. The
    # negative control of the test above.
    dip = 0.45**2 + 0.55**2
    linear = variance["linear"]
    assert np.mean(linear[np.ix_(PLAIN, PLAIN)]) == pytest.approx(1.0, abs=0.03)
    assert np.mean(linear[np.ix_(MIDDLE, PLAIN)]) == pytest.approx(dip, abs=0.03 * dip)
    assert np.mean(linear[np.ix_(PLAIN, MIDDLE)]) == pytest.approx(dip, abs=0.03 * dip)
    assert np.mean(linear[np.ix_(MIDDLE, MIDDLE)]) == pytest.approx(dip**2, abs=0.05 * dip**2)


@every("blend", ["power", "linear"])
@every("overlap", [0, 10, 40])
@every(("old", "new"), [((100, 150), (170, 150)), ((128, 64), (128, 300)),
                                          ((90, 90), (91, 92)), ((64, 64), (65, 65))])  # fmt: skip
def test_growing_the_picture_keeps_old_pixels(old, new, overlap: int, blend: str):
    # Tiles that stick out count whole, so a pixel changes only where a new tile reaches it.
    arguments = {"drift": (4.0, 9.0), "seed": 21, "overlap": overlap, "blend": blend}
    before = textured.field(old, **arguments)
    after = textured.field(new, **arguments)
    counts = [len(twin.tile_starts(n, overlap=overlap)) for n in old]
    kept = tuple(slice(0, min(n, c * (64 - overlap))) for n, c in zip(old, counts, strict=True))
    assert before[kept].size > 0
    assert np.array_equal(before[kept], after[kept])


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

"""Depths whose pixels are means of two: the weather before both, by their shares."""

import numpy as np
import pytest

import flurries as fl
from flurries.frame.edges import edges_of
from flurries.io.layers.deep import Deep, write_deep

H, W, FINE = 40, 64, 16
Y, X = ((one + 0.5) / FINE for one in np.mgrid[: H * FINE, : W * FINE])
# A pole of 3 px and a hill's rim.
NEAR = (abs(X - 26.0 - 0.21 * Y) < 1.5) | (30.0 + 4.0 * np.sin(X / 9.0) < Y)
EFFECTS = [fl.Snow("heavy"), fl.Rain("downpour"), fl.Mist("fog"), fl.Snow("heavy", method="cone")]


def filtered(plane):
    """The means of pixels of a plane that is `FINE` times as fine."""
    return plane.reshape(H, FINE, W, FINE).mean(axis=(1, 3)).astype(np.float32)


SHARE = filtered(NEAR)


def deep(path, near, far):
    """The same as samples, the far one first; none where there is nothing."""
    last = [(1.0, far)] if np.isfinite(far) else []
    samples = [last + ([(share, near)] if share else []) for share in SHARE.ravel().tolist()]
    rows = [(0.0, 0.0, 0.0, cover, z, z) for one in samples for cover, z in one]
    counts = np.array([len(one) for one in samples]).reshape(H, W)
    write_deep(path, Deep(counts, np.array(rows)), half=False)
    return path


@pytest.mark.parametrize("far", [40.0, 1e10, np.inf])
@pytest.mark.parametrize("kind", ["linear", "inverse", "deep"])
def test_weather_is_that_before_both_sides_by_their_shares(kind, far, tmp_path):
    # Of a filtered infinity nothing is known but that there is some.
    share = np.floor(SHARE) if kind == "linear" and far == np.inf else SHARE
    if kind == "linear":
        depth = filtered(np.where(NEAR, 5.0, far))
    elif kind == "inverse":
        depth = fl.scene.DepthMap(SHARE, near=5.0, far=far, law="inverse")
    else:
        depth = deep(tmp_path / "deep.exr", 5.0, far)
    for effect in EFFECTS:
        got, before, behind = (
            fl.Scene("#405060", size=(W, H), effects=effect, depth=one, fps=24)
            for one in (depth, 5.0, np.full((H, W), far))
        )
        wanted = share * before.layers(3).alpha + (1.0 - share) * behind.layers(3).alpha
        np.testing.assert_allclose(got.layers(3).alpha, wanted, atol=1e-5)
        part = np.s_[5:33, 20:50]
        np.testing.assert_array_equal(got.render(3, region=part), got.render(3)[part])


def test_slopes_are_no_edges_and_the_limb_of_a_ball_is_one():
    rows, columns = np.mgrid[:H, :W]
    floor, wall = 160.0 / np.maximum(rows - 9.7, 1e-3), 1.0 / (0.26 - 0.004 * columns)
    for sky in (1e10, np.inf):
        for depth in (np.where(rows > 9, floor, sky), np.where(columns < 50, wall, sky)):
            assert edges_of(depth.astype(np.float32)) is None
    left = 150.0 - (X - 32) ** 2 - (Y - 20) ** 2
    found = edges_of(filtered(np.where(left > 0.0, 8.0 - 0.2 * np.sqrt(abs(left)), 30.0)))
    share = filtered(left > 0.0)
    assert found is not None
    assert np.abs(found.front.cover - share)[(share > 0.05) & (share < 0.95)].max() < 0.05


def test_deep_samples_are_parted_where_their_inverse_depths_differ_most(tmp_path):
    rng = np.random.default_rng(4)
    counts = rng.integers(1, 6, (6, 7))
    cover, z = (rng.uniform(*ends, counts.sum()) for ends in ((0.05, 0.9), (1.0, 20.0)))
    write_deep(tmp_path / "a.exr", Deep(counts, np.c_[np.zeros((len(z), 3)), cover, z, z]))
    found = iter(fl.io.read_depth(tmp_path / "a.exr").reshape(-1, 3))
    for own in np.split(np.arange(len(z)), np.cumsum(counts)[:-1]):
        near = own[np.argsort(z[own])]
        left = np.append(1.0, np.cumprod(1.0 - cover[near]))
        # What each shows, and the infinity behind all.
        shown, close = np.append(left[:-1] * cover[near], left[-1]), np.append(1.0 / z[near], 0.0)
        sums = np.cumsum([shown, shown * close], axis=1)[:, :-1]
        rest = sums[:, -1:] * [[0.0], [1.0]] + [[1.0], [0.0]] - sums
        k = np.argmax(sums[0] * rest[0] * (sums[1] / sums[0] - rest[1] / rest[0]) ** 2)
        behind = rest[0, k] / rest[1, k] if k + 1 < len(near) else np.inf
        assert next(found) == pytest.approx([sums[0, k] / sums[1, k], behind, sums[0, k]], rel=1e-3)


def test_a_damaged_deep_depth_is_refused(tmp_path):
    path = deep(tmp_path / "deep.exr", 5.0, 40.0)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(OSError, match=r"deep\.exr: the picture is damaged or cut short"):
        fl.Scene("#405060", size=(W, H), depth=path).layers(0)
    for near, words in ((-1.0, "depth must be greater than 0"), (np.nan, "depth .*nan")):
        with pytest.raises(ValueError, match=words):
            fl.Scene("#405060", size=(W, H), depth=deep(path, near, 40.0)).layers(0)

"""Depth and sun of a scene: where they come from, how they are fitted, and pixels of two depths."""

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.frame.edges import edges_of
from flurries.io import fit, fit_nearest, write_layers, write_picture
from flurries.io.layers.planes import Deep, write_deep

W, H = 60, 40
RNG = np.random.default_rng(31)
FAR = RNG.uniform(1.0, 50.0, (H, W)).astype(np.float32)
FAR[:5] = np.inf
GREY = RNG.integers(0, 256, (H, W)).astype(np.uint8)
MAP = {"near": 2.0, "far": 30.0}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_layers(tmp_path / "z.exr", {"rgba": np.zeros((H, W, 4), np.float32), "depth": FAR})
    write_layers(tmp_path / "view.exr", {"view.depth": FAR, "view": np.ones((H, W, 4), np.float32)})
    write_picture(tmp_path / "grey.png", GREY)
    write_picture(tmp_path / "plate.png", np.dstack([GREY] * 3))
    for number in (7, 8, 9):
        write_layers(tmp_path / f"film.{number}.exr", {"depth": FAR + np.float32(number)})
    monkeypatch.chdir(tmp_path)
    return tmp_path


def depth(value: Any, t: float = 0.0, size: Any = (W, H)) -> np.ndarray:
    got = fl.Scene(size=size, depth=value)._depth_at(t)
    assert got is not None and got.dtype == np.float32 and got.flags.c_contiguous
    assert not got.flags.writeable and got.shape == size[::-1]
    return got


def test_a_wall_an_array_and_files(folder: Path):
    assert (depth(12.5) == 12.5).all() and (depth(3) == 3.0).all()
    for value in (FAR, FAR.tolist(), "z.exr", Path("view.exr")):
        assert np.array_equal(depth(value), FAR)
    half = FAR.astype(np.float16)
    assert np.array_equal(depth(half), half.astype(np.float32))
    assert fl.Scene(size=(W, H))._depth_at(3.0) is None


def test_a_sequence_goes_with_the_frames(folder: Path):
    # Numbers that it has not are judged in `test_shot_numbers.py`.
    for t, number in [(7, 7), (7.99, 7), (8, 8), (9, 9), (8.0, 8)]:
        assert np.array_equal(depth("film.%d.exr", t), FAR + np.float32(number))
    scene = fl.Scene(size=(W, H), depth="film.%d.exr")
    first = scene._depth_at(8)
    assert scene._depth_at(8.5) is first, "fitted once"
    assert np.array_equal(pickle.loads(pickle.dumps(scene))._depth_at(8), first)


@pytest.mark.parametrize("white", ["near", "far"])
@pytest.mark.parametrize("law", ["linear", "inverse"])
@pytest.mark.parametrize("kind", ["uint8", "uint16", "float", "file", "color file"])
def test_greys_become_depths(white: str, law: str, kind: str, folder: Path):
    given: dict[str, Any] = {
        "uint8": GREY, "uint16": GREY.astype(np.uint16) * 257, "float": GREY / 255.0,
        "file": "grey.png", "color file": "plate.png",
    }  # fmt: skip
    got = depth(fl.scene.DepthMap(given[kind], white=white, law=law, **MAP))
    g = GREY / 255.0
    w = 1.0 - g if white == "near" else g
    want = 2.0 + 28.0 * w if law == "linear" else 1.0 / (0.5 + w * (1 / 30.0 - 0.5))
    assert np.abs(got / want - 1.0).max() < 1e-5
    assert got[GREY == 255].mean() == pytest.approx(2.0 if white == "near" else 30.0, rel=1e-5)


@pytest.mark.parametrize("size", [(60, 40), (120, 80), (33, 47), (1, 1), (7, 200)])
def test_files_are_fitted_as_the_background_is_without_making_depths(size: Any, folder: Path):
    assert set(np.unique(depth("z.exr", size=size))) <= set(np.unique(FAR)), "nobody gave it"
    if min(size) < 5:
        return
    # A ramp of light through the background's own fitting says where each pixel came from.
    rows, cols = np.mgrid[0:H, 0:W].astype(np.float32)
    ramp = fit(np.dstack([rows, cols, cols]), size, encoding="linear")
    near = fit_nearest(np.arange(H * W).reshape(H, W), size)
    for off in (np.abs(near // W - ramp[..., 0]), np.abs(near % W - ramp[..., 1])):
        # Rounding to a pixel is half of one; the ramp's ends bend under the filter.
        inner = off[1:-1, 1:-1]
        assert np.median(inner) <= 0.5 and np.quantile(inner, 0.9) <= 0.75


REFUSED: list[tuple[Any, str]] = [
    (np.where(FAR < 2.0, np.nan, FAR), "depth .*got nan at \\[5, 5\\]"),
    (np.where(FAR < 2.0, 0.0, FAR), "depth .*infinity where nothing stands.*got 0"),
    (np.where(FAR < 2.0, -np.inf, FAR), "depth .*got -inf"),
    (GREY, "depth .*DepthMap"), (fl.scene.DepthMap(GREY.T, **MAP), "depth: source must have shape"),
    ("nope.exr", "nope.exr"), ("nope.%d.exr", "nope"), ("a\0b", "depth"), ("", "depth"),
    ("grey.png", "grey.png.*no float channel.*DepthMap"),
    ("hole.exr", r"hole\.exr: depth .*nan at"),
]  # fmt: skip


def test_refusals(folder: Path):
    write_layers("hole.exr", {"depth": np.where(FAR < 2.0, np.nan, FAR).astype(np.float32)})
    for value, words in REFUSED:
        with pytest.raises((ValueError, TypeError, OSError), match=words):
            fl.Scene(size=(W, H), depth=value)._depth_at(0)


def test_the_sun():
    for one in (1e-90, 1.0, 1e90):
        unit = fl.scene.Sun((0, 3 * one, -4 * one)).unit()
        assert unit == pytest.approx([0, 0.6, -0.8], abs=1e-15)


@pytest.mark.parametrize("way", ["array", "file", "transform"])
@pytest.mark.parametrize(
    "unit, said",
    [("inverse", "farther than 1 m; flurries.scene.DepthMap"), ("mm", "divide millimetres")],
)
def test_depths_that_are_hardly_metres_are_warned_of(
    tmp_path: Path, way: str, unit: str, said: str
):
    metres = RNG.uniform(1.0, 6.0, (H, W)).astype(np.float32)
    given = 1.0 / metres if unit == "inverse" else 1000.0 * metres
    write_layers(tmp_path / "z.exr", {"depth": given})
    with pytest.warns(UserWarning, match=f"depth is taken as metres: .*{said}"):
        if way == "array":
            fl.Scene(size=(W, H), depth=given)
        elif way == "file":
            depth(tmp_path / "z.exr")
        else:
            fl.augment.Fog(seed=1)(np.zeros((H, W, 3), np.uint8), depth=given)


def test_near_and_far_metres_are_not():
    """A desk, a wall, mountains under the sky, and a map of greys: warnings are errors here."""
    hills = RNG.uniform(500.0, 5000.0, (H, W))
    hills[:9] = np.inf
    for given in (RNG.uniform(0.3, 1.5, (H, W)), np.full((H, W), 0.7), hills, 900.0):
        fl.Scene(size=(W, H), depth=given)
    fl.Scene(size=(W, H), depth=fl.scene.DepthMap(GREY, near=0.2, far=0.9))


def test_lengths_in_other_units_are_warned_of():
    with pytest.warns(UserWarning, match="focal length of 35 px for a picture 1920 px wide"):
        fl.Scene(size=(1920, 1080), camera=fl.Camera(35.0))
    with pytest.warns(UserWarning, match="flake_size is taken as metres"):
        fl.Snow(flake_size=(1.0, 5.0, 20.0))


@pytest.mark.parametrize("mode", ["tile", "pixel"])
def test_a_depth_that_stays_and_one_that_changes_have_the_same_frames(mode: str):
    # What is found of a depth is kept while it stays: never for another depth, time or map.
    near, far = np.full((60, 80), 6.0, np.float32), np.full((60, 80), 40.0, np.float32)
    near[:30] = 90.0
    effect = fl.effects.TentSnow(fall=0.4, wind=(0.1, 0.0, 0.0), flakes=40, depth_mode=mode, seed=3)
    firsts = []
    for depth, haze in ((near, 0.2), (far, 0.2), (near, fl.Keys([(0.0, 0.1), (9.0, 0.4)]))):
        made = fl.Scene("#304050", size=(80, 60), effects=replace(effect, haze=haze), depth=depth)
        first, second, third = (made.render(t) for t in (1, 2, 1))
        again = made.replace(depth=depth.copy())
        assert np.array_equal(first, third) and np.array_equal(first, again.render(1))
        assert np.array_equal(second, again.render(2))
        firsts.append(first)
    assert all(not np.array_equal(firsts[0], other) for other in firsts[1:])


TALL, WIDE, FINE = 40, 64, 16
Y, X = ((one + 0.5) / FINE for one in np.mgrid[: TALL * FINE, : WIDE * FINE])
# A pole of 3 px and a hill's rim.
NEAR = (abs(X - 26.0 - 0.21 * Y) < 1.5) | (30.0 + 4.0 * np.sin(X / 9.0) < Y)
EFFECTS = [fl.Snow("heavy"), fl.Rain("downpour"), fl.Mist("fog"), fl.Snow("heavy", method="cone")]


def filtered(plane):
    return plane.reshape(TALL, FINE, WIDE, FINE).mean(axis=(1, 3)).astype(np.float32)


SHARE = filtered(NEAR)


def deep(path, near, far):
    """The same as samples, the far one first; none where there is nothing."""
    last = [(1.0, far)] if np.isfinite(far) else []
    samples = [last + ([(share, near)] if share else []) for share in SHARE.ravel().tolist()]
    rows = [(0.0, 0.0, 0.0, cover, z, z) for one in samples for cover, z in one]
    counts = np.array([len(one) for one in samples]).reshape(TALL, WIDE)
    write_deep(path, Deep(counts, np.array(rows)), half=False)
    return path


@pytest.mark.parametrize("far", [40.0, 1e10, np.inf])
@pytest.mark.parametrize("kind", ["linear", "inverse", "deep", "alpha", "picture"])
def test_weather_is_that_before_both_sides_by_their_shares(kind, far, tmp_path):
    # Of a filtered infinity nothing is known but that there is some.
    share = np.floor(SHARE) if kind == "linear" and far == np.inf else SHARE
    red, front = np.full((TALL, WIDE, 4), (0.8, 0.1, 0.05, 1.0), np.float32), None
    plates = [SHARE[..., None] * red if kind == "alpha" else 0.0 * red, red, 0.0 * red]
    if kind == "linear":
        depth = filtered(np.where(NEAR, 5.0, far))
    elif kind == "inverse":
        depth = fl.scene.DepthMap(SHARE, near=5.0, far=far, law="inverse")
    elif kind == "deep":
        depth = deep(tmp_path / "deep.exr", 5.0, far)
    else:
        depth = np.where((SHARE > 0.0) & (kind == "alpha"), 5.0, far)
        pole = fl.scene.Foreground(SHARE[..., None] * red, depth=5.0)
        front = pole if kind == "picture" else None
    for effect in EFFECTS:
        more = [fl.Mist(visibility=90.0, color=0.3)] if kind in ("alpha", "picture") else []
        effects = [replace(effect, color=0.6), *more]
        got, before, behind = (
            fl.Scene(plate, effects=effects, depth=one, fps=24, lens=None)
            for plate, one in zip(plates, (depth, 5.0, np.full((TALL, WIDE), far)), strict=True)
        )
        got = got.replace(foreground=front)
        seen = [one.render(3) if more else one.layers(3).alpha for one in (got, before, behind)]
        shares = share[..., None] if more else share
        wanted = shares * seen[1] + (1.0 - shares) * seen[2]
        np.testing.assert_allclose(seen[0], wanted, atol=1e-5)
        part = np.s_[5:33, 20:50]
        np.testing.assert_array_equal(got.render(3, region=part), got.render(3)[part])
        if front is not None:
            layers = got.layers(3)
            rebuilt = layers.background
            for layer in layers.layers.values():
                rebuilt = layer.rgba + (1.0 - layer.rgba[..., 3:]) * rebuilt
            whole = SHARE % 1.0 == 0.0
            np.testing.assert_allclose(rebuilt[whole], layers.image[whole], atol=1e-5)


def test_slopes_are_no_edges_and_the_limb_of_a_ball_is_one():
    rows, columns = np.mgrid[:TALL, :WIDE]
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
        fl.Scene("#405060", size=(WIDE, TALL), depth=path).layers(0)
    for near, words in ((-1.0, "depth must be greater than 0"), (np.nan, "depth .*nan")):
        with pytest.raises(ValueError, match=words):
            fl.Scene("#405060", size=(WIDE, TALL), depth=deep(path, near, 40.0)).layers(0)


@pytest.mark.parametrize("wall", [3.0, 8.0])
def test_flakes_too_small_to_be_drawn_hide_what_they_would(wall: float):
    snow = fl.effects.TentSnow(texture=0.0, haze=0.0, flake_density=66.0, near_depth=12.0)
    about = {"size": (64, 48), "camera": fl.Camera(76.8), "effects": snow}
    walls = (fl.Scene("#000000", depth=depth, **about) for depth in (wall, 1e5))
    before, all_ = (np.mean([w.layers(t).alpha.mean() for t in range(0, 400, 20)]) for w in walls)
    diameters = np.linspace(0.008, 0.024, 1001) * math.sqrt(8.0) / 6.0
    covered = 66.0 * 0.9 * math.pi / 4.0 * np.mean(diameters**2)
    lost = math.log((1.0 - before) / (1.0 - all_))
    assert lost == pytest.approx(covered * (12.0 * 1.04 - wall), rel=0.02)
    assert len(fl.flakes(fl.Scene("#000000", **about), 0)) < 1500

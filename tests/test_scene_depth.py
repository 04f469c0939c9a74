"""Depth and sun of a scene: where they come from, how they are fitted, and what is refused."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import fit, fit_nearest, write_layers, write_picture

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


@pytest.mark.parametrize("scale", [1e-90, 1.0, 1e90])
def test_the_sun(scale: float):
    unit = fl.scene.Sun((0, 3 * scale, -4 * scale)).unit()
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

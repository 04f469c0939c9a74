"""Depth and sun of a scene: where they come from, how they are fitted, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import fit, fit_nearest, read_depth, write_layers, write_picture
from flurries.scene.fingerprint import fingerprint

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
    got = fl.Scene(size, depth=value).depth_at(t)
    assert got is not None and got.dtype == np.float32 and got.flags.c_contiguous
    assert not got.flags.writeable and got.shape == size[::-1]
    return got


def test_a_wall_an_array_and_files(folder: Path):
    assert (depth(12.5) == 12.5).all() and (depth(3) == 3.0).all()
    for value in (FAR, FAR.astype(np.float64), FAR.tolist(), "z.exr", Path("view.exr")):
        assert np.array_equal(depth(value), FAR)
    half = FAR.astype(np.float16)
    assert np.array_equal(depth(half), half.astype(np.float32))
    assert fl.Scene((W, H)).depth_at(3.0) is None


def test_one_float_channel_is_depth_whatever_its_name(folder: Path):
    import OpenImageIO as oiio

    specification = oiio.ImageSpec(W, H, 1, "float")
    for name in ("y.exr", "y.tif"):
        out = oiio.ImageOutput.create(name)
        assert out.open(name, specification) and out.write_image(FAR[..., None])
        out.close()
        assert np.array_equal(depth(name), FAR)


def test_outside_the_data_window_is_the_sky(folder: Path):
    import OpenImageIO as oiio

    specification = oiio.ImageSpec(10, 8, 1, "float")
    specification.channelnames = ("Z",)
    specification.x, specification.y = 5, 4
    specification.full_width, specification.full_height = W, H
    out = oiio.ImageOutput.create("window.exr")
    assert out.open("window.exr", specification)
    assert out.write_image(np.full((8, 10, 1), 3.0, np.float32))
    out.close()
    got = read_depth("window.exr")
    assert got.shape == (H, W) and np.isinf(got).sum() == W * H - 80
    assert (got[4:12, 5:15] == 3.0).all()


def test_a_sequence_goes_with_the_frames(folder: Path):
    for t, number in [(7, 7), (7.99, 7), (8, 8), (9, 9), (8.0, 8)]:
        assert np.array_equal(depth("film.%d.exr", t), FAR + np.float32(number))
    scene = fl.Scene((W, H), depth="film.%d.exr")
    for t in (500, -3):
        with pytest.raises(ValueError, match=r"the depth film\.%d\.exr has 7-9"):
            scene.depth_at(t)
    held = scene.replace(extend="hold")
    for t, number in [(500, 9), (-3, 7)]:
        assert np.array_equal(held.depth_at(t), FAR + np.float32(number))
    first = scene.depth_at(8)
    assert scene.depth_at(8.5) is first, "fitted once"
    again = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(again.depth_at(8), first)


@pytest.mark.parametrize("white", ["near", "far"])
@pytest.mark.parametrize("law", ["linear", "inverse"])
@pytest.mark.parametrize("kind", ["uint8", "uint16", "float", "file", "color file"])
def test_greys_become_depths(white: str, law: str, kind: str, folder: Path):
    given: dict[str, Any] = {
        "uint8": GREY, "uint16": GREY.astype(np.uint16) * 257, "float": GREY / 255.0,
        "file": "grey.png", "color file": "plate.png",
    }  # fmt: skip
    got = depth(fl.DepthMap(given[kind], white=white, law=law, **MAP))
    g = GREY / 255.0
    w = 1.0 - g if white == "near" else g
    want = 2.0 + 28.0 * w if law == "linear" else 1.0 / (0.5 + w * (1 / 30.0 - 0.5))
    assert np.abs(got / want - 1.0).max() < 1e-5
    assert got[GREY == 255].mean() == pytest.approx(2.0 if white == "near" else 30.0, rel=1e-5)


def test_the_sky_may_be_painted():
    sky = fl.DepthMap(np.array([[0, 255, 51]], np.uint8), near=2.0, far=np.inf, law="inverse")
    got = depth(sky, size=(3, 1))[0]
    assert got[0] == np.inf and got[1] == 2.0 and got[2] == pytest.approx(10.0)


SIZES = [(60, 40), (30, 20), (120, 80), (80, 40), (60, 70), (33, 47), (1, 1), (7, 200)]


@pytest.mark.parametrize("size", SIZES)
def test_files_are_fitted_as_the_background_is_without_making_depths(size: Any, folder: Path):
    got = depth("z.exr", size=size)
    assert set(np.unique(got)) <= set(np.unique(FAR)), "a depth that nobody gave"
    # A ramp of light through the background's own fitting says where each pixel came from.
    rows, cols = np.mgrid[0:H, 0:W].astype(np.float32)
    ramp = fit(np.dstack([rows, cols, cols]), size, encoding="linear")
    near = fit_nearest(np.arange(H * W).reshape(H, W), size)
    inner = (rows.shape, np.s_[1:-1, 1:-1])[1]
    if min(size) < 5:
        return
    off = np.abs(near // W - ramp[..., 0])[inner], np.abs(near % W - ramp[..., 1])[inner]
    # Rounding to a pixel is half of one; the ramp's ends bend under the filter.
    assert np.median(off[0]) <= 0.5 and np.median(off[1]) <= 0.5
    assert np.quantile(off[0], 0.9) <= 0.75 and np.quantile(off[1], 0.9) <= 0.75


def test_a_frame_belongs_to_nobody_else():
    mine = FAR.copy()
    scene = fl.Scene((W, H), depth=mine)
    print_before = fingerprint(scene)
    mine[...] = 1.0
    assert np.array_equal(scene.depth_at(0), FAR) and fingerprint(scene) == print_before
    again = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(again.depth_at(0), FAR)


REFUSED: dict[str, tuple[Any, str]] = {
    "a NaN inside": (np.where(FAR < 2.0, np.nan, FAR), "depth .*got nan at \\[5, 5\\]"),
    "a hole of 0": (np.where(FAR < 2.0, 0.0, FAR), "depth .*infinity where nothing stands.*got 0"),
    "minus infinity": (np.where(FAR < 2.0, -np.inf, FAR), "depth .*got -inf"),
    "greys": (GREY, "depth .*DepthMap"),
    "a map turned": (fl.DepthMap(GREY.T, **MAP), "depth: source must have shape"),
    "no file": ("nope.exr", "nope.exr"), "no sequence": ("nope.%d.exr", "nope"),
    "a PNG": ("grey.png", "grey.png.*no float channel.*DepthMap"), "a NUL": ("a\0b", "depth"),
    "empty": ("", "depth"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refusals(name: str, folder: Path):
    value, words = REFUSED[name]
    with pytest.raises((ValueError, TypeError, OSError), match=words):
        fl.Scene((W, H), depth=value)


def test_a_file_with_a_hole_is_named(folder: Path):
    write_layers("hole.exr", {"depth": np.where(FAR < 2.0, np.nan, FAR).astype(np.float32)})
    scene = fl.Scene((W, H), depth="hole.exr", effects=[fl.TentSnow(flakes=10)])
    with pytest.raises(ValueError, match=r"hole\.exr: depth .*nan at"):
        scene.render(0)


# The sun -----------------------------------------------------------------------------------------


def test_the_sun():
    sun = fl.Sun((0, 3, -4), 0.5, 0.25)
    assert sun == fl.Sun((0.0, 3.0, -4.0), (0.5, 0.5, 0.5), 0.25)
    assert sun.unit() == pytest.approx([0.0, 0.6, -0.8], abs=1e-15)
    for scale in (1e-90, 1e90):
        assert fl.Sun((0, 3 * scale, -4 * scale)).unit() == pytest.approx([0, 0.6, -0.8], abs=1e-15)
    assert pickle.loads(pickle.dumps(sun)) == sun
    with pytest.raises(TypeError, match=r"sun must be a flurries\.Sun"):
        fl.Scene((W, H), sun=(0, 1, 0))  # type: ignore[arg-type]


# Scene files -------------------------------------------------------------------------------------

SAVED: dict[str, dict[str, Any]] = {
    "wall": {"depth": 3.25},
    "file": {"depth": "z.exr", "sun": fl.Sun()},
    "sequence": {"depth": Path("film.%d.exr")},
    "map": {"depth": fl.DepthMap("grey.png", near=1.0, far=np.inf, white="far", law="inverse"),
            "sun": fl.Sun((1.0, 2.0, 3.0), (1.0, 0.5, 0.25), 0.0)},
}  # fmt: skip


@pytest.mark.parametrize("name", SAVED)
def test_saved_and_loaded(name: str, folder: Path):
    scene = fl.Scene((W, H), **SAVED[name])
    (folder / "deep").mkdir()
    for file in ("scene.toml", "deep/scene.toml"):
        scene.save(file)
        again = fl.Scene.load(file)
        assert again.sun == scene.sun and fingerprint(again) == fingerprint(scene)
        for t in (7, 8):
            assert np.array_equal(again.depth_at(t), scene.depth_at(t))  # type: ignore[arg-type]


def test_a_fingerprint_sees_depth_and_sun(folder: Path):
    kinds: list[Any] = [None, 3.0, 4.0, FAR, FAR + 1, "z.exr", "film.%d.exr",
             *(fl.DepthMap(s, **{**MAP, **c}) for s in ("grey.png", GREY)
               for c in ({}, {"near": 1.0}, {"white": "far"}, {"law": "inverse"}))]  # fmt: skip
    prints = [fingerprint(fl.Scene((W, H), depth=kind)) for kind in kinds]
    prints += [
        fingerprint(fl.Scene((W, H), sun=sun))
        for sun in (fl.Sun(), fl.Sun((0, 1, 0)), fl.Sun(ambient=0.5), fl.Sun(color=0.5))
    ]
    assert len(set(prints)) == len(prints)
    assert prints[0] == fingerprint(fl.Scene((W, H)))
    before = fingerprint(fl.Scene((W, H), depth=fl.DepthMap("grey.png", **MAP)))
    write_picture(folder / "grey.png", 255 - GREY)
    assert fingerprint(fl.Scene((W, H), depth=fl.DepthMap("grey.png", **MAP))) != before


@pytest.mark.parametrize("value", [FAR, fl.DepthMap(GREY, **MAP)], ids=["array", "map"])
def test_arrays_are_not_saved(value: Any, tmp_path: Path):
    with pytest.raises(ValueError, match="depth"):
        fl.Scene((W, H), depth=value).save(tmp_path / "scene.toml")


MISTAKES: dict[str, tuple[str, int, str]] = {
    "zero": ("size = [6, 4]\ndepth = 0\n", 2, "depth"),
    "NaN": ("depth = nan\n", 1, "depth.*finite"),
    "a list": ("depth = [1, 2]\n", 1, "depth"),
    "unknown": ("[depth]\nsource = 'grey.png'\nnaer = 1\n", 3, "naer.*depth.*'near'"),
    "no source": ("[depth]\nnear = 1\nfar = 2\n", 1, "depth needs source"),
    "no far": ("[depth]\nsource = 'grey.png'\nnear = 1\n", 1, "depth needs far"),
    "source a number": ("[depth]\nsource = 3\nnear = 1\nfar = 2\n", 2, "source"),
    "backwards": ("[depth]\nsource = 'grey.png'\nnear = 3\nfar = 2\n", 4, "far"),
    "white": ("[depth]\nsource = 'g.png'\nnear = 1\nfar = 2\nwhite = 'x'\n", 5, "white"),
    "sun a number": ("sun = 3\n", 1, "sun must be a table"),
    "sun unknown": ("[sun]\ncolr = 1.0\n", 2, "colr.*sun.*'color'"),
    "sun nowhere": ("[sun]\ndirection = [0, 0, 0]\n", 2, "direction"),
    "sun bright": ("[sun]\ndirection = [0, 1, 0]\ncolor = 2\n", 3, "color"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_with_its_line(name: str, folder: Path):
    text, line, words = MISTAKES[name]
    (folder / "scene.toml").write_text(f"format = 3\n{text}")
    with pytest.raises((ValueError, TypeError), match=words) as caught:
        fl.Scene.load("scene.toml")
    assert "scene.toml" in str(caught.value) and f"line {1 + line}" in str(caught.value)


@pytest.mark.parametrize("way", ["array", "file", "transform"])
@pytest.mark.parametrize(
    "unit, said", [("inverse", "farther than 1 m; flurries.DepthMap"), ("mm", "divide millimetres")]
)
def test_depths_that_are_hardly_metres_are_warned_of(
    tmp_path: Path, way: str, unit: str, said: str
):
    metres = RNG.uniform(1.0, 6.0, (H, W)).astype(np.float32)
    given = 1.0 / metres if unit == "inverse" else 1000.0 * metres
    write_layers(tmp_path / "z.exr", {"depth": given})
    with pytest.warns(UserWarning, match=f"depth is taken as metres: .*{said}"):
        if way == "array":
            fl.Scene((W, H), depth=given)
        elif way == "file":
            depth(tmp_path / "z.exr")
        else:
            fl.augment.Fog(seed=1)(np.zeros((H, W, 3), np.uint8), depth=given)


def test_near_and_far_metres_are_not():
    """A desk, a wall, mountains under the sky, and a map of greys: warnings are errors here."""
    desk = RNG.uniform(0.3, 1.5, (H, W)).astype(np.float32)
    hills = RNG.uniform(500.0, 5000.0, (H, W)).astype(np.float32)
    hills[:9] = np.inf
    for given in (desk, np.full((H, W), 0.7, np.float32), np.full((H, W), 900.0), hills):
        fl.Scene((W, H), depth=given)
    fl.Scene((W, H), depth=fl.DepthMap(GREY, near=0.2, far=0.9))


def test_lengths_in_other_units_are_warned_of():
    with pytest.warns(UserWarning, match="focal length of 35 px for a picture 1920 px wide"):
        fl.Scene((1920, 1080), camera=fl.Camera(35.0))
    with pytest.warns(UserWarning, match="flake_size is taken as metres"):
        fl.Snow(flake_size=(1.0, 5.0, 20.0))


@pytest.mark.parametrize("mode", ["tile", "pixel"])
def test_a_depth_that_stays_and_one_that_changes_have_the_same_frames(mode: str):
    # What is found of a depth is kept while it stays: never for another depth, time or map.
    near, far = np.full((60, 80), 6.0, np.float32), np.full((60, 80), 40.0, np.float32)
    near[:30] = 90.0
    effect = fl.TentSnow(fall=0.4, wind=(0.1, 0.0, 0.0), flakes=40, depth_mode=mode, seed=3)
    grown = fl.Keys([(0.0, 0.1), (9.0, 0.4)])
    frames = []
    for depth, haze in ((near, 0.2), (far, 0.2), (near, grown)):
        made = fl.Scene((80, 60), "#304050", effects=replace(effect, haze=haze), depth=depth)
        frames.append([made.render(t) for t in (1, 2, 1)])
        again = made.replace(depth=depth.copy())
        assert all(
            np.array_equal(a, again.render(t)) for a, t in zip(frames[-1], (1, 2, 1), strict=True)
        )
        assert np.array_equal(frames[-1][0], frames[-1][2])
    assert not np.array_equal(frames[0][0], frames[1][0])
    assert not np.array_equal(frames[0][0], frames[2][0])

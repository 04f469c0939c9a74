"""Two eyes: disparities of what is rendered, anaglyphs, packings, files."""

import warnings
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
import measure
from every import every
from flurries import io, stereo
from measure import FOCAL, LONGEST, NEAR, TEXTURE, TORUS, scene
from stills import header_of

Camera, Snow, Scene = fl.Camera, fl.effects.TentSnow, fl.Scene
BANDS = (30.0, 24.0, 20.0, 16.0, 12.0, 10.0, 8.0, 6.0, 5.0)
SHARP = {**TEXTURE, **TORUS, "alias": "keep"}


def halves(shown: fl.Scene, t: float, **about: Any) -> tuple[np.ndarray, np.ndarray]:
    left, right = shown.stereo(t, **about)
    return left[..., 0].astype(float), right[..., 0].astype(float)


def test_eyes_are_cameras_moved_aside():
    lens = Camera(600.0, offset=(0.5, 0.1, -0.2), center_shift=(2.0, 1.0), rotation=(0.1, 0, 0))
    left, right = fl.stereo.eyes(lens, distance=0.07)
    assert left.offset == pytest.approx((0.465, 0.1, -0.2), abs=1e-15)
    assert right.offset == pytest.approx((0.535, 0.1, -0.2), abs=1e-15)
    assert left.center_shift == right.center_shift == (2.0, 1.0)
    assert left.rotation == right.rotation == lens.rotation and left.focal == 600.0
    assert fl.stereo.eyes(lens, distance=0.0) == (lens, lens)
    # At the depth of convergence both see one place; nearer and farther as the formula says.
    left, right = fl.stereo.eyes(Camera(600.0), distance=0.07, convergence=4.0)
    points = np.array([(0.3, -0.2, z) for z in (1.0, 4.0, 50.0)])
    seen = [fl.camera.project(points, eye, (300, 400))[0] for eye in (left, right)]
    want = 600.0 * 0.07 * (1.0 / points[:, 2] - 0.25)
    assert (seen[0] - seen[1])[:, 0] == pytest.approx(want, abs=1e-11)
    assert (seen[0] - seen[1])[:, 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("t", [0.0, 5.0, 1000.25])
def test_disparity_times_depth_is_constant_and_the_slope_is_minus_one(t: float):
    distance = 0.05
    pair = halves(scene(SHARP), t, distance=distance)
    depths, shifts = [], []
    for band in BANDS:
        moved, mean = measure.band_shift(pair, band)
        depths.append(NEAR * LONGEST / mean)
        shifts.append(-moved[0])
        assert abs(moved[1]) < 0.002 * abs(moved[0]) + 1e-3
    products = np.array(depths) * shifts
    assert np.abs(products / (FOCAL * distance) - 1.0).max() < 0.01
    slope = np.polyfit(np.log(depths), np.log(shifts), 1)[0]
    assert abs(slope + 1.0) < 0.01


def test_an_ambiguous_texture_is_told():
    # K = f b / (near_depth longest): 600 px, 65 mm, 3 m and 32 px give 0.406.
    def shown(near: float, **more: Any) -> fl.Scene:
        snow = Snow(wavelengths=(4.0, 32.0), near_depth=near, **{"flakes": 0, **more})
        return Scene(size=(128, 96), camera=Camera(600.0), effects=[snow])

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shown(3.0).stereo(0, distance=0.065)
        shown(2.0, texture=0.0, flakes=10).stereo(0, distance=0.065)
    with pytest.warns(UserWarning, match=r"effects\[0\]: .*0\.61 cycles.*near_depth above 2\.44"):
        shown(2.0).stereo(0, distance=0.065)


SHARED: list[tuple[str, list[Any]]] = [
    ("flakes and texture", [Snow("heavy")]),
    ("two of one effect", [Snow(flakes=300)] * 2),
    ("depth by pixel", [Snow(flakes=200, depth_mode="pixel", haze=0.2)]),
    ("rain", [fl.effects.TentRain(drops=400, near_depth=6.0)]),
    ("gusts", [Snow(flakes=200, wind=fl.Wind((0.5, 0.0, 0.0), gusts=0.5, swirl=0.2))]),
    ("gas", [fl.Mist("fog", wind=(0.3, 0.0, 0.1)), Snow(flakes=200)]),
    ("light of the background", [Snow(flakes=200, color="ambient")]),
]


@pytest.mark.parametrize("deep", [False, True], ids=["flat", "depth"])
@pytest.mark.parametrize(("name", "effects"), SHARED, ids=[name for name, _ in SHARED])
def test_both_eyes_at_once_have_the_bits_of_each_alone(name: str, effects: list[Any], deep: bool):
    rng = np.random.default_rng(3)
    picture = rng.integers(0, 255, (96, 128, 3)).astype(np.uint8)
    depth = rng.uniform(1.0, 30.0, (96, 1)).repeat(128, axis=1) if deep else None
    sun = fl.scene.Sun() if name == "gas" else None
    # The camera flies over a depth, and stands still without.
    camera = fl.CameraPath(Camera(FOCAL), velocity=(0.2, 0.0, 1.5 if deep else 0.0))
    shown = Scene(picture, camera=camera, effects=effects, depth=depth, sun=sun)
    both = fl.stereo.eyes(shown.camera.camera, distance=0.01, convergence=6.0)
    for about in ({}, {"region": np.s_[10:60, 30:99]}):
        pair = shown.stereo(4.5, distance=0.01, convergence=6.0, **about)
        for eye, got in zip(both, pair, strict=True):
            want = shown.render(4.5, eye=eye, **about)
            np.testing.assert_array_equal(got, want)
        if not about:
            assert not np.array_equal(*pair)


# In linear light.
CASES = {
    "red pair": ((1, 0, 0), (1, 0, 0), (0.41263, 0.33839, 0)),
    "blue pair": ((0, 0, 1), (0, 0, 1), (0.17483, 0, 1)),
    "white and black": ((1, 1, 1), (0, 0, 0), (1, 0, 0)),
    "black and white": ((0, 0, 0), (1, 1, 1), (0, 1, 1)),
}


@every("dtype", [np.float32, np.float64])
@every("case", CASES)
def test_anaglyph_cases(case, dtype):
    left, right, want = (np.array(c, dtype).reshape(1, 1, 3) for c in CASES[case])
    got = stereo.anaglyph(left, right)
    assert got.dtype == dtype
    np.testing.assert_allclose(got, want, atol=5e-6 if case.endswith("pair") else 2e-3)


@every("matrix", ["lsq2001", "lcd2009"])
def test_grey_pairs_stay_grey(matrix):
    # The matrices' rows sum to 1 within .001; clipped at white.
    levels = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    got = stereo.anaglyph(levels / 255.0, levels / 255.0, matrix=matrix)
    assert np.abs(got - levels / 255.0).max() < 1.2e-3
    got = stereo.anaglyph(levels, levels, matrix=matrix).astype(int)
    assert np.abs(got - levels).max() <= 1 and np.ptp(got, axis=2).max() <= 1


def test_integers_go_through_linear_light():
    rng = np.random.default_rng(1)
    for dtype, limit in ((np.uint8, 0), (np.uint16, 1)):
        left, right = rng.integers(0, np.iinfo(dtype).max + 1, (2, 70, 90, 3)).astype(dtype)
        light = [io.srgb_to_linear(p / np.iinfo(dtype).max) for p in (left, right)]
        a, b = (np.array(m) for m in stereo.MATRICES["lsq2001"])
        mixed = np.clip(light[0] @ a.T + light[1] @ b.T, 0, 1)
        want = np.rint(io.linear_to_srgb(mixed) * np.iinfo(dtype).max)
        got = stereo.anaglyph(left, right)
        assert got.dtype == dtype
        off = np.abs(got - want)
        # float32 light, where a value lies on the border of two levels.
        assert off.max() <= 1 and (off > limit).mean() < 2e-3
        # On display values it would be far off: the negative control.
        shown = np.clip(left / np.iinfo(dtype).max @ a.T + right / np.iinfo(dtype).max @ b.T, 0, 1)
        assert np.abs(shown - io.linear_to_srgb(mixed)).max() > 0.2


@every("dtype", [np.uint8, np.uint16, np.float32])
@every("shape", [(4, 6, 3), (4, 6, 4), (4, 6)])
def test_packings(shape, dtype):
    left, right = np.random.default_rng(3).integers(0, 200, (2, *shape)).astype(dtype)
    wide, tall = stereo.side_by_side(left, right), stereo.over_under(left, right)
    assert wide.dtype == dtype
    np.testing.assert_array_equal(wide, np.concatenate([left, right], axis=1))
    np.testing.assert_array_equal(tall, np.concatenate([left, right], axis=0))
    crossed = stereo.side_by_side(left, right, cross=True)
    np.testing.assert_array_equal(crossed, stereo.side_by_side(right, left))
    with pytest.raises(ValueError, match="right must"):
        stereo.over_under(left, right[:3])


def pair(left, right):
    return {"left": {"rgba": left}, "right": {"rgba": right}}


@pytest.mark.parametrize(("half", "channels"), [(True, 3), (False, 4)])
def test_stereo_exr(half, channels, tmp_path):
    left, right = np.random.default_rng(4).random((2, 70, 33, channels), np.float32) * 2
    path, again = tmp_path / "pair.exr", tmp_path / "again.exr"
    for file in (path, again):
        io.write_layer_views(file, pair(left, right), half=half, metadata={"frame": 7})
    got = io.read_views(path)
    for eye, want in zip(got, (left, right), strict=True):
        stored = want.astype(np.float16).astype(np.float32) if half else want
        np.testing.assert_array_equal(eye, stored)
    # Other readers see the left eye, and the note.
    np.testing.assert_array_equal(io.read_picture(path).pixels, got[0][..., :3])
    assert header_of(path)["frame"] == "7"
    assert again.read_bytes() == path.read_bytes()


def test_the_other_layout_of_views_is_read(tmp_path):
    # One part, the names of the right eye's channels marked.
    left, right = np.random.default_rng(4).random((2, 4, 5, 3), np.float32)
    spec = oiio.ImageSpec(5, 4, 6, "float")
    spec.channelnames = ("R", "G", "B", "right.R", "right.G", "right.B")
    spec.attribute("multiView", oiio.TypeDesc("string[2]"), ("left", "right"))
    output = oiio.ImageOutput.create("b.exr")
    assert output.open(str(tmp_path / "b.exr"), spec)
    assert output.write_image(np.concatenate([left, right], axis=2)) and output.close()
    for eye, want in zip(io.read_views(tmp_path / "b.exr"), (left, right), strict=True):
        np.testing.assert_array_equal(eye, want)
    io.write_picture(tmp_path / "c.exr", left)
    with pytest.raises(ValueError, match="left and a right view"):
        io.read_views(tmp_path / "c.exr")

"""Two eyes: every band of the texture at the depth that it stands for, flakes at their own."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import flurries as fl
import measure
from measure import FOCAL, LONGEST, NEAR, TEXTURE, TORUS, scene

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
        moved, mean = measure.band_shift([pair], band, 0.04)
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

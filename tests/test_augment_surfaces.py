"""The rest of the weather: light under its sky, wet ground, drops on the lens."""

import math
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from flurries.augment import Fog, Ground, Rainfall
from flurries.augment.corrupt import corrupt
from flurries.io import linear_to_srgb, srgb_to_linear
from test_augment import DTYPES, PICTURE
from test_augment_corrupt import lines

SUN = math.exp(-50.0 * math.log(20.0) / 100.0)


def test_a_sky_leaves_its_own_light_and_half_of_the_shadows():
    fog = Fog(visibility=100.0, patches=0.0, shade=50.0)
    light = np.full((64, 96, 3), 0.4)
    seen = srgb_to_linear(fog(linear_to_srgb(light), depth=1e-6))
    assert np.allclose(seen, 0.4 * (0.3 + 0.7 * SUN), rtol=1e-4)
    light[:, 48:] *= 0.1
    seen = srgb_to_linear(fog(linear_to_srgb(light), depth=1e-6))
    # In stops, far from the border; and what is fine keeps all of its contrast.
    assert seen[30, 5, 0] / seen[30, 90, 0] == pytest.approx(10.0 ** (0.5 + 0.5 * SUN), rel=1e-3)
    light[30, 90] *= 2.0
    finer = srgb_to_linear(fog(linear_to_srgb(light), depth=1e-6))
    assert finer[30, 90, 0] / finer[28, 90, 0] == pytest.approx(2.0, rel=0.05)


def test_wet_ground_is_darker_and_a_mirror():
    light = np.random.default_rng(1).random((40, 60, 3))
    wet = np.random.default_rng(2).random((40, 60))
    ground = Ground(horizon=0.5)
    how = {"amount": 0.0, "ground": ground, "focal": 1.0}
    seen = srgb_to_linear(Rainfall(**how)(linear_to_srgb(light), index=0, wet=wet))
    assert np.allclose(seen[:20], light[:20], atol=1e-5)
    for row in range(20, 40):
        below = row - 19.5
        mirror = 0.02 + 0.98 * (1.0 - below / math.hypot(below, 60.0)) ** 5
        dark = light[row] / (light[row] + 1.77 * (1.0 - light[row]))
        under = (1.0 - mirror) * dark + mirror * light[39 - row]
        want = light[row] + wet[row][:, None] * (under - light[row])
        assert np.allclose(seen[row], want, atol=1e-5)
    dry = Rainfall(**how).apply((PICTURE, PICTURE), index=0, wet=[None, np.zeros((48, 64))])
    assert np.array_equal(dry[0].image, PICTURE) and np.array_equal(dry[1].image, PICTURE)
    with pytest.raises(ValueError, match="wet"):
        Rainfall()(PICTURE, wet=2.0 * wet)


def test_drops_show_what_is_around_them_upside_down_and_no_label_knows_them():
    down, across = np.mgrid[:300, :400] / 400.0
    picture = np.stack([down, across, np.full_like(down, 0.5)], axis=-1)
    wet, dry = (Rainfall(severity=1, seed=3, drops=drops) for drops in (12, 0))
    seen, plain = (one.apply(picture, index=4, boxes=[[5, 5, 90, 90]]) for one in (wet, dry))
    assert np.array_equal(seen.alpha, plain.alpha) and seen.occlusion == plain.occlusion
    changed = np.abs(seen.image - plain.image).max(axis=-1) > 0.02
    assert 0.003 < changed.mean() < 0.05
    # Inside, what is further down in a drop is from further up; at the edges slopes go up, too.
    for axis in (0, 1):
        slope = np.gradient(seen.image[..., axis], axis=axis)
        assert np.median(slope[changed]) < -5.0 / 400.0
    # They stay in a film, and each eye has its own.
    later = wet.apply(picture, index=4, time=2.0).image
    moved = np.abs(later - dry.apply(picture, index=4, time=2.0).image).max(axis=-1) > 0.02
    assert (moved == changed).mean() > 0.99
    left, right = Rainfall(amount=0.0, seed=3, drops=9).pair(PICTURE, PICTURE, index=4)
    assert not np.array_equal(left, right)


def test_a_set_has_them(tmp_path: Path):
    wet = np.zeros(PICTURE.shape[:2], np.uint8)
    wet[30:] = 255
    for name, plane in (("rgb", PICTURE), ("masks", wet)):
        (tmp_path / "in" / name).mkdir(parents=True)
        fl.io.write_picture(tmp_path / "in" / name / "a.png", plane)
    how = {"weather": "rain", "severity": 2, "workers": 1, "shade": 400.0, "drops": 4.0}
    made = corrupt(tmp_path / "in", tmp_path / "out", labels={"wet": ("rgb", "masks")}, **how)
    record = lines(tmp_path / "out")["rain/2/rgb/a.png"]["record"]
    assert (record["shade"], record["drops"]) == (400.0, 4.0)
    want = fl.augment.replay(record)(PICTURE, wet=wet > 0)
    assert np.array_equal(fl.io.read_picture(made.written[0]).pixels, want)


@pytest.mark.parametrize("name", DTYPES)
def test_all_kinds_of_pictures_have_them(name: str):
    picture, full = DTYPES[name], {"u1": 255.0, "u2": 65535.0}.get(name, 1.0)
    how = {"index": 0, "wet": np.ones(picture.shape[:2])}
    rain = Rainfall(severity=4, seed=2, shade=300.0, drops=5)
    seen = rain(picture, **how)
    assert seen.dtype == picture.dtype
    assert np.abs(seen / full - rain(DTYPES["f8"], **how)).max() < 3e-3 + 0.003 * (name == "u1")
    grey = rain(picture[..., 0], **how)
    assert grey.shape == picture.shape[:2]

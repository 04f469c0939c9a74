"""How much an amount is, and the weather beside the air: sky, wet ground, drops on the lens."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skimage import data
from skimage.measure import label
from skimage.metrics import structural_similarity

import flurries as fl
from flurries import _core
from flurries.augment import Fog, Ground, Rainfall, contrast_loss
from flurries.augment.corrupt import corrupt
from flurries.io import linear_to_srgb, srgb_to_linear
from test_augment import DTYPES, EACH, KINDS, PICTURE
from test_augment_corrupt import lines


@EACH
def test_a_severity_is_that_of_a_scene(kind: str):
    """Rate, number, visibility and what is lost, but for flakes nearer than those of data sets."""
    for severity in range(1, 6):
        own, _ = KINDS[kind](severity=severity).strength()
        scene: Any = {"snow": fl.Snow, "rain": fl.Rain, "fog": fl.Mist}[kind](severity=severity)
        theirs = scene.strength()
        assert own.visibility == pytest.approx(theirs.visibility, rel=1e-3)
        assert own.rate == pytest.approx(theirs.rate) and f"{own.visibility:.4g} m" in str(own)
        lost = contrast_loss(severity / 5, weather=kind)  # type: ignore[arg-type]
        assert own.cover == lost
        if kind != "fog":
            assert own.density == pytest.approx(theirs.density)
            assert lost == pytest.approx(theirs.cover, rel=0.03)
        assert f"covers {100 * lost:.3g} %" in repr(KINDS[kind](severity=severity))


def test_hard_is_above_natural_at_every_step():
    for kind in KINDS:
        scales = [
            [contrast_loss(n / 20, profile=profile, weather=kind) for n in range(21)]  # type: ignore[arg-type]
            for profile in ("natural", "hard")
        ]
        assert scales[0][0] == scales[1][0] == 0.0 and (np.diff(scales) > 0.0).all()
        assert (np.array(scales[1][1:]) > scales[0][1:]).all()


def lost_by(weather: Any, size: int, count: int, depth: Any = None) -> np.ndarray:
    """The contrast of two pictures that is lost, of each of some draws."""
    dark = np.zeros((size, size))
    both = (
        [weather(dark + level, index=k, depth=depth).mean() for k in range(count)]
        for level in (1.0, 0.0)
    )
    return 1.0 - np.subtract(*both)


@EACH
@pytest.mark.parametrize("profile", ["natural", "hard"])
@pytest.mark.parametrize("severity, size, count", [
    (1, 64, 96), (1, 512, 24), (3, 64, 96), (3, 224, 48), (3, 2160, 2), (5, 64, 96), (5, 512, 24),
])  # fmt: skip
def test_a_severity_takes_its_share_at_every_size(
    kind: str, profile: str, severity: int, size: int, count: int
):
    """5 %, and what falls to three standard errors."""
    lost = lost_by(KINDS[kind](severity=severity, profile=profile, seed=1), size, count)
    error = 3.0 * np.std(lost) / math.sqrt(count)
    wanted = contrast_loss(severity / 5, profile=profile, weather=kind)  # type: ignore[arg-type]
    assert np.mean(lost) == pytest.approx(wanted, rel=0.05, abs=error)


STEPS = np.exp(np.random.default_rng(1).uniform(np.log(3.0), np.log(300.0), (256, 256)))


@EACH
@pytest.mark.parametrize("ground, depth", [
    (fl.augment.Ground(), None), (None, STEPS), (None, 40.0),
])  # fmt: skip
def test_severities_with_grounds_and_depths(kind: str, ground: Any, depth: Any):
    """Hard weather takes its share before any depths, natural weather what lies before them."""
    hard = KINDS[kind](severity=3, seed=2, ground=ground, profile="hard")
    wanted = contrast_loss(0.6, profile="hard", weather=kind)  # type: ignore[arg-type]
    assert lost_by(hard, 256, 6, depth).mean() == pytest.approx(wanted, rel=0.05)
    plain = KINDS[kind](severity=3, seed=2, ground=ground)
    way = ground.rows((256, 256), 1.2 * 256) if depth is None else np.asarray(depth, np.float64)
    end = 400.0 if kind == "fog" else 60.0
    way = np.minimum(way, end) if kind == "fog" else np.clip(way, 1.5, end) - 1.5
    # Without a depth the sky of fog is 60 m away.
    thick = 3.0 / plain.strength()[0].visibility
    wanted = 1.0 - np.exp(-thick * way).mean()
    assert lost_by(plain, 256, 6, depth).mean() == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("kind", ["snow", "rain"])
def test_a_veil_takes_the_place_of_flakes(kind: str):
    share, wanted = 0.4, contrast_loss(0.6, weather=kind)  # type: ignore[arg-type]
    seen = KINDS[kind](severity=3, seed=2, veil=share).apply(np.zeros((224, 224)), index=0).alpha
    assert seen.mean() == pytest.approx(wanted, rel=0.03)
    assert seen.min() >= 1.0 - (1.0 - wanted) ** share - 1e-6
    whole = KINDS[kind](severity=3, seed=2, veil=1.0).apply(np.zeros((9, 9)), index=0).alpha
    assert np.ptp(whole) == 0.0 and whole[0, 0] == pytest.approx(wanted, rel=1e-5)


def test_extinction_is_the_root():
    rng = np.random.default_rng(2)
    for _ in range(50):
        density = np.maximum(1.0 + 0.3 * rng.standard_normal(7), 0.05)
        ways = np.outer(rng.uniform(0.0, 200.0, 100), density).ravel()
        loss = rng.uniform(0.12, 0.6)
        found = _core.extinction(ways, loss)
        assert np.exp(-found * ways).mean() == pytest.approx(1.0 - loss, rel=1e-6)
    assert _core.extinction(np.zeros(9), 0.05) == math.inf


@pytest.mark.parametrize("kind", ["snow", "rain"])
@pytest.mark.parametrize("profile, size", [
    ("natural", 224), ("natural", 1024), ("hard", 128), ("hard", 512),
])  # fmt: skip
def test_structure_grows_with_every_severity(kind: str, profile: str, size: int):
    """The deviation of what is finer than 8 px; and of hard weather a veil is at most a third."""
    fine = []
    for severity in range(1, 6):
        weather = KINDS[kind](severity=severity, seed=3, profile=profile)
        alphas = [weather.apply(np.zeros((size, size)), index=k).alpha for k in range(2)]
        rows = np.stack(alphas)[:, : size // 8 * 8, : size // 8 * 8].astype(np.float64)
        cells = rows.reshape(2, size // 8, 8, size // 8, 8)
        fine.append((cells - cells.mean(axis=(2, 4), keepdims=True)).std())
        if profile == "hard":
            assert np.quantile(rows, 0.1, axis=2).mean() <= rows.mean() / 3.0
    # In the heaviest snow flakes hide one another: it has less structure than the one before.
    heaviest = fine.pop() if (kind, profile) == ("snow", "hard") else np.inf
    assert (np.diff(fine) > 0.0).all() and heaviest > fine[2], fine


PHOTOGRAPHS = ("astronaut", "coffee", "camera", "rocket")


@pytest.mark.parametrize("size", [128, 224, 512, 1024])
def test_hard_flakes_are_as_large_in_pixels_as_those_of_photographs(size: int):
    """Areas above 18 of 255, where flakes are few: no blobs at any size."""
    snow = fl.augment.Snowfall(amount=0.02, profile="hard", seed=4)
    seen = [snow(np.zeros((size, size), np.float32), index=k) > 18 / 255 for k in range(8)]
    areas = np.concatenate([np.bincount(label(one, connectivity=1).ravel())[1:] for one in seen])
    middle, most, nearly_all = np.percentile(areas, [50, 90, 99])
    assert 1 <= middle <= 4 and 7 <= most <= 22 and nearly_all <= 41 and areas.max() <= 80


@EACH
@pytest.mark.parametrize("size", [128, 512])
def test_similarity_falls_at_every_step_and_hard_is_below_natural(kind: str, size: int):
    found = np.zeros((2, 5))
    for number, name in enumerate(PHOTOGRAPHS):
        grey = fl.io.fit(np.ascontiguousarray(getattr(data, name)()), (size, size))
        grey = grey if grey.ndim == 2 else np.ascontiguousarray(grey[..., 1])
        for (row, column), _ in np.ndenumerate(found):
            profile = ("natural", "hard")[row]
            weather = KINDS[kind](severity=column + 1, profile=profile, seed=3)
            seen = weather(grey, index=10 * number)
            found[row, column] += structural_similarity(grey, seen) / len(PHOTOGRAPHS)
    assert (np.diff(found) < 0.0).all() and (found[1] < found[0]).all(), found


def test_far_flakes_leave_no_lattice():
    """What alternates from pixel to pixel is no stronger than the waves beside it."""
    snow = fl.augment.Snowfall(severity=5, seed=2)
    alphas = [snow.apply(np.zeros((128, 128)), index=k).alpha for k in range(8)]
    power = sum(np.abs(np.fft.fft2(a.astype(np.float64) - a.mean())) ** 2 for a in alphas)
    for along in (power, power.T):
        beside = along[54:64].sum(axis=1).mean()
        assert along[64].sum() < 1.15 * beside


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

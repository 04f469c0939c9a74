"""Weather by depth: fog's law, holes, grounds, and the labels that come along."""

import json
import math
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import flurries as fl
from flurries.augment import Fog, Ground, Snowfall, occlusion
from flurries.augment.air import _UNEVEN
from test_augment import DTYPES, EACH, KINDS, PICTURE


def test_fog_is_koschmieder():
    depth = np.random.default_rng(3).uniform(1.0, 300.0, (40, 50))
    depth[:5] = np.inf
    picture = np.random.default_rng(4).random((40, 50, 3))
    # Patches are a field of 120 points along the longer side, read between them.
    field = fl.spectral.field((98, 122), drift=(0.0, 0.0), seed=5, texture=_UNEVEN)
    between = map_coordinates(field.astype(float), (np.mgrid[:40, :50] + 0.5) * 120 / 50, order=1)
    # Its air ends at two visibilities, and 60 m at least, as that of `Mist` does.
    for visible, end, patches in ((80.0, 160.0, 0.0), (20.0, 60.0, 0.8)):
        fog = Fog(visibility=visible, patches=patches, color=(0.7, 0.8, 0.9), weather_seed=5)
        thick = np.maximum(1.0 + patches * between, 0.0) * math.log(20.0) / visible
        clear = np.exp(-np.minimum(depth, end) * thick)[..., None]
        want = picture * clear + np.array([0.7, 0.8, 0.9]) * (1.0 - clear)
        assert np.abs(fog(picture, index=0, depth=depth) - want).max() < 1e-6


@EACH
def test_what_is_beyond_the_air_looks_alike_and_keeps_its_depth(kind: str):
    hard = {"severity": 4, "profile": "hard", "exposure": 1e-4}
    law: dict[str, Any] = {"visibility": 40.0} if kind == "fog" else hard
    seen = []
    for wall in (1e5, 1e10, np.inf):
        depth = np.full((96, 128), wall)
        one = KINDS[kind](**law, seed=1).apply(
            np.zeros((96, 128)), index=0, depth=depth, eye="left"
        )
        bare = one.depth > 12.0
        assert bare.any() and bare.all() == (kind == "fog")
        assert (one.depth[bare] == np.float32(wall)).all()
        assert np.array_equal(one.disparity == 0.0, bare & (wall == np.inf))
        seen.append(one.image)
    assert np.ptp(seen, axis=0).max() < 1e-6


def test_flakes_stay_behind_what_is_nearer():
    wall = np.full((128, 128), 200.0)
    wall[:, :64] = 4.0

    def fallen(depth: Any, profile: str) -> np.ndarray:
        snow = Snowfall(severity=5, seed=1, profile=profile)  # type: ignore[arg-type]
        return snow.apply(np.zeros((128, 128)), index=0, depth=depth).alpha

    far, near, nothing, half = (fallen(depth, "natural") for depth in (200.0, 4.0, 0.3, wall))
    assert far.mean() > 3.0 * near.mean() > 0.0 and nothing.max() == 0.0
    walls = [np.full((128, 128), depth) for depth in (0.5, 2.0, 4.0, 30.0, 1e3, 1e10, np.inf)]
    assert (np.diff([fallen(depth, "natural").mean() for depth in walls]) >= 0.0).all()
    assert np.abs(half - np.where(wall > 100.0, far, near)).max() < 1e-6
    # Of hard weather there is as much more as makes up for near things, four times at most.
    lost = fl.augment.contrast_loss(1.0, profile="hard")
    seen = [fallen(depth, "hard").mean() for depth in (200.0, wall, 0.8, 0.54)]
    assert seen[:3] == pytest.approx([lost] * 3, rel=0.05) and seen[3] < 0.5 * lost
    assert fallen(0.3, "hard").max() == 0.0


def filled(depth: np.ndarray) -> np.ndarray:
    """Holes filled pixel by pixel, as the page says."""
    result = depth.copy()
    known = ~(np.isnan(depth) | (depth == 0.0))
    rows = [i for i in range(len(depth)) if known[i].any()]
    for i, j in np.ndindex(depth.shape):
        row = min(rows, key=lambda k: (abs(k - i), k))
        column = min(np.flatnonzero(known[row]), key=lambda k: (abs(k - j), k))
        result[i, j] = depth[row, column]
    return result


@EACH
def test_holes_in_a_depth_are_filled_from_their_row(kind: str):
    rng = np.random.default_rng(9)
    depth = rng.uniform(3.0, 60.0, (48, 64))
    holes = rng.random((48, 64)) < 0.4
    holes[:7] = holes[20:29] = holes[-1] = True
    depth[0, 3] = depth[30, 5] = np.inf
    holes[0, 3] = holes[30, 5] = False
    depth[holes] = np.where(rng.random(int(holes.sum())) < 0.5, np.nan, 0.0)
    weather = KINDS[kind](severity=4, seed=1)
    whole = filled(depth)
    assert np.array_equal(
        weather(PICTURE, index=2, depth=depth), weather(PICTURE, index=2, depth=whole)
    )
    # The label has holes where the depth had them and no flake is, and nothing is made up.
    seen = weather.apply(PICTURE, index=2, depth=depth)
    plain = weather.apply(PICTURE, index=2, depth=whole)
    nearer = plain.depth < KINDS[kind](amount=0.0).apply(PICTURE, depth=whole).depth
    label = np.where(nearer, plain.depth, depth.astype(np.float32))
    assert np.array_equal(seen.depth[holes], label[holes], equal_nan=True)
    assert np.array_equal(seen.depth[~holes], plain.depth[~holes])
    assert np.array_equal(seen.soft_depth[holes], depth[holes].astype(np.float32), equal_nan=True)


@pytest.mark.parametrize("ground", [Ground(), Ground(horizon=0.3, height=3.0, far=80.0)])
def test_a_ground_is_found_in_a_depth(ground: Ground):
    rng = np.random.default_rng(3)
    rows = np.repeat(ground.rows((240, 320), 1.2 * 320), 320, axis=1).astype(np.float64)
    depth = rows * np.exp(0.03 * rng.standard_normal((240, 320)))
    depth[60:200, 40:90] = 6.0  # what stands there
    depth[rng.random((240, 320)) < 0.2] = 0.0
    depth[:20] = np.inf
    found = Ground.from_depth(depth, focal=1.2)
    assert found.horizon == pytest.approx(ground.horizon, abs=0.03)
    assert found.height == pytest.approx(ground.height, rel=0.05)
    below = slice(150, 240)
    got = found.rows((240, 320), 1.2 * 320)[below]
    assert np.allclose(got, ground.rows((240, 320), 1.2 * 320)[below], rtol=0.05)
    for none in (rng.uniform(2.0, 9.0, (64, 64)), np.full((64, 64), 5.0), np.zeros((64, 64))):
        with pytest.raises(ValueError, match="depth must"):
            Ground.from_depth(none)


def test_a_ground_comes_from_files():
    ground = {"horizon": 0.3, "height": 2.0}
    for kind in KINDS.values():
        weather = kind(ground=ground, severity=3, seed=1)
        assert weather.ground == Ground(**ground)
        record = json.loads(json.dumps(weather.record(index=2)))
        assert fl.augment.replay(record).record(index=2) == weather.record(index=2)
    with pytest.raises(TypeError, match="no 'horizont'; did you mean 'horizon'"):
        Snowfall(ground={"horizont": 0.3})


def test_relative_depths_become_metres():
    greys = np.random.default_rng(5).integers(0, 256, (48, 64), dtype=np.uint8)
    painted = fl.scene.DepthMap(greys, near=2.0, far=80.0, law="inverse")
    fog = Fog(visibility=50.0, seed=1)
    metres = painted.depth_of(greys / 255.0)
    assert np.allclose(
        fog(DTYPES["f8"], index=0, depth=painted), fog(DTYPES["f8"], index=0, depth=metres),
        atol=1e-6,
    )  # fmt: skip


def test_the_ground_is_a_plane_with_a_horizon():
    rows = Ground(horizon=0.5, height=2.0, far=50.0).rows((100, 100), 120.0)[:, 0]
    assert (np.diff(rows) < 0.0).all() and rows[0] == pytest.approx(50.0, rel=0.02)
    # Far below the horizon the rounding is gone: 1 / (y / (f h) + 1 / far).
    assert rows[99] == pytest.approx(1.0 / (49.5 / 240.0 + 1.0 / 50.0), rel=0.02)


def test_occlusion_is_the_mean_opacity():
    alpha = np.random.default_rng(6).random((30, 40)).astype(np.float32)
    boxes = [[0, 0, 40, 30], [3, 4, 17, 9], [2.5, 3.25, 2.75, 7.0], [-5, -5, 10, 10],
             [50, 50, 60, 60], [4, 4, 4, 9], *([x / 3, 35, 20, 40] for x in range(9))]  # fmt: skip
    found = occlusion(alpha, boxes)
    # Each pixel cut into 8 x 8 parts: exact for eighths.
    fine = np.kron(alpha.astype(np.float64), np.ones((8, 8)))
    for (x0, y0, x1, y1), value in zip(boxes, found, strict=True):
        columns = slice(max(int(8 * x0), 0), max(int(8 * x1), 0))
        part = fine[max(int(8 * y0), 0) : max(int(8 * y1), 0), columns]
        wanted = part.mean() if part.size else math.nan
        assert value == pytest.approx(wanted, abs=1e-12, nan_ok=True)


@EACH
def test_labels_come_along(kind: str):
    rng = np.random.default_rng(7)
    shape = (384, 512)
    boxes, masks = np.array([[1.0, 2.0, 30.0, 40.0]]), [rng.random(shape) > 0.5]
    depth = rng.uniform(6.0, 60.0, shape)
    flow = rng.standard_normal((*shape, 2)).astype(np.float32)
    # So short an exposure that drops hide what is behind them.
    sharp = {} if kind == "fog" else {"exposure": 1e-4, "profile": "hard"}
    seen = KINDS[kind](severity=5, seed=1, **sharp).apply(
        np.zeros(shape), index=0, boxes=boxes, masks=masks, depth=depth, flow=flow, motion=True
    )
    assert seen.boxes is boxes and seen.masks is masks
    metres = depth.astype(np.float32)
    covered = seen.depth < metres
    # Fog hides, but is nowhere in particular.
    assert covered.any() == (kind != "fog")
    assert np.array_equal(seen.depth[~covered], metres[~covered])
    assert (seen.alpha[covered] > 0.5).all()
    changed = (seen.flow != flow).any(axis=-1)
    assert changed[covered].all()
    assert np.array_equal(seen.flow[changed], seen.motion[changed])


@EACH
def test_soft_labels_are_means_by_what_is_seen(kind: str):
    rng = np.random.default_rng(8)
    shape = (96, 128)
    depth, flow = rng.uniform(6.0, 60.0, shape), rng.standard_normal((*shape, 2))
    boxes = [[4.0, 5.0, 60.0, 80.0], [0.0, 0.0, 128.0, 96.0]]
    depth[:9], masks = np.inf, np.zeros(shape, np.int32)
    masks[10:40, 10:50], masks[30:60, 40:90] = 26001, 7
    how: dict[str, Any] = {"index": 0, "depth": depth, "eye": "left", "distance": 0.5}
    weather = KINDS[kind](severity=4, seed=1, **({} if kind == "fog" else {"veil": 0.3}))
    seen = weather.apply(np.zeros(shape), flow=flow, boxes=boxes, masks=masks, motion=True, **how)
    planes = [seen.alpha[masks == number] for number in (7, 26001)]
    assert seen.instances.tolist() == [7, 26001]
    assert seen.instance_occlusion == pytest.approx([plane.mean() for plane in planes], rel=1e-5)
    assert seen.instance_visibility == pytest.approx([(plane < 0.5).mean() for plane in planes])
    bare = np.stack([masks == number for number in (7, 26001, 1)])
    same = weather.apply(np.zeros(shape), masks=bare, **how)
    assert same.instances.tolist() == [0, 1, 2] and math.isnan(same.instance_occlusion[2])
    assert np.array_equal(same.instance_visibility[:2], seen.instance_visibility)
    parallax = 1.2 * 128 * 0.5
    assert np.allclose(seen.disparity, parallax / seen.depth, rtol=1e-6)
    assert (seen.weather_disparity <= parallax / 0.3).all()
    assert ((seen.weather_disparity > parallax / 61.0) == (seen.falling[..., 3] > 0.0)).mean() > 0.9
    depth = np.where(depth == np.inf, seen.depth.max(), depth)
    way, nearness, alpha = seen.falling[..., :2], seen.falling[..., 2], seen.falling[..., 3]
    assert seen.falling.shape == (*shape, 4) and seen.falling.dtype == np.float32
    # Something falls in rain and snow; and the veil is over it.
    assert (alpha.max() > 0.05) == (kind != "fog") and (alpha <= seen.alpha + 1e-4).all()
    left = 1.0 - alpha[..., None]
    assert np.allclose(seen.soft_flow, left * flow + way, atol=1e-4)
    assert np.allclose(1.0 / seen.soft_depth, left[..., 0] / depth + nearness, atol=1e-5)
    if kind != "fog":
        # Its own depth is between the nearest flake's and the farthest's.
        some = alpha > 0.05
        metres = alpha[some] / nearness[some]
        assert metres.min() > 1.0 and metres.max() < 61.0
        assert (way[..., 1][some] > 0.0).all()
    for number, (x0, y0, x1, y1) in enumerate(np.array(boxes, int)):
        part = seen.alpha[y0:y1, x0:x1]
        assert seen.occlusion[number] == pytest.approx(part.mean(), rel=1e-5)
        assert seen.visibility[number] == pytest.approx((part < 0.5).mean(), abs=1e-6)
        wanted = alpha[y0:y1, x0:x1].mean()
        assert seen.coverage[number] == pytest.approx(wanted, rel=1e-5, abs=1e-6)


def test_threads_that_ask_for_labels_at_once_get_them():
    started, waits = threading.Event(), threading.Event()

    def make() -> dict[str, Any]:
        started.set()
        waits.wait(10.0)
        return {"depth": np.ones((2, 2)), "motion": np.zeros((2, 2, 2))}

    seen = fl.augment.Weathered(PICTURE, np.zeros((2, 2)), (1.0, 1.0, 1.0), _mixture=make)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(lambda: seen.depth)
        started.wait(10.0)
        second = pool.submit(lambda: seen.motion)
        threading.Timer(0.2, waits.set).start()
        assert first.result() is not None and second.result() is not None

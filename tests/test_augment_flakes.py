"""Flakes of the weather for data sets: sheets that are kept, what flakes cover, how they move."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import find_objects, label, uniform_filter

import flurries as fl
from flurries import _core
from flurries.augment import sheets
from flurries.augment.air import Here
from flurries.augment.labels import falling_of, slices
from measure import drawn_of

EACH = pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])


def airs_of(
    weather: Any, shape: tuple[int, int], index: int = 0, times: tuple[float, ...] = (0.0,),
    fps: float | None = None,
) -> list[Here]:  # fmt: skip
    """The air before a picture, at each of some times."""
    records = [weather.record(index=index)] * len(times)
    return list(weather._airs([np.empty(shape)] * len(times), records, None, list(times), fps))


@EACH
@pytest.mark.parametrize("amount", [0.05, 0.33, 0.6, 1.0])
@pytest.mark.parametrize("profile", ["natural", "hard"])
def test_each_layer_hides_its_share(kind: str, profile: str, amount: float):
    """Over all of a sheet, whatever the amount differs by from its rung."""
    weather = getattr(fl.augment, kind)(amount=amount, profile=profile, seed=1)
    (here,) = airs_of(weather, (200, 220))
    assert here.request() is None
    total = 0.0
    for layer, own in zip(here.layers, here.sheets[1], strict=True):
        columns, rows = own[0].period
        plane = np.empty((rows, columns), np.float32)
        _core.sheet_read(plane, (0, 0), [(*layer[:2], (0.0, 1.0), *layer[3:])], None, True)
        taken = -math.log(1.0 - plane.mean(dtype=np.float64))
        total += taken
        if own[1] > 1.1:
            wanted = here.thickness * (layer[5] - layer[4]) / here.sheets[1].count(own)
            assert taken == pytest.approx(wanted, rel=0.02)
    assert total == pytest.approx(here.thickness * (here.far - here.near), rel=0.01)


@EACH
def test_layers_are_their_product_and_nothing_depends_on_what_is_kept(kind: str):
    weather = getattr(fl.augment, kind)(severity=4, seed=1)
    dark = np.zeros((96, 130))
    first = weather(dark, index=5)
    sheets._SHEETS.clear()
    assert (weather(dark, index=5) == first).all()
    (here,) = airs_of(weather, dark.shape, 5)
    whole, left = np.empty(dark.shape, np.float32), np.ones(dark.shape)
    here.write(whole)
    for layer in here.layers:
        plane = np.empty(dark.shape, np.float32)
        _core.sheet_read(plane, (0, 0), [layer], None, True)
        left *= 1.0 - plane
    assert np.abs(whole - (1.0 - left)).max() < 1e-5 < whole.std()


@EACH
def test_pictures_of_one_weather_have_nothing_in_common(kind: str):
    weather = getattr(fl.augment, kind)(severity=3, wind=1.0, fall=5.0, exposure=0.01, seed=3)
    planes = [weather.apply(np.zeros((200, 200)), index=k).alpha for k in range(6)]
    alike = np.corrcoef([plane.ravel() for plane in planes])
    # Streaks make some hundred pixels alike.
    assert np.abs(alike - np.eye(6)).max() < 0.08


def test_a_process_keeps_some_bytes():
    sheets._SHEETS.clear()
    for size in range(40, 640, 8):
        fl.augment.Rainfall(severity=5, seed=1)(np.zeros((8, size), np.uint8), index=size)
    fl.augment.Snowfall(severity=5, seed=1).clip(np.zeros((20, 64, 64), np.uint8), index=1)
    assert sheets._SHEETS.bytes <= 1.2 * sheets.MOST_BYTES


@pytest.mark.parametrize("profile, size", [("natural", 512), ("hard", 128), ("hard", 224)])
@pytest.mark.parametrize("way", [(0.0, 6.0, 0.005), (2.0, 5.0, 0.01), (-2.0, 5.0, 0.01)])
def test_streaks_are_the_way_of_a_drop(profile: Any, size: int, way: tuple[float, float, float]):
    """As long down the picture, at half of the light, and leaning as much; of single ones."""
    how = dict(zip(("wind", "fall", "exposure"), way, strict=True))
    weather = fl.augment.Rainfall(severity=1, profile=profile, seed=2, **how)
    (here,) = airs_of(weather, (size, size))
    layer, plane, found = here.layers[0], np.empty((900, 900), np.float32), []
    _core.sheet_read(plane, (0, 0), [layer], None, False)
    parts = label(plane > 0.0, np.ones((3, 3)))[0]
    for number, at in enumerate(find_objects(parts), 1):
        light = plane[at] * (parts[at] == number)
        if all(0 < side.start < side.stop < 900 for side in at) and len(light) > 3:
            down, (y, x) = light.sum(axis=1), np.indices(light.shape)
            both = np.cov(y.ravel(), x.ravel(), aweights=light.ravel(), ddof=0)
            found.append((sum(down >= 0.5 * np.quantile(down, 0.75)), both[0, 1] / both[0, 0]))
    pixels = here.view.focal / math.sqrt(layer[4] * layer[5])
    long, lean = np.median(found, axis=0)
    assert len(found) > 100 and long == pytest.approx(pixels * way[1] * way[2], abs=0.6)
    assert lean == pytest.approx(way[0] / way[1], abs=0.03)


def moved(alpha: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Carry each pixel along its vector; where several arrive the denser count for more."""
    height, width = alpha.shape
    y, x = np.mgrid[:height, :width]
    row, column = y + motion[..., 1], x + motion[..., 0]
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    down, across = row - i, column - j
    sums, shares = np.zeros(height * width + 1), np.zeros(height * width + 1)
    for di in (0, 1):
        for dj in (0, 1):
            share = np.where(di, down, 1 - down) * np.where(dj, across, 1 - across)
            share = share * (alpha + 1e-9)
            inside = (i + di >= 0) & (i + di < height) & (j + dj >= 0) & (j + dj < width)
            at = np.where(inside, (i + di) * width + j + dj, height * width).ravel()
            sums += np.bincount(at, (share * alpha).ravel(), len(sums))
            shares += np.bincount(at, share.ravel(), len(sums))
    there = shares[:-1] > 0.0
    carried = np.divide(sums[:-1], shares[:-1], out=np.zeros(height * width), where=there)
    return carried.reshape(height, width), there.reshape(height, width)


@pytest.mark.parametrize("severity", [1, 5])
@pytest.mark.parametrize("ground", [None, fl.augment.Ground()])
def test_patches_of_fog_are_carried_by_their_vectors(severity: int, ground: Any):
    weather = fl.augment.Fog(severity=severity, seed=5, ground=ground)
    picture = np.zeros((512, 512), np.uint8)
    now = weather.apply(picture, index=0, time=1.0, motion=True)
    then = weather.apply(picture, index=0, time=1.0 + 1.0 / 30.0)
    carried, there = moved(now.alpha.astype(np.float64) - now.alpha.min(), now.motion)
    assert np.corrcoef(carried[there], then.alpha[there])[0, 1] >= 0.9


@EACH
@pytest.mark.parametrize("severity, fps", [(1, 60.0), (5, 30.0)])
def test_slices_carried_by_their_own_motions_are_the_next_frame(
    kind: str, severity: int, fps: float
):
    """What falls overlaps, so that one vector a pixel cannot carry it; each slice has its own."""
    weather = getattr(fl.augment, kind)(severity=severity, seed=5, profile="hard", exposure=0.02)
    here, there = airs_of(weather, (512, 512), times=(1.0, 1.0 + 1.0 / fps), fps=fps)
    then, _ = there.alpha()
    # What comes in from outside is not known.
    inner = np.zeros((512, 512), bool)
    inner[96:-16, 64:-64] = True
    found = []
    for share in (1.0, 0.0):
        left = np.ones((512, 512))
        for opacity, motion, depth in slices(here, fps):
            way = share / (depth or 1.0) * np.moveaxis(motion[:2], 0, -1) + np.zeros((512, 512, 2))
            carried, _ = moved(opacity.astype(np.float64), way)
            left *= 1.0 - carried
        # What is carried between pixels is smoother, which thin streaks show: so are both made.
        smooth = [uniform_filter(one, 3) for one in (1.0 - left, then.astype(np.float64))]
        found.append(np.corrcoef(smooth[0][inner], smooth[1][inner])[0, 1])
    assert found[0] >= 0.8 > 0.6 > found[1], found


@EACH
def test_vectors_are_focal_over_depth(kind: str):
    """At every flake that hides what is behind it: its own exact motion, by finite differences."""
    weather = getattr(fl.augment, kind)(severity=5, seed=5, exposure=1e-3, profile="hard")
    times = (1.0 - 0.5 / 30.0, 1.0, 1.0 + 0.5 / 30.0)
    airs = airs_of(weather, (512, 512), times=times, fps=30.0)
    _, most = falling_of(airs[1], slices(airs[1], 30.0), 30.0, slice(None))
    found = [drawn_of(here) for here in airs]
    focal, errors = airs[0].view.focal, []
    for number, (_, _, z, u, v, depth, diameter, share) in found[1].items():
        if not (number in found[0] and number in found[2]):
            continue
        way = found[2][number][3:5] - found[0][number][3:5]
        inside = 2 < u < 510 and 2 < v < 510 and np.abs(way).max() < 200
        if inside and share == 1.0 and focal * diameter / z > 1.5:
            own = most[:, int(v), int(u)]
            errors.append((np.abs(own[:2] - way).max(), abs(own[2] * depth - 1.0)))
    # Flakes behind larger ones see those.
    assert len(errors) > 20 and np.median(errors, axis=0)[0] < 1e-3
    assert np.median(errors, axis=0)[1] < 1e-6

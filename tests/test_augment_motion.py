"""A clip keeps its weather's motion: frame t and its vectors say where frame t + 1 has what."""

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

import flurries as fl
from flurries import _core
from flurries.augment.slices import falling_of, slices


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


@pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])
@pytest.mark.parametrize("severity, fps", [(1, 60.0), (5, 30.0)])
def test_slices_carried_by_their_own_motions_are_the_next_frame(
    kind: str, severity: int, fps: float
):
    """What falls overlaps, so that one vector a pixel cannot carry it; each slice has its own."""
    weather = getattr(fl.augment, kind)(severity=severity, seed=5, profile="hard", exposure=0.02)
    two = [np.empty((512, 512))] * 2, [weather.record(index=0)] * 2, None, [1.0, 1.0 + 1.0 / fps]
    here, there = weather._airs(*two, fps)
    then, _ = there.alpha()
    # What comes in from outside is not known.
    inner = np.zeros((512, 512), bool)
    inner[96:-16, 64:-64] = True
    found = []
    for share in (1.0, 0.0):
        left = np.ones((512, 512))
        for part in slices(here, fps):
            motion = np.broadcast_to(share * np.asarray(part.motion), (512, 512, 2))
            carried, _ = moved(part.opacity.astype(np.float64), motion)
            left *= 1.0 - carried
        # What is carried between pixels is smoother, which thin streaks show: so are both made.
        smooth = [uniform_filter(one, 3) for one in (1.0 - left, then.astype(np.float64))]
        found.append(np.corrcoef(smooth[0][inner], smooth[1][inner])[0, 1])
    assert found[0] >= 0.8 > 0.6 > found[1], found


@pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])
def test_vectors_are_focal_over_depth(kind: str):
    """At every flake that hides what is behind it: its own exact motion, by finite differences."""
    weather = getattr(fl.augment, kind)(severity=5, seed=5, exposure=1e-3, profile="hard")
    times = [1.0 - 0.5 / 30.0, 1.0, 1.0 + 0.5 / 30.0]
    three = [np.empty((512, 512))] * 3, [weather.record(index=0)] * 3
    airs = list(weather._airs(*three, None, times, 30.0))
    _, (_, motion, where) = falling_of(airs[1], 30.0)
    found = []
    for here in airs:
        request = here.request()
        assert request is not None
        ids, rows, _ = _core.flake_rows(_core.fall(request))
        found.append(dict(zip(ids.tolist(), rows, strict=True)))
    focal, errors = airs[0].view.focal, []
    for number, (_, _, z, u, v, depth, diameter, share) in found[1].items():
        if not (number in found[0] and number in found[2]):
            continue
        way = found[2][number][3:5] - found[0][number][3:5]
        inside = 2 < u < 510 and 2 < v < 510 and np.abs(way).max() < 200
        if inside and share == 1.0 and focal * diameter / z > 1.5:
            at = int(v), int(u)
            errors.append((np.abs(motion[at] - way).max(), abs(where[at] / depth - 1.0)))
    # Flakes behind larger ones see those.
    assert len(errors) > 20 and np.median(errors, axis=0)[0] < 1e-3
    assert np.median(errors, axis=0)[1] < 1e-6


def test_time_is_seekable():
    weather = fl.augment.Snowfall(severity=3, seed=5)
    picture = np.zeros((96, 128), np.uint8)
    clip = weather.clip(np.stack([picture] * 5), index=2, fps=30.0, time=1e5)
    assert np.array_equal(weather(picture, index=2, time=1e5 + 3 / 30.0), clip[3])

"""A candidate for what falls, drawn before the clip's plate and coded as the clip is.

What noise and a codec leave of flakes differs with the plate, and with their contrast, speed and
number. So it is no law here: a candidate goes the clip's way, and peaks of both are counted, by
their height and by the shade of the plate.
"""

import io
import math
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera import Camera
from flurries.effects import Snow
from flurries.matching.watched import LUMA
from flurries.scene import Scene

# Frames of a candidate; how bright a camera's noise is; the level (crf) of h264 that is tried
# first, and shares of the clip's bytes between which it stays.
COUNT, _NOISE, LEVEL, _ALIKE = 16, np.float32(2.0 / 255.0), 18.0, (0.4, 1.6)
# Shades of the plate; shares of a shade's pixels that are peaks above a height; and the least
# height, of white, of those that are counted and of those that may grow to it.
_SHADES, _LEAST, _KEPT = 4, 6.0 / 255.0, 4.0 / 255.0
_RANKS = np.array([375, 188, 94, 47, 22, 9, 3, 1]) / 230_400.0
# By how many times numbers of peaks spread more than those of chance, as flakes are seen in some
# frames and at some heights; and what their logarithms are right by at best.
_SEEN, _SURE = 6.0, 0.09
# By how much is tried, and gone at a time: logarithms of density and mean size, and light.
_TRIED, _FAR = np.array([0.05, 0.04, 0.02]), np.array([0.5, 0.2, 0.1])


class Peaks(NamedTuple):
    """Pixels that differ from the mean by more than those around them."""

    height: Array  # (n,) of white.
    behind: Array  # (n,) the mean there.
    pixels: int  # That were looked at.


def peaks(frames: Array, mean: Array) -> Peaks:
    """Return the peaks of frames (n, h, w) less their mean (h, w)."""
    heights, behind = [], []
    for frame in frames:
        for axis in (0, 1):
            rows = np.moveaxis(frame, axis, 0)
            frame = np.moveaxis(0.25 * (rows[2:] + rows[:-2]) + 0.5 * rows[1:-1], 0, axis)
        soft = np.abs(frame)
        middle = soft[1:-1, 1:-1]
        top = middle > _KEPT
        for row, col in product(range(3), range(3)):
            beside = soft[row:, col:][: middle.shape[0], : middle.shape[1]]
            top &= (middle >= beside) if (row, col) <= (1, 1) else (middle > beside)
        heights.append(middle[top])
        behind.append(mean[2:-2, 2:-2][top])
    return Peaks(np.concatenate(heights), np.concatenate(behind), frames.size)


def shown(
    snow: Snow, camera: Camera, fps: float, plate: Array, colors: Float64, level: float | None,
    seed: int, count: int,
) -> tuple[Peaks, float]:  # fmt: skip
    """Return the peaks of a candidate before a plate, and bytes as of `leaning`."""
    flakes = replace(snow, color=1.0, shape="round", seed=seed)  # Balls, as those of the waves.
    scene = Scene(np.zeros_like(plate), camera=camera, effects=[flakes], fps=fps, lens=None)
    chance, pictures, used = np.random.default_rng(seed), [], 0.0
    for t in range(count):
        picture = plate + scene.render(t) * (colors.astype(np.float32) - plate)
        picture += chance.standard_normal(picture.shape, np.float32) * _NOISE
        pictures.append(np.rint(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8))
    if level is not None:
        pictures, used = _coded(pictures, level, fps)
    frames = np.array([picture @ (LUMA / np.float32(255.0)) for picture in pictures])
    mean = frames.mean(axis=0)
    return peaks(frames - mean, mean), used


def _coded(pictures: list[Array], level: float, fps: float) -> tuple[list[Array], float]:
    """Return pictures after h264 at a level, and bytes as of `leaning`."""
    import av

    store, (height, width) = io.BytesIO(), (side // 2 * 2 for side in pictures[0].shape[:2])
    with av.open(store, "w", format="mp4") as out:
        stream = out.add_stream("libx264", rate=max(round(fps), 1), options={"crf": str(level)})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for picture in pictures:
            even = np.ascontiguousarray(picture[:height, :width])
            out.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        out.mux(stream.encode())
    with av.open(io.BytesIO(store.getvalue())) as film:
        found = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    return found, leaning(io.BytesIO(store.getvalue()))


def leaning(film: Any) -> float:
    """Return the mean bytes of a film's frames that lean on others: what a codec is known by."""
    import av

    with av.open(film) as opened:
        sizes = [one.size for one in opened.demux(video=0) if one.size and not one.is_keyframe]
    return float(sum(sizes)) / max(len(sizes), 1)


def level_for(level: float, share: float) -> float:
    """Return a level at which a candidate has the clip's bytes, of which it has a share."""
    alike = _ALIKE[0] < share < _ALIKE[1]
    return level if alike else min(max(level + 6.0 * math.log2(max(share, 0.01)), 0.0), 45.0)


def nearer(
    real: Peaks, ours: Peaks, light: float, usual: Float64, known: Float64
) -> tuple[Float64, Float64, float]:
    """Return how a candidate changes to show the clip's peaks, and how unlike they stay."""
    # Changes (3,) of the logarithms of density and size, and of the light, with their covariance;
    # `usual` ones are expected, with the inverse covariance `known`.
    shades = np.quantile(real.behind, np.linspace(0.0, 1.0, _SHADES + 1)[1:-1])
    clip, candidate = (np.searchsorted(shades, part.behind) for part in (real, ours))
    ranks, edges = (_RANKS * real.pixels / _SHADES).astype(int), []
    for shade in range(_SHADES):
        heights = np.sort(real.height[clip == shade])[::-1]
        limits = heights[ranks[ranks < len(heights)]]
        edges.append([*limits[limits > _LEAST], np.inf])
    share = real.pixels / ours.pixels
    flat = ours.height / np.maximum(np.abs(light - ours.behind), 0.03)

    def numbers(heights: Array, shade: Array) -> Float64:
        """Return how many peaks of each shade are between limits."""
        parts = zip((heights[shade == n] for n in range(_SHADES)), edges, strict=True)
        counts = [np.diff([np.count_nonzero(part >= end) for end in ends]) for part, ends in parts]
        return np.asarray(np.maximum(-np.concatenate(counts), 0.5))

    def changed(by: Float64) -> Float64:
        """Return numbers of a changed candidate: a peak is as high as its flake covers."""
        heights = flat * math.exp(2.0 * by[1]) * np.abs(light + by[2] - ours.behind)
        return numbers(heights, candidate) * math.exp(by[0]) * share

    by = np.zeros(3)
    many, few = numbers(real.height, clip), changed(by)
    sure = np.sqrt(_SEEN * (1.0 / many + share / few) + _SURE**2)
    used = (many > 8.0) & (few > 4.0)

    def left(by: Float64) -> Float64:
        return np.asarray((np.log(changed(by) / many) / sure)[used])

    for _ in range(4):
        tried = [left(by + step) - left(by - step) for step in np.diag(_TRIED)]
        slopes = np.array(tried) / (2.0 * _TRIED[:, None])
        square = slopes @ slopes.T + known
        change = np.linalg.solve(square, -slopes @ left(by) - known @ (by - usual))
        by = by + np.clip(change, -_FAR, _FAR)
    unlike = float(np.sqrt((left(by) ** 2).mean())) if used.any() else math.inf
    return by, np.linalg.inv(square), unlike

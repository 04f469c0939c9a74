"""A candidate for what falls, drawn before the clip's plate and coded as the clip is.

What noise and a codec leave of flakes differs with the plate, and with their contrast, speed and
number. So it is no law here: a candidate goes the clip's way, and peaks of both are counted, by
their height and by the shade of the plate.
"""

import io
import math
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera import Camera
from flurries.effects import Snow
from flurries.matching.streaks import Way, found_again
from flurries.matching.watched import LUMA, soft
from flurries.scene import Scene

# Frames of a candidate; how bright a camera's noise is; the level (crf) of h264 that is tried
# first, and shares of the clip's bytes between which it stays.
COUNT, LEVEL, ALIKE = 16, 18.0, (0.4, 1.6)
# It keeps of flakes what the usual settings do, in a third of their time; "veryfast" keeps less.
_CODER = {"preset": "faster", "subq": "1", "motion-est": "dia"}
# A camera's noise of two levels in each color; and black and white in films.
_NOISE = np.float32(2.0 / 255.0 * math.hypot(*LUMA.tolist()))
_BLACK, _WHITE = np.float32(16.0), np.float32(219.0)
# Shades of the plate; heights, of white, that peaks are counted between, up to so many for each
# pixel, as those near each other are one; the least that may grow; and what no ball covers more.
_SHADES, _STEP, _RARE = 8, 1.25, 1.0 / 600.0
_HEIGHTS = (6.0 / 255.0 * _STEP ** np.arange(17.0)).tolist()
_KEPT, _WHOLE = 4.0 / 255.0, 0.99
# Heights from which peaks are looked for in the frame beside, and streaks told; from how many steps
# on peaks are counted by how far they went, which is their depth, and px that part these.
_SOUGHT, _SHARP, _APART, _WENT = 11.0 / 255.0, 14.0 / 255.0, 6, (1.0, 12.0)
# By how many times numbers of peaks spread more than those of chance, as flakes are seen in some
# frames and at some heights; and what their logarithms are right by at best.
_SEEN, _SURE = 6.0, 0.09
# By how much is tried, and gone from a candidate: logarithms of density and mean size, and light.
_TRIED, _FAR = np.array([0.05, 0.04, 0.02]), np.array([0.5, 0.2, 0.1])


class Peaks(NamedTuple):
    """Pixels that differ from the mean by more than those around them."""

    pixels: int  # That were looked at.
    together: int  # Frames that have one mean.
    height: Array  # (n,) of white.
    behind: Array  # (n,) the mean there.
    went: Array  # (n,) the number of ways of `_WENT` that they go until the frame beside.
    streaks: Array  # (m,) exposures in frames, of those that are seen to move.


def peaks(frames: Array, mean: Array, count: int, way: Way) -> Peaks:
    """Return the peaks of frames (n, h, w) less their mean (h, w), by `count` that have one."""

    def found(n: int) -> tuple[Array, ...]:
        # The last of those that have one mean goes back.
        last = (n + 1) % count == 0
        now, other = smooth[n], smooth[n - 1 if last else n + 1]
        height = np.abs(now)
        rows = np.maximum(np.maximum(height[:, 2:], height[:, :-2]), height[:, 1:-1])
        top = height[1:-1, 1:-1] >= np.maximum(np.maximum(rows[2:], rows[:-2]), rows[1:-1])
        top &= height[1:-1, 1:-1] > _KEPT
        row, column = np.divmod(np.flatnonzero(top), top.shape[1])
        own, far = height[row + 1, column + 1], np.zeros(len(row))
        bright = own > _SOUGHT
        places = np.stack([row[bright], column[bright]], axis=1) + 1
        far[bright], long = found_again(now, other, places, way.back() if last else way)
        sharp = (own[bright] > _SHARP) & ~np.isnan(long)
        shade = behind[n // count][row + 2, column + 2]
        return own, shade, np.searchsorted(_WENT, far, "right"), long[sharp]

    parts = frames[: len(frames) // count * count].reshape(-1, count, *mean.shape)
    means = parts.mean(axis=1, keepdims=True)
    rest, behind = (parts - means).reshape(-1, *mean.shape), mean + means[:, 0]
    with ThreadPoolExecutor(2) as both:
        smooth = list(both.map(soft, rest))
        seen = zip(*both.map(found, range(len(rest))), strict=True)
        return Peaks(rest.size, count, *map(np.concatenate, seen))


def shown(
    snow: Snow, camera: Camera, fps: float, plate: Array, light: float, level: float | None,
    seed: int, count: int, way: Way,
) -> tuple[Peaks, float]:  # fmt: skip
    """Return the peaks of a candidate before a plate (h, w), and bytes as of `leaning`."""
    flakes = replace(snow, color=1.0, shape="round", seed=seed)  # Balls, as those of the waves.
    dark = np.zeros((*plate.shape, 3), np.float32)
    scene = Scene(dark, camera=camera, effects=[flakes], fps=fps, lens=None)
    chance, size = np.random.default_rng(seed), plate.size
    # Of one run of noise each frame takes another part, whose places are far apart.
    noise = chance.standard_normal(2 * size, np.float32) * _NOISE
    firsts = [int(chance.integers(size)) for _ in range(count)]
    change = np.float32(light) - plate

    def picture(t: int) -> Array:
        made = scene.render(t)[..., 0] * change
        made += plate
        made += noise[firsts[t] : firsts[t] + size].reshape(plate.shape)
        made *= _WHITE
        made += _BLACK
        np.clip(np.rint(made, made), _BLACK, _BLACK + _WHITE, made)
        return np.asarray(made.astype(np.uint8))

    with ThreadPoolExecutor(2) as both:
        frames, used = _coded(both.map(picture, range(count)), plate.shape, level, fps)
    frames = (frames - _BLACK) / _WHITE
    return peaks(frames[1:], np.zeros_like(frames[0]), count - 1, way), used


def _coded(
    pictures: Iterable[Array], shape: tuple[int, ...], level: float | None, fps: float
) -> tuple[Array, float]:
    """Return the brightness of pictures after h264 at a level, and bytes as of `leaning`."""
    if level is None:
        return np.array(list(pictures), np.float32), 0.0
    import av

    store, (height, width) = io.BytesIO(), (side // 2 * 2 for side in shape)
    grey = np.full((height // 2, width), 128, np.uint8)
    with av.open(store, "w", format="mp4") as out:
        rate, options = max(round(fps), 1), {"crf": str(level), **_CODER}
        stream = out.add_stream("libx264", rate=rate, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.thread_count = 2  # Else bytes go with the processors.
        for picture in pictures:
            planes = np.concatenate([picture[:height, :width], grey])
            out.mux(stream.encode(av.VideoFrame.from_ndarray(planes, format="yuv420p")))
        out.mux(stream.encode())
    with av.open(io.BytesIO(store.getvalue())) as film:
        found = [frame.to_ndarray()[:height] for frame in film.decode(video=0)]
    return np.array(found, np.float32), leaning(io.BytesIO(store.getvalue()))


def leaning(film: Any) -> float:
    """Return the mean bytes of a film's frames that lean on others: what a codec is known by."""
    import av

    with av.open(film) as opened:
        sizes = [one.size for one in opened.demux(video=0) if one.size and not one.is_keyframe]
    return float(sum(sizes)) / max(len(sizes), 1)


def nearer(
    real: Peaks, ours: Peaks, light: float, usual: Float64, known: Float64
) -> tuple[Float64, Float64, float]:
    """Return how a candidate changes to show the clip's peaks, and how unlike they stay."""
    # Changes (3,) of the logarithms of density and size, and of the light, with their covariance;
    # `usual` ones are expected, with the inverse covariance `known`.
    shades = np.quantile(np.append(real.behind, ours.behind), np.arange(1, _SHADES) / _SHADES)
    kinds, wide = len(_WENT) + 1, len(_HEIGHTS) + 1
    # Of each peak the row of its shade, and the optical depth of its flake.
    told: dict[int, tuple[Array, Array]] = {}
    for part in (real, ours):
        cover = np.minimum(part.height / np.maximum(np.abs(light - part.behind), 0.03), _WHOLE)
        told[id(part)] = np.searchsorted(shades, part.behind) * kinds, np.log1p(-cover)

    def roots(part: Peaks, by: Float64) -> Float64:
        """Return roots of numbers of changed peaks by shade, way and height: all spread alike."""
        row, depth = told[id(part)]
        height = 1.0 - np.exp(depth * math.exp(2.0 * by[1]))
        height *= np.abs(float(light + by[2]) - part.behind) * (1.0 / _HEIGHTS[0])
        step = np.log(np.maximum(height, 0.1)) * (1.0 / math.log(_STEP)) + 1.0
        step = np.clip(np.floor(step), 0, wide - 1).astype(int)
        cell = (row + np.where(step < _APART, 0, part.went)) * wide + step
        counts = np.bincount(cell, minlength=_SHADES * kinds * wide).reshape(-1, wide)
        return np.asarray(np.sqrt(counts[:, 1:] * (math.exp(by[0]) * real.pixels / part.pixels)))

    by, many, few = np.zeros(3), roots(real, np.zeros(3)), roots(ours, np.zeros(3))
    both = many**2 + few**2
    sure = np.sqrt(0.25 * _SEEN * (1.0 + real.pixels / ours.pixels) + 0.125 * _SURE**2 * both)
    # Where peaks are near each other, twice as many flakes have not twice as many.
    above = np.cumsum(both.reshape(_SHADES, kinds, -1).sum(axis=1)[:, ::-1], axis=1)[:, ::-1]
    above = above.repeat(kinds, axis=0)
    used = (above < 2.0 * _RARE * real.pixels / _SHADES) & (both > 0.0)
    # The clip's slopes count as much as the candidate's: by these alone chance makes flakes fewer.
    steps, parts = np.diag(_TRIED), (real, ours)
    tried = [[roots(part, step) - roots(part, -step) for step in steps] for part in parts]
    slopes = (np.sum(tried, axis=0) / (4.0 * _TRIED[:, None, None]) / sure)[:, used]
    square = slopes @ slopes.T + known
    for _ in range(5):
        left = ((roots(ours, by) - many) / sure)[used]
        change = np.linalg.solve(square, -slopes @ left - known @ (by - usual))
        by = np.clip(by + change, -_FAR, _FAR)
    alike = (np.minimum(many, few) > 2.0)[used]
    unlike = math.sqrt(float((left[alike] ** 2).mean())) if alike.any() else math.inf
    return by, np.linalg.inv(square), unlike

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
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera import Camera
from flurries.effects import Snow
from flurries.matching.watched import LUMA, ahead, soft
from flurries.scene import Scene

# Frames of a candidate; how bright a camera's noise is; the level (crf) of h264 that is tried
# first, and shares of the clip's bytes between which it stays.
COUNT, _NOISE, LEVEL, ALIKE = 16, np.float32(2.0 / 255.0), 18.0, (0.4, 1.6)
# Shades of the plate; heights, of white, that peaks are counted between, up to so many for each
# pixel, as those near each other are one; the least that may grow; and what no ball covers more.
_SHADES, _STEP, _RARE = 8, 1.25, 1.0 / 600.0
_HEIGHTS = (6.0 / 255.0 * _STEP ** np.arange(17.0)).tolist()
_KEPT, _WHOLE = 4.0 / 255.0, 0.99
# By how many times numbers of peaks spread more than those of chance, as flakes are seen in some
# frames and at some heights; and what their logarithms are right by at best.
_SEEN, _SURE = 6.0, 0.09
# By how much is tried, and gone from a candidate: logarithms of density and mean size, and light.
_TRIED, _FAR = np.array([0.05, 0.04, 0.02]), np.array([0.5, 0.2, 0.1])


class Peaks(NamedTuple):
    """Pixels that differ from the mean by more than those around them."""

    height: Array  # (n,) of white.
    behind: Array  # (n,) the mean there.
    pixels: int  # That were looked at.
    together: int = 1  # Frames that have one mean.


def peaks(frames: Array, mean: Array, count: int) -> Peaks:
    """Return the peaks of frames (n, h, w) less their mean (h, w), by `count` that have one."""

    def found(frame: Array, behind: Array) -> tuple[Array, Array]:
        height = np.abs(soft(frame))
        middle = height[1:-1, 1:-1]
        top = middle > _KEPT
        for row, col in product(range(3), range(3)):
            beside = height[row:, col:][: middle.shape[0], : middle.shape[1]]
            top &= (middle >= beside) if (row, col) <= (1, 1) else (middle > beside)
        return middle[top], behind[2:-2, 2:-2][top]

    parts = frames[: len(frames) // count * count].reshape(-1, count, *mean.shape)
    means = parts.mean(axis=1, keepdims=True)
    rest, behind = (parts - means).reshape(-1, *mean.shape), np.repeat(mean + means[:, 0], count, 0)
    with ThreadPoolExecutor(2) as both:
        heights, places = zip(*both.map(found, rest, behind), strict=True)
    return Peaks(np.concatenate(heights), np.concatenate(places), rest.size, count)


def shown(
    snow: Snow, camera: Camera, fps: float, plate: Array, colors: Float64, level: float | None,
    seed: int, count: int,
) -> tuple[Peaks, float]:  # fmt: skip
    """Return the peaks of a candidate before a plate, and bytes as of `leaning`."""
    flakes = replace(snow, color=1.0, shape="round", seed=seed)  # Balls, as those of the waves.
    scene = Scene(np.zeros_like(plate), camera=camera, effects=[flakes], fps=fps, lens=None)
    chance, size, used = np.random.default_rng(seed), plate.size, 0.0
    # Of one run of noise each frame takes another part, whose places are far apart.
    noise = chance.standard_normal(2 * size, np.float32) * _NOISE
    change = colors.astype(np.float32) - plate

    def picture(t: int) -> Array:
        first = int(chance.integers(size))
        made = scene.render(t)[..., :1] * change
        made += plate
        made += noise[first : first + size].reshape(plate.shape)
        made *= np.float32(255.0)
        return np.asarray(np.clip(np.rint(made, made), 0.0, 255.0, made).astype(np.uint8))

    pictures = ahead(map(picture, range(count)))
    if level is None:
        frames = np.array([one @ (LUMA / np.float32(255.0)) for one in pictures])
    else:
        frames, used = _coded(pictures, plate.shape, level, fps)
    return peaks(frames[1:], np.zeros_like(frames[0]), count - 1), used


def _coded(
    pictures: Iterable[Array], shape: tuple[int, ...], level: float, fps: float
) -> tuple[Array, float]:
    """Return the brightness of pictures after h264 at a level, and bytes as of `leaning`."""
    import av

    store, (height, width) = io.BytesIO(), (side // 2 * 2 for side in shape[:2])
    with av.open(store, "w", format="mp4") as out:
        stream = out.add_stream("libx264", rate=max(round(fps), 1), options={"crf": str(level)})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.thread_count = 2  # Else bytes go with the processors.
        for picture in pictures:
            even = np.ascontiguousarray(picture[:height, :width])
            out.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        out.mux(stream.encode())
    with av.open(io.BytesIO(store.getvalue())) as film:
        found = [frame.to_ndarray()[:height] for frame in film.decode(video=0)]
    # Black is 16 in films, and white 235.
    frames = (np.array(found, np.float32) - 16.0) / np.float32(219.0)
    return frames, leaning(io.BytesIO(store.getvalue()))


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
    rows = {id(part): np.searchsorted(shades, part.behind) * (len(_HEIGHTS) + 1)
            for part in (real, ours)}  # fmt: skip

    def roots(part: Peaks, by: Float64) -> Float64:
        """Return roots of numbers of changed peaks by shade and height: all spread alike."""
        contrast = np.abs(light - part.behind)
        cover = 1.0 - np.minimum(part.height / np.maximum(contrast, 0.03), _WHOLE)
        height = 1.0 - cover ** math.exp(2.0 * by[1])
        height *= np.abs(float(light + by[2]) - part.behind) / _HEIGHTS[0]
        step = np.log(np.maximum(height, 0.1)) * (1.0 / math.log(_STEP)) + 1.0
        cell = rows[id(part)] + np.clip(np.floor(step), 0, len(_HEIGHTS)).astype(int)
        counts = np.bincount(cell, minlength=_SHADES * (len(_HEIGHTS) + 1)).reshape(_SHADES, -1)
        return np.asarray(np.sqrt(counts[:, 1:] * (math.exp(by[0]) * real.pixels / part.pixels)))

    by, many, few = np.zeros(3), roots(real, np.zeros(3)), roots(ours, np.zeros(3))
    both = many**2 + few**2
    sure = np.sqrt(0.25 * _SEEN * (1.0 + real.pixels / ours.pixels) + 0.125 * _SURE**2 * both)
    # Where peaks are near each other, twice as many flakes have not twice as many.
    above = np.cumsum(both[:, ::-1], axis=1)[:, ::-1]
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

"""A clip apart from what falls in it: what stands still is laid over itself, and its mean kept.

The mean M of frames before a plate B that flakes of light L cover by a is B + mean(a) (L - B), and
so (frame - M) / (L - M) is (a - mean(a)) / (1 - mean(a)), whatever the plate is: its covariance is
that of the flakes' optical density alone, and the plate need not be known.
"""

import math
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from flurries._ahead import Ahead
from flurries._contract import Array, Float64
from flurries._kept import kept as keep

# Pictures are made smaller until they are at most so wide, and of more frames the first are looked
# at.
WIDE, LONG = 900, 96
# Phases are compared of pictures of half the size, up to this share of their Nyquist frequency.
_COARSE = 0.5


class Watched(NamedTuple):
    """What was seen of a clip."""

    frames: Array  # (n, h, w, 3) float32, less their mean, laid over the first one.
    mean: Array  # (h, w, 3) over time.
    clean: Array | None  # (h, w, 3): the plate, if given.
    shifts: Float64  # (n, 2) px, right and down: where the first frame's things are in each.


def smaller(pixels: Array, scale: int) -> Array:
    """Return the means over squares of pixels, (h, w, 3) float32, integers as shares of white."""
    white = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
    height, width = (length // scale * scale for length in pixels.shape[:2])
    parts = [pixels[n:height:scale, :width, :3].astype(np.float32) for n in range(scale)]
    rows = sum(parts[1:], parts[0]).reshape(height // scale, -1, 3 * scale)
    # Products by rows: loops over colors are slow, threads of a large one keep the reader waiting.
    mean = np.tile(np.eye(3, dtype=np.float32), (scale, 1)) / np.float32(scale**2 * white)
    return np.asarray(rows @ mean)


@keep(4)
def _hann(height: int, width: int) -> tuple[Array, Array]:
    """Return a window over a picture, and what counts of its waves where phases are compared."""
    ky, kx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)
    counts = np.exp(-0.5 * (kx**2 + ky**2) / (0.5 * _COARSE) ** 2)
    window = np.hanning(height)[:, None] * np.hanning(width)
    return window.astype(np.float32), counts.astype(np.float32)


def waves(picture: Array) -> Array:
    """Return the transform of a picture's brightness of half the size, but for its mean."""
    height, width = (length // 2 * 2 for length in picture.shape[:2])
    part = picture[:height, :width] @ LUMA
    part = part[::2, ::2] + part[::2, 1::2] + part[1::2, ::2] + part[1::2, 1::2]
    return np.asarray(np.fft.rfft2((part - part.mean()) * _hann(*part.shape)[0]))


def moved(first: Array, other: Array, shape: tuple[int, int]) -> tuple[float, float]:
    """Return how far things of a picture (h, w) are moved, by waves: px right and down."""
    height, width = (length // 2 for length in shape)
    cross = other * first.conj()
    cross *= _hann(height, width)[1] / (np.abs(cross) + np.float32(1e-9))
    peak = np.fft.irfft2(cross, (height, width))
    row, col = divmod(int(peak.argmax()), width)
    near = np.log(np.maximum(np.roll(peak, (1 - row, 1 - col), (0, 1))[:3, :3], 1e-12))
    dx, dy = (  # A peak is a parabola of logarithms.
        (at + 0.5 * (low - high) / min(low - 2.0 * top + high, -1e-12) + 0.5 * length) % length
        for at, length, (low, top, high) in ((col, width, near[1]), (row, height, near[:, 1]))
    )
    return 2.0 * float(dx) - width, 2.0 * float(dy) - height


def laid_back(picture: Array, shift: tuple[float, float]) -> Array:
    """Return a picture (h, w, c) with its things moved back by a shift; what came in is NaN."""
    for axis, by in ((1, shift[0]), (0, shift[1])):
        places, whole = np.arange(picture.shape[axis]), math.floor(by)
        one, two = (picture.take(places + n, axis, mode="clip") for n in (whole, whole + 1))
        picture = one + np.float32(by - whole) * (two - one)
        outside = (places + by < 0.0) | (places + by > places[-1])
        np.moveaxis(picture, axis, 0)[outside] = np.nan
    return picture


def watch(pictures: Iterable[Array], clean: Array | None) -> Watched:
    """Return what is seen of pictures (h, w, 3) float32, before a plate if it is given."""
    kept: list[Array] = []
    first, shifts = None, list[tuple[float, float]]()
    for small in Ahead(iter(pictures)):
        own = waves(small)
        first = own if first is None else first
        kept.append(small)
        shifts.append(moved(first, own, small.shape[:2]))
    if np.abs(shifts).max() > 0.25:
        kept = [laid_back(one, shift) for one, shift in zip(kept, shifts, strict=True)]
    frames = np.stack(kept)
    unseen = np.isnan(frames)
    mean = np.nanmean(frames, axis=0) if unseen.any() else frames.mean(axis=0)
    if clean is not None and len(frames) == 1:
        # That of a still is its plate behind an even veil, whose light and opacity fit best.
        for own, plate in zip(mean.T, clean.T, strict=True):
            own[:] = np.polyval(np.polyfit(plate.ravel(), own.ravel(), 1), plate)
    frames -= mean
    frames[unseen] = 0.0
    return Watched(frames, mean, clean, np.array(shifts))


# The light of what falls is that at which flakes would not be seen: one of light L before a plate
# of brightness B changes it by a (L - B). However many and opaque, what varies in time goes with
# |L - B| from place to place, and is nothing where the plate is as bright as they.

# Shades of the plate that are told apart, and the opacity above which a flake counts no more: a
# few large ones vary more than all others.
_SHADES, _MOST = 14, 0.25
# The share of frames that are darker than the shade of a place: its mean is brighter where a large
# flake went by, and varies more there. What a light that seems sure is right by.
_DARK, _SURE = 0.25, 0.015
# Px of places that have a tint.
_PLACE = 16
# What codecs keep sharp: the brightness of television.
LUMA = np.array([0.299, 0.587, 0.114], np.float32)
# Lights that are tried.
_LEVELS = np.linspace(0.2, 1.6, 561)


def soft(picture: Array) -> Array:
    """Return a picture (h, w) that is smooth over 3 px, (h - 2, w - 2)."""
    for axis in (0, 1):
        rows = np.moveaxis(picture, axis, 0)
        picture = np.moveaxis(0.25 * (rows[2:] + rows[:-2]) + 0.5 * rows[1:-1], 0, axis)
    return picture


def light_of(frames: Array, mean: Array) -> tuple[float, float]:
    """Return the light of flakes in frames (n, h, w) less their mean (h, w), and its error."""
    place = int(_DARK * len(frames))
    with ThreadPoolExecutor(2) as both:
        # A few rows at a time, which the processor keeps at hand.
        rows = np.array_split(frames, 24, axis=1)
        parts = both.map(lambda part: np.partition(part, place, axis=0)[place], rows)
        shade = np.concatenate(list(parts)) + mean
    # Codecs smooth what a flake changes, by the plate's contrast around it.
    shade, mean = (soft(soft(one)) for one in (shade, mean))
    shade, frames = shade[:-1, :-1].ravel(), frames[:, 2:-2, 2:-2]
    edges = np.quantile(shade, np.linspace(0.0, 1.0, _SHADES + 1))
    cell = np.clip(np.searchsorted(edges, shade) - 1, 0, _SHADES - 1)
    number = np.maximum(np.bincount(cell, minlength=_SHADES), 1)

    def shades(values: Array) -> Float64:
        return np.asarray(np.bincount(cell, values.ravel(), _SHADES) / number)

    middle = shades(mean[:-1, :-1])
    square = shades(mean[:-1, :-1] ** 2) - middle**2
    light = 1.0
    for _ in range(3):
        most = np.float32(_MOST) * np.maximum(np.abs(light - mean), np.float32(0.05))

        def shared(few: Array, most: Array = most) -> Array:
            """Return what neighbours have in common in some frames."""
            total = np.zeros_like(most[1:, 1:])
            for frame in few:
                held = np.clip(frame, -most, most)
                total += held[:-1, :-1] * (held[:-1, 1:] + held[1:, :-1])
            return total

        with ThreadPoolExecutor(2) as both:
            own = shades(np.add(*both.map(shared, (frames[::2], frames[1::2]))))
        contrast = (_LEVELS[:, None] - middle) ** 2 + square
        weight = number / (contrast + 0.01) ** 2
        gain = (weight * contrast * own).sum(axis=1) / (weight * contrast**2).sum(axis=1)
        off = (weight * (own - gain[:, None] * contrast) ** 2).sum(axis=1)
        share = off / (weight * own**2).sum(axis=1)
        light = float(_LEVELS[int(share.argmin())])
    # Lights up to two errors away fit nearly as well.
    good = _LEVELS[share < share.min() * (1.0 + 4.0 / (_SHADES - 2)) + 1e-6]
    return min(light, 1.0), float(np.hypot(_SURE, 0.25 * (good[-1] - good[0])))


def tinted(frames: Array, mean: Array, light: float) -> Float64:
    """Return the light of flakes in each channel, whose brightness is known."""
    # Codecs keep the tint of large places alone.
    frames, mean = np.stack([smaller(one, _PLACE) for one in frames]), smaller(mean, _PLACE)
    contrast = light - mean @ LUMA
    opacity = frames @ LUMA * (contrast / (contrast**2 + 0.01))
    opacity = np.clip(opacity, -_MOST, _MOST)[..., None]
    found = (mean * opacity**2 + frames * opacity).sum(axis=(0, 1, 2)) / (opacity**2).sum()
    return np.asarray(np.clip(found + light - found @ LUMA, 0.0, 1.0))

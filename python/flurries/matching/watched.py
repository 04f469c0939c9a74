"""A clip apart from what falls in it: what stands still is laid over itself, and its mean kept.

The mean M of frames before a plate B that flakes of light L cover by a is B + mean(a) (L - B), and
so (frame - M) / (L - M) is (a - mean(a)) / (1 - mean(a)), whatever the plate is: its covariance is
that of the flakes' optical density alone, and the plate need not be known.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64

# Pictures are made smaller until they are at most so wide, and no more frames are looked at.
WIDE, LONG = 900, 96

# The share of the Nyquist frequency that phases are compared up to: noise is above.
_COARSE = 0.25


class Watched(NamedTuple):
    """What was seen of a clip."""

    frames: Array  # (n, h, w, 3) float32, less their mean, laid over the first one.
    mean: Array  # (h, w, 3) over time.
    clean: Array | None  # (h, w, 3): the plate, if given.
    shifts: Float64  # (n, 2) px, right and down: where the first frame's things are in each.
    scale: int  # By what pictures were made smaller.


def smaller(pixels: Array, scale: int) -> Array:
    """Return the means over squares of pixels, (h, w, 3) float32, integers as shares of white."""
    white = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
    height, width = (length // scale for length in pixels.shape[:2])
    squares = pixels[: height * scale, : width * scale, :3].reshape(height, scale, width, scale, 3)
    return np.asarray(squares.mean(axis=(1, 3), dtype=np.float32) / np.float32(white))


def moved(first: Array, other: Array) -> tuple[float, float]:
    """Return how far another picture's things are moved, px right and down: phase correlation."""
    height, width = first.shape
    window = np.hanning(height)[:, None] * np.hanning(width)
    one, two = (np.fft.rfft2((part - part.mean()) * window) for part in (first, other))
    cross = two * one.conj()
    ky, kx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)
    cross *= np.exp(-0.5 * (kx**2 + ky**2) / (0.5 * _COARSE) ** 2) / (np.abs(cross) + 1e-9)
    peak = np.fft.irfft2(cross, (height, width))
    row, col = divmod(int(peak.argmax()), width)
    near = np.log(np.maximum(np.roll(peak, (1 - row, 1 - col), (0, 1))[:3, :3], 1e-12))
    dx, dy = (  # A peak is a parabola of logarithms.
        (at + 0.5 * (low - high) / min(low - 2.0 * top + high, -1e-12) + 0.5 * length) % length
        for at, length, (low, top, high) in ((col, width, near[1]), (row, height, near[:, 1]))
    )
    return float(dx - 0.5 * width), float(dy - 0.5 * height)


def laid_back(picture: Array, shift: tuple[float, float]) -> Array:
    """Return a picture (h, w, c) with its things moved back by a shift; what came in is NaN."""
    for axis, by in ((1, shift[0]), (0, shift[1])):
        last = picture.shape[axis] - 1
        at, whole = np.arange(last + 1) + by, math.floor(by)
        one, two = (
            picture.take(np.arange(last + 1) + n, axis, mode="clip") for n in (whole, whole + 1)
        )
        picture = one + np.float32(by - whole) * (two - one)
        np.moveaxis(picture, axis, 0)[(at < 0.0) | (at > last)] = np.nan
    return picture


def watch(pictures: Iterable[Array], clean: Array | None) -> Watched:
    """Return what is seen of pictures, before a plate if it is given."""
    kept: list[Array] = []
    shifts: list[tuple[float, float]] = []
    shape: tuple[int, ...] = ()
    for picture in pictures:
        shape = _size("frames", picture, shape)
        kept.append(smaller(picture, -(-shape[1] // WIDE)))
        shifts.append(moved(kept[0].mean(axis=2), kept[-1].mean(axis=2)))
    scale = -(-shape[1] // WIDE)
    if np.abs(shifts).max() > 0.25:
        kept = [laid_back(one, shift) for one, shift in zip(kept, shifts, strict=True)]
    frames = np.stack(kept)
    mean = np.nanmean(frames, axis=0) if np.isnan(frames).any() else frames.mean(axis=0)
    if clean is not None:
        _size("clean", clean, shape)
        clean = smaller(clean, scale)
        if len(frames) == 1:
            # That of a still is its plate behind an even veil, whose light and opacity fit best.
            for c in range(3):
                line = np.polyfit(clean[..., c].ravel(), mean[..., c].ravel(), 1)
                mean[..., c] = np.polyval(line, clean[..., c])
    frames -= mean
    np.nan_to_num(frames, copy=False)
    return Watched(frames, mean, clean, np.array(shifts), scale)


def _size(name: str, picture: Array, size: tuple[int, ...]) -> tuple[int, ...]:
    if size and picture.shape[:2] != size:
        raise ValueError(f"{name} must be (H, W) = {size} as frames' first, got {picture.shape}")
    return picture.shape[:2]

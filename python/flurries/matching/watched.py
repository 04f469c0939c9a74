"""A clip apart from what falls in it: what stands still is laid over itself, and its mean kept.

The mean M of frames before a plate B that flakes of light L cover by a is B + mean(a) (L - B), and
so (frame - M) / (L - M) is (a - mean(a)) / (1 - mean(a)), whatever the plate is: its covariance is
that of the flakes' optical density alone, and the plate need not be known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from flurries._contract import Array, Float64

# Pictures are made smaller until they are at most so wide, and no more frames are looked at.
WIDE, LONG = 900, 96

# The share of the Nyquist frequency that phases are compared up to: noise is above.
_COARSE = 0.25


@dataclass(frozen=True)
class Watched:
    """What was seen of a clip."""

    frames: Array  # (n, h, w, 3) float32, less their mean, laid over the first one.
    mean: Array  # (h, w, 3) over time, or the plate that was given.
    shifts: Float64  # (n, 2) px, right and down: where the first frame's things are in each.
    scale: int  # By what pictures were made smaller.
    veil: Array | None = None  # (h, w, 3): the mean less the plate.


def smaller(picture: Array, scale: int) -> Array:
    """Return the means over squares of pixels, (h, w, 3) float32, integers as shares of white."""
    pixels = np.asarray(picture)
    white = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    height, width = (length // scale * scale for length in pixels.shape[:2])
    found = np.zeros((height // scale, width // scale, 3), np.float32)
    for y in range(scale):
        for x in range(scale):
            found += pixels[y:height:scale, x:width:scale, :3]
    found /= np.float32(scale**2 * white)
    return found


def moved(first: Array, other: Array) -> tuple[float, float]:
    """Return how far another picture's things are moved, px right and down: phase correlation."""
    height, width = first.shape
    window = np.hanning(height)[:, None] * np.hanning(width)
    one, two = (np.fft.rfft2((part - part.mean()) * window) for part in (first, other))
    cross = two * one.conj()
    ky, kx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)
    cross /= np.abs(cross) + 1e-9
    cross *= np.exp(-0.5 * (kx**2 + ky**2) / (0.5 * _COARSE) ** 2)
    peak = np.fft.irfft2(cross, (height, width))
    row, col = np.unravel_index(int(peak.argmax()), peak.shape)

    def between(low: float, middle: float, high: float) -> float:
        logs = np.log(np.maximum([low, middle, high], 1e-12))
        bend = logs[0] - 2.0 * logs[1] + logs[2]
        return 0.5 * (logs[0] - logs[2]) / bend if bend < 0.0 else 0.0

    dy = row + between(peak[row - 1, col], peak[row, col], peak[(row + 1) % height, col])
    dx = col + between(peak[row, col - 1], peak[row, col], peak[row, (col + 1) % width])
    return (dx + width / 2) % width - width / 2, (dy + height / 2) % height - height / 2


def laid_back(picture: Array, shift: Sequence[float]) -> Array:
    """Return a picture (h, w, c) with its things moved back by a shift; what came in is NaN."""
    dx, dy = shift
    if abs(dx) < 0.02 and abs(dy) < 0.02:
        return picture
    height, width = picture.shape[:2]
    found = np.full_like(picture, np.nan)
    col, row = int(np.floor(dx)), int(np.floor(dy))
    x, y = dx - col, dy - row
    top, left = max(-row, 0), max(-col, 0)
    bottom, right = min(height - 1 - row, height), min(width - 1 - col, width)
    if bottom <= top or right <= left:
        return found
    part = picture[top + row : bottom + row + 1, left + col : right + col + 1]
    lines = (1.0 - y) * part[:-1] + y * part[1:]
    found[top:bottom, left:right] = (1.0 - x) * lines[:, :-1] + x * lines[:, 1:]
    return found


def watch(frames: Iterable[Array], clean: Array | None) -> Watched:
    """Return what is seen of frames, before a plate if it is given."""
    kept: list[Array] = []
    shifts: list[tuple[float, float]] = []
    scale, first = 0, np.empty(0)
    for picture in frames:
        scale = scale or -(-picture.shape[1] // WIDE)
        small = smaller(picture, scale)
        luma = small.mean(axis=2)
        if not kept:
            first = luma
        shifts.append(moved(first, luma) if kept else (0.0, 0.0))
        kept.append(small)
        if len(kept) == LONG:
            break
    found = np.array(shifts)
    if np.abs(found).max() > 0.25:
        kept = [laid_back(one, shift) for one, shift in zip(kept, shifts, strict=True)]
    stack = np.stack(kept)
    mean = np.nanmean(stack, axis=0) if np.isnan(stack).any() else stack.mean(axis=0)
    veil = None
    if clean is not None:
        plate = smaller(clean, scale)
        veil = mean - plate
        mean = plate if len(kept) == 1 else mean
    stack -= mean
    np.nan_to_num(stack, copy=False)
    return Watched(stack, mean, found, scale, veil)

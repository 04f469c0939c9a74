"""The light of what falls: that at which flakes would not be seen.

A flake of light L before a plate of brightness B changes it by a (L - B). However many flakes there
are and however opaque, what varies in time goes with |L - B| from place to place, and is nothing
where the plate is as bright as they.
"""

from __future__ import annotations

import numpy as np

from flurries._contract import Array, Float64

# Shades of the plate that are told apart, and the opacity above which a flake counts no more: a
# few large ones vary more than all others.
_SHADES, _MOST = 14, 0.25

_LEVELS = np.linspace(0.2, 1.6, 561)


def covariance(frames: Array, contrast: Array) -> Float64:
    """Return the mean over time of what neighbours have in common, (h - 1, w - 1)."""
    most = np.float32(_MOST) * np.maximum(np.abs(contrast), np.float32(0.05))
    held = np.clip(frames, -most, most)
    one = (held[:, :-1, :-1] * held[:, 1:, :-1]).mean(axis=0)
    two = (held[:, :-1, :-1] * held[:, :-1, 1:]).mean(axis=0)
    return np.asarray(0.5 * (one + two), np.float64)


def light_of(frames: Array, mean: Array) -> tuple[float, float]:
    """Return the light of flakes in frames (n, h, w) less their mean (h, w), and its error."""
    shade = mean[:-1, :-1].ravel()
    edges = np.quantile(shade, np.linspace(0.0, 1.0, _SHADES + 1))
    cell = np.clip(np.searchsorted(edges, shade) - 1, 0, _SHADES - 1)
    number = np.maximum(np.bincount(cell, minlength=_SHADES), 1)
    middle = np.bincount(cell, shade, _SHADES) / number
    square = np.bincount(cell, shade**2, _SHADES) / number - middle**2
    light = 1.0
    for _ in range(3):
        power = covariance(frames, light - mean).ravel()
        # Of strips of the picture, for the error.
        own = np.bincount(cell, power, _SHADES) / number
        contrast = (_LEVELS[:, None] - middle) ** 2 + square
        weight = number / (contrast + 0.01) ** 2
        gain = (weight * contrast * own).sum(axis=1) / (weight * contrast**2).sum(axis=1)
        off = (weight * (own - gain[:, None] * contrast) ** 2).sum(axis=1)
        scale = (weight * own**2).sum(axis=1)
        share = off / scale
        light = float(_LEVELS[int(share.argmin())])
    # Lights that fit nearly as well.
    least = share.min()
    good = _LEVELS[share < least * (1.0 + 4.0 / (_SHADES - 2)) + 1e-6]
    return light, float(0.5 * (good[-1] - good[0]))


def light_over(veil: Array, plate: Array) -> tuple[float, float]:
    """Return the light of a veil, a (L - B), over a plate B, and its error: a line's zero."""

    def zero(rows: slice) -> float:
        slope, height = np.polyfit(plate[rows].ravel(), veil[rows].ravel(), 1)
        return float(-height / slope) if slope < 0.0 else 2.0

    half = len(plate) // 2
    found = zero(np.s_[:half]), zero(np.s_[half:])
    return zero(np.s_[:]), 0.5 * abs(found[0] - found[1])


def tinted(frames: Array, mean: Array, light: float) -> tuple[float, float, float]:
    """Return the light of flakes in each channel, whose mean is known; frames (n, h, w, 3)."""
    contrast = light - mean.mean(axis=2)
    opacity = frames.mean(axis=3) * (contrast / (contrast**2 + np.float32(0.01)))
    np.clip(opacity, -_MOST, _MOST, out=opacity)
    # Noise is not alike in neighbours.
    other = np.roll(opacity, 1, axis=1)
    pairs = opacity * other
    where = pairs.sum(axis=0).clip(0.0)
    behind = [float(np.average(mean[..., c], weights=where)) for c in range(3)]
    found = [float((frames[..., c] * other).sum() / pairs.sum()) + behind[c] for c in range(3)]
    shift = light - sum(found) / 3.0
    return found[0] + shift, found[1] + shift, found[2] + shift

"""The light of what falls: that at which flakes would not be seen.

A flake of light L before a plate of brightness B changes it by a (L - B). However many flakes there
are and however opaque, what varies in time goes with |L - B| from place to place, and is nothing
where the plate is as bright as they.
"""

import numpy as np

from flurries._contract import Array, Float64
from flurries.matching.watched import smaller

# Shades of the plate that are told apart, and the opacity above which a flake counts no more: a
# few large ones vary more than all others.
_SHADES, _MOST = 14, 0.25

# Px of places that have a tint.
_PLACE = 16

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

    def shades(values: Array) -> Float64:
        return np.asarray(np.bincount(cell, values, _SHADES) / number)

    middle = shades(shade)
    square = shades(shade**2) - middle**2
    light = 1.0
    for _ in range(3):
        own = shades(covariance(frames, light - mean).ravel())
        contrast = (_LEVELS[:, None] - middle) ** 2 + square
        weight = number / (contrast + 0.01) ** 2
        gain = (weight * contrast * own).sum(axis=1) / (weight * contrast**2).sum(axis=1)
        off = (weight * (own - gain[:, None] * contrast) ** 2).sum(axis=1)
        share = off / (weight * own**2).sum(axis=1)
        light = float(_LEVELS[int(share.argmin())])
    # Lights that fit nearly as well.
    good = _LEVELS[share < share.min() * (1.0 + 4.0 / (_SHADES - 2)) + 1e-6]
    return light, float(0.5 * (good[-1] - good[0]))


def light_over(veil: Array, plate: Array) -> float:
    """Return the light of a veil, a (L - B), over a plate B: a line's zero."""
    slope, height = np.polyfit(plate.ravel(), veil.ravel(), 1)
    return float(-height / slope) if slope < 0.0 else 2.0


def tinted(frames: Array, mean: Array, clean: Array | None, light: float) -> Float64:
    """Return the light of flakes in each channel, whose mean is known; frames (n, h, w, 3)."""
    if clean is not None:
        veil = mean - clean
        found = np.array([light_over(veil[..., c], clean[..., c]) for c in range(3)])
    else:
        # Codecs keep the tint of large places alone.
        frames, mean = np.stack([smaller(one, _PLACE) for one in frames]), smaller(mean, _PLACE)
        contrast = light - mean.mean(axis=2)
        opacity = frames.mean(axis=3) * (contrast / (contrast**2 + 0.01))
        opacity = np.clip(opacity, -_MOST, _MOST)[..., None]
        power = opacity**2
        behind = (mean * power).sum(axis=(0, 1, 2)) / power.sum()
        found = behind + (frames * opacity).sum(axis=(0, 1, 2)) / power.sum()
    return np.asarray(np.clip(found + light - found.mean(), 0.0, 1.0))

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

# The share of frames that are darker than the shade of a place: its mean is brighter where a large
# flake went by, and varies more there.
_DARK = 0.25

# What a light that seems sure is right by.
_SURE = 0.015

# Px of places that have a tint.
_PLACE = 16

# What codecs keep sharp: the brightness of television.
LUMA = np.array([0.299, 0.587, 0.114], np.float32)

_LEVELS = np.linspace(0.2, 1.6, 561)


def light_of(frames: Array, mean: Array) -> tuple[float, float]:
    """Return the light of flakes in frames (n, h, w) less their mean (h, w), and its error."""
    place = int(_DARK * len(frames))
    shade = (np.partition(frames, place, axis=0)[place] + mean)[:-1, :-1].ravel()
    edges = np.quantile(shade, np.linspace(0.0, 1.0, _SHADES + 1))
    cell = np.clip(np.searchsorted(edges, shade) - 1, 0, _SHADES - 1)
    number = np.maximum(np.bincount(cell, minlength=_SHADES), 1)

    def shades(values: Array) -> Float64:
        return np.asarray(np.bincount(cell, values.ravel(), _SHADES) / number)

    middle = shades(mean[:-1, :-1])
    square = shades(mean[:-1, :-1] ** 2) - middle**2
    light = 1.0
    for _ in range(3):
        # What neighbours have in common.
        most = np.float32(_MOST) * np.maximum(np.abs(light - mean), np.float32(0.05))
        held = np.clip(frames, -most, most)
        beside = held[:, :-1, 1:] + held[:, 1:, :-1]
        own = shades(np.einsum("tij,tij->ij", held[:, :-1, :-1], beside))
        contrast = (_LEVELS[:, None] - middle) ** 2 + square
        weight = number / (contrast + 0.01) ** 2
        gain = (weight * contrast * own).sum(axis=1) / (weight * contrast**2).sum(axis=1)
        off = (weight * (own - gain[:, None] * contrast) ** 2).sum(axis=1)
        share = off / (weight * own**2).sum(axis=1)
        light = float(_LEVELS[int(share.argmin())])
    # Lights that fit nearly as well.
    good = _LEVELS[share < share.min() * (1.0 + 4.0 / (_SHADES - 2)) + 1e-6]
    return light, float(np.hypot(_SURE, good[-1] - good[0]))


def tinted(frames: Array, mean: Array, light: float) -> Float64:
    """Return the light of flakes in each channel, whose brightness is known."""
    # Codecs keep the tint of large places alone.
    frames, mean = np.stack([smaller(one, _PLACE) for one in frames]), smaller(mean, _PLACE)
    contrast = light - mean @ LUMA
    opacity = frames @ LUMA * (contrast / (contrast**2 + 0.01))
    opacity = np.clip(opacity, -_MOST, _MOST)[..., None]
    power = opacity**2
    behind = (mean * power).sum(axis=(0, 1, 2)) / power.sum()
    found = behind + (frames * opacity).sum(axis=(0, 1, 2)) / power.sum()
    return np.asarray(np.clip(found + light - found @ LUMA, 0.0, 1.0))

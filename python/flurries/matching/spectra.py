"""Spectra between frames of what varies in a clip, by places of the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flurries._contract import Array, Float64

WINDOW = 128
LAGS = 3

# Contrast to the light below which a pixel counts less.
_LEAST = 0.12


@dataclass(frozen=True)
class Spectra:
    """Of the optical density, px^2, in windows."""

    cross: Array  # (places, lags, WINDOW, WINDOW // 2 + 1) complex: means over time.
    places: Float64  # (places, 2) px from the middle of the picture, right and down.
    frames: int


def density(frames: Array, mean: Float64, light: float) -> tuple[Array, Array]:
    """Return deviations of the optical density, and how much each pixel counts."""
    contrast = (light - mean).astype(np.float32)
    square = contrast**2
    counts = square / (square + np.float32(_LEAST**2))
    return frames * (contrast / (square + np.float32(_LEAST**2))), counts


def starts(length: int) -> list[int]:
    """Return where windows begin along a side, half a window apart or less."""
    count = max(2 * length // WINDOW - 1, 1)
    return [round(start) for start in np.linspace(0, length - WINDOW, count).tolist()]


def spectra(frames: Array, counts: Array, lags: int = LAGS) -> Spectra:
    """Return spectra between frames of deviations, already times how much pixels count."""
    n, height, width = frames.shape
    hann = np.hanning(WINDOW + 1)[:-1].astype(np.float32)
    window = hann[:, None] * hann
    found, places = [], []
    for top in starts(height):
        for left in starts(width):
            part = np.s_[top : top + WINDOW, left : left + WINDOW]
            taper = float((window * window * counts[part] ** 2).sum())
            own = np.fft.rfft2(frames[:, part[0], part[1]] * window).astype(np.complex64)
            sums = [(own[lag:] * own[: n - lag].conj()).mean(axis=0) for lag in range(lags)]
            # What pixels are worth differs; a window is worth what it holds.
            found.append(np.array(sums) / max(taper, 1e-6))
            places.append((left + 0.5 * (WINDOW - width), top + 0.5 * (WINDOW - height)))
    return Spectra(np.array(found), np.array(places), n)

"""Which way flakes move: the line that all planes of the fan share, by places."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.matching.spectra import WINDOW, Spectra

# Lengths of way between two frames that are looked at, px; and degrees by which rays are smoothed.
_NEAR, _FAR, _SMOOTH = 2, 44, 3.0


class Direction(NamedTuple):
    """Of the motion in the middle of the picture."""

    angle: float  # Radians from +x to +y.
    approach: float  # Velocity away from the camera over that across, both in the same unit.
    error: float  # Radians.
    share: float  # Of the covariance between two frames that lies about this way and not the other.


def rays(found: Spectra, lag: int) -> Float64:
    """Return how alike frames are along rays of each degree, (places, 360)."""
    near = np.fft.fftshift(np.fft.irfft2(found.cross[:, lag], (WINDOW, WINDOW)), axes=(1, 2))
    near -= np.median(near, axis=(1, 2), keepdims=True)
    angle = np.radians(np.arange(360))
    way = np.arange(_NEAR, _FAR + 1.0)[:, None]
    total = np.zeros((len(near), 360))
    x, y = way * np.cos(angle) + WINDOW // 2, way * np.sin(angle) + WINDOW // 2
    col, row = np.floor(x).astype(int), np.floor(y).astype(int)
    right, down = x - col, y - row
    for dy, part in ((0, 1.0 - down), (1, down)):
        for dx, share in ((0, 1.0 - right), (1, right)):
            total += (near[:, row + dy, col + dx] * (part * share)).sum(axis=1)
    wave = np.fft.rfftfreq(360)
    smooth = np.exp(-2.0 * (np.pi * _SMOOTH * wave) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(total, axis=1) * smooth, 360, axis=1))


def direction(found: Spectra, focal: float) -> Direction:
    """Return the direction of all, which differs over the picture where air comes nearer."""
    # A still shows ways only by its streaks, whose ends are alike: things fall.
    still = found.cross.shape[1] == 1
    profile = rays(found, 0 if still else 1)
    if still:
        profile[:, 180:] = -1.0
    places = found.places / focal

    def score(angle: Float64, approach: float, of: Float64, at: Float64) -> Float64:
        x = np.cos(angle)[:, None] - approach * at[:, 0]
        y = np.sin(angle)[:, None] - approach * at[:, 1]
        degree = np.degrees(np.arctan2(y, x)) % 360.0
        low = np.floor(degree).astype(int)
        part, rows = degree - low, np.arange(len(at))
        first, second = of[rows, low % 360], of[rows, (low + 1) % 360]
        return np.asarray(((1.0 - part) * first + part * second).sum(axis=1))

    def best(of: Float64, at: Float64) -> tuple[float, float]:
        coarse = np.radians(np.arange(0.0, 360.0, 2.0))
        approaches = np.linspace(-1.6, 1.6, 17)
        table = np.array([score(coarse, one, of, at) for one in approaches])
        row, col = np.unravel_index(int(table.argmax()), table.shape)
        angle, approach = coarse[col], approaches[row]
        for step in (0.5, 0.1):
            fine = angle + np.radians(step * np.arange(-6, 7))
            near = approach + step * 0.2 * np.arange(-3, 4)
            table = np.array([score(fine, one, of, at) for one in near])
            row, col = np.unravel_index(int(table.argmax()), table.shape)
            angle, approach = fine[col], near[row]
        return float(angle), float(approach)

    angle, approach = best(profile, places)
    parts = [best(profile[n::4], places[n::4])[0] for n in range(4)]
    turns = np.angle(np.exp(1j * (np.array(parts) - angle)))
    error = float(np.sqrt((turns**2).mean() / 3.0))
    this, other = (
        float(score(np.array([a]), approach * s, profile, places)[0])
        for a, s in ((angle, 1.0), (angle + np.pi, -1.0))
    )
    level = float(np.abs(profile).mean(axis=1).sum())
    return Direction(angle, approach, error, (this - abs(other)) / max(level, 1e-12))

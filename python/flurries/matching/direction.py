"""Which way flakes move: the line that all planes of the fan share, by places of the picture."""

from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64

# Px of the windows that spectra are taken of, and how many frames apart they are at most.
WINDOW, LAGS = 128, 3
# Contrast to the light below which a pixel counts less: codecs keep there what is opaque alone.
# What the direction is right by at best, radians: clips 100 to 129 of `docs/make_match.py`.
_LEAST, _SURE = 0.3, 0.005
# Lengths of way between two frames that are looked at, px; and degrees by which rays are smoothed.
_NEAR, _FAR, _SMOOTH = 2, 44, 3.0
# Angles in degrees and approaches that are tried: all, then such as are near the best.
_TRIED = (
    (np.arange(0.0, 360.0, 2.0), np.linspace(-1.6, 1.6, 17)),
    (0.5 * np.arange(-6.0, 7.0), 0.1 * np.arange(-3.0, 4.0)),
    (0.1 * np.arange(-6.0, 7.0), 0.02 * np.arange(-3.0, 4.0)),
)


class Spectra(NamedTuple):
    """Of the optical density between frames, px^2, in windows."""

    cross: Array  # (places, lags, WINDOW, WINDOW // 2 + 1) complex: means over time.
    places: Float64  # (places, 2) px from the middle of the picture, right and down.
    weights: Float64  # (places,) what each tells, of 1 together.


class Direction(NamedTuple):
    """Of the motion in the middle of the picture."""

    angle: float  # Radians from +x to +y.
    approach: float  # Velocity away from the camera over that across, both in the same unit.
    error: float  # Radians.
    share: float  # Of the covariance between two frames that lies about this way and not the other.


def spectra(frames: Array, mean: Array, light: float) -> Spectra:
    """Return the spectra of flakes of a light in frames (n, h, w) less their mean (h, w)."""
    n, height, width = frames.shape
    contrast = (light - mean).astype(np.float32)
    floor = contrast**2 + np.float32(_LEAST**2)
    # A pixel as bright as flakes tells nothing; a window is worth what its pixels are.
    dense, counts = frames * (contrast / floor), contrast**2 / floor
    hann = np.hanning(WINDOW + 1)[:-1].astype(np.float32)
    window = hann[:, None] * hann
    tops, lefts = (
        np.linspace(0, length - WINDOW, max(2 * length // WINDOW - 1, 1)).round().astype(int)
        for length in (height, width)
    )

    def seen(corner: tuple[int, int]) -> tuple[Array, float]:
        """Return the means over time in the window at a corner, and its weight."""
        rows, columns = (slice(low, low + WINDOW) for low in corner)
        taper = float(((window * counts[rows, columns]) ** 2).sum())
        own = np.fft.rfft2(dense[:, rows, columns] * window)
        other, lags = own.conj(), range(min(LAGS, n))
        means = [(own[lag:] * other[: n - lag]).sum(axis=0) / np.float32(n - lag) for lag in lags]
        return np.array(means) / max(taper, 1e-6), taper + 1e-6

    corners = list(product(tops.tolist(), lefts.tolist()))
    with ThreadPoolExecutor(2) as both:
        found, weights = zip(*both.map(seen, corners), strict=True)
    middles = np.array(corners)[:, ::-1] + 0.5 * (WINDOW - np.array([width, height]))
    return Spectra(np.array(found), middles, np.array(weights) / sum(weights))


def rays(cross: Array) -> Float64:
    """Return how alike frames with these spectra are along rays of .1 degrees, (places, 3600)."""
    near = np.fft.fftshift(np.fft.irfft2(cross, (WINDOW, WINDOW)), axes=(1, 2))
    near -= np.median(near, axis=(1, 2), keepdims=True)
    angle, way = np.radians(np.arange(360)), np.arange(_NEAR, _FAR + 0.5, 0.5)[:, None]
    col, row = (np.rint(way * part(angle)).astype(int) + WINDOW // 2 for part in (np.cos, np.sin))
    total = near[:, row, col].sum(axis=1)
    smooth = np.exp(-2.0 * (np.pi * _SMOOTH * np.fft.rfftfreq(360)) ** 2)
    return np.asarray(10.0 * np.fft.irfft(np.fft.rfft(total, axis=1) * smooth, 3600, axis=1))


def direction(found: Spectra, focal: float) -> Direction:
    """Return the direction of all, which differs over the picture where air comes nearer."""
    still = found.cross.shape[1] == 1
    profile, places = rays(found.cross[:, 0 if still else 1]), found.places / focal
    if still:
        # It shows ways only by streaks, whose ends are alike: things fall.
        profile[:, 1800:] = -1.0

    def score(tried: Float64, some: slice) -> Float64:
        """Return how alike frames are along ways, (n, 2) of angle and approach."""
        (angle, approach), at = tried.T[..., None], places[some]
        x, y = np.cos(angle) - approach * at[:, 0], np.sin(angle) - approach * at[:, 1]
        degree = np.rint(10.0 * np.degrees(np.arctan2(y, x))).astype(int) % 3600
        return np.asarray(profile[some][np.arange(len(at)), degree].sum(axis=1))

    def best(some: slice) -> Float64:
        way = np.zeros(2)
        for angles, approaches in _TRIED:
            grid = np.meshgrid(np.radians(angles), approaches)
            tried = way + np.stack(grid, axis=-1).reshape(-1, 2)
            way = tried[int(score(tried, some).argmax())]
        return way

    way = best(np.s_[:])
    turns = [best(np.s_[n::4])[0] - way[0] for n in range(4)]
    error = np.sqrt((np.angle(np.exp(1j * np.array(turns))) ** 2).mean() / 3.0 + _SURE**2)
    this, other = score(np.array([way, (way[0] + np.pi, -way[1])]), np.s_[:])
    level = float(np.abs(profile).mean(axis=1).sum())
    share = (this - abs(other)) / max(level, 1e-12)
    return Direction(float(way[0]), float(way[1]), float(error), float(share))

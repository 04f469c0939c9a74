"""What a reader of the paper would write with NumPy and SciPy: the other side of our ratios."""

from __future__ import annotations

import numpy as np
import scipy.fft

import flurries as fl


def _steps(tile: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the tent's phase per frame of the half spectrum, cycles, and the amplitudes."""
    f = np.fft.fftfreq(tile)
    fy, fx = np.meshgrid(f, f[: tile // 2 + 1], indexing="ij")
    size = np.hypot(fy, fx)
    size[0, 0] = 1.0
    amplitude = fl.spectral.band_amplitude((tile, tile))[:, : tile // 2 + 1]
    return -(3.0 * fx + 9.0 * fy) / 32.0 / size, amplitude


def _alpha(z: np.ndarray) -> np.ndarray:
    return (np.clip(0.5 + z / 6.0, 0.0, 1.0) ** 2).astype(np.float32)


def straightforward(size: int = 1024, tile: int = 64, overlap: int = 10) -> np.ndarray:
    """Make a texture's alpha plainly: irfft2 of all tiles, a loop to blend."""
    starts = fl.spectral.tile_starts(size, tile=tile, overlap=overlap)
    step, amplitude = _steps(tile)
    ramp = np.minimum(1.0, (np.minimum(np.arange(tile), np.arange(tile)[::-1]) + 0.5) / overlap)
    weight = np.sin(np.pi / 2 * ramp)
    window = np.outer(weight, weight)
    length = starts[-1] + tile
    total, power = np.zeros((length, length)), np.zeros((length, length))
    rng = np.random.default_rng(1)
    phases = rng.random((len(starts), len(starts), tile, tile // 2 + 1)) + step
    tiles = np.fft.irfft2(amplitude * np.exp(2j * np.pi * phases), (tile, tile)) * tile**2
    for i, top in enumerate(starts):
        for j, left in enumerate(starts):
            place = np.s_[top : top + tile, left : left + tile]
            total[place] += window * tiles[i, j]
            power[place] += window**2
    return _alpha((total / np.sqrt(power))[:size, :size])


class Tuned:
    """The same with care: float32, the band's bins alone, two workers, a blend without a loop.

    Tiles are added in four groups that do not overlap, each as one strided block.
    """

    def __init__(self, size: int = 1024, tile: int = 64, overlap: int = 10) -> None:
        self.size, self.tile, self.step = size, tile, tile - overlap
        self.starts = fl.spectral.tile_starts(size, tile=tile, overlap=overlap)
        steps, amplitude = _steps(tile)
        self.bins = np.nonzero(amplitude)
        self.amplitude = amplitude[self.bins].astype(np.float32) * tile**2
        self.cycles = steps[self.bins].astype(np.float32)
        count = len(self.starts)
        rng = np.random.default_rng(1)
        self.phases = rng.random((count, count, len(self.cycles)), np.float32)
        self.spectrum = np.zeros((count, count, tile, tile // 2 + 1), np.complex64)
        ramp = np.minimum(np.arange(tile), np.arange(tile)[::-1]) + 0.5
        weight = np.sin(np.pi / 2 * np.minimum(1.0, ramp / overlap)).astype(np.float32)
        self.window = np.outer(weight, weight)

    def __call__(self) -> np.ndarray:
        turn = np.float32(2 * np.pi) * (self.phases + self.cycles)
        bins = np.empty(turn.shape, np.complex64)
        np.cos(turn, out=bins.real)
        np.sin(turn, out=bins.imag)
        bins *= self.amplitude
        self.spectrum[:, :, self.bins[0], self.bins[1]] = bins
        tiles = scipy.fft.irfft2(self.spectrum, (self.tile, self.tile), workers=2)
        tiles *= self.window
        length = self.starts[-1] + 2 * self.tile
        total = np.zeros((length, length), np.float32)
        for down in (0, 1):
            for across in (0, 1):
                group = tiles[down::2, across::2]
                rows, cols = group.shape[:2]
                blocks = total[down * self.step :, across * self.step :]
                blocks = blocks[: 2 * self.step * rows, : 2 * self.step * cols]
                view = blocks.reshape(rows, 2 * self.step, cols, 2 * self.step)
                view[:, : self.tile, :, : self.tile] += group.transpose(0, 2, 1, 3)
        # The weights' squares sum to 1 in this law but for the ramps' own rounding.
        return _alpha(total[: self.size, : self.size])


def cloud(count: int, size: int, focal: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points spread over the picture and radii that are 1 to 4 px in it."""
    rng = np.random.default_rng(1)
    z = rng.uniform(2, 20, count)
    x, y = ((rng.uniform(0, size, count) - size / 2) * z / focal for _ in range(2))
    return np.stack([x, y, z], 1), rng.uniform(1, 4, count) * z / focal


def discs(points: np.ndarray, radius: np.ndarray, size: int, focal: float) -> np.ndarray:
    """Draw Gaussian discs of opacity 1/2 by bincount, those of one size together."""
    x, y = (focal * points[:, axis] / points[:, 2] + size / 2 for axis in (0, 1))
    raw = (focal * radius / points[:, 2] / 3.0) ** 2
    wide = np.maximum(raw + 1.0 / 12.0, 0.38)
    dimmed = np.zeros(size * size)
    for some in np.array_split(np.argsort(wide), 16):
        sigma = np.sqrt(wide[some])[:, None]
        steps = np.arange(-np.ceil(4.0 * sigma[-1, 0]), np.ceil(4.0 * sigma[-1, 0]) + 1.0)
        rows, columns = (np.floor(place[some])[:, None] + steps for place in (y, x))
        down, across = (
            np.exp(-0.5 * ((at + 0.5 - place[some][:, None]) / sigma) ** 2)
            * ((at >= 0) & (at < size))
            for at, place in ((rows, y), (columns, x))
        )
        down *= 0.5 * (raw / wide)[some][:, None]
        place = np.clip(rows, 0, size - 1)[:, :, None] * size
        place = (place + np.clip(columns, 0, size - 1)[:, None, :]).astype(np.int64)
        light = np.log1p(-down[:, :, None] * across[:, None, :])
        dimmed += np.bincount(place.ravel(), light.ravel(), size * size)
    return 1.0 - np.exp(dimmed).reshape(size, size)

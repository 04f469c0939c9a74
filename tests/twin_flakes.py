"""The texture of flakes in plain NumPy and float64: slow, and written from the equations."""

import math

import numpy as np

import twin


def share(length: int, center: float, sigma: float) -> np.ndarray:
    """Of a Gaussian in each pixel of an axis; pixel i reaches from i - 1/2 to i + 1/2."""
    edges = (np.arange(length + 1) - 0.5 - center) / (sigma * math.sqrt(2.0))
    return np.diff([math.erf(edge) for edge in edges]) / 2.0


def on_torus(
    tile: int, x: float, y: float, diameter: float, opacity: float, shear: float
) -> np.ndarray:
    """A flake on the lattice (M, 0), (shear M, M), averaged over the square of each pixel."""
    sigma = max(diameter / math.sqrt(8.0), 0.3)
    found = np.zeros((tile, tile))
    reach = math.ceil(9.0 * sigma / tile) + 1
    for n in range(-reach, reach + 1):
        across = sum(
            share(tile, x + (m + n * shear) * tile, sigma)
            for m in range(-2 * reach - 1, 2 * reach + 2)
        )
        found += np.outer(share(tile, y + n * tile, sigma), across)
    return opacity * math.pi * diameter**2 / 4.0 * found


def spectrum(pixels: np.ndarray, shear: float) -> np.ndarray:
    """Direct sum of pixels over the waves (a, b - shear a) / M, half a cycle left out."""
    tile = len(pixels)
    y, x = np.mgrid[:tile, :tile]
    found = np.zeros((tile, tile // 2 + 1), complex)
    for b in range(tile):
        for a in range(tile // 2 + 1):
            if 2 * a != tile and 2 * b != tile:
                turns = (a * x + (b - shear * a) * y) / tile
                found[b, a] = (pixels * np.exp(-2j * np.pi * turns)).sum()
    return found


def tile_of(
    spectra: np.ndarray, shift: np.ndarray, streak: np.ndarray, gain: np.ndarray, shear: float
) -> np.ndarray:
    """One tile of the patterns (L, M, M // 2 + 1): the sum over all waves of both halves."""
    tile = spectra.shape[1]
    b = np.fft.fftfreq(tile, 1.0 / tile)[:, None]
    a = np.arange(tile // 2 + 1)[None, :]
    kx, ky = (a + 0.0 * b) / tile, (b - shear * a) / tile
    total = np.zeros(kx.shape, complex)
    for layer, (x, y) in enumerate(shift):
        turn = np.exp(-2j * np.pi * (kx * x + ky * y))
        blur = np.sinc(kx * streak[layer][0] + ky * streak[layer][1])
        total += gain[layer] * spectra[layer] * turn * blur
    total[(2 * np.abs(b) == tile) & (a >= 0) | (2 * a == tile) & (b == b)] = 0.0
    # Columns a > 0 stand for their opposites as well.
    total[:, 1:] *= 2.0
    y, x = np.mgrid[:tile, :tile]
    rows = np.exp(2j * np.pi * ky[:, None, :] * np.arange(tile)[None, :, None])
    between = (total[:, None, :] * rows).sum(0)
    columns = np.exp(2j * np.pi * np.arange(tile // 2 + 1)[:, None] * np.arange(tile) / tile)
    return (between @ columns).real / tile**2


def optical_depth(
    shape: tuple[int, int], spectra: np.ndarray, *, drift: np.ndarray,
    velocity: np.ndarray | None = None, shutter: float = 0.0, gain: np.ndarray | None = None,
    shear: float = 0.0, overlap: int = 10,
) -> np.ndarray:  # fmt: skip
    """A frame in which every tile has pattern 0, unshifted."""
    layers, _, tile, _ = spectra.shape
    rows, cols = (len(twin.tile_starts(n, tile=tile, overlap=overlap)) for n in shape)

    def each(vectors: np.ndarray) -> np.ndarray:
        return np.broadcast_to(vectors, (rows, cols, layers, 2))

    shifts = each(np.asarray(drift))
    streaks = each(np.zeros((layers, 2)) if velocity is None else shutter * np.asarray(velocity))
    gains = np.ones(layers) if gain is None else np.asarray(gain)
    mean = float((gains * spectra[:, 0, 0, 0].real).sum()) / tile**2
    tiles = np.empty((rows, cols, tile, tile))
    for row in range(rows):
        for col in range(cols):
            at = shifts[row, col], streaks[row, col]
            tiles[row, col] = tile_of(spectra[:, 0], *at, gains, shear) - mean
    return np.maximum(0.0, mean + twin.blend_tiles(tiles, shape, overlap=overlap, blend="power"))

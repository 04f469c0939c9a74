"""How a texture of waves moves from one frame to the next, as one vector for each tile."""

from collections.abc import Sequence

import numpy as np

from flurries._contract import Float64
from flurries._kept import kept
from flurries.spectral.frame import Request
from flurries.spectral.tables import band_amplitude, temporal_gain
from flurries.spectral.tiles import tile_starts

_TILES = 64  # Tiles whose waves are looked at together.


def tile_motions(now: Request, others: Sequence[Request]) -> tuple[list[Float64], Float64]:
    """Return the motions, px, of each tile's field to other frames, and its wavelength."""
    # Waves of a texture that stands for many depths move at many speeds. The vector (rows, cols, 2)
    # is that of the shift that predicts the other frame best, to first order: the least squares of
    # the waves' phase errors, sum a^2 (k . (v - v_k))^2, over the waves with their amplitudes a as
    # the alias law, the shutter and the scene's depth leave them. Without wind that varies over
    # depth it is the drift of the wavelength L at which the field has its gradients, L = sum a^2 k
    # / sum a^2 k^2; the longest where nothing is left of a tile.
    rows, cols = (
        len(tile_starts(n, tile=m, overlap=now.overlap))
        for n, m in zip(now.shape, now.tile, strict=True)
    )
    shortest = np.zeros((1, 1)) if now.shortest is None else now.shortest
    parts = [now.velocity, now.shift_rate]
    for other in others:
        parts += [other.drift - now.drift, other.shift - now.shift]
    rings = max(part.shape[2] for part in parts)
    whole = (rows, cols, rings, 2)
    wide = [np.broadcast_to(part, whole).reshape(rows * cols, -1) for part in parts]
    wide.append(np.broadcast_to(shortest, (rows, cols)).reshape(-1, 1))
    # Tiles of a camera that does not come nearer are all alike.
    kinds, which = np.unique(np.concatenate(wide, axis=1), axis=0, return_inverse=True)
    # So many at a time that their waves stay in a cache.
    some = [kinds[first : first + _TILES] for first in range(0, len(kinds), _TILES)]
    found = np.concatenate([_fitted(now, part, rings) for part in some])[which.ravel()]
    pairs = found[:, :-1].reshape(rows, cols, len(others), 2)
    return list(np.moveaxis(pairs, 2, 0)), found[:, -1].reshape(rows, cols)


def _fitted(now: Request, kinds: Float64, rings: int) -> Float64:
    """Return motions x, y to each other frame, and the wavelength, of tiles: (n, 2 others + 1)."""
    k, power, length, ring, sums = _waves(
        now.tile, now.wavelengths, now.exponent, tuple(now.ring_edges.tolist()), rings
    )
    near = length / now.wavelengths[1]
    velocity, turned, *ways = np.moveaxis(kinds[:, :-1].reshape(len(kinds), -1, rings, 2), 1, 0)
    rate = np.empty((len(kinds), len(k)))
    for which in range(rings):
        own = ring == which if rings > 1 else slice(None)
        # Not a product of matrices: two terms wake the threads of BLAS.
        drifts, shifts = velocity[:, which, :, None], turned[:, which, :, None]
        kx, ky = k[own].T
        rate[:, own] = drifts[:, 0] * (near[own] * kx) + drifts[:, 1] * (near[own] * ky)
        if shifts.any():
            rate[:, own] += shifts[:, 0] * kx + shifts[:, 1] * ky
    gain = temporal_gain(rate, alias=now.alias, soft_from=now.soft_from, shutter=now.shutter)
    kept = np.where(length > kinds[:, -1:], power, 0.0)
    weight = kept * gain**2
    # Blurred away, or no air: what it would be.
    none = weight.sum(axis=1) <= 1e-9 * power.sum()
    weight[none] = np.where(kept[none].any(axis=1)[:, None], kept[none], power)
    summed = weight @ sums
    # Of each ring sum a^2 k k^T, and the same times the part of the drift that its waves go.
    gradients, carried = summed[:, 2:].reshape(len(kinds), 2, rings, 2, 2).swapaxes(0, 1)
    inverse = np.linalg.pinv(gradients.sum(axis=1), rcond=1e-9, hermitian=True)
    found = []
    for moved, shifted in zip(ways[::2], ways[1::2], strict=True):
        pull = (carried @ moved[..., None] + gradients @ shifted[..., None]).sum(axis=1)
        found.append((inverse @ pull)[..., 0])
    return np.concatenate([*found, (summed[:, :1] / summed[:, 1:2])], axis=1)


@kept(4)
def _waves(
    tile: tuple[int, int], wavelengths: tuple[float, float], exponent: float,
    edges: tuple[float, ...], rings: int,
) -> tuple[Float64, Float64, Float64, np.ndarray, Float64]:  # fmt: skip
    """Return the waves of half the band: vectors, power, wavelength, ring, products."""
    # The last are what is summed over them with their weights, a column each, (n, 2 + 8 rings).
    power = band_amplitude(tile, wavelengths=wavelengths, exponent=exponent) ** 2
    ky, kx = np.meshgrid(np.fft.fftfreq(tile[0]), np.fft.fftfreq(tile[1]), indexing="ij")
    half = (power > 0.0) & ((ky > 0.0) | ((ky == 0.0) & (kx > 0.0)))
    k = np.stack([kx[half], ky[half]], axis=1)
    length = 1.0 / np.hypot(k[:, 0], k[:, 1])
    ring = np.zeros(len(k), np.intp)
    if rings > 1:
        ring = np.clip(np.searchsorted(edges, length, side="left") - 1, 0, rings - 1)
    products = (k[:, :, None] * k[:, None]).reshape(-1, 1, 1, 4)
    # By ring, for waves as they are and times the part of the drift that they go.
    parts = np.stack([np.ones_like(length), length / wavelengths[1]], axis=1)[:, :, None, None]
    own = (ring[:, None] == np.arange(rings))[:, None, :, None]
    tables = (products * parts * own).reshape(len(k), -1)
    sums = np.column_stack([1.0 / length, 1.0 / length**2, tables])
    return k, power[half], length, ring, sums

"""The texture: precision, transforms, the two methods, the shutter."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries.accuracy import reference
from flurries.accuracy.ways import Way, largest, rms

BAND = (4.0, 32.0)
DRIFT = np.array([37.25, 411.5])


def precision() -> list[Way]:
    """float32 and float64, whole frames and a reader's NumPy."""
    shape = (512, 512)
    off = largest(reference.field(shape, drift=DRIFT, seed=7))

    def frame(dtype: Any) -> Way:
        out = np.empty(shape, dtype)
        return Way(
            f"field, {np.dtype(dtype).name}",
            lambda: spectral.field(shape, drift=DRIFT, seed=7, dtype=dtype, out=out),
            off,
        )

    def steps(dtype: Any) -> Way:
        return Way(f"step by step, {np.dtype(dtype).name}", lambda: _by_steps(shape, dtype), off)

    def reader(dtype: Any) -> Way:
        return Way(f"plain NumPy, {np.dtype(dtype).name}", lambda: _plain(shape, dtype), off)

    kinds = (np.float32, np.float64)
    return [make(kind) for make in (frame, steps, reader) for kind in kinds]  # fmt: skip


def _tiles(shape: tuple[int, int]) -> tuple[int, int]:
    return tuple(len(spectral.tile_starts(n)) for n in shape)  # type: ignore[return-value]


def _by_steps(shape: tuple[int, int], dtype: Any) -> Array:
    rows, cols = _tiles(shape)
    amplitude = spectral.band_amplitude((64, 64))
    tiles = np.empty((rows, cols, 64, 64), dtype)
    for row in range(rows):
        for col in range(cols):
            start = spectral.random_phase((64, 64), seed=7, tile=(row, col))
            phase = spectral.advance_phase(start, DRIFT)
            spectral.inverse_transform(amplitude, phase, dtype=dtype, out=tiles[row, col])
    return spectral.blend_tiles(tiles, shape)


def _plain(shape: tuple[int, int], dtype: Any) -> Array:
    """What a reader of the paper writes: all in one precision, the phase too."""
    rows, cols = _tiles(shape)
    complex_ = np.result_type(dtype, np.complex64)
    ky = np.fft.fftfreq(64).astype(dtype)[:, None]
    kx = np.fft.rfftfreq(64).astype(dtype)[None, :]
    length = np.hypot(ky, kx)
    length[0, 0] = 1
    moved = (DRIFT[0].astype(dtype) * kx + DRIFT[1].astype(dtype) * ky) / (length * dtype(32))
    amplitude = spectral.band_amplitude((64, 64))[:, :33].astype(dtype)
    start = np.stack([
        [spectral.random_phase((64, 64), seed=7, tile=(r, c))[:, :33] for c in range(cols)]
        for r in range(rows)
    ]).astype(dtype)  # fmt: skip
    turns = (2 * np.pi * (start - moved)).astype(dtype)
    spectrum = (amplitude * (np.cos(turns) + 1j * np.sin(turns))).astype(complex_)
    tiles = np.fft.irfft2(spectrum, s=(64, 64), norm="forward").astype(dtype)
    return spectral.blend_tiles(tiles, shape)


def transform() -> list[Way]:
    """Fused or from tables, 64 or 256 px, and NumPy's."""
    return [way for size in (64, 256) for way in _transforms(size)]


def _transforms(size: int) -> list[Way]:
    shape = (size, size)
    off = largest(reference.torus(size, 3, DRIFT, BAND))
    amplitude = spectral.band_amplitude(shape)
    phase = spectral.advance_phase(spectral.random_phase(shape, seed=3), DRIFT)

    def fused(dtype: Any) -> Way:
        field = partial(spectral.field, shape, drift=DRIFT, seed=3, tile=size, overlap=0)
        return Way(f"{size} px fused, {np.dtype(dtype).name}", partial(field, dtype=dtype), off)

    def tables(dtype: Any) -> Way:
        make = partial(spectral.inverse_transform, amplitude, phase, dtype=dtype)
        return Way(f"{size} px from tables, {np.dtype(dtype).name}", make, off)

    def numpy_() -> Array:
        half = (slice(None), slice(size // 2 + 1))
        spectrum = amplitude[half] * np.exp(2j * np.pi * phase[half])
        return np.asarray(np.fft.irfft2(spectrum, s=shape, norm="forward"))

    ways = [make(dtype) for make in (fused, tables) for dtype in (np.float32, np.float64)]
    return [*ways, Way(f"{size} px numpy.fft.irfft2, float64", numpy_, off)]


def film() -> list[Way]:
    """Frames of the 2-D method, and the 3-D method's films of several lengths."""
    velocity = np.array([0.5, 2.0])
    count = 32
    exact = np.stack([reference.torus(64, 5, velocity * t, BAND) for t in range(count)])
    off = rms(exact)

    def flat(dtype: Any) -> Way:
        def make() -> Array:
            return np.stack([
                spectral.field((64, 64), drift=velocity * t, seed=5, overlap=0, dtype=dtype)
                for t in range(count)
            ])  # fmt: skip

        return Way(f"2-D, {np.dtype(dtype).name}", make, off, count)

    def solid(length: int) -> Way:
        return Way(
            f"3-D, {length} frames",
            lambda: spectral.volume(length, 64, velocity, seed=5),
            lambda made: off(made[:count]),
            length,
        )

    return [flat(np.float32), flat(np.float64), *[solid(n) for n in (32, 64, 128, 256)]]


def shutter() -> list[Way]:
    """The exposure as one factor for each wave, or as a mean of sub-frames."""
    shape, velocity = (256, 256), np.array([2.0, 8.0])
    nodes, weights = np.polynomial.legendre.leggauss(64)
    exact = sum(
        0.5 * weight * reference.field(shape, drift=DRIFT + velocity * 0.5 * node, seed=7)
        for node, weight in zip(nodes, weights, strict=True)
    )
    off = rms(np.asarray(exact))

    def factor(dtype: Any) -> Way:
        return Way(
            f"sinc, {np.dtype(dtype).name}",
            lambda: spectral.field(
                shape, drift=DRIFT, seed=7, velocity=velocity, shutter=1.0, dtype=dtype
            ),
            off,
        )

    def parts(count: int) -> Way:
        def make() -> Array:
            total = np.zeros(shape, np.float32)
            for i in range(count):
                at = DRIFT + velocity * ((i + 0.5) / count - 0.5)
                total += spectral.field(shape, drift=at, seed=7)
            return np.asarray(total / np.float32(count))

        return Way(f"{count} sub-frames", make, off)

    return [factor(np.float32), factor(np.float64), *[parts(n) for n in (1, 2, 4, 8, 16, 64)]]

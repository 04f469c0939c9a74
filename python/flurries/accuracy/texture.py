"""The axes of the texture's arithmetic: precision, transforms, modes, phases, the two methods."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries._threads import reproducible, set_reproducible
from flurries.accuracy import reference
from flurries.accuracy.ways import KINDS, Way, axis, both, largest, rms

BAND = (4.0, 32.0)
DRIFT = np.array([37.25, 411.5])


@axis("in sigma, largest", "phases and transform in extended precision")
def precision() -> Iterator[Way]:
    """Precision and kernels of the texture, 512 x 512."""
    shape = (512, 512)
    off = largest(reference.field(shape, drift=DRIFT, seed=7))
    yield from both("field", partial(spectral.field, shape, drift=DRIFT, seed=7), off)
    yield from both("step by step", partial(_steps, shape), off)
    yield from both("plain NumPy", partial(_plain, shape), off)


def _starts(shape: tuple[int, int]) -> Array:
    """Return the phases of all tiles at time 0, (rows, cols, 64, 64)."""
    rows, cols = (range(len(spectral.tile_starts(length))) for length in shape)
    start = partial(spectral.random_phase, (64, 64), seed=7)
    return np.array([[start(tile=(row, col)) for col in cols] for row in rows])


def _steps(shape: tuple[int, int], dtype: Any) -> Array:
    starts, amplitude = _starts(shape), spectral.band_amplitude((64, 64))
    tiles = np.empty(starts.shape, dtype)
    for place in np.ndindex(*starts.shape[:2]):
        phase = spectral.advance_phase(starts[place], DRIFT)
        spectral.inverse_transform(amplitude, phase, dtype=dtype, out=tiles[place])
    return spectral.blend_tiles(tiles, shape)


def _plain(shape: tuple[int, int], dtype: Any) -> Array:
    """Return a frame all in one precision, the phase too."""
    ky = np.fft.fftfreq(64).astype(dtype)[:, None]
    kx = np.fft.rfftfreq(64).astype(dtype)[None, :]
    length = np.hypot(ky, kx)
    length[0, 0] = 1
    moved = (DRIFT[0].astype(dtype) * kx + DRIFT[1].astype(dtype) * ky) / (length * dtype(32))
    amplitude = spectral.band_amplitude((64, 64))[:, :33].astype(dtype)
    turns = (2 * np.pi * (_starts(shape)[..., :33].astype(dtype) - moved)).astype(dtype)
    spectrum = amplitude * (np.cos(turns) + 1j * np.sin(turns))
    whole = spectrum.astype(np.result_type(dtype, np.complex64))
    tiles = np.fft.irfft2(whole, s=(64, 64), norm="forward").astype(dtype)
    return spectral.blend_tiles(tiles, shape)


@axis("in sigma, largest", "the inverse transform in extended precision, of the same tile")
def transform() -> Iterator[Way]:
    """Transforms of one tile."""
    for size in (64, 256):
        shape = (size, size)
        off = largest(reference.torus(size, 3, DRIFT, BAND))
        amplitude = spectral.band_amplitude(shape)
        phase = spectral.advance_phase(spectral.random_phase(shape, seed=3), DRIFT)
        whole = partial(spectral.field, shape, drift=DRIFT, seed=3, tile=size, overlap=0)
        tables = partial(spectral.inverse_transform, amplitude, phase)
        yield from both(f"{size} px fused", whole, off)
        yield from both(f"{size} px from tables", tables, off)
        yield Way(f"{size} px numpy.fft.irfft2, float64", partial(_numpy, amplitude, phase), off)


def _numpy(amplitude: Array, phase: Array) -> Array:
    half = (slice(None), slice(len(phase) // 2 + 1))
    spectrum = amplitude[half] * np.exp(2j * np.pi * phase[half])
    return np.asarray(np.fft.irfft2(spectrum, s=phase.shape, norm="forward"))


@axis("in sigma, largest", "phases and transform in extended precision")
def modes() -> Iterator[Way]:
    """The same bits on every processor, texture of 512 x 512."""
    shape = (512, 512)
    for tile, overlap, band in ((64, 10, BAND), (256, 20, (2.0, 64.0))):
        about: dict[str, Any] = {"drift": DRIFT, "seed": 7, "tile": tile, "overlap": overlap}
        off = largest(reference.field(shape, band=band, **about))
        frame = partial(spectral.field, shape, wavelengths=band, **about)
        for on, mark in ((False, ""), (True, ", reproducible")):
            for way in both(f"{band[0]:g} to {band[1]:g} px", partial(_in_mode, on, frame), off):
                yield way._replace(setting=way.setting + mark)


def _in_mode(on: bool, make: Any, dtype: Any) -> Any:
    before = reproducible()
    set_reproducible(on)
    try:
        return make(dtype=dtype)
    finally:
        set_reproducible(before)


@axis("in cycles, largest", "rate times time in extended precision")
def phase(frames: int = 100_000) -> Iterator[Way]:
    """Ways to advance 392 phases, after 10^5 frames."""
    ky, kx, length = reference.waves(64)
    inside = (reference.amplitude(64, BAND) > 0) & ((kx > 0) | ((kx == 0) & (ky > 0)))
    rate = reference.Long(0.1) * (0.28 * kx + 0.96 * ky)[inside] / length[inside]

    def off(cycles: Array) -> float:
        rest = np.asarray(cycles, reference.Long) - rate * frames
        return float(np.max(np.abs(rest - np.round(rest))))

    for kind, turn in zip(KINDS, (np.complex64, np.complex128), strict=True):
        own = rate.astype(kind)
        step = np.exp(2j * np.pi * rate.astype(np.float64)).astype(turn)
        yield Way(f"closed form, {kind.__name__}", partial(_reduced, own, frames), off)
        yield Way(f"running sum, {kind.__name__}", partial(_summed, own, frames), off, frames)
        yield Way(f"rotor, {turn.__name__}", partial(_turned, step, frames), off, frames)


def _reduced(rate: Array, frames: int) -> Array:
    turns = rate * rate.dtype.type(frames)
    return np.asarray(turns - np.rint(turns))


def _summed(rate: Array, frames: int) -> Array:
    at = np.zeros_like(rate)
    for _ in range(frames):
        at += rate
        at -= np.rint(at)
    return at


def _turned(step: Array, frames: int) -> Array:
    at = np.ones_like(step)
    for _ in range(frames):
        at *= step
    return np.asarray(np.angle(at.astype(np.complex128)) / (2 * np.pi))


@axis("in sigma, rms", "the 2-D sum with unrounded rates, in extended precision")
def film() -> Iterator[Way]:
    """2-D method against 3-D method, 64 x 64."""
    velocity, count = np.array([0.5, 2.0]), 32
    off = rms(np.stack([reference.torus(64, 5, velocity * t, BAND) for t in range(count)]))

    def flat(dtype: Any) -> Array:
        frame = partial(spectral.field, (64, 64), seed=5, overlap=0, dtype=dtype)
        return np.stack([frame(drift=velocity * t) for t in range(count)])

    yield from (way._replace(per=count) for way in both("2-D", flat, off))
    for length in (32, 64, 128, 256):
        solid = partial(spectral.volume, length, 64, velocity, seed=5)
        yield Way(f"3-D, {length} frames", solid, lambda made: off(made[:count]), length)

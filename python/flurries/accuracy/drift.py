"""Ways to advance phases over a long film."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.accuracy.reference import Long, amplitude, waves
from flurries.accuracy.ways import Way

FRAMES = 100_000
CYCLES = 0.1


def phase() -> list[Way]:
    """Closed form, running sums and rotors; the time is that of a frame."""
    ky, kx, length = waves(64)
    inside = (amplitude(64, (4.0, 32.0)) > 0) & ((kx > 0) | ((kx == 0) & (ky > 0)))
    rate = Long(CYCLES) * (0.28 * kx + 0.96 * ky)[inside] / length[inside]
    exact = rate * FRAMES

    def off(cycles: Array) -> float:
        rest = np.asarray(cycles, Long) - exact
        return float(np.max(np.abs(rest - np.round(rest))))

    def closed(dtype: Any) -> Way:
        own = rate.astype(dtype)

        def make() -> Array:
            turned = own * dtype(FRAMES)
            return np.asarray(turned - np.floor(turned + dtype(0.5)))

        return Way(f"closed form, {np.dtype(dtype).name}", make, off)

    def summed(dtype: Any) -> Way:
        own = rate.astype(dtype)

        def make() -> Array:
            at = np.zeros_like(own)
            for _ in range(FRAMES):
                at += own
                at -= np.rint(at)
            return np.asarray(at)

        return Way(f"running sum, {np.dtype(dtype).name}", make, off, FRAMES)

    def rotor(dtype: Any) -> Way:
        step = np.exp(2j * np.pi * rate.astype(np.float64)).astype(dtype)

        def make() -> Array:
            at = np.ones_like(step)
            for _ in range(FRAMES):
                at *= step
            return np.asarray(np.angle(at.astype(np.complex128)) / (2 * np.pi))

        return Way(f"rotor, {np.dtype(dtype).name}", make, off, FRAMES)

    return [
        closed(np.float64), closed(np.float32), summed(np.float64), summed(np.float32),
        rotor(np.complex128), rotor(np.complex64),
    ]  # fmt: skip

"""Two eyes: what one complex transform for both would save. Ratios in one run.

python benches/stereo.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy import fft

import flurries as fl

ROUNDS = 25


def best(work: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the shortest time of each, interleaved, seconds."""
    times = {name: [] for name in work}
    for _ in range(ROUNDS):
        for name, run in work.items():
            start = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - start)
    return {name: min(all_) for name, all_ in times.items()}


def transforms(size: int) -> None:
    """One complex inverse transform against two real ones, by the same library."""
    rng = np.random.default_rng(0)
    half = [rng.normal(size=(size, size // 2 + 1)) + 1j for _ in range(2)]
    whole = rng.normal(size=(size, size)) + 1j * rng.normal(size=(size, size))
    many = max(1, 256 // size) ** 2
    found = best(
        {
            "two real": lambda: [
                fft.irfft2(h, s=(size, size), overwrite_x=False) for _ in range(many) for h in half
            ],
            "one complex": lambda: [fft.ifft2(whole) for _ in range(many)],
        }
    )
    print(f"{size} px: one complex / two real {found['one complex'] / found['two real']:.2f}")


def frames(tile: int) -> None:
    """A frame of the texture for two eyes against one."""
    shape = (1024, 1024)
    out = np.empty(shape, np.float32)

    def eye(drift: float) -> None:
        fl.spectral.field(shape, drift=(drift, 8.0), seed=1, tile=tile, overlap=10, out=out)

    found = best({"one": lambda: eye(1.0), "both": lambda: [eye(1.0), eye(4.0)]})
    print(f"tiles of {tile} px: both eyes / one {found['both'] / found['one']:.2f}")


if __name__ == "__main__":
    for pixels in (64, 128, 512):
        transforms(pixels)
    for pixels in (64, 512):
        frames(pixels)

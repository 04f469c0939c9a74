"""Two eyes: whole scenes, and what one complex transform for both would save. Ratios in one run.

python benches/stereo.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy import fft

import flurries as fl

ROUNDS = 25
ROUNDS_OF_SCENES = 8


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


def scenes() -> None:
    """Whole scenes for two eyes against one, in processor time."""
    fl.set_threads(1)
    rng = np.random.default_rng(1)
    picture = rng.integers(0, 255, (768, 1024, 3)).astype(np.uint8)
    rows = np.arange(768.0)[:, None]
    ground = np.where(rows > 400, 3.0 + 200.0 / np.maximum(rows - 399.0, 1.0), np.inf)
    deep = np.broadcast_to(ground, (768, 1024)).astype(np.float32)
    path = fl.CameraPath(fl.Camera(900.0), velocity=(0.0, 0.0, 1.0))
    heavy = fl.TentSnow.preset
    kinds = {
        "texture": [heavy("heavy", flakes=0)],
        "flakes": [heavy("heavy", texture=0.0)],
        "snow": [heavy("heavy")],
        "fog": [fl.Mist.preset("fog")],
        "fog and snow": [fl.Mist.preset("fog"), heavy("heavy")],
    }
    for name, effects in kinds.items():
        for about, depth in (("flat", None), ("with depth", deep)):
            shown = fl.Scene(None, picture, camera=path, effects=effects, depth=depth)
            times: tuple[list[float], list[float]] = ([], [])
            for t in range(ROUNDS_OF_SCENES):
                for eyes, least in enumerate(times):
                    start = time.process_time()
                    if eyes:
                        shown.stereo(t, distance=0.02, convergence=4.0)
                    else:
                        shown.render(t)
                    least.append(time.process_time() - start)
            one, two = (1e3 * min(found) for found in times)
            print(f"{name}, {about}: one eye {one:.1f} ms, both / one {two / one:.2f}")


if __name__ == "__main__":
    scenes()
    for pixels in (64, 128, 512):
        transforms(pixels)
    for pixels in (64, 512):
        frames(pixels)

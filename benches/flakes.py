"""Time the flakes against np.bincount and a copy of the alpha, in one run.

    python benches/flakes.py [--threads N] [--runs N] [--size N]

Variants take turns, so that a busy moment of the machine meets them all; read the ratios.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

import flurries as fl
from flurries import particles
from flurries.camera import Camera


def cloud(count: int, size: int, focal: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points spread over the picture and radii that are 1 to 4 px in it."""
    rng = np.random.default_rng(1)
    z = rng.uniform(2, 20, count)
    x, y = ((rng.uniform(0, size, count) - size / 2) * z / focal for _ in range(2))
    return np.stack([x, y, z], 1), rng.uniform(1, 4, count) * z / focal


def bincount(points: np.ndarray, radius: np.ndarray, size: int, focal: float) -> np.ndarray:
    """Sum the discs' log transmittance the way NumPy can: one big scatter."""
    z = points[:, 2]
    px, py = (focal * points[:, axis] / z + size / 2 for axis in (0, 1))
    raw = (focal * radius / 3 / z) ** 2
    variance = np.maximum(raw + 1 / 12, 0.38)
    grid = np.arange(-5, 6)
    columns = np.floor(px)[:, None] + grid
    rows = np.floor(py)[:, None] + grid
    across = np.exp(-0.5 * (columns + 0.5 - px[:, None]) ** 2 / variance[:, None])
    down = np.exp(-0.5 * (rows + 0.5 - py[:, None]) ** 2 / variance[:, None])
    alpha = 0.5 * (raw / variance)[:, None, None] * down[:, :, None] * across[:, None, :]
    inside = (rows >= 0) & (rows < size)
    inside = inside[:, :, None] & ((columns >= 0) & (columns < size))[:, None, :]
    index = (rows[:, :, None] * size + columns[:, None, :]).astype(np.int64)
    log = np.bincount(index[inside], np.log1p(-alpha[inside]), size * size)
    return -np.expm1(log.reshape(size, size)).astype(np.float32)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--counts", type=int, nargs="*", default=[2000, 30_000, 150_000])
    options = parser.parse_args()
    fl.set_threads(options.threads)
    size, focal = options.size, 1000.0
    camera = Camera(focal)
    source, target = np.random.default_rng(0).random((2, size, size), np.float32)
    for count in options.counts:
        points, radius = cloud(count, size, focal)
        z = points[:, 2:]
        rng = np.random.default_rng(2)
        angle = rng.uniform(0, 2 * np.pi, (count, 1))
        direction = np.hstack([np.cos(angle), np.sin(angle), np.zeros((count, 1))])
        wide = np.empty((size, size))
        variants: dict[str, Callable[[], object]] = {
            "memcpy": lambda: np.copyto(target, source),
            "discs f32": lambda p=points, r=radius: particles.splat(
                (size, size), p, r, camera, opacity=0.5, out=target
            ),
            "discs f64": lambda p=points, r=radius, o=wide: particles.splat(
                (size, size), p, r, camera, opacity=0.5, dtype=np.float64, out=o
            ),
        }
        for length in (1, 5, 20, 100):
            velocity = direction * z * (length / focal)
            variants[f"streaks {length} px f32"] = lambda p=points, r=radius, v=velocity: (
                particles.splat(
                    (size, size), p, r, camera, opacity=0.5, velocity=v, shutter=1, out=target
                )
            )
        variants["positions"] = lambda n=count: particles.positions(
            n, 10.0, seed=1, velocity=(0.1, 0.2, 0.3), time=5.0, sway=(0.1, 0.2)
        )
        times: dict[str, list[float]] = {name: [] for name in variants}
        for _ in range(options.runs):
            for name, call in variants.items():
                start = time.perf_counter()
                call()
                times[name].append(1e3 * (time.perf_counter() - start))
        times["np.bincount"] = []
        for _ in range(3):
            start = time.perf_counter()
            bincount(points, radius, size, focal)
            times["np.bincount"].append(1e3 * (time.perf_counter() - start))
        copy, scatter = min(times["memcpy"]), min(times["np.bincount"])
        print(f"{count} flakes, {size} x {size}, {options.threads} thread(s)")
        for name, values in times.items():
            least = min(values)
            print(
                f"  {name:20} min {least:9.3f} ms  median {statistics.median(values):9.3f} ms"
                f"  {least / copy:8.1f} memcpy  {least / scatter:7.4f} np.bincount"
            )


if __name__ == "__main__":
    main()

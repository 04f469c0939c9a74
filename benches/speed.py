"""The speeds in the README: ratios within one run, one frame of 1024 x 1024.

    python benches/speed.py [--runs N]

Variants take turns, so that a busy moment of the machine meets all of them. A row says the minimum
and the median in milliseconds, and the minimum against that of copying the alpha (4 MiB) in the
same run.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

import flurries as fl

SIZE = 1024
SHAPE = (SIZE, SIZE)
# Every tile has its own drift, as before a camera that flies forward.
TILES = len(fl.spectral.tile_starts(SIZE))
DRIFT = np.random.default_rng(3).normal(0.0, 5.0, (TILES, TILES, 2))
ARGUMENTS = {"drift": DRIFT, "seed": 1}


def straightforward() -> np.ndarray:
    """Make such an alpha as a reader of the paper would: irfft2 of all tiles, a loop to blend."""
    tile, overlap = 64, 10
    starts = fl.spectral.tile_starts(SIZE, tile=tile, overlap=overlap)
    amplitude = fl.spectral.band_amplitude((tile, tile))
    ramp = np.minimum(1.0, (np.minimum(np.arange(tile), np.arange(tile)[::-1]) + 0.5) / overlap)
    weight = np.sin(np.pi / 2 * ramp)
    length = starts[-1] + tile
    total, power = np.zeros((length, length)), np.zeros((length, length))
    rng = np.random.default_rng(1)
    f = np.fft.fftfreq(tile)
    fy, fx = np.meshgrid(f, f[: tile // 2 + 1], indexing="ij")
    size = np.hypot(fy, fx)
    size[0, 0] = 1.0
    step = -(3.0 * fx + 9.0 * fy) / 32.0 / size
    phases = rng.random((len(starts), len(starts), tile, tile // 2 + 1)) + step
    half = amplitude[:, : tile // 2 + 1] * np.exp(2j * np.pi * phases)
    tiles = np.fft.irfft2(half, (tile, tile)) * tile**2
    window = np.outer(weight, weight)
    for i, top in enumerate(starts):
        for j, left in enumerate(starts):
            place = np.s_[top : top + tile, left : left + tile]
            total[place] += window * tiles[i, j]
            power[place] += window**2
    z = (total / np.sqrt(power))[:SIZE, :SIZE]
    return (np.clip(0.5 + z / 6.0, 0.0, 1.0) ** 2).astype(np.float32)


def variants() -> dict[str, Callable[[], object]]:
    """Return what is timed, by the name in the table."""
    out = np.empty(SHAPE, np.float32)
    wide = np.empty(SHAPE, np.float64)
    source = np.random.default_rng(0).random(SHAPE, np.float32)
    target = np.empty_like(source)
    picture = np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), np.uint8)
    texture = fl.Snow.preset("heavy", flakes=0)
    scenes = {
        "scene: heavy snow, texture alone, uint8 RGB": fl.Scene(None, picture, effects=[texture]),
        "scene: heavy snow, 20,000 flakes and texture": fl.Scene(
            None, picture, effects=[fl.Snow.preset("heavy")]
        ),
        "scene: heavy snow, 30,000 flakes and texture": fl.Scene(
            None, picture, effects=[fl.Snow.preset("heavy", flakes=30_000)]
        ),
        "scene: heavy snow, flying forward, no flakes": fl.Scene(
            None,
            picture,
            camera=fl.CameraPath(fl.Camera(1.2 * SIZE), velocity=(0.0, 0.0, 3.0)),
            effects=[texture],
        ),
    }
    camera = fl.camera.Camera(1000.0)
    rng = np.random.default_rng(2)
    z = rng.uniform(2, 20, 150_000)
    points = np.stack([(rng.random(len(z)) - 0.5) * z, (rng.random(len(z)) - 0.5) * z, z], 1)
    radius = rng.uniform(1, 4, len(z)) * z / 1000.0
    result: dict[str, Callable[[], object]] = {
        "copy of the alpha": lambda: np.copyto(target, source),
        "texture, float32": lambda: fl.spectral.alpha(SHAPE, **ARGUMENTS, out=out),
        "texture, float64": lambda: fl.spectral.alpha(
            SHAPE, **ARGUMENTS, dtype=np.float64, out=wide
        ),
        "texture, straightforward NumPy": straightforward,
        "150,000 flakes of 1-4 px": lambda: fl.particles.splat(
            SHAPE, points, radius, camera, opacity=0.5, out=out
        ),
    }
    for name, scene in scenes.items():
        result[name] = lambda scene=scene: scene.render(17)
    return result


def main() -> None:
    """Print the tables for one thread and for two."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    runs = parser.parse_args().runs
    for threads in (1, 2):
        fl.set_threads(threads)
        calls = variants()
        times: dict[str, list[float]] = {name: [] for name in calls}
        for turn in range(runs + 2):
            for name, call in calls.items():
                start = time.perf_counter()
                call()
                # The first turns warm caches and page in the outputs.
                if turn >= 2:
                    times[name].append(1e3 * (time.perf_counter() - start))
        floor = min(times["copy of the alpha"])
        print(f"{threads} thread{'s' if threads > 1 else ''}, {runs} runs, {SIZE} x {SIZE}")
        print(f"{'':<46}{'min ms':>9}{'median':>9}{'/ copy':>9}")
        for name, values in times.items():
            least, middle = min(values), statistics.median(values)
            print(f"{name:<46}{least:>9.2f}{middle:>9.2f}{least / floor:>9.1f}")
        print()


if __name__ == "__main__":
    main()

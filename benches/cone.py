"""The double cone's two properties and its speed, as ratios within one run.

    python benches/cone.py [--runs N] [--size N] [--plot FILE]

Variants take turns on one thread, and processor time is counted, so that a busy machine
matters less; read the ratios. Where OpenCV can be imported, four of its warps are timed beside.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import numpy as np

import flurries as fl
from flurries import cone

AXIS = (0.1, 1.0, 0.05)
COUNTS = (300, 1000, 3000, 10_000, 30_000, 100_000, 300_000)


def least(calls: dict[str, Callable[[], object]], runs: int) -> dict[str, float]:
    """Return the least time of each call in milliseconds; they take turns."""
    times = dict.fromkeys(calls, math.inf)
    for turn in range(runs + 2):
        for name, call in calls.items():
            start = time.process_time()
            call()
            if turn >= 2:
                times[name] = min(times[name], 1e3 * (time.process_time() - start))
    return times


def warps(size: int, focal: float, tile: np.ndarray) -> dict[str, Callable[[], object]]:
    """Return four scrolled textures warped by OpenCV, with kept maps and with new ones."""
    try:
        import cv2
    except ImportError:
        return {}
    cv2.setNumThreads(1)
    axis, first, second = (v.astype(np.float32) for v in cone.frame(AXIS))
    y, x = (np.mgrid[:size, :size] + 0.5 - size / 2).astype(np.float32)
    texels = len(tile)
    # Four copies side by side, since a remap wraps by its border only.
    wide = np.tile(tile, (2, 2)).astype(np.float32)

    def maps() -> list[tuple[np.ndarray, np.ndarray]]:
        p, q, s = (v[0] * x + v[1] * y + v[2] * np.float32(focal) for v in (first, second, axis))
        across, turn = cv2.cartToPolar(p, q)
        height = s / across
        u = turn * np.float32(4 * texels / (2 * math.pi))
        v = height * np.float32(4 * texels / (2 * math.pi))
        return [(np.mod(k * u, texels), np.mod(k * v, texels)) for k in (1, 2, 4, 8)]

    kept = [cv2.convertMaps(u, v, cv2.CV_16SC2) for u, v in maps()]

    def drawn(charts: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        clear = np.ones((size, size), np.float32)
        for u, v in charts:
            # The scroll is a roll of the texture by whole texels: cheaper than new maps.
            rolled = np.roll(wide, 17, axis=0)
            alpha = cv2.remap(rolled, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            clear = cv2.multiply(clear, 1.0 - alpha)
        return 1.0 - clear

    return {
        "OpenCV: four warps, kept maps": lambda: drawn(kept),
        "OpenCV: four warps, new maps": lambda: drawn(maps()),
    }


def speed(size: int, runs: int) -> None:
    """Print what a frame costs against a copy of its alpha."""
    shape, focal = (size, size), 1.2 * size
    camera = fl.Camera(focal)
    tile = cone.rain_tile(512, seed=1)
    texture = cone.Texture(tile)
    still = cone.Mapping(shape, camera, axis=AXIS)
    out, (source, target) = (
        np.empty(shape, np.float32),
        np.random.default_rng(0).random((2, *shape), np.float32),
    )
    ahead = (0.1, 0.3, 1.0)
    calls: dict[str, Callable[[], object]] = {
        "copy of the alpha": lambda: np.copyto(target, source),
        "four layers, camera still": lambda: cone.layers(
            shape, camera, texture, axis=AXIS, phase=0.3, mapping=still, out=out
        ),
        "four layers, camera turning": lambda: cone.layers(
            shape, camera, texture, axis=AXIS, phase=0.3, out=out
        ),
        "four layers, flying ahead": lambda: cone.layers(
            shape, camera, texture, axis=ahead, phase=0.3, out=out
        ),
        "one layer, exact boxes": lambda: cone.layer(
            shape, camera, tile, axis=AXIS, phase=0.3, out=out
        ),
        **warps(size, focal, tile),
    }
    times = least(calls, runs)
    copy = times["copy of the alpha"]
    print(f"{size} x {size}, one thread, {runs} runs")
    for name, value in times.items():
        print(f"  {name:34}{value:9.2f} ms {value / copy:8.1f} copies")


def density(size: int, runs: int) -> dict[str, list[float]]:
    """Print and return the milliseconds of a frame by the number of flakes in view."""
    shape, camera = (size, size), fl.Camera(1.2 * size)
    curves: dict[str, list[float]] = {"cone": [], "particles": []}
    print(f"\ncost against density, {size} x {size}, one thread")
    print(f"  {'flakes':>8}{'cone':>11}{'particles':>11}")
    still = cone.Mapping(shape, camera, axis=AXIS)
    for count in COUNTS:
        rng = np.random.default_rng(count)
        z = rng.uniform(2.0, 24.0, count)
        points = np.stack([(rng.random(count) - 0.5) * z, (rng.random(count) - 0.5) * z, z], 1)
        points[:, :2] /= 1.2
        # As many in a tile of the texture; what a tile holds does not matter to a look-up.
        texture = cone.Texture(cone.snow_tile(512, seed=1, flakes=count))
        calls: dict[str, Callable[[], object]] = {
            "cone": lambda t=texture: cone.layers(
                shape, camera, t, axis=AXIS, phase=0.3, mapping=still
            ),
            "particles": lambda p=points: fl.particles.splat(
                shape, p, 0.01, camera, opacity=0.9, velocity=(0.01, 0.05, 0.0), shutter=0.5
            ),
        }
        times = least(calls, max(runs // 3, 3))
        for name, curve in curves.items():
            curve.append(times[name])
        print(f"  {count:>8}{times['cone']:>8.2f} ms{times['particles']:>8.2f} ms")
    spread = max(curves["cone"]) / min(curves["cone"])
    grown = curves["particles"][-1] / curves["particles"][0]
    print(f"  largest over least: cone {spread:.2f}, particles {grown:.0f}")
    return curves


def fall_speeds() -> None:
    """Print how fast rain falls on the screen at many frame rates, ours and as printed."""
    print("\nfall speed by frame rate, px/s of a drop of 6 m/s at 16 m, f = 1200 px (450)")
    print(f"  {'fps':>12}{'ours':>9}{'as printed':>12}")
    for fps in (15, 24, 30, 60, 120, "stuttering"):
        rate = 60 if fps == "stuttering" else fps
        times = np.arange(121) / rate
        if fps == "stuttering":
            times = times + np.random.default_rng(0).choice([0.0, 0.004, 0.012], 121)
        ours = cone.path(times, (0.0, 6.0, 0.0), radius=16.0, repeats=16, exposure=0.0)
        gone = np.unwrap(ours.phase, period=1.0)
        pixels = 2.0 * math.pi / 16 * 1200.0
        speeds = np.diff(gone) / np.diff(times) * pixels
        steps = np.diff(times)
        drop = np.broadcast_to((0.0, 6.0, 0.0), (len(steps), 3))
        length = np.linalg.norm(cone.travel(drop, published=True, dt=steps), axis=1)
        # Eq. 3 as printed, for streaks of 8 px and 20 px to a metre.
        printed = 30.0 * (8.0 + 20.0 * length)
        print(
            f"  {fps:>12}{speeds.min():>6.1f}-{speeds.max():<6.1f}"
            f"{printed.min():>6.0f}-{printed.max():<6.0f}"
        )


def plot(curves: dict[str, list[float]], file: str) -> None:
    """Draw the cost against the density, both logarithmic."""
    from matplotlib import pyplot as plt

    figure, ax = plt.subplots(figsize=(7.2, 4.4), dpi=100)
    for (name, curve), color in zip(curves.items(), ("#0060c0", "#c04000"), strict=True):
        ax.plot(COUNTS, curve, "o-", color=color)
        ax.annotate(name, (COUNTS[-1], curve[-1]), xytext=(8, -3), textcoords="offset points")
    ax.set(xscale="log", yscale="log", xlabel="flakes in view", ylabel="ms of processor time")
    ax.set_ylim(0.5 * min(map(min, curves.values())))
    ax.grid(True, color="#e4eaf0")
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(file, metadata={"Software": None})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--plot", metavar="FILE", help="draw cost against density")
    options = parser.parse_args()
    fl.set_threads(1)
    speed(options.size, options.runs)
    curves = density(options.size, options.runs)
    if options.plot:
        plot(curves, options.plot)
    fall_speeds()


if __name__ == "__main__":
    main()

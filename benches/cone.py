"""The double cone's two properties and its speed: ``python benches/cone.py [--plot FILE]``."""

from __future__ import annotations

import argparse
import math
import time
from functools import partial

import numpy as np
from timing import Calls, timed

import flurries as fl
from flurries import cone

AXIS = (0.1, 1.0, 0.05)
SIZE, RUNS = 1024, 25
COUNTS = (300, 1000, 3000, 10_000, 30_000, 100_000, 300_000)


def speed() -> None:
    shape, camera = (SIZE, SIZE), fl.Camera(1.2 * SIZE)
    tile = cone.rain_tile(512, seed=1)
    texture = cone.Texture(tile)
    source = np.random.default_rng(0).random(shape, np.float32)
    out = np.empty_like(source)
    layers = partial(cone.layers, shape, camera, texture, phase=0.3, out=out)
    # The second phase of an axis is looked up.
    layers(axis=AXIS, phase=0.2)
    calls: Calls = {
        "copy of the alpha": lambda: np.copyto(out, source),
        "four layers, camera still": partial(layers, axis=AXIS),
        "four layers, camera turning": partial(layers, axis=(0.1, 1.0, 0.06)),
        "four layers, flying ahead": partial(layers, axis=(0.1, 0.3, 1.0)),
        "one layer, exact boxes": partial(
            cone.layer, shape, camera, tile, axis=AXIS, phase=0.3, out=out
        ),
    }
    times = timed(calls, RUNS, clock=time.process_time)
    copy = times["copy of the alpha"][0]
    print(f"{SIZE} x {SIZE}, one thread, {RUNS} runs")
    for name, (value, _) in times.items():
        print(f"  {name:34}{value:9.2f} ms {value / copy:8.1f} copies")


def density() -> dict[str, list[float]]:
    """Print and return the milliseconds of a frame by the number of flakes in view."""
    shape, camera = (SIZE, SIZE), fl.Camera(1.2 * SIZE)
    curves: dict[str, list[float]] = {"cone": [], "particles": []}
    print(f"\ncost against density, {SIZE} x {SIZE}, one thread")
    print(f"  {'flakes':>8}{'cone':>11}{'particles':>11}")
    for count in COUNTS:
        rng = np.random.default_rng(count)
        z = rng.uniform(2.0, 24.0, count)
        points = np.stack([(rng.random(count) - 0.5) * z, (rng.random(count) - 0.5) * z, z], 1)
        points[:, :2] /= 1.2
        # As many in a tile of the texture; what a tile holds does not matter to a look-up.
        texture = cone.Texture(cone.snow_tile(512, seed=1, flakes=count))
        flakes = partial(fl.particles.splat, opacity=0.9, velocity=(0.01, 0.05, 0.0), shutter=0.5)
        calls: Calls = {
            "cone": partial(cone.layers, shape, camera, texture, axis=AXIS, phase=0.3),
            "particles": partial(flakes, shape, points, 0.01, camera),
        }
        times = timed(calls, RUNS // 3, clock=time.process_time)
        for name, curve in curves.items():
            curve.append(times[name][0])
        print(f"  {count:>8}{times['cone'][0]:>8.2f} ms{times['particles'][0]:>8.2f} ms")
    spread = max(curves["cone"]) / min(curves["cone"])
    grown = curves["particles"][-1] / curves["particles"][0]
    print(f"  largest over least: cone {spread:.2f}, particles {grown:.0f}")
    return curves


def fall_speeds() -> None:
    """Print how fast rain falls on the screen at many frame rates, ours and as printed."""
    print("\nfall speed by frame rate, px/s of a drop of 6 m/s at 16 m, f = 1200 px (450)")
    print(f"  {'fps':>12}{'ours':>9}{'as printed':>12}")
    late = np.random.default_rng(0).choice([0.0, 0.004, 0.012], 121)
    rates = {f"{fps}": np.arange(121) / fps for fps in (15, 24, 30, 60, 120)}
    for name, times in {**rates, "stuttering": rates["60"] + late}.items():
        ours = cone.path(times, (0.0, 6.0, 0.0), radius=16.0, repeats=16, exposure=0.0)
        steps = np.diff(times)
        speeds = np.diff(np.unwrap(ours.phase, period=1.0)) / steps * (math.pi / 8 * 1200.0)
        # Eq. 3 as printed, of a drop's way in a frame, for streaks of 8 px and 20 px to a metre.
        printed = 30.0 * (8.0 + 20.0 * 6.0 * steps)
        print(
            f"  {name:>12}{speeds.min():>6.1f}-{speeds.max():<6.1f}"
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plot", metavar="FILE", help="draw cost against density")
    options = parser.parse_args()
    fl.set_threads(1)
    speed()
    curves = density()
    if options.plot:
        plot(curves, options.plot)
    fall_speeds()


if __name__ == "__main__":
    main()

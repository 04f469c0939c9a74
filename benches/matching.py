"""Fully simulated snow against the hybrid, before and after the match: table, picture, plot.

    python benches/matching.py [--seeds N] [--size PX] [--images FOLDER]

A million flakes are drawn one by one; then particles down to a pixel of sigma and a texture for the
rest: first the paper's texture (1/f, one tent that moves like the flakes at the handover, its own
map with an amount that conserves the coverage), then the matched one. Powers are variances of the
opacity per octave, of Hann-windowed pictures; speeds are least squares of phase steps over a motion
of a fifth of a pixel. Times are the least of interleaved runs, with one thread.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np

import flurries as fl

FOCAL = 1229.0
SNOW = fl.hybrid.Population(density=110.0, radius=(0.006, 0.014), opacity=0.9, depth=(1.5, 24.0))
EDGES = (2.0, 4.0, 8.0, 16.0, 32.0)

# Frames of the space-time spectra, and world units between them: slow, so that no wave aliases.
FRAMES, SLOW = 64, 0.0045

# World units between two frames: the nearest flake moves by a fifth of a pixel.
STEP = 0.2 * SNOW.depth[0] / FOCAL

# Where the largest flakes are the texture's alone: sigma 0.8 px.
DEEPEST = FOCAL * SNOW.radius[1] / (3.0 * 0.8)

Drawn = Callable[..., np.ndarray]


def before(made: fl.hybrid.Match) -> fl.hybrid.Match:
    """Return the texture as the paper has it, behind the same particles."""
    rings = len(made.ring_edges) - 1
    depth = FOCAL * np.mean(SNOW.radius) / (3.0 * np.mean(made.handover))
    return dataclasses.replace(
        made, near_depth=depth, exponent=1.0, ring_gains=(1.0,) * rings, ring_speeds=(1.0,) * rings,
        mean=0.5, spread=3.0, power=2.0, amount=made.texture_opacity / 0.27764,
    )  # fmt: skip


def variants(size: int) -> dict[str, Drawn]:
    """Return what draws each variant: a call with seed and displacement along x."""
    camera, shape = fl.Camera(FOCAL), (size, size)
    made = fl.hybrid.match(SNOW, FOCAL)

    def simulated(seed: int, way: float, **options: object) -> np.ndarray:
        return fl.hybrid.simulate(
            shape, SNOW, camera, seed=seed, displacement=(-way, 0.0, 0.0), **options
        )

    def hybrid(match: fl.hybrid.Match) -> Drawn:
        return lambda seed, way, **options: fl.hybrid.render(
            shape, match, camera, seed=seed, displacement=(-way, 0.0, 0.0), **options
        )

    return {"simulated": simulated, "before": hybrid(before(made)), "after": hybrid(made)}


def windowed(image: np.ndarray) -> np.ndarray:
    """Return the spectrum of a picture's middle: its squares sum to the variance."""
    size = len(image)
    hann = np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2
    window = np.outer(hann, hann)
    away = image - np.sum(window * image) / window.sum()
    return np.fft.fft2(away * window) / (size * np.sqrt(np.sum(window**2)))


def measured(draw: Drawn, seeds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean opacity (1,), power and speed per octave, from pairs of frames."""
    means, powers, fluxes = [], 0.0, 0.0
    for seed in range(seeds):
        now, later = (draw(seed, way, dtype=np.float64) for way in (0.0, STEP))
        means.append(now.mean())
        first, second = windowed(now), windowed(later)
        powers = powers + np.abs(first) ** 2 / seeds
        fluxes = fluxes - (second * first.conj()).imag / (2.0 * np.pi * STEP) / seeds
    f = np.fft.fftfreq(len(powers))
    fx, length = np.broadcast_to(f, powers.shape), np.hypot(f[:, None], f)
    power, speed = [], []
    for short, long in pairwise(EDGES):
        inside = (length * short < 1.0) & (length * long >= 1.0)
        power.append(powers[inside].sum())
        pull = np.sum(fx[inside] ** 2 * powers[inside])
        speed.append(np.sum(fx[inside] * fluxes[inside]) / pull)
    return np.array([np.mean(means)]), np.array(power), np.array(speed)


def timed(draws: dict[str, Drawn], runs: int = 7) -> dict[str, float]:
    """Return the least milliseconds of each."""
    times: dict[str, list[float]] = {name: [] for name in draws}
    for _ in range(runs):
        for name, draw in draws.items():
            start = time.perf_counter()
            draw(1, 0.3)
            times[name].append(1e3 * (time.perf_counter() - start))
    return {name: min(values) for name, values in times.items()}


def table(draws: dict[str, Drawn], seeds: int) -> None:
    """Print what is measured and, for the hybrids, its deviation."""
    found = {name: measured(draw, seeds) for name, draw in draws.items()}
    exact = fl.hybrid.statistics(SNOW, FOCAL, edges=EDGES)
    found["closed form"] = (np.array([exact.mean_opacity]), exact.power, exact.speed)
    octaves = [f"{short:g}-{long:g} px" for short, long in pairwise(EDGES)]
    print(f"{'':14}{'opacity':>16}" + "".join(f"{name:>18}" for name in octaves))
    for kind, title in ((1, "power"), (2, "speed, px per world unit")):
        print(title)
        for name, values in found.items():
            row = f"  {name:12}"
            row += f"{values[0][0]:10.4f}{percent(values[0], found['simulated'][0])[0]:>6}"
            parts = percent(values[kind], found["simulated"][kind])
            for value, off in zip(values[kind], parts, strict=True):
                row += f"{value:12.5g}{off:>6}"
            print(row)


def percent(values: np.ndarray, truth: np.ndarray) -> list[str]:
    """Return the deviations in percent."""
    return [
        f"{100.0 * (value / want - 1.0):+.0f}%" for value, want in zip(values, truth, strict=True)
    ]


def film_power(draw: Drawn, size: int, seeds: int) -> np.ndarray:
    """Return (FRAMES, size, size): mean squares of the windowed film's transform."""
    hann = np.sin(np.pi * (np.arange(FRAMES) + 0.5) / FRAMES) ** 2
    total = np.zeros((FRAMES, size, size), np.float32)
    for seed in range(seeds):
        film = np.array([draw(seed, t * SLOW) for t in range(FRAMES)])
        spectra = np.array([windowed(image) for image in film - film.mean()], np.complex64)
        total += np.abs(np.fft.fft(spectra * hann[:, None, None].astype(np.float32), axis=0)) ** 2
    return total / (seeds * np.sum(hann**2) * FRAMES)


def along(power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return wave numbers and (n, FRAMES): power of waves within 20 degrees of the motion.

    Rows are wave numbers along the motion, columns temporal frequencies that move with it.
    """
    size = power.shape[1]
    f = np.fft.fftfreq(size)
    fx, fy = np.broadcast_to(f, (size, size)), np.broadcast_to(f[:, None], (size, size))
    near = (fx > 0.0) & (np.abs(fy) < np.tan(np.radians(20.0)) * fx)
    number = np.rint(np.hypot(fx, fy) * size).astype(int)
    result = np.zeros((size // 2, FRAMES))
    for k in range(1, size // 2):
        ring = near & (number == k)
        # A wave that moves towards +x turns by -fx v: mirrored, so that this is positive.
        result[k] = np.roll(power[:, ring].mean(axis=1)[::-1], 1)
    return np.arange(size // 2) / size, result


def spread_of_speed(f: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Return the deviation of the speeds of each octave's waves, over their mean."""
    turns = np.fft.fftfreq(FRAMES)
    result = []
    for short, long in pairwise(EDGES):
        rows = (f * short < 1.0) & (f * long >= 1.0)
        weight = power[rows] * f[rows, None]  # a ring of waves is as long as its radius
        speed = np.sum(weight * turns * f[rows, None]) / np.sum(weight * f[rows, None] ** 2)
        off = turns - speed * f[rows, None]
        result.append(
            np.sqrt(np.sum(weight * off**2) / np.sum(weight * f[rows, None] ** 2)) / speed
        )
    return np.array(result)


def pictures(folder: Path) -> None:
    """Save a still of each variant, and the space-time spectra beside each other."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from skimage import data

    from flurries import io

    background = io.fit(data.rocket(), (1024, 1024))[300:700, 200:720]
    stills = []
    for draw in variants(1024).values():
        alpha = np.ascontiguousarray(draw(3, 0.7)[300:700, 200:720])
        stills.append(fl.composite.snow(background, alpha))
    io.write_picture(folder / "matching.jpg", np.hstack(stills), quality=88)

    size = 512
    shown = [(name, *along(film_power(draw, size, 2))) for name, draw in variants(size).items()]
    exact = fl.hybrid.statistics(SNOW, FOCAL, edges=EDGES)
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), sharey=True, layout="constrained")
    turns = np.fft.fftshift(np.fft.fftfreq(FRAMES))
    top = max(power.max() for _, _, power in shown)
    print("spread of the speeds of an octave's waves, over their mean")
    for axis, (name, f, power) in zip(axes, shown, strict=True):
        print(f"  {name:12}" + "".join(f"{v:8.2f}" for v in spread_of_speed(f, power)))
        level = 10.0 * np.log10(np.fft.fftshift(power, axes=1).T / top + 1e-9)
        image = axis.pcolormesh(f, turns, level, vmin=-60, vmax=0, cmap="magma", shading="auto")
        for (short, long), speed in zip(pairwise(EDGES), exact.speed, strict=True):
            ends = np.array([1.0 / long, 1.0 / short])
            axis.plot(ends, SLOW * speed * ends, color="cyan", lw=1.2)
        axis.set(title=name, xlabel="cycles per pixel, along the motion", ylim=(-0.1, 0.5))
    axes[0].set_ylabel("cycles per frame")
    figure.colorbar(image, ax=axes, label="power, dB")
    figure.savefig(folder / "matching_spectrum.png", dpi=90)


def shutters(draws: dict[str, Drawn]) -> None:
    """Print the deviation of the matched hybrid over that of the simulation, for open shutters."""
    motion = {"velocity": (-1.4 / 30.0, 0.0, 0.0)}
    print("contrast of the hybrid over the simulation's, flakes at 1.4 units a second, 30 fps")
    for shutter in (0.0, 0.25, 0.5):
        true = draws["simulated"](1, 0.0, shutter=shutter, **motion).std()
        row = f"  shutter {shutter:4.2f}"
        for alias in ("keep", "soft"):
            made = draws["after"](1, 0.0, shutter=shutter, alias=alias, **motion).std()
            row += f"   {alias} {made / true:.2f}"
        print(row)


def main() -> None:
    """Print the tables; make the picture and the plot if asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--images", type=Path)
    options = parser.parse_args()
    fl.set_threads(1)
    draws = variants(options.size)
    near, far = SNOW.depth
    prisms = [(options.size / FOCAL * end) ** 2 * (end - near) for end in (far, DEEPEST)]
    flakes = [round(SNOW.density * prism) for prism in prisms]
    print(f"{flakes[0]} flakes in the prism around the view, {flakes[1]} for the hybrids")
    table(draws, options.seeds)
    times = timed(draws)
    for name, least in times.items():
        print(f"{name:12} {least:8.1f} ms a frame, {least / times['simulated']:6.3f} of simulated")
    shutters(draws)
    if options.images is not None:
        pictures(options.images)


if __name__ == "__main__":
    main()

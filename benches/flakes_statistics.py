"""Hybrid snow against every flake drawn, in numbers: ``python benches/flakes_statistics.py``.

For each preset the ratio of mean, deviation, skewness, excess kurtosis, areas above an opacity and
power by octave (finest first), and the correlations of a pixel with itself one frame later.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.stats import kurtosis, skew

import flurries as fl

OCTAVES = 5


def statistics(scene: fl.Scene) -> list[float]:
    """Return the numbers of two frames."""
    first, second = (scene.render(t, layers=True).alpha for t in (10, 11))
    power = np.abs(np.fft.fft2(first - first.mean())) ** 2
    height, width = first.shape
    cycles = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None])
    octaves = [
        power[(cycles >= 0.5 / 2 ** (n + 1)) & (cycles < 0.5 / 2**n)].sum() for n in range(OCTAVES)
    ]
    flat = first.ravel()
    same = np.corrcoef(flat, second.ravel())[0, 1]
    areas = [(first > 0.3).mean(), (first > 0.5).mean()]
    return [first.mean(), first.std(), skew(flat), kurtosis(flat), *areas, *octaves, same]


def main() -> None:
    """Print a table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--presets", nargs="+", default=["light", "moderate", "heavy", "blizzard"])
    words.add_argument("--seeds", type=int, default=3)
    words.add_argument("--size", type=int, nargs=2, default=(640, 480))
    asked = words.parse_args()
    names = ["mean", "deviation", "skewness", "kurtosis", "above .3", "above .5"]
    names += [f"octave {n + 1}" for n in range(OCTAVES)]
    print("| preset | " + " | ".join(names) + " | correlation, all drawn |")
    print("| --- |" + " --- |" * (len(names) + 1))
    for preset in asked.presets:
        found = {}
        for method in ("hybrid", "simulated"):
            snow = fl.Snow.preset(preset, method=method)
            found[method] = np.mean(
                [
                    statistics(fl.Scene(tuple(asked.size), "#000000", effects=[snow], seed=seed))
                    for seed in range(asked.seeds)
                ],
                axis=0,
            )
        ours, drawn = found["hybrid"], found["simulated"]
        ratios = " | ".join(f"{a / b:.3f}" for a, b in zip(ours[:-1], drawn[:-1], strict=True))
        print(f"| {preset} | {ratios} | {ours[-1]:.3f}, {drawn[-1]:.3f} |", flush=True)


if __name__ == "__main__":
    main()

"""Hybrid snow against every flake drawn, in numbers: ``python benches/flakes_statistics.py``.

For each preset, size and camera the quotients ours / drawn of mean, deviation, skewness, excess
kurtosis, areas above an opacity, power by octave (finest first) and Euler number at levels of the
drawn picture, and the correlation of pixels with themselves some frames later, ours and drawn. A
star marks what misses its limit. ``--control`` adds a Gaussian field with the mean, the deviation
and the spectrum of the drawn picture, which must fail.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import flurries as fl

OCTAVES = 5
LAGS = (1, 2, 4, 8)
LEVELS = (50, 80, 95)

# Limits of quotients, and of differences of correlations.
LIMITS = {
    "mean": 0.01, "deviation": 0.03, "skewness": 0.10, "kurtosis": 0.15,
    "above .3": 0.10, "above .5": 0.10,
    **{f"octave {n + 1}": 0.05 for n in range(OCTAVES)},
    **{f"Euler {level}": 0.10 for level in LEVELS},
    **{f"after {lag}": 0.03 for lag in LAGS},
}  # fmt: skip

Picture = npt.NDArray[np.float64]


def euler(above: npt.NDArray[np.bool_]) -> float:
    """Return pieces minus holes of a picture, pixels that touch at corners joined."""
    padded = np.pad(above, 1)
    quads = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    count = np.sum(quads, axis=0)
    diagonal = (count == 2) & (quads[0] == quads[3])
    return float(((count == 1).sum() - (count == 3).sum() - 2 * diagonal.sum()) / 4)


def numbers(first: Picture, later: list[Picture], levels: Picture) -> dict[str, float]:
    """Return the numbers of a film's first frame and some later ones."""
    away = first - first.mean()
    deviation = away.std()
    power = np.abs(np.fft.fft2(away)) ** 2
    cycles = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in first.shape[::-1])))
    found = {
        "mean": first.mean(),
        "deviation": deviation,
        "skewness": (away**3).mean() / deviation**3,
        "kurtosis": (away**4).mean() / deviation**4 - 3.0,
        "above .3": (first > 0.3).mean(),
        "above .5": (first > 0.5).mean(),
    }
    for n in range(OCTAVES):
        band = (cycles >= 0.5 / 2 ** (n + 1)) & (cycles < 0.5 / 2**n)
        found[f"octave {n + 1}"] = power[band].sum()
    for name, level in zip(LEVELS, levels, strict=True):
        found[f"Euler {name}"] = euler(first > level)
    for lag, picture in zip(LAGS, later, strict=True):
        found[f"after {lag}"] = np.corrcoef(first.ravel(), picture.ravel())[0, 1]
    return {name: float(value) for name, value in found.items()}


def film(scene: fl.Scene, start: float = 10.0) -> list[Picture]:
    """Return a frame and those after `LAGS`."""
    return [scene.render(start + lag, layers=True).alpha.astype(np.float64) for lag in (0, *LAGS)]


def gaussian(drawn: list[Picture], seed: int) -> list[Picture]:
    """Return fields with the spectrum, the mean and the deviation of drawn ones."""
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal(drawn[0].shape))
    made = []
    for picture in drawn:
        spectrum = np.fft.fft2(picture - picture.mean())
        field = np.fft.ifft2(noise / np.abs(noise) * np.abs(spectrum)).real
        made.append(np.clip(field + picture.mean(), 0.0, 1.0))
    return made


def compared(
    scenes: Callable[[str, int], fl.Scene], seeds: int, *, control: bool = False
) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Return the means over seeds of the numbers of ours, of drawn and of Gaussian films."""
    rows: tuple[list[dict[str, float]], ...] = ([], [], [])
    for seed in range(seeds):
        drawn = film(scenes("simulated", seed))
        levels = np.percentile(drawn[0], LEVELS)
        made = [film(scenes("hybrid", seed)), drawn]
        made += [gaussian(drawn, seed)] if control else []
        for row, one in zip(rows, made, strict=False):
            row.append(numbers(one[0], one[1:], levels))
    ours, all_drawn, noise = (
        {name: float(np.mean([one[name] for one in row])) for name in (row or [{}])[0]}
        for row in rows
    )
    return ours, all_drawn, noise


def missed(found: dict[str, float], drawn: dict[str, float]) -> list[str]:
    """Return the names of numbers that miss their limits."""
    result = []
    for name, limit in LIMITS.items():
        ours, wanted = found[name], drawn[name]
        off = abs(ours - wanted) if name.startswith("after") else abs(ours / wanted - 1.0)
        # Of rare pixels, and of no pieces, chance makes more than any limit.
        rare = name.startswith("above") and wanted < 2e-4
        if off > limit and not rare:
            result.append(name)
    return result


def scene_of(
    preset: str, size: tuple[int, int], *, flying: bool = False, focal: float | None = None
) -> Callable[[str, int], fl.Scene]:
    """Return what makes a preset's scenes, by method and seed."""

    def make(method: str, seed: int) -> fl.Scene:
        snow = fl.Snow.preset(preset, method=method)
        camera = fl.Camera(focal or 1.2 * size[0])
        path = fl.CameraPath(camera, velocity=(0.0, 0.0, 2.0)) if flying else camera
        return fl.Scene(size, "#000000", path, [snow], seed=seed)

    return make


def main() -> None:
    """Print a table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--presets", nargs="+", default=["light", "heavy", "blizzard"])
    words.add_argument("--seeds", type=int, default=3)
    words.add_argument("--size", type=int, nargs=2, default=(640, 480))
    words.add_argument("--focal", type=float, help="px; 1.2 of the width if not given")
    words.add_argument("--flying", action="store_true", help="2 m/s forward")
    words.add_argument("--control", action="store_true", help="a Gaussian field, too")
    asked = words.parse_args()
    print("| preset | " + " | ".join(LIMITS) + " |")
    print("| --- |" + " --- |" * len(LIMITS))
    for preset in asked.presets:
        make = scene_of(preset, tuple(asked.size), flying=asked.flying, focal=asked.focal)
        ours, drawn, noise = compared(make, asked.seeds, control=asked.control)
        for label, found in (("", ours), (", Gaussian", noise)):
            if not found:
                continue
            misses = missed(found, drawn)
            cells = [
                (f"{found[n]:.3f}, {drawn[n]:.3f}" if n.startswith("after")
                 else f"{found[n] / drawn[n]:.3f}") + ("*" if n in misses else "")
                for n in LIMITS
            ]  # fmt: skip
            print(
                f"| {preset}{label} | " + " | ".join(cells) + f" | {len(misses)} missed", flush=True
            )


if __name__ == "__main__":
    main()

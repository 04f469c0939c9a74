"""Hybrid snow against every flake drawn, in numbers: ``python benches/flakes_statistics.py``.

For each preset, size and camera the quotients ours / drawn of mean, deviation, skewness, kurtosis
(of a Gaussian 3), areas above an opacity, power by octave (finest first) and Euler number, and how
much the correlation of pixels with themselves some frames later differs. A star marks what misses
its limit. A Gaussian field with the mean, the deviation and the spectrum of the drawn picture is
judged, too: it must fail.

The Euler number of a level p is that of the pixels above a picture's own p-th percentile, since
mean, deviation and areas judge how opaque a picture is; "at common levels" both pictures are cut at
the percentiles of the drawn one.

Drawing all flakes takes hours: what has been measured is kept in ``--keep`` and not measured again,
``--rows`` measures some cases, and ``--write`` makes docs/internals/flakes_statistics.md.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

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
SHOWN = [*LIMITS, *(f"Euler {level} at common levels" for level in LEVELS)]

PRESETS = ("light", "heavy", "blizzard")
SEEDS = 12

# Of each size, the parts of its picture that seeds take turns at: rows and columns of parts.
SIZES = {(640, 480): (1, 1), (1920, 1080): (2, 3)}

# Pixels of the patch whose correlations are taken, (rows, cols).
PATCH = (180, 240)

PAGE = Path(__file__).parents[1] / "docs/internals/flakes_statistics.md"

Picture = npt.NDArray[np.float64]
Numbers = dict[str, float]
Scenes = Callable[[str, int], fl.Scene]
Region = tuple[slice, slice]


def euler(above: npt.NDArray[np.bool_]) -> float:
    """Return pieces minus holes of a picture, pixels that touch at corners joined."""
    padded = np.pad(above, 1)
    quads = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    count = np.sum(quads, axis=0)
    diagonal = (count == 2) & (quads[0] == quads[3])
    return float(((count == 1).sum() - (count == 3).sum() - 2 * diagonal.sum()) / 4)


def numbers(picture: Picture, common: Picture) -> Numbers:
    """Return the numbers of a picture; `common` are the levels of the drawn one."""
    away = picture - picture.mean()
    deviation = away.std()
    power = np.abs(np.fft.fft2(away)) ** 2
    cycles = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in picture.shape[::-1])))
    found = {
        "mean": picture.mean(),
        "deviation": deviation,
        "skewness": (away**3).mean() / deviation**3,
        "kurtosis": (away**4).mean() / deviation**4,
        "above .3": (picture > 0.3).mean(),
        "above .5": (picture > 0.5).mean(),
    }
    for n in range(OCTAVES):
        band = (cycles >= 0.5 / 2 ** (n + 1)) & (cycles < 0.5 / 2**n)
        found[f"octave {n + 1}"] = power[band].sum()
    for name, own, level in zip(LEVELS, np.percentile(picture, LEVELS), common, strict=True):
        found[f"Euler {name}"] = euler(picture > own)
        found[f"Euler {name} at common levels"] = euler(picture > level)
    return {name: float(value) for name, value in found.items()}


def pictures(scene: fl.Scene, part: Region | None, patch: Region) -> tuple[Picture, list[Picture]]:
    """Return a part of a frame, and a patch of it and of those after `LAGS`."""

    def alpha(lag: int, region: Region | None) -> Picture:
        return scene.render(10.0 + lag, layers=True, region=region).alpha.astype(np.float64)

    return alpha(0, part), [alpha(lag, patch) for lag in (0, *LAGS)]


def correlations(patches: list[Picture]) -> Numbers:
    """Return how much pixels are after `LAGS` as they were."""
    first, *later = (patch.ravel() for patch in patches)
    return {
        f"after {lag}": float(np.corrcoef(first, patch)[0, 1])
        for lag, patch in zip(LAGS, later, strict=True)
    }


def gaussian(drawn: Picture, seed: int) -> Picture:
    """Return a field with the spectrum, the mean and the deviation of a drawn one."""
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal(drawn.shape))
    spectrum = np.fft.fft2(drawn - drawn.mean())
    field = np.fft.ifft2(noise / np.abs(noise) * np.abs(spectrum)).real
    return np.clip(field + drawn.mean(), 0.0, 1.0)


def measure(scenes: Scenes, seed: int, parts: tuple[int, int] = (1, 1)) -> dict[str, Numbers]:
    """Return the numbers of ours, of all flakes drawn and of a Gaussian field."""
    drawn, ours = scenes("simulated", seed), scenes("hybrid", seed)
    height, width = drawn.shape
    rows, cols = height // parts[0], width // parts[1]
    row, col = divmod(seed % (parts[0] * parts[1]), parts[1])
    part = np.s_[row * rows : (row + 1) * rows, col * cols : (col + 1) * cols]
    # A patch of every part of the part, as seeds go on.
    tall, wide = min(PATCH[0], rows), min(PATCH[1], cols)
    top = row * rows + int((seed + 0.5) * 0.618 % 1.0 * (rows - tall))
    left = col * cols + int((seed + 0.5) * 0.755 % 1.0 * (cols - wide))
    patch = np.s_[top : top + tall, left : left + wide]
    whole, patches = pictures(drawn, part, patch)
    common = np.percentile(whole, LEVELS)
    made, made_patches = pictures(ours, part, patch)
    return {
        "ours": numbers(made, common) | correlations(made_patches),
        "drawn": numbers(whole, common) | correlations(patches),
        "Gaussian": numbers(gaussian(whole, seed), common),
    }


def mean_of(rows: list[Numbers]) -> Numbers:
    """Return the means over seeds."""
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}


def off(found: Numbers, drawn: Numbers, name: str) -> float:
    """Return a quotient less 1, or a difference of correlations."""
    if name.startswith("after"):
        return found[name] - drawn[name]
    return found[name] / drawn[name] - 1.0


def missed(found: Numbers, drawn: Numbers) -> list[str]:
    """Return the names of numbers that miss their limits."""
    # Of rare pixels chance makes more than any limit.
    rare = [name for name in LIMITS if name.startswith("above") and drawn[name] < 2e-4]
    return [
        name
        for name, limit in LIMITS.items()
        if name in found and name not in rare and abs(off(found, drawn, name)) > limit
    ]


def compared(scenes: Scenes, seeds: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return the means over seeds of the numbers of ours, of drawn and of Gaussian pictures."""
    each = [measure(scenes, seed) for seed in range(seeds)]
    ours, drawn, noise = (mean_of([one[who] for one in each]) for who in each[0])
    return ours, drawn, noise


def scene_of(preset: str, size: tuple[int, int], flying: bool) -> Scenes:
    """Return what makes a preset's scenes, by method and seed."""

    def make(method: str, seed: int) -> fl.Scene:
        snow = fl.Snow.preset(preset, method=method)
        camera = fl.Camera(1.2 * size[0])
        path = fl.CameraPath(camera, velocity=(0.0, 0.0, 2.0)) if flying else camera
        return fl.Scene(size, "#000000", path, [snow], seed=seed)

    return make


def cases() -> Iterator[tuple[str, tuple[str, tuple[int, int], bool]]]:
    """Return the names of all cases with what they are."""
    for size in SIZES:
        for flying in (False, True):
            for preset in PRESETS:
                name = f"{preset}-{size[0]}-{'flying' if flying else 'still'}"
                yield name, (preset, size, flying)


def row_of(name: str, seed: int, keep: Path) -> dict[str, Numbers]:
    """Return the numbers of a case, measured now or kept."""
    file = keep / f"{name}-{seed}.json"
    if not file.exists():
        preset, size, flying = dict(cases())[name]
        found = measure(scene_of(preset, size, flying), seed, SIZES[size])
        file.write_text(json.dumps(found), encoding="utf-8")
    rows: dict[str, Numbers] = json.loads(file.read_text(encoding="utf-8"))
    return rows


def cells(rows: list[dict[str, Numbers]]) -> tuple[dict[str, str], int, int]:
    """Return the cells of a case by number, and how many limits ours and a Gaussian miss."""
    ours, drawn, noise = (mean_of([row[who] for row in rows]) for who in rows[0])
    misses = missed(ours, drawn)
    found = {}
    for name in SHOWN:
        each = [row["ours"][name] for row in rows], [row["drawn"][name] for row in rows]
        value, scale = off(ours, drawn, name), 1.0
        spread = np.subtract(*each)
        if not name.startswith("after"):
            value, scale = value + 1.0, drawn[name]
            spread = np.array(each[0]) - value * np.array(each[1])
        error = float(np.std(spread, ddof=1)) / math.sqrt(len(rows)) / abs(scale)
        star = "*" if name in misses else ""
        found[name] = f"{value:.3f} ± {error:.3f}{star}"
    return found, len(misses), len(missed(noise, drawn))


def tables(keep: Path, seeds: int) -> str:
    """Return the tables of all cases that were measured, one for each preset."""
    lines: list[str] = []
    for preset in PRESETS:
        measured: dict[str, Any] = {}
        for name, (which, size, flying) in cases():
            files = [keep / f"{name}-{seed}.json" for seed in range(seeds)]
            rows = [row_of(name, n, keep) for n, file in enumerate(files) if file.exists()]
            if which == preset and len(rows) > 1:
                title = f"{size[0]} px, {'flying' if flying else 'still'}, {len(rows)} seeds"
                measured[title] = cells(rows)
        if not measured:
            continue
        lines += [f"## {preset}", "", "| | limit | " + " | ".join(measured) + " |"]
        lines.append("| --- |" + " --- |" * (len(measured) + 1))
        for name in SHOWN:
            limit = f"{LIMITS[name]:.2f}" if name in LIMITS else "none"
            found = " | ".join(each[0][name] for each in measured.values())
            lines.append(f"| {name} | {limit} | {found} |")
        for label, at in (("limits missed", 1), ("missed by a Gaussian field", 2)):
            found = " | ".join(str(each[at]) for each in measured.values())
            lines.append(f"| {label} | | {found} |")
        lines.append("")
    return "\n".join(lines)


INTRO = """# Statistics of snow: the texture against all flakes drawn

Made by `python benches/flakes_statistics.py --write`, which also says what each number is. Presets
of `fl.Snow` by the method "hybrid" over `method="simulated"`, means over seeds: quotients, and for
"after" (the correlation of pixels with themselves so many frames later) differences. Behind ± is
the standard error, what chance makes of it. A star marks what misses its limit. The focal length is
1.2 of the width; "flying" is 2 m/s forward at 30 frames a second. Seeds take turns at the six parts
of a picture 1920 px wide. The Euler number of a level is that of the pixels above each picture's
own percentile, a topological number of the picture: how opaque it is the other rows say. "At common
levels" both are cut at the percentiles of the drawn one, and there a hundredth of the area more is
a tenth of the number at the median.

"""


def main() -> None:
    """Measure, and print or write the tables."""
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [name for name, _ in cases()]
    words.add_argument("--rows", nargs="+", choices=names, default=names, metavar="CASE")
    words.add_argument("--seeds", type=int, default=SEEDS)
    words.add_argument("--keep", type=Path, default=Path("target/flakes_statistics"))
    words.add_argument("--write", action="store_true", help="make the page")
    asked = words.parse_args()
    asked.keep.mkdir(parents=True, exist_ok=True)
    for seed in range(asked.seeds):
        for name in asked.rows:
            row_of(name, seed, asked.keep)
            print(f"{name}, seed {seed}", file=sys.stderr, flush=True)
    found = tables(asked.keep, asked.seeds)
    print(found)
    if asked.write:
        PAGE.write_text(INTRO + found.rstrip("\n") + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

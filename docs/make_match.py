"""The closed loop of `fl.match`: 40 clips of the tests' twin, `python docs/make_match.py FOLDER`.

It draws clips that are not in FOLDER yet, which takes half an hour, matches each, and prints its
errors, those that were refused, and medians and worst of the rest.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import flurries as fl
from flurries.matching.match import Unmatched

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from plates_with_snow import MOST, case, clip, errors_of

CLIPS = 40


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    found, refused = {}, 0
    for seed in range(CLIPS):
        one = case(seed)
        file = clip(one, folder)
        try:
            match = fl.match(file, camera=fl.Camera(one.view.focal))
        except Unmatched as error:
            refused += 1
            print(f"{seed:2}  {str(error)[:90]}", flush=True)
            continue
        found[seed] = off = errors_of(match, one)
        missed = [name for name, value in off.items() if abs(value) > MOST[name]]
        numbers = "  ".join(f"{name} {value:+.2f}" for name, value in off.items())
        print(f"{seed:2}  {numbers}  {'misses ' + ', '.join(missed) if missed else ''}", flush=True)
    table = np.array([[abs(v) for v in off.values()] for off in found.values()])
    met = int((table <= np.array(list(MOST.values()))).all(axis=1).sum())
    print(f"{met} of {CLIPS} within all limits, {refused} refused, {len(found) - met} missed")
    for name, values in zip(MOST, table.T, strict=True):
        print(f"{name:<10} median {np.median(values):.3f}  worst {values.max():.3f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

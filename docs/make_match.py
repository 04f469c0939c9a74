"""The closed loop of `fl.match`: 40 clips of the tests' twin, `python docs/make_match.py FOLDER`.

It draws clips that are not in FOLDER yet, which takes half an hour, matches each, and prints its
errors, those that were refused, and medians and worst of the rest, with the root mean square of
errors over those that a match states. `python docs/make_match.py FOLDER 100 130` takes other clips:
what is set in `fl.match` was set by these.

`python docs/make_match.py --photograph snow.tif fit.png` matches a photograph whose plate is not
known: the plate is taken to be the 35th of 100 within 11 px, from dark to bright, so it is blurred.

`python docs/make_match.py --speed film.mp4` prints how long 48 frames of 720p take.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy import ndimage

import flurries as fl
from flurries.matching.match import Unmatched

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from plates_with_snow import MOST, case, clip, errors_of

CLIPS = 0, 40
STATED = {"exposure": "shutter"}


def main(folder: Path, first: int, last: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    found, stated, refused = {}, [], 0
    for seed in range(first, last):
        one = case(seed)
        file = clip(one, folder)
        try:
            match = fl.match(file, camera=fl.Camera(one.view.focal))
        except Unmatched as error:
            refused += 1
            print(f"{seed:2}  {str(error)[:90]}", flush=True)
            continue
        found[seed] = off = errors_of(match, one)
        error = match.errors | {"direction": np.degrees(match.errors["direction"])}
        stated.append([error[STATED.get(name, name)] for name in MOST])
        missed = [name for name, value in off.items() if abs(value) > MOST[name]]
        numbers = "  ".join(f"{name} {value:+.2f}" for name, value in off.items())
        print(f"{seed:2}  {numbers}  {'misses ' + ', '.join(missed) if missed else ''}", flush=True)
    table = np.array([[abs(v) for v in off.values()] for off in found.values()])
    met = int((table <= np.array(list(MOST.values()))).all(axis=1).sum())
    print(
        f"{met} of {last - first} within all limits, {refused} refused, {len(found) - met} missed"
    )
    scores = np.sqrt(((table / stated) ** 2).mean(axis=0))
    for name, values, score in zip(MOST, table.T, scores, strict=True):
        print(f"{name:<10} median {np.median(values):.3f}  worst {values.max():.3f}  z {score:.1f}")


def speed(file: str) -> None:
    """Match 48 frames of 720p, drawn by the package: 40 flakes per m3 of 7 mm, exposure .5."""
    plate = fl.io.fit(fl.io.photograph("coffee"), (1280, 720))
    camera, snow = fl.Camera(1500.0), fl.Snow(density=40.0, wind=(1.0, 0.0, 0.0), color=0.9)
    scene = fl.Scene(plate, camera=camera, effects=[snow], fps=25, lens=None)
    with fl.io.VideoWriter(file, (1280, 720), 25) as film:
        for t in range(48):
            film.write(scene.render(t))
    wall, own = time.perf_counter(), time.process_time()
    print(fl.match(file, camera=camera))
    print(f"{time.perf_counter() - wall:.1f} s, {time.process_time() - own:.1f} s of processors")


def photograph(file: str, picture: str) -> None:
    frame = fl.io.open_background(file).frame(0).pixels[..., :3]
    plate = [ndimage.percentile_filter(frame[..., c], 35, size=11) for c in range(3)]
    found = fl.match(frame, np.stack([ndimage.gaussian_filter(c, 2.0) for c in plate], axis=2))
    print(found)
    fl.io.write_picture(picture, found.report())


if __name__ == "__main__" and sys.argv[1] == "--photograph":
    photograph(*sys.argv[2:4])
elif __name__ == "__main__" and sys.argv[1] == "--speed":
    speed(sys.argv[2])
elif __name__ == "__main__":
    main(Path(sys.argv[1]), *(map(int, sys.argv[2:4]) if sys.argv[2:] else CLIPS))

"""Draw the contact sheets of docs/augment.md: severities of each weather on six photographs.

python docs/make_weathers.py

Columns are the severities 1 to 5 of the natural profile, then those of the hard one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from skimage import data

import flurries as fl

IMAGES = Path(__file__).parent / "images"
SIZE = 128
# Dark, busy, bright, textured, overcast, and nearly black.
PHOTOGRAPHS = ("rocket", "coffee", "astronaut", "chelsea", "camera", "hubble_deep_field")
WEATHERS = (fl.augment.Snowfall, fl.augment.Rainfall, fl.augment.Fog)


def photographs() -> list[np.ndarray]:
    """Return the photographs, (SIZE, SIZE, 3) uint8 each."""
    found = []
    for name in PHOTOGRAPHS:
        picture = getattr(data, name)()
        if picture.ndim == 2:
            picture = np.repeat(picture[..., None], 3, axis=2)
        found.append(fl.io.fit(np.ascontiguousarray(picture[..., :3]), (SIZE, SIZE)))
    return found


def main() -> None:
    for kind in WEATHERS:
        rows = []
        for number, picture in enumerate(photographs()):
            row = [
                kind(severity=severity, profile=profile, seed=2)(picture, index=number)
                for profile in ("natural", "hard")
                for severity in range(1, 6)
            ]
            rows.append(np.concatenate(row, axis=1))
        path = IMAGES / f"{kind.__name__.lower()}_severities.jpg"
        Image.fromarray(np.concatenate(rows)).save(path, quality=82)
        print(path)


if __name__ == "__main__":
    main()

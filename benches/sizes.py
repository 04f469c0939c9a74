"""How alike a look is at other sizes of the picture: ``python benches/sizes.py``.

Mean and standard deviation of the opacity of pictures 512 and 256 px wide, against those of one of
2048 px whose squares of pixels are averaged; last with the map that is tuned for 1024 px.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import flurries as fl

EFFECTS = {
    "texture of moderate snow": fl.TentSnow(flakes=0, haze=0.0),
    "moderate snow": fl.TentSnow(),
    "heavy snow": fl.TentSnow.preset("heavy"),
    "rain": fl.TentRain(),
}


def opacities(effect: Any, width: int, count: int) -> np.ndarray:
    """Return the opacities of some pictures, (count, H, W)."""
    size = (width, 3 * width // 4)
    scenes = [fl.Scene(size, effects=[effect], seed=seed) for seed in range(count)]
    return np.stack([s.render(3, layers=True).alpha.astype(np.float64) for s in scenes])


def smaller(planes: np.ndarray, times: int) -> np.ndarray:
    """Return means over squares."""
    count, height, width = planes.shape
    parts = planes.reshape(count, height // times, times, width // times, times)
    return np.asarray(parts.mean(axis=(2, 4)))


def ratios(small: np.ndarray, large: np.ndarray) -> str:
    """Return mean and standard deviation against those of the large picture made smaller."""
    return f"{small.mean() / large.mean():.3f}, {small.std() / large.std():.2f}"


def main() -> None:
    """Print a table."""
    print(
        "| mean, standard deviation | 512 px | 256 px | 256 px without |\n| --- | --- | --- | --- |"
    )
    for name, effect in EFFECTS.items():
        large = opacities(effect, 2048, 2)
        row = [
            ratios(opacities(effect, width, count), smaller(large, 2048 // width))
            for width, count in ((512, 10), (256, 40))
        ]
        # A band in pixels is taken as it stands.
        band = effect.parts.texture.field.band((192, 256))
        alone = replace(effect, wavelengths=band)
        row.append(ratios(opacities(alone, 256, 40), smaller(large, 8)))
        print(f"| {name} | " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()

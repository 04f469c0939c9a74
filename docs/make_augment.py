"""Print a table of docs/internals/effects.md: the contrast that severities take, at three sizes.

python docs/make_augment.py
"""

from __future__ import annotations

import numpy as np

import flurries as fl

# Width and height of pictures, and how many of each.
SIZES = (((64, 64), 24), ((512, 512), 8), ((3840, 2160), 1))
KINDS = (fl.augment.Snowfall, fl.augment.Rainfall, fl.augment.Fog)


def loss(weather: fl.augment.Snowfall, size: tuple[int, int], count: int) -> float:
    """Return the share of the difference of a white and a black picture that is lost, measured."""
    black = np.zeros((size[1], size[0]), np.float32)
    left = [
        (weather(black + 1.0, index=k) - weather(black, index=k)).mean(dtype=np.float64)
        for k in range(count)
    ]
    return 1.0 - float(np.mean(left))


def main() -> None:
    names = ", ".join(f"{width} x {height}" for (width, height), _ in SIZES)
    print(f"| weather | severity | wanted | measured at {names} |")
    print("| --- | --- | --- | --- |")
    for kind in KINDS:
        for severity in range(1, 6):
            weather = kind(severity=severity, seed=5)
            measured = [f"{loss(weather, *size):.3f}" for size in SIZES]
            wanted = fl.augment.contrast_loss(severity / 5)
            print(f"| {kind.__name__} | {severity} | {wanted:.2f} | {', '.join(measured)} |")


if __name__ == "__main__":
    main()

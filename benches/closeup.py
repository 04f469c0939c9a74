"""What shapes, a lens, local light and lamps cost: a frame with each over the same frame without.

    python benches/closeup.py [--runs N] [--size W H]

Heavy snow over a photograph. Variants take turns, so that a busy moment of the machine meets all of
them; a row says the least time of a frame in milliseconds, and that over the plain frame's.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import flurries as fl

LAMPS = tuple(
    fl.Lamp((x, -2.0, z), color=(1.0, 0.7, 0.4), power=60.0)
    for x, z in ((-2.0, 5.0), (2.0, 8.0), (-3.0, 14.0), (3.0, 20.0))
)


def scenes(width: int, height: int) -> dict[str, tuple[fl.Scene, str]]:
    """Return the variants, each with the one that it is compared with."""
    plate = fl.io.photograph("rocket", size=(width, height))

    def film(plate: np.ndarray = plate, *, shape: str = "round", color: str = "ambient", **more):
        snow = fl.Snow.preset("heavy", color=color, shape=shape)
        return fl.Scene(None, plate, effects=[snow], seed=1, **more)

    linear = fl.io.srgb_to_linear(plate / 255.0).astype(np.float32)
    return {
        "plain": (film(), "plain"),
        "shapes": (film(shape="natural"), "plain"),
        "lens": (film(lens=fl.Lens(focus=4.0, f_stop=2.0, blades=6)), "plain"),
        "local light": (film(color="local"), "plain"),
        "linear": (film(linear), "linear"),
        "linear, local light": (film(linear, color="local"), "linear"),
        "linear, four lamps": (film(linear, lights=LAMPS), "linear"),
        "four lamps": (film(lights=LAMPS), "plain"),
        "all of them": (
            film(shape="natural", color="local", lights=LAMPS,
                 lens=fl.Lens(focus=4.0, f_stop=2.0, blades=6)),
            "plain",
        ),
    }  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--size", type=int, nargs=2, default=(1024, 1024))
    given = parser.parse_args()
    films = scenes(*given.size)
    best = dict.fromkeys(films, np.inf)
    for run in range(given.runs + 1):
        for name, (scene, _) in films.items():
            start = time.perf_counter()
            scene.render(10 + run)
            if run > 0:
                best[name] = min(best[name], time.perf_counter() - start)
    print(f"{'variant':22}{'ms':>8}{'ratio':>8}")
    for name, (_, against) in films.items():
        print(f"{name:22}{1e3 * best[name]:8.1f}{best[name] / best[against]:8.2f}")


if __name__ == "__main__":
    main()

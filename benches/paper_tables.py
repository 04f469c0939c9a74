"""The tables of Langer 2004 again, with our pictures in place of Magritte's.

    python benches/paper_tables.py [--runs N] [--images FOLDER]

The paper's textures were made beforehand: "replayed" takes its frame from a loop of 30 of the
table's size, "spectral" makes it anew. Milliseconds are the least of runs in turns: read ratios.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
from skimage import data
from timing import timed

import flurries as fl
from flurries import io

WINDOW = (600, 800)
FOCAL = 960.0
SNOW = {"mean": 0.05, "spread": 2.0}
# Five percent of the power are left of rain as fast as this; the map's spread makes up for it.
RAIN = {"mean": 0.2, "spread": 0.5, "amount": 0.6}
SNOW_BAND = {"wavelengths": (3.0, 24.0), "exponent": 0.9}
RAIN_BAND = {"wavelengths": (2.0, 16.0), "alias": "cut"}
WHITE = 250 / 255
FRAMES = 30

# Metres per frame at 30 fps: falling snow, and the flythrough's camera.
FALL, FLIGHT = np.array([0.012, 0.047, 0.0]), np.array([0.0, -0.01, 0.12])


@dataclass(frozen=True)
class Row:
    """A line of Table 1, and what the paper measured for it (Table 2, ms per frame)."""

    name: str
    picture: Callable[[], np.ndarray]
    texture: int
    few: int | None
    many: int | None
    flying: bool = False
    rain: bool = False
    paper: tuple[float, ...] = ()


ROWS = (
    Row("Human Condition", data.rocket, 512, 2000, 16_000, paper=(1.57, 1.73, 9.82, 1.52, 1.99)),
    Row("Son of Man", data.astronaut, 512, 2000, 16_000, paper=(1.37, 1.7, 9.73, 1.59, 2.0)),
    Row("Ventana", data.coffee, 512, None, None, rain=True),
    Row("Flythrough", data.chelsea, 1024, 30_000, 150_000, flying=True,
        paper=(0.94, 24.6, 121.9, 1.44, 24.6)),
)  # fmt: skip

COLUMNS = ("basic", "few", "many", "spectral", "few + spectral", "replayed", "few + replayed")


class Scenery:
    """What a row needs to draw any frame: its picture, its camera, its texture."""

    def __init__(self, row: Row) -> None:
        self.row = row
        self.picture = io.fit(row.picture(), WINDOW[::-1])
        self.camera = fl.Camera(FOCAL)
        self.motion = FALL - (FLIGHT if row.flying else 0.0)
        self.velocity = np.array((8.0, 114.0) if row.rain else (0.6, 2.4))
        self.band = RAIN_BAND if row.rain else SNOW_BAND
        # A still camera's texture repeats in the window, as in the paper; a flying one's does not.
        if row.flying:
            self.loop = [self.alpha(float(t)) for t in range(FRAMES)]
            return
        size = (row.texture, row.texture)
        field = fl.spectral.loop(FRAMES, size, self.velocity, seed=1, **self.band)
        self.loop = list(fl.spectral.opacity(field, **(RAIN if row.rain else SNOW)))

    def alpha(self, t: float) -> np.ndarray:
        size = (self.row.texture, self.row.texture)
        torus = {"tile": size, "overlap": 0} if self.row.rain and not self.row.flying else {}
        how = {"seed": 1, "texture": fl.spectral.Texture(**torus, **self.band)}
        if self.row.flying:
            drift = fl.camera.tile_drift(size, -self.motion * t, self.camera, near_depth=20.0)
            return fl.spectral.alpha(size, drift=drift, **how, **SNOW)
        how |= {"drift": t * self.velocity, "velocity": self.velocity}
        shape, look = (size, RAIN) if self.row.rain else (WINDOW, SNOW)
        return fl.spectral.alpha(shape, **how, **look)

    def windowed(self, texture: np.ndarray) -> np.ndarray:
        """Repeat a torus over the window, or show the middle of one that is larger."""
        if self.row.flying:
            top, left = ((n - m) // 2 for n, m in zip(texture.shape, WINDOW, strict=True))
            return np.ascontiguousarray(texture[top : top + WINDOW[0], left : left + WINDOW[1]])
        repeats = [-(-m // n) for n, m in zip(texture.shape, WINDOW, strict=True)]
        return np.ascontiguousarray(np.tile(texture, repeats)[: WINDOW[0], : WINDOW[1]])

    def flakes(self, number: int, t: float) -> np.ndarray:
        """Draw particles at time t, as points that do not blur, like the paper's sprites."""
        box, middle = (12.0, 9.0, 12.0), (0.0, 0.0, 7.0)
        points = fl.particles.positions(
            number, box, seed=1, velocity=self.motion, time=t, center=middle
        )
        fade = fl.particles.edge_fade(points, box, center=middle)
        return fl.particles.splat(WINDOW, points, 0.012, self.camera, opacity=0.9 * fade, near=0.8)

    def draw(self, column: str, t: int) -> np.ndarray | None:
        """Return a frame; None where the paper's table has none."""
        if column == "basic":
            return self.picture.copy()
        planes = []
        if "few" in column or column == "many":
            number = self.row.many if column == "many" else self.row.few
            if number is None:
                return None
            planes.append(self.flakes(number, float(t)))
        if "spectral" in column:
            planes.append(self.windowed(self.alpha(float(t))))
        if "replayed" in column:
            planes.append(self.windowed(self.loop[t % FRAMES]))
        image = self.picture
        for plane in planes:
            image = fl.composite.snow(image, plane, intensity=WHITE)
        return image


def measured(scenes: list[Scenery], runs: int) -> dict[tuple[str, str], float]:
    """Return the least milliseconds of every scene and column; they take turns.

    Many particles have turns of their own: of 150,000 not all buffers are kept, and the next frame
    of 30,000 would pay 4 ms for that.
    """
    found: dict[tuple[str, str], float] = {}
    for columns in ([c for c in COLUMNS if c != "many"], ["many"]):
        turn = count()
        calls = {
            f"{i} {column}": lambda s=scene, c=column, t=turn: s.draw(c, next(t))
            for i, scene in enumerate(scenes)
            for column in columns
            if scene.draw(column, 0) is not None
        }
        for key, (least, _) in timed(calls, runs, warm=1).items():
            number, _, column = key.partition(" ")
            found[scenes[int(number)].row.name, column] = least
    return found


def print_tables(times: dict[tuple[str, str], float]) -> None:
    print(f"{'Table 1':18}{'texture':>14}{'few':>10}{'many':>10}")
    for row in ROWS:
        counts = "".join(f"{'N/A' if n is None else n:>10}" for n in (row.few, row.many))
        print(f"{row.name:18}{f'{row.texture} x {row.texture}':>14}{counts}")
    print(f"\n{'Table 2, ms':18}" + "".join(f"{name:>16}" for name in COLUMNS))
    for row in ROWS:
        cells = [times.get((row.name, column)) for column in COLUMNS]
        print(
            f"{row.name:18}" + "".join(f"{'N/A' if c is None else f'{c:.2f}':>16}" for c in cells)
        )
        if row.paper:
            print(f"{'  the paper':18}" + "".join(f"{c:>16.2f}" for c in row.paper))
    print(f"\n{'ratios':18}{'many / few':>16}{'hybrid / few':>16}{'hybrid / many':>16}")
    for row in ROWS:
        if row.few is None:
            continue
        for name, cells in (
            (row.name, [times[row.name, c] for c in COLUMNS]),
            ("  replayed", [times[row.name, c] for c in (*COLUMNS[:4], "few + replayed")]),
            ("  the paper", list(row.paper)),
        ):
            few, many, hybrid = cells[1], cells[2], cells[4]
            print(f"{name:18}{many / few:>16.2f}{hybrid / few:>16.2f}{hybrid / many:>16.2f}")


def stills(scenes: list[Scenery], folder: Path) -> None:
    """Save few, many, spectral, and few with spectral of every scene, one row each."""
    rows = []
    for scene in scenes:
        drawn = (scene.draw(column, 20) for column in COLUMNS[1:5])
        shown = [scene.picture if image is None else image for image in drawn]
        rows.append(np.hstack([io.fit(image, (400, 300)) for image in shown]))
    io.write_picture(folder / "paper_tables.jpg", np.vstack(rows), quality=85)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--images", type=Path)
    options = parser.parse_args()
    fl.set_threads(1)
    scenes = [Scenery(row) for row in ROWS]
    print_tables(measured(scenes, options.runs))
    if options.images is not None:
        stills(scenes, options.images)


if __name__ == "__main__":
    main()

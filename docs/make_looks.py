"""Make the plates of the looks in examples/looks, and their contact sheet at 1:1.

python docs/make_looks.py [--plates] [NAME ...]

Each look is shown as two stills, 24 frames apart, and as the difference of two frames in a row.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage import data
from street import street as street_of_houses

import flurries as fl
from flurries import io

ROOT = Path(__file__).parents[1]
LOOKS = ROOT / "examples" / "looks"
PLATES = LOOKS / "plates"
WIDTH, HEIGHT = 960, 540
CROP = np.s_[120:420, 330:730]

# The frames that are shown of a look, where they are not 24 and 48.
TIMES = {
    "gust": (30, 44), "stops": (60, 200), "figure": (5, 12), "focus_pull": (5, 60),
    "loop": (24, 95),
}  # fmt: skip


def _noise(rng: np.random.Generator, grain: int) -> np.ndarray:
    """Return smooth noise around 0, (H, W)."""
    rows, columns = HEIGHT // grain + 2, WIDTH // grain + 2
    coarse = rng.normal(0.0, 1.0, (rows, columns, 1)).astype(np.float32)
    return io.fit(np.repeat(coarse, 3, 2), (columns * grain, rows * grain))[:HEIGHT, :WIDTH, 0]


def overcast() -> np.ndarray:
    """A grey sky over a dark wood and a field of snow, linear light."""
    rng = np.random.default_rng(1)
    y, _ = np.indices((HEIGHT, WIDTH)).astype(float)
    light = np.empty((HEIGHT, WIDTH, 3))
    light[...] = (0.55 + 0.2 * (1.0 - y / HEIGHT) + 0.02 * _noise(rng, 64))[..., None]
    tops = 300.0 + 30.0 * _noise(rng, 24)[100] + 12.0 * np.abs(_noise(rng, 6)[50])
    wood = np.clip((y - tops[None, :]) / 2.0, 0.0, 1.0) * np.clip((420.0 - y) / 3.0, 0.0, 1.0)
    dark = np.array([0.035, 0.045, 0.04]) * np.exp(0.25 * _noise(rng, 5))[..., None]
    light = light * (1.0 - wood[..., None]) + dark * wood[..., None]
    field = np.clip((y - 418.0) / 4.0, 0.0, 1.0)[..., None]
    return light * (1.0 - field) + field * (0.42 + 0.02 * _noise(rng, 32))[..., None]


def street() -> np.ndarray:
    """Two street lamps at dusk, walls with windows, wet ground, linear light."""
    rng = np.random.default_rng(2)
    y, x = np.indices((HEIGHT, WIDTH)).astype(float)
    light = np.empty((HEIGHT, WIDTH, 3))
    light[...] = np.array([0.012, 0.017, 0.03]) * (1.5 - y / HEIGHT)[..., None]
    wall = (y > 130.0 + 60.0 * (np.floor(x / 160.0) % 3.0)) & (y < 400.0)
    light[wall] = np.array([0.01, 0.01, 0.011])
    panes = wall & (x % 40.0 < 16.0) & (y % 56.0 < 26.0) & (y < 360.0)
    lit = np.random.default_rng(5).random((20, 40))[(y // 56).astype(int), (x // 40).astype(int)]
    light[panes & (lit > 0.72)] = np.array([0.5, 0.33, 0.15])
    light[y >= 400.0] = np.array([0.018, 0.018, 0.022])
    light *= np.exp(0.1 * _noise(rng, 4))[..., None]
    warm = np.array([1.0, 0.62, 0.3])
    for cx, cy, size, power in ((52.0, 130.0, 9.0, 8.0), (781.0, 75.0, 5.0, 8.0)):
        square = (x - cx) ** 2 + (y - cy) ** 2
        light += (
            warm * (power * np.exp(-square / (2.0 * size**2)) + 12.0 / (square + 400.0))[..., None]
        )
        below = np.exp(-((x - cx) ** 2) / 6e3) * np.clip((y - 400.0) / 140.0, 0.0, 1.0)
        light += 0.12 * warm * below[..., None]
    return light


def road() -> np.ndarray:
    """A road at night in the light of a car, linear light."""
    rng = np.random.default_rng(3)
    y, x = np.indices((HEIGHT, WIDTH)).astype(float)
    ahead = np.maximum(y - 285.0, 0.0)
    across = (x - 480.0) / np.maximum(ahead, 1.0)
    light = np.empty((HEIGHT, WIDTH, 3))
    light[...] = np.array([0.004, 0.005, 0.008])
    beam = np.exp(-(across**2) / 3.0) * np.exp(-ahead / 160.0) * (ahead > 0.0)
    ground = np.array([0.1, 0.095, 0.085]) * (beam * np.exp(0.3 * _noise(rng, 3)))[..., None]
    light += ground
    line = (np.abs(np.abs(across) - 1.6) < 0.05) & (ahead > 2.0)
    light[line] += 0.35 * beam[line][:, None]
    dash = (np.abs(across) < 0.04) & (np.floor(1500.0 / np.maximum(ahead, 1.0)) % 3.0 == 0.0)
    light[dash & (ahead > 2.0)] += 0.35 * beam[dash & (ahead > 2.0)][:, None]
    for cx in (448.0, 456.0):
        light += (
            np.array([0.9, 0.06, 0.03])
            * np.exp(-((x - cx) ** 2 + (y - 281.0) ** 2) / 5.0)[..., None]
        )
    return light


def walk() -> None:
    """Write a figure that walks before the wood, and its depth: black is near, white is far."""
    place = overcast()[::2, ::2]
    y, x = 2.0 * np.indices(place.shape[:2])
    for frame in range(17):
        cx = 330.0 + 16.0 * frame
        body = np.clip(9.0 - 9.0 * np.hypot((x - cx) / 38.0, (y - 330.0) / 130.0), 0.0, 1.0)
        head = np.clip(9.0 - 9.0 * np.hypot(x - cx, y - 175.0) / 32.0, 0.0, 1.0)
        cover = np.maximum(body, head)[..., None]
        coat = np.array([0.16, 0.03, 0.025]) * (1.2 - y / HEIGHT)[..., None]
        shown = io.linear_to_srgb(place * (1.0 - cover) + coat * cover)
        picture = np.rint(255.0 * shown).astype(np.uint8)
        io.write_picture(PLATES / f"walk.{frame:04d}.jpg", picture, quality=80)
        near = np.repeat(np.where(cover > 0.5, 0, 255).astype(np.uint8), 3, 2)
        io.write_picture(PLATES / f"figure.{frame:04d}.png", near)


def houses() -> None:
    """Write the street of houses by day and at night, and its depth."""
    for name, night in (("houses", False), ("houses_night", True)):
        light, depth = street_of_houses(night)
        shown = io.linear_to_srgb(np.clip(light, 0.0, 1.0))
        grain = np.random.default_rng(3).normal(0.0, 1.0, shown.shape)
        picture = np.clip(np.rint(255.0 * shown + grain), 0.0, 255.0).astype(np.uint8)
        io.write_picture(PLATES / f"{name}.jpg", picture, quality=85)
        io.write_layers(PLATES / "houses_depth.exr", {"depth": depth.astype(np.float32)})


def portrait() -> None:
    """Write a portrait of 1024 px, and how far away it is, painted: white is 1.5 m, black 6 m."""
    io.write_picture(PLATES / "portrait.jpg", io.fit(data.astronaut(), (1024, 1024)), quality=88)
    y, x = np.indices((1024, 1024)).astype(float)
    head = np.hypot((x - 452.0) / 158.0, (y - 205.0) / 178.0) < 1.0
    ring = np.hypot((x - 420.0) / 195.0, (y - 440.0) / 150.0) < 1.0
    body = (y > 380.0) & (x > 440.0 - 1.15 * (y - 330.0)) & (x < 520.0 + 0.95 * (y - 330.0))
    body &= (x > 40.0) & (x < 740.0)
    helmet = np.hypot((x - 780.0) / 225.0, (y - 900.0) / 215.0) < 1.0
    near = gaussian_filter((head | ring | body | helmet).astype(float), 2.0)
    grey = np.rint(255.0 * near).astype(np.uint8)
    io.write_picture(PLATES / "portrait_depth.png", np.repeat(grey[..., None], 3, 2))


def plates() -> None:
    """Write the plates as small JPEG files."""
    PLATES.mkdir(exist_ok=True)
    for make in (overcast, street, road):
        shown = io.linear_to_srgb(np.clip(make(), 0.0, 1.0))
        picture = np.rint(255.0 * shown).astype(np.uint8)
        io.write_picture(PLATES / f"{make.__name__}.jpg", picture, quality=88)
    walk()
    houses()
    portrait()


def row(path: Path) -> np.ndarray:
    """Return a look's row of the sheet: two stills, and the difference of two frames in a row."""
    scene, (early, late) = fl.open(path), TIMES.get(path.stem, (24, 48))
    first, second = (scene.render(t, region=CROP).astype(float) for t in (late, late + 1))
    step = np.clip(128.0 + second - first, 0, 255).astype(np.uint8)
    if path.stem == "stereo":
        return np.hstack([*(eye[CROP] for eye in scene.stereo(late, distance=0.065)), step])
    return np.hstack([scene.render(early, region=CROP), first.astype(np.uint8), step])


def main() -> None:
    """Make what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plates", action="store_true", help="make the plates, too")
    parser.add_argument("--output", default=str(ROOT / "docs" / "images" / "light.jpg"))
    parser.add_argument("names", nargs="*")
    given = parser.parse_args()
    if given.plates:
        plates()
    names = given.names or sorted(path.stem for path in LOOKS.glob("*.toml"))
    rows = [row(LOOKS / f"{name}.toml") for name in names]
    io.write_picture(given.output, np.vstack(rows), quality=80)


if __name__ == "__main__":
    main()

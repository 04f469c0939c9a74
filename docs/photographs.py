"""Ten photographs in snow: how grey, bright and visible flakes are, and contact sheets at 1:1.

python docs/photographs.py [--sheets FOLDER]
OPENBLAS_NUM_THREADS=1 python docs/photographs.py --costs

The photographs are made here or are scikit-image's. Limits are those of real photographs of falling
snow: flakes grey within 17 of 255, the brightest of them (98th percentile of peaks) .75 to 1.0 of
the sky, and visible before what is dark. A flake lets some of the plate through: grey is what it
adds itself, by its known opacity; the spread of the pixel with what shines through stands beside.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from make_looks import HEIGHT, WIDTH, _noise, overcast, street
from scipy.ndimage import gaussian_filter, maximum_filter
from skimage import data

import flurries as fl
from flurries import io
from flurries.light.plate import plate_light

# Channels of a flake differ by at most so many levels; a flake is seen that is so much brighter
# than what lies behind it.
GREY, SEEN = 17.0, 18.0
BRIGHT = (0.75, 1.0)
EVEN = ("even grey", "black")


def _display(light: np.ndarray) -> np.ndarray:
    shown = io.linear_to_srgb(np.clip(light, 0.0, 1.0)) * 255.0
    grain = np.random.default_rng(9).normal(0.0, 1.2, shown.shape)
    return np.clip(np.rint(shown + grain), 0, 255).astype(np.uint8)


def _ground() -> tuple[np.random.Generator, np.ndarray, np.ndarray, np.ndarray]:
    y, x = np.indices((HEIGHT, WIDTH)).astype(float)
    return np.random.default_rng(4), y, x, np.empty((HEIGHT, WIDTH, 3))


def _houses(light: np.ndarray, x: np.ndarray, y: np.ndarray, base: float, sun: float) -> None:
    for number, (left, right, top) in enumerate(
        ((0, 210, 90), (210, 330, 190), (600, 720, 210), (720, 960, 60))
    ):
        wall = (x >= left) & (x < right) & (y > top) & (y < 400)
        tint = np.array(
            [(0.22, 0.16, 0.12), (0.3, 0.27, 0.2), (0.16, 0.17, 0.19), (0.25, 0.2, 0.17)][number]
        )
        light[wall] = base * tint * (sun if left >= 600 else 1.0)
        panes = (
            wall
            & ((x - left) % 46 > 14)
            & ((x - left) % 46 < 34)
            & ((y - top) % 62 > 20)
            & ((y - top) % 62 < 50)
        )
        light[panes] = base * np.array([0.05, 0.06, 0.07])


def day() -> np.ndarray:
    """A street in the sun."""
    _, y, x, light = _ground()
    light[...] = np.array([0.33, 0.5, 0.78]) * (0.75 + 0.35 * (y / HEIGHT))[..., None]
    _houses(light, x, y, 1.0, 2.6)
    road = y >= 400
    light[road] = np.array([0.16, 0.16, 0.165])
    light[road & (x < 480 - 0.6 * (y - 400))] *= 0.35
    return light * np.exp(0.05 * _noise(np.random.default_rng(11), 3))[..., None]


def white_ground() -> np.ndarray:
    """Snow on the ground before a grey sky, a fence and some bushes."""
    rng, y, x, light = _ground()
    light[...] = (0.5 + 0.1 * y / HEIGHT)[..., None]
    field = y > 250 + 14 * _noise(rng, 60)[200][None, :]
    light[field] = 0.62
    light *= (1.0 + 0.05 * _noise(rng, 24))[..., None]
    fence = ((x % 90 < 7) & (y > 260) & (y < 380)) | ((np.abs(y - 300) < 4) | (np.abs(y - 345) < 4))
    light[fence] = np.array([0.06, 0.05, 0.04])
    bush = (_noise(rng, 5) > 0.6) & (y > 215) & (y < 275) & (x > 500)
    light[bush] = np.array([0.03, 0.03, 0.025])
    return light


def blue_sky() -> np.ndarray:
    """Fir trees before a blue sky."""
    rng, y, x, light = _ground()
    light[...] = np.array([0.12, 0.28, 0.62]) * (0.8 + 0.7 * y / HEIGHT)[..., None]
    for middle in (90, 250, 330, 560, 700, 905):
        top = rng.uniform(60, 260)
        wide = 0.22 * (y - top) * (1.0 + 0.35 * np.sin(0.35 * y + middle)) + 3 * _noise(rng, 4)
        light[(y > top) & (np.abs(x - middle) < wide)] = np.array([0.02, 0.035, 0.022])
    light *= np.exp(0.05 * _noise(rng, 3))[..., None]
    light[y > 470] = np.array([0.62, 0.66, 0.74])
    return light


def forest() -> np.ndarray:
    """Trunks in a dark wood, some sky between them."""
    rng, y, x, light = _ground()
    light[...] = np.array([0.05, 0.06, 0.05]) + 0.28 * np.clip(1 - y / 260, 0, 1)[..., None]
    light *= np.exp(0.3 * _noise(rng, 40) + 0.2 * _noise(rng, 9))[..., None]
    for _ in range(34):
        middle, wide = rng.uniform(0, WIDTH), rng.uniform(3, 24)
        side = (x - middle - 0.03 * (y - 300) * rng.normal()) / wide
        shade = 0.01 + 0.03 * np.clip(0.5 - side, 0, 1)
        light = np.where(
            (np.abs(side) < 0.5)[..., None], shade[..., None] * np.array([1.0, 0.85, 0.7]), light
        )
    floor = np.clip((y - 420) / 40, 0, 1)[..., None]
    return (
        light * (1 - floor)
        + floor * np.array([0.045, 0.035, 0.02]) * np.exp(0.4 * _noise(rng, 3))[..., None]
    )


def tungsten() -> np.ndarray:
    """A room in the light of a bulb."""
    own = io.srgb_to_linear(io.fit(data.astronaut(), (WIDTH, WIDTH))[60 : 60 + HEIGHT] / 255.0)
    y, x = np.indices((HEIGHT, WIDTH)).astype(float)
    bulb = 0.35 + 0.9 * np.exp(-((x - 760) ** 2 + (y - 120) ** 2) / 9e4)
    return own.mean(axis=2, keepdims=True) ** 0.9 * np.array([0.95, 0.62, 0.3]) * bulb[..., None]


def photographs() -> dict[str, np.ndarray]:
    """Return the ten, uint8 (540, 960, 3)."""
    made = {
        "day": day, "night street": street, "snow on the ground": white_ground,
        "overcast": overcast,
        "blue sky": blue_sky, "tungsten room": tungsten, "forest": forest,
    }  # fmt: skip
    found = {name: _display(make()) for name, make in made.items()}
    found["coffee"] = io.fit(data.coffee(), (WIDTH, HEIGHT))
    found["even grey"] = np.full((HEIGHT, WIDTH, 3), 110, np.uint8)
    found["black"] = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    return found


def measured(plate: np.ndarray, scene: fl.Scene) -> dict[str, float]:
    """Return channels' spread, the level of bright peaks and what is seen on the darkest third."""
    parts = scene.layers(7)
    image, alpha = parts.image.astype(float), parts.alpha
    level, behind = image.mean(axis=2), plate.astype(float).mean(axis=2)
    peaks = (alpha == maximum_filter(alpha, 5)) & (alpha > 0.6)
    cover = alpha[peaks][:, None]
    own = (image[peaks] - (1.0 - cover) * plate[peaks]) / cover
    spread, mixed = (
        np.ptp(one, axis=1) if len(own) else np.zeros(1) for one in (own, image[peaks])
    )
    white = float(np.percentile(gaussian_filter(behind, 2.0), 99.0))
    dark = behind <= np.percentile(behind, 100.0 / 3.0)
    rises = (level - behind)[(alpha == maximum_filter(alpha, 5)) & (alpha > 0.2) & dark]
    return {
        "spread": float(np.median(spread)),
        "mixed": float(np.median(mixed)),
        "bright": float(np.percentile(level[peaks], 98.0)) if peaks.any() else 0.0,
        "white": white,
        "seen": float((rises > SEEN).sum() / (1e-6 * dark.sum())),
        "lighter": float((rises > SEEN).mean()) if len(rises) else 0.0,
    }


def costs() -> None:
    """Print what lens, shapes and light cost: time on one thread, heavy snow at 1920 x 1080."""
    fl.settings(threads=1)
    rng = np.random.default_rng(1)
    plate = np.full((1080, 1920, 3), 60, np.uint8)
    plate[:500] = 150, 170, 210
    plate += rng.integers(0, 20, plate.shape, dtype=np.uint8)
    depth = np.full(plate.shape[:2], 8.0, np.float32)
    depth[:500] = np.inf
    natural, round_, local = (
        fl.Snow("heavy", **more) for more in ({}, {"shape": "round"}, {"color": "local"})
    )
    sharp = fl.Scene(plate, effects=[natural], lens=None, fps=30)
    deep = sharp.replace(depth=depth)
    scenes = {
        "no lens": sharp, "usual lens": fl.Scene(plate, effects=[natural], fps=30),
        "no lens, round flakes": sharp.replace(effects=[round_]),
        "before a wall": deep, "before a wall, in linear light": deep.replace(space="linear"),
        "before a wall, local light": deep.replace(effects=[local]),
    }  # fmt: skip
    for look in ("heavy", "blizzard"):
        even = fl.Snow(look)
        mean = np.asarray(even.wind, float)
        speed = max(float(np.hypot(*mean[[0, 2]])), 1.0)
        gusty = fl.Wind(tuple(mean), gusts=speed / 4.0, swirl=speed / 10.0)
        scenes[look] = sharp.replace(effects=[even])
        scenes[f"{look}, even"] = sharp.replace(effects=[fl.Snow(look, clumps=0.0)])
        scenes[f"{look} in gusts"] = sharp.replace(effects=[fl.Snow(look, wind=gusty)])
    times: dict[str, list[float]] = {name: [] for name in scenes}
    # Each film by itself, six times: in turns each would find its sheets driven out of the cache.
    for name, scene in 6 * [*scenes.items()]:
        for t in range(6):
            start = time.process_time()
            scene.render(t)
            times[name].append(time.process_time() - start)
    least = {name: 1e3 * min(found) for name, found in times.items()}
    for name, found in least.items():
        print(f"{name}: {found:.1f} ms, {found / least['no lens']:.2f} of no lens")
    for look in ("heavy", "blizzard"):
        print(f"gusts: {least[f'{look} in gusts'] / least[look]:.1f} of {look} in an even wind")
        print(f"clumps: {least[look] / least[f'{look}, even']:.2f} of {look} without")
    wall = least["before a wall"]
    print(f"lace and outlines: {least['no lens'] / least['no lens, round flakes']:.3f} of round")
    for name in ("local light", "in linear light"):
        print(f"{name}: {least[f'before a wall, {name}'] / wall:.2f} of before a wall")
    light = fl.scene.Light(0.5)
    for name, wall in (("shot light", None), ("shot light by depth", depth)):
        found = []
        for _ in range(25):
            start = time.process_time()
            plate_light(plate, "display", *light.at(0.0)[1:], wall).local(
                2304.0, asymmetry=0.76, albedo=0.9
            )
            found.append(1e3 * (time.process_time() - start))
        print(f"{name}: {min(found):.1f} ms for each frame of a shot that moves, once for a still")


def main() -> None:
    """Print the table, and write sheets where a folder is given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sheets", type=Path, help="folder for contact sheets at 1:1")
    parser.add_argument("--look", default="moderate")
    parser.add_argument("--costs", action="store_true", help="time frames instead")
    given = parser.parse_args()
    if given.costs:
        return costs()
    columns = "spread", "of the pixel", "bright peaks", "of white", "seen on the dark", "share"
    print(f"| photograph | {' | '.join(columns)} |\n|{' --- |' * 7}")
    missed = []
    for name, plate in photographs().items():
        scene = fl.Scene(plate, effects=[fl.Snow(given.look)], seed=3)
        found = measured(plate, scene)
        ratio = found["bright"] / max(found["white"], 1.0)
        numbers = (
            f"{found['spread']:.0f} | {found['mixed']:.0f} | {found['bright']:.0f} | {ratio:.2f}"
        )
        print(f"| {name} | {numbers} | {found['seen']:.0f} | {found['lighter']:.2f} |")
        if name not in EVEN:
            rules = {
                "grey": found["spread"] <= GREY, "bright": BRIGHT[0] <= ratio <= BRIGHT[1],
                "seen": found["seen"] > 100.0,
            }  # fmt: skip
            missed += [f"{name}: {rule}" for rule, kept in rules.items() if not kept]
        if given.sheets:
            given.sheets.mkdir(exist_ok=True)
            crops = [scene.render(t)[120:480, 240:720] for t in (7,)]
            io.write_picture(given.sheets / f"{name.replace(' ', '_')}.png", np.hstack(crops))
    print("\nmissed: " + (", ".join(missed) or "none"))


if __name__ == "__main__":
    main()

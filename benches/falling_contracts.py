"""What falling snow must keep by itself: identities, motion, sizes of picture, bounds, costs.

Costs alone, in processor time on one thread: ``python benches/falling_contracts.py``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count, repeat
from typing import Any

import numpy as np
from falling_cases import FPS, Case, pictures
from speed import scenes
from timing import alone, timed

import flurries as fl
import judges
from twin_falling import View


def verdict(name: str, off: float, limit: float) -> str:
    return f"- {name}: {off:.4g}, limit {limit:g}, {'pass' if off <= limit else 'miss'}"


def sizes() -> Iterator[str]:
    """Compare a picture of 256 px with one of 2048 px made smaller, in light and in heavy snow."""
    for weather in ("light", "heavy"):
        made = []
        for width, seeds in ((256, 12), (2048, 3)):
            case, step = Case("still", weather, 0.0, width), width // 256
            each = []
            for seed in range(seeds):
                for full in pictures(case.scene(seed), (0.0, 90.0, 180.0)):
                    rows, cols = (n // step for n in full.shape)
                    small = full.reshape(rows, step, cols, step).mean(axis=(1, 3))
                    each.append((small.mean(), small.std()))
            made.append(np.mean(each, axis=0))
        mean, deviation = np.abs(made[0] / made[1] - 1.0)
        yield verdict(f"256 px against 2048 px made smaller, {weather}: mean", mean, 0.01)
        yield verdict(f"256 px against 2048 px made smaller, {weather}: deviation", deviation, 0.03)


WILD: dict[str, tuple[dict[str, Any], float]] = {
    "wind of 1,000 m/s": ({"wind": (1000.0, 0.0, 0.0)}, 5.0),
    "fall of 1,000 m/s": ({"fall": 1000.0}, 5.0),
    "sway of 1,000 m/s": ({"sway": (250.0, 4.0)}, 5.0),
    "10^9 frames": ({}, 1e9),
    "density of 0": ({"density": 0.0}, 5.0),
    "density of .01": ({"density": 0.01}, 5.0),
    "density of 10^5": ({"density": 1e5}, 5.0),
}


def bounded() -> Iterator[str]:
    """Time wild scenes at 48 x 36 px; a refusal is an answer, too."""
    for name, (fields, t) in WILD.items():
        begun = time.perf_counter()
        try:
            scene = fl.Scene("#000000", size=(48, 36), effects=[fl.Snow(**fields)], seed=1)
            scene.render(t)
            how = ""
        except (ValueError, TypeError):
            how = ", refused"
        yield verdict(f"{name}{how}, seconds", time.perf_counter() - begun, 1.0)


# (height, width) by name, px.
SIZES = {**{str(n): (n, n) for n in (64, 224, 512, 1024)}, "1080p": (1080, 1920),
         "4k": (2160, 3840), "8k": (4320, 7680)}  # fmt: skip


def cost(widest: int) -> Iterator[str]:
    """Compare the time of a pixel of heavy snow, sheets made, less what is fixed, at most 1 ms."""
    each: dict[str, dict[str, float]] = {}
    for size, shape in SIZES.items():
        calls = {k: v for k, v in scenes(shape).items() if k.startswith("scene: heavy")}
        warm = 40 if shape[0] < 2000 else 6
        for name, (least, _) in timed(calls, 8, warm=warm, clock=time.process_time).items():
            each.setdefault(name, {})[size] = least
        if shape[1] >= widest:
            break
    for name, found in each.items():
        least, pixels = np.array([(ms, math.prod(SIZES[size])) for size, ms in found.items()]).T
        fixed = np.arange(0.0, min(1.0, least.min()), 0.01)
        each_ns = 1e6 * (least - fixed[:, None]) / pixels
        ns, off = min(((row, row.max() / row.min()) for row in each_ns), key=lambda pair: pair[1])
        shown = ", ".join(f"{size}: {one:.1f}" for size, one in zip(found, ns, strict=True))
        yield verdict(f"ns a pixel, {name[7:]} ({shown}), dearest over cheapest", off, 1.5)


# From a value on in steps.
SETTINGS = {
    "amount": (0.1, 0.1), "opacity": (0.1, 0.1), "density": (90.0, 90.0),
    "wind": (0.1, 0.1), "shutter": (0.1, 0.1), "focal": (700.0, 9.0), "seed": (1, 1),
}  # fmt: skip


def changed(name: str, values: Iterator[Any]) -> None:
    """Make a frame of heavy snow at 640 x 480 with the next value of a setting."""
    given = {"seed": 0, "focal": 700.0, "wind": 0.0, name: next(values)}
    camera, seed, wind = fl.Camera(given.pop("focal")), given.pop("seed"), given.pop("wind")
    black, snow = np.zeros((480, 640, 3), np.uint8), fl.Snow("heavy", wind=(wind, 0, 0), **given)
    fl.Scene(black, camera=camera, effects=[snow], seed=seed).render(0)


def changes() -> Iterator[str]:
    """Time the frame after a change of a setting, and the first frame of a process at 224 px."""
    calls = {name: partial(changed, name, count(*steps)) for name, steps in SETTINGS.items()}
    times = timed({"": partial(changed, "seed", repeat(0)), **calls}, 6, clock=time.process_time)
    for name in SETTINGS:
        limit = 2.0 * times[""][0] if name in ("amount", "opacity") else 30.0
        yield verdict(f"a change of {name} at 640 px, ms", times[name][0], limit)
    yield verdict("first frame of a process at 224 px, ms", 1e3 * float(alone(FIRST)), 150.0)


FIRST = """
import time, numpy as np, flurries as fl
effects, picture = [fl.Snow("heavy")], np.zeros((224, 224, 3), np.uint8)
fl.set_threads(1), fl.Scene
begun = time.process_time()
fl.Scene(picture, effects=effects).render(0)
print(time.process_time() - begun)
"""


def identities(flakes: Callable[[fl.Scene, float], np.ndarray], **air: Any) -> Iterator[str]:
    """Compare the flakes of larger pictures, of parts, of another eye and of half the size."""
    t, lens = 40.0, 576.0
    snow = fl.Snow("heavy", shape="round", **air)

    def seen(size: tuple[int, int], focal: float = lens, **camera: Any) -> np.ndarray:
        view = fl.Camera(focal, **camera)
        return flakes(fl.Scene("#000000", size=size, camera=view, effects=[snow], seed=1), t)

    whole = judges.inside(seen((480, 360)), (0.0, 0.0), (480.0, 360.0))
    over = judges.inside(seen((600, 440)), (60.0, 40.0), (540.0, 400.0))
    yield verdict(f"overscan, strangers of {len(whole)}", judges.strangers(whole, over), 0)
    part = seen((240, 180), center=(120.0, 90.0))
    inner = judges.inside(whole, (120.0, 90.0), (360.0, 270.0))
    part = judges.inside(part, (0.0, 0.0), (240.0, 180.0))
    yield verdict(f"crop, strangers of {len(inner)}", judges.strangers(inner, part), 0)
    eye = seen((600, 440), offset=(0.06, 0.0, 0.0))
    # What is nearer than .6 m may have left the other eye's picture.
    own = whole[whole["depth"] > 0.6]
    yield verdict("other eye, strangers", judges.strangers(own, eye, whole=False), 0)
    half = judges.inside(seen((240, 180), 0.5 * lens), (0.0, 0.0), (240.0, 180.0))
    yield verdict("half size, strangers", judges.strangers(half, whole, whole=False), 0)


def motions(flakes: Callable[[fl.Scene, float], np.ndarray]) -> Iterator[str]:
    """Compare where flakes are seen with the twin's camera, and motion with where they go."""
    t, lens = 20.0, fl.Camera(576.0)
    gusts = fl.Wind((1.0, 0.0, 0.0), gusts=1.0)
    turn = fl.Keys([(0.0, (0.0, 0.0, 0.0)), (900.0, (0.0, 6.0, 0.0))])
    about: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
        "sway": ({}, {}, {}),
        "forward": ({"velocity": (0.5, 0.0, 2.0)}, {"velocity": (0.5, 0.0, 2.0)}, {}),
        "turning": ({"orientation": turn}, {"spin": 6.0 / 900.0 * FPS}, {}),
        "gusts": ({}, {}, {"wind": gusts}),
        "zoom": (
            {"focal": fl.Keys([(0.0, 576.0), (100.0, 1152.0)])},
            {"zoom": math.log(1.0 + t / 100.0) * FPS / t},
            {},
        ),
    }
    for name, (way, view, fields) in about.items():
        snow = fl.Snow("light", shape="round", **fields)
        path = fl.CameraPath(lens, **way)
        scene = fl.Scene("#000000", size=(480, 360), camera=path, effects=[snow], seed=1, fps=FPS)
        now, then = flakes(scene, t), flakes(scene, t + 1.0)
        twin = View(size=(480, 360), focal=576.0, fps=FPS, **view)
        away = twin.project(now["place"].T, t)[0].T - now["pixel"]
        yield verdict(f"{name}: places in the picture, px", float(np.abs(away).max()), 1e-3)
        layers = scene.layers(t)
        (layer,) = layers.layers.values()
        ids, motion, cover = layer.ids, layer.motion, layer.coverage
        # Of each flake the pixel that it covers most; where it is faint the texture's motion shows.
        order = np.argsort(-cover.ravel(), kind="stable")
        order = order[cover.ravel()[order] > 0.3]
        numbers, first = np.unique(ids.ravel()[order], return_index=True)
        own = now[np.argsort(now["id"])]
        own = own[np.isin(own["id"].astype(np.int64), numbers)]
        shown = order[first][np.isin(numbers, own["id"].astype(np.int64))]
        off = judges.motion_off(motion.reshape(-1, 2)[shown], own, then)
        yield verdict(f"{name}: motion of {len(own)} flakes, px", off, 1e-3)


def contracts(*, quick: bool) -> list[str]:
    """Return the lines of all."""
    costs = *cost(1920 if quick else 7680), *changes()
    return [*sizes(), *bounded(), *costs, *identities(fl.flakes), *motions(fl.flakes)]


if __name__ == "__main__":
    fl.set_threads(1)
    print("\n".join((*cost(7680), *changes())))

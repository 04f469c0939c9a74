"""What whole frames cost with layers, a depth, eyes, lamps: ``python benches/layers.py``.

Ratios in one run: scenes of 1024 x 768 on one thread, in processor time, the least of many turns.
"""

from __future__ import annotations

import json
import time
from itertools import count

import numpy as np
from timing import Calls, alone, timed

import flurries as fl
from flurries.camera import Lens

SHAPE = (768, 1024)
EYES = {"distance": 0.02, "convergence": 4.0}
LIT = {
    "lights": [fl.scene.Lamp((x, -2.0, 8.0), power=60.0) for x in (-3.0, -1.0, 1.0, 3.0)],
    "lens": Lens(focus=6.0, f_stop=1.4),
}


def scenes(*, flying: bool) -> dict[str, tuple[fl.Scene, fl.Scene]]:
    """Return scenes by name, each without and with a depth that differs from pixel to pixel."""
    picture = np.random.default_rng(1).integers(0, 255, (*SHAPE, 3)).astype(np.uint8)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    ground = np.where(y > 400, 3.0 + 200.0 / np.maximum(y - 399.0, 1.0), 400.0)
    depth = (ground * (1.0 + 0.2 * np.sin(x / 40.0) * np.cos(y / 31.0))).astype(np.float32)
    path = fl.CameraPath(fl.Camera(900.0), velocity=(0.0, 0.0, 1.0 if flying else 0.0))
    snow, tent, fog = fl.Snow("heavy"), fl.effects.TentSnow("heavy"), fl.Mist("fog")
    kinds = {"fl.Snow": [snow], "fl.effects.TentSnow": [tent]}
    if flying:  # A still camera's mist does not change: it is kept.
        kinds |= {"fl.Mist": [fog], "fl.Mist and fl.effects.TentSnow": [fog, tent]}
    flat = {n: fl.Scene(picture, camera=path, effects=kind) for n, kind in kinds.items()}
    return {name: (scene, scene.replace(depth=depth)) for name, scene in flat.items()}


def ratios(flat: fl.Scene, deep: fl.Scene, rounds: int) -> list[float]:
    """Return ms of a frame; over it layers, depth, both eyes, light; then both by depth."""
    frame, lit = count(), flat.replace(**LIT)
    calls: Calls = {
        "one": lambda: flat.render(next(frame)),
        "layers": lambda: flat.layers(next(frame)),
        "depth": lambda: deep.render(next(frame)),
        "both": lambda: flat.stereo(next(frame), **EYES),
        "lit": lambda: lit.render(next(frame)),
        "both, deep": lambda: deep.stereo(next(frame), **EYES),
    }
    one, layers, depth, both, light, deeper = (
        least for least, _ in timed(calls, rounds, warm=1, clock=time.process_time).values()
    )
    return [one, layers / one, depth / one, both / one, light / one, deeper / depth]


def measured(rounds: int) -> dict[str, list[float]]:
    fl.set_threads(1)
    return {
        f"{name}, {about}": ratios(*pair, rounds)
        for flying, about in ((False, "still"), (True, "flying"))
        for name, pair in scenes(flying=flying).items()
    }


def table(rounds: int) -> list[str]:
    """Return the lines of a table, measured where NumPy's products wake no other threads."""
    lines = [
        "| scene | ms | `layers=True` | with depth | both eyes | lamps, lens | both, with depth |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    said = alone(f"import json, layers; print(json.dumps(layers.measured({rounds})))")
    for name, found in json.loads(said).items():
        lines.append(f"| {name} | {' | '.join(f'{value:.2f}' for value in found)} |")
    return lines


if __name__ == "__main__":
    print("\n".join(table(12)))

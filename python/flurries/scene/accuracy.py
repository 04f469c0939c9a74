"""What accuracy costs in a scene: more or fewer flakes drawn one by one, in time and in looks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries.effects.falling import Rain, Snow
from flurries.effects.weather import Weather
from flurries.frame.needs import renderer_of
from flurries.frame.plan import Accuracy, Handover
from flurries.frame.view import Frame
from flurries.scene.rendering import Rendering
from flurries.scene.scene import Scene, expect_scene

# Runs of which the fastest counts, after one that makes what all of them share.
RUNS = 3

# The percentile above which a pixel has much weather.
LEVEL = 99.0

NO_SAY = (
    "in a film that begins again, and where flakes are so few that all are drawn, `handover` has "
    "no say"
)


def accuracy_of(scene: Rendering, number: int) -> Accuracy:
    """Return what a frame takes and looks like with other hand-overs."""
    scene = expect_scene(scene)
    frame = scene._program.frame(scene._time_of(number))
    mixed = [isinstance(e, (Snow, Rain)) and e.method != "simulated" for e in scene.effects]
    if not any(mixed):
        why = "no effect of the scene draws near flakes over a texture, as Snow and Rain do"
        return Accuracy(number, (), why)
    depths = [_depth(effect, frame) if mixes and scene._lap is None else None
              for effect, mixes in zip(scene.effects, mixed, strict=True)]  # fmt: skip
    known = any(depth is not None for depth in depths)
    settings = []
    for factor in (0.5, 1.0, 2.0) if known else (1.0,):
        effects = [replace(effect, handover=factor * depth) if depth and factor != 1.0 else effect
                   for effect, depth in zip(scene.effects, depths, strict=True)]  # fmt: skip
        there = [_depth(e, frame) for e, depth in zip(effects, depths, strict=True) if depth]
        name = ", ".join(f"{depth:.3g} m" for depth in there)
        settings.append(
            _setting(scene, number, f"hand-over at {name}" if name else "as is", effects)
        )
    effects = [replace(effect, method="simulated") if mixes else effect
               for effect, mixes in zip(scene.effects, mixed, strict=True)]  # fmt: skip
    settings.append(_setting(scene, number, "every flake drawn", effects))
    return Accuracy(number, tuple(settings), "" if known else NO_SAY)


def _depth(effect: Any, frame: Frame) -> float | None:
    """Return the mean depth up to which flakes are drawn; None where `handover` has no say."""
    flakes = getattr(renderer_of(effect), "flakes", None)
    if not isinstance(flakes, Weather):
        return None
    film = flakes.film(frame)
    return fmean(share.reach for share in film.drawn) if film.layers else None


def _setting(scene: Scene, number: int, name: str, effects: Sequence[Any]) -> Handover:
    changed = scene.replace(effects=effects)
    alpha = changed.layers(number).alpha
    spent = []
    for _ in range(RUNS + 1):
        began = time.perf_counter()
        changed.render(number)
        spent.append(1e3 * (time.perf_counter() - began))
    return Handover(
        name, min(spent[1:]), float(alpha.std()), euler(alpha > np.percentile(alpha, LEVEL))
    )


def euler(above: npt.NDArray[np.bool_]) -> int:
    """Return pieces less holes of a picture, where pixels that touch at corners are joined."""
    padded = np.pad(above, 1)
    quads = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    count = np.sum(quads, axis=0)
    diagonal = (count == 2) & (quads[0] == quads[3])
    ends = (count == 1).sum() - (count == 3).sum() - 2 * diagonal.sum()
    return int(ends) // 4

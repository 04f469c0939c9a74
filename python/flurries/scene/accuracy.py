"""What accuracy costs in a scene: more or fewer flakes drawn one by one, in time and in looks."""

import time
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

RUNS = 3  # Runs of which the fastest counts, after one that makes what all of them share.
LEVEL = 99.0  # The percentile above which a pixel has much weather.

NO_SAY = (
    "in a film that begins again, and where flakes are so few that all are drawn, `handover` has "
    "no say"
)


def accuracy_of(scene: Rendering, number: int) -> Accuracy:
    scene = expect_scene(scene)
    frame = scene._program.frame(scene._time_of(number))
    mixed = {
        index: effect for index, effect in enumerate(scene.effects)
        if isinstance(effect, (Snow, Rain)) and effect.method != "simulated"
    }  # fmt: skip
    if not mixed:
        why = "no effect of the scene draws near flakes over a texture, as Snow and Rain do"
        return Accuracy(number, (), why)
    depths = {} if scene._lap is not None else {
        index: depth for index, effect in mixed.items() if (depth := _depth(effect, frame))
    }  # fmt: skip
    settings = []
    for factor in (0.5, 1.0, 2.0) if depths else (1.0,):
        changed = mixed if factor == 1.0 else {
            index: replace(mixed[index], handover=factor * depth)
            for index, depth in depths.items()
        }  # fmt: skip
        there = ", ".join(f"{_depth(changed[index], frame):.3g} m" for index in depths)
        name = f"hand-over at {there}" if there else "as is"
        settings.append(_setting(scene, number, name, changed))
    drawn = {index: replace(effect, method="simulated") for index, effect in mixed.items()}
    settings.append(_setting(scene, number, "every flake drawn", drawn))
    return Accuracy(number, tuple(settings), "" if depths else NO_SAY)


def _depth(effect: Any, frame: Frame) -> float | None:
    """Return the mean depth up to which flakes are drawn; None where `handover` has no say."""
    flakes = getattr(renderer_of(effect), "flakes", None)
    if not isinstance(flakes, Weather):
        return None
    film = flakes.film(frame)
    return fmean(share.reach for share in film.drawn) if film.layers else None


def _setting(scene: Scene, number: int, name: str, effects: dict[int, Any]) -> Handover:
    mine = [effects.get(index, effect) for index, effect in enumerate(scene.effects)]
    changed = scene.replace(effects=mine)
    alpha, spent = changed.layers(number).alpha, []
    for _ in range(RUNS + 1):
        began = time.perf_counter()
        changed.render(number)
        spent.append(1e3 * (time.perf_counter() - began))
    much = alpha > np.percentile(alpha, LEVEL)
    return Handover(name, min(spent[1:]), float(alpha.std()), euler(much))


def euler(above: npt.NDArray[np.bool_]) -> int:
    """Return pieces less holes of a picture, where pixels that touch at corners are joined."""
    padded = np.pad(above, 1)
    quads = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    count = np.sum(quads, axis=0)
    diagonal = (count == 2) & (quads[0] == quads[3])
    ends = (count == 1).sum() - (count == 3).sum() - 2 * diagonal.sum()
    return int(ends) // 4

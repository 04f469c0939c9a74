"""Numbers of a population that change over time: by what is there, never by what a flake is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries.effects.precipitation import Precipitation
from flurries.frame.layer import Layer
from flurries.frame.needs import LeftOut, Needs
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, Number, value_at

# Straight pieces between two keys that stand for the product of two keyed numbers.
_PIECES = 8


def highest(number: Number) -> float:
    """Return the largest value that a number ever has."""
    return max(value for _, value in number.keys) if isinstance(number, Keys) else float(number)


def product(first: Number, second: Number) -> Number:
    """Return two numbers multiplied; of two keyed ones by straight pieces between their keys."""
    if not isinstance(first, Keys) and not isinstance(second, Keys):
        return first * second
    frames = sorted(
        {frame for one in (first, second) if isinstance(one, Keys) for frame, _ in one.keys}
    )
    if isinstance(first, Keys) and isinstance(second, Keys) and len(frames) > 1:
        at = np.interp(
            np.linspace(0.0, len(frames) - 1.0, _PIECES * (len(frames) - 1) + 1),
            np.arange(len(frames)),
            frames,
        )
        frames = at.tolist()
    return Keys([(t, float(value_at(first, t)) * float(value_at(second, t))) for t in frames])


def shares_of(keys: Keys) -> list[tuple[Any, Number]]:
    """Return each key's value with its share over time: 1 at its own frame, 0 at the others'."""
    frames = [frame for frame, _ in keys.keys]
    found: list[tuple[Any, Number]] = []
    for index, (frame, value) in enumerate(keys.keys):
        share = [(frame, 1.0)]
        if index > 0:
            share.insert(0, (frames[index - 1], 0.0))
        if index + 1 < len(frames):
            share.append((frames[index + 1], 0.0))
        found.append((value, Keys(share) if len(share) > 1 else 1.0))
    return found


@dataclass(frozen=True, eq=False)
class Mixture:
    """Populations that take turns: between two keys the flakes of one go as those of the next come.

    Attributes
    ----------
    parts : sequence of Precipitation
        One for each key, with its share in its amount.
    """

    parts: Sequence[Precipitation[Any]]

    @property
    def motion(self) -> Any:
        """The motion of the flakes of the first key."""
        return self.parts[0].motion

    def _now(self, frame: Frame) -> list[tuple[int, Precipitation[Any]]]:
        shown = [value_at(part.amount, frame.t) > 0.0 for part in self.parts]
        return [(index, part) for index, part in enumerate(self.parts) if shown[index]]

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of a frame: the steps of all populations that are there."""
        asked = [part.needs(frame) for _, part in self._now(frame)]
        if not asked:
            why = "its amount is 0"
            return Needs((), (LeftOut(self.parts[0].name, why),), most=0.0)
        clear = float(np.prod([1.0 - needs.most for needs in asked]))
        return Needs(
            tuple(step for needs in asked for step in needs.steps),
            tuple(one for needs in asked for one in needs.left_out),
            frozenset[str]().union(*(needs.reads for needs in asked)),
            most=1.0 - clear,
            by_rows=True,
        )

    def render(self, frame: Frame) -> tuple[Layer, ...]:
        """Return a layer for each population that is there."""
        layers: list[Layer] = []
        for _, part in self._now(frame):
            made = part.render(frame)
            layers += made if isinstance(made, tuple) else [made]
        return tuple(layers)

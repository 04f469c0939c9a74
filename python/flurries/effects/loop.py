"""Weather that begins again: what is drawn of one round gives way, one by one, to that of the next.

A flake that falls through a film of N frames is N frames' way farther on when the film begins
again. So a film that repeats shows two rounds at a time: the film at t, and the film at t - N. In
each frame a few flakes of the first go and as many of the second come, by the same law as where
the amount of snow changes; at the end all are those of t - N, which is where the film began. No
speed is bent, and as many flakes are there at all times. What is no crowd of flakes looks at the
frame's `lap` itself: waves of a texture turn by whole cycles, a cone by whole tiles.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from flurries.effects.cone import ConeSnow
from flurries.effects.population import product
from flurries.effects.rain import Rain
from flurries.effects.snow import Snow
from flurries.effects.tent_rain import TentRain
from flurries.effects.tent_snow import TentSnow
from flurries.frame.layer import Layer
from flurries.frame.needs import Needs, needs_of, renderer_of
from flurries.frame.view import Frame, Lap
from flurries.motion.keys import Keys
from flurries.motion.wind import FIELDS, Wind

# Values that differ by less than this, of the larger one, are one.
_SAME = 1e-9

# A number that does not end where it began goes back over this share of the film.
_BACK = 0.25

# Of effects that have both: the fields without which nothing is drawn one by one, and those without
# which nothing else is left.
_DRAWN: dict[type[Any], tuple[dict[str, Any], dict[str, Any]]] = {
    Snow: ({"density": 0.0}, {"haze": 0.0}),
    Rain: ({"density": 0.0}, {"haze": 0.0}),
    TentSnow: ({"flakes": 0, "flake_density": None}, {"texture": 0.0, "haze": 0.0}),
    TentRain: ({"drops": 0, "drop_density": None}, {"texture": 0.0, "haze": 0.0}),
    ConeSnow: ({"flakes": 0}, {"gain": 0.0, "haze": 0.0}),
}


@dataclass(frozen=True, eq=False)
class Earlier:
    """An effect as it was some frames ago, in the light and before the depth of now."""

    effect: Any
    frames: int
    seed: int
    NAME: str  # For people.

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of the effect."""
        return needs_of(self.effect, self.then(frame))

    def render(self, frame: Frame) -> Layer | tuple[Layer, ...]:
        """Return its layer."""
        made: Layer | tuple[Layer, ...] = renderer_of(self.effect).render(self.then(frame))
        return made

    def then(self, frame: Frame) -> Frame:
        """Return the frame of the earlier round."""
        then = frame.later(-self.frames)
        turns = frame.path.turns or frame.path.zooms
        return replace(
            then, depth=frame.depth, ambient=frame.ambient, plate=frame.plate, lap=None,
            nearer=frame.nearer, shared=None if turns else frame.shared,
        )  # fmt: skip


def looped(effect: Any, lap: Lap, seed: int) -> tuple[Any, ...]:
    """Return effects that show one over and over, back to front; `seed` is its own."""
    if type(effect) not in _DRAWN:
        return (effect,)
    without, alone = _DRAWN[type(effect)]
    first, end = float(lap.first), float(lap.end)
    going = Keys([(first, 1.0), (end, 0.0)])
    coming = Keys([(first - lap.frames, 0.0), (first, 1.0)])
    effect = replace(effect, seed=seed)
    if not any(getattr(effect, name) for name in without):
        return (effect,)
    now, then = (
        replace(effect, amount=product(effect.amount, share), **alone) for share in (going, coming)
    )
    rounds = now, Earlier(then, lap.frames, seed, effect.NAME)
    rest = any(getattr(effect, name) != nothing for name, nothing in alone.items())
    return (replace(effect, **without), *rounds) if rest else rounds


def one_place(effect: Any) -> bool:
    """Whether what is drawn of an effect stays at its place, but for a sway."""
    known = type(effect) in _DRAWN and hasattr(effect, "sway")
    return known and bool(effect.parts.motion.still)


def closed(value: Any, lap: Lap) -> tuple[Any, float | None]:
    """Return a keyed value for two rounds, and the frame from which it goes back to the first."""
    if not isinstance(value, Keys):
        return value, None
    first, end = float(lap.first), float(lap.end)
    inside = [(t, v) for t, v in value.keys if first < t < end]
    begins, ends = value.value(first), value.value(end)
    back = None
    if not _same(begins, ends):
        back = end - _BACK * lap.frames
        inside = [(t, v) for t, v in inside if t < back]
        inside.append((back, value.value(back)))
    ring = [(first, begins), *inside]
    if back is None and all(_same(begins, v) for _, v in inside):
        return begins, None
    rounds = [(t + n * lap.frames, v) for n in (-2, -1, 0, 1) for t, v in ring]
    return Keys(rounds), back


def closed_fields(thing: Any, lap: Lap) -> tuple[Any, dict[str, float]]:
    """Return a dataclass with its keyed fields closed, and from which frame each goes back."""
    if not is_dataclass(thing) or isinstance(thing, type):
        return thing, {}
    changes, bent = {}, {}
    for name in (f.name for f in fields(thing) if f.init):
        value = getattr(thing, name, None)
        inner = value.mean if isinstance(value, Wind) else value
        made, back = closed(inner, lap)
        if made is not inner:
            changes[name] = made
            if isinstance(value, Wind):
                rest = {one: getattr(value, one) for one in FIELDS if one != "mean"}
                changes[name] = Wind(made, **rest)
        if back is not None:
            bent[name] = back
    return (replace(thing, **changes), bent) if changes else (thing, bent)


def _same(one: Any, other: Any) -> bool:
    return bool(np.allclose(one, other, rtol=_SAME, atol=0.0))

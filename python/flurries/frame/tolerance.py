"""Where a tolerance is spent: what a frame does without, or does less exactly, to take less time.

Each step of an effect says what error of an opacity it makes to do so (`Step.error`). Here errors
become prices, in values of the frame, that add up; of all choices within the tolerance the one is
taken that saves most by the fixed cost model. What may be chosen does not depend on the tolerance:
a larger one never saves less. No choice follows a clock.

A layer of opacity a and color c makes v into v + a (c - v): an error e of a is at most e |c - v|
of the frame, and layers over it only lessen it. In pictures of integers each layer is rounded: one
that errs by e < n steps before it is rounded errs by n steps after it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import add
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array
from flurries.frame.costs import milliseconds
from flurries.frame.needs import Needs, Step
from flurries.io.color import linear_to_srgb

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# What the encoding's table errs by, display values: half a step of 16 bits at the steepest place.
TABLE = 0.5 * STEEPEST / 65535.0

# What float32 may add to an error.
ROUNDING = 1e-6

# Errors that a step may be given, and opacities under which weather is not made: steps of 8 bits
# and one and a half of them, which integers round to one, times powers of two.
LEVELS = tuple(part * 2.0**k / 255.0 for k in range(-12, 5) for part in (1.0, 1.5))

# Choices that are held at a time.
_MOST_KEPT = 500


@dataclass(frozen=True)
class Spent:
    """A saving that a tolerance is spent on."""

    what: str
    error: float  # The most that an opacity is off.
    milliseconds: float  # The time that it saves, by the cost model.


class Choice(NamedTuple):
    """The approximations of a frame; the sum of two, field by field, is both of them."""

    error: float = 0.0  # The most that a value of the frame may differ, of full scale.
    saved: float = 0.0  # Milliseconds by the cost model.
    spent: tuple[Spent, ...] = ()
    without: tuple[tuple[int, str], ...] = ()  # Steps left out, by their effects' places.
    errors: tuple[tuple[int, float], ...] = ()  # `Run.error` of effects, by their places.
    table: bool = False  # Whether display values are looked up in a table of 16 bits.
    hidden: float = 0.0  # Where all but this is covered, the weather behind is not made.

    def gone(self, place: int) -> frozenset[str]:
        """Return the steps that an effect goes without."""
        return frozenset(step for of, step in self.without if of == place)


EXACT = Choice()


class Light(NamedTuple):
    """The law by which errors of opacities become errors of a frame."""

    same: bool  # Whether layers are mixed in the light that the background holds.
    step: float  # Of a picture of integers, of full scale; 0 of floats.
    factor: float  # The most that a value of the frame is off for each unit of opacity.

    @staticmethod
    def of(picture: Array, linear: bool, encoding: str) -> Light:
        """Return the law over a background, with layers mixed in linear light or not."""
        same = linear == (encoding == "linear")
        if picture.dtype.kind == "u" and picture.shape[2] == 3:
            return Light(same, 1.0 / float(np.iinfo(picture.dtype).max), 1.0 if same else STEEPEST)
        low, high = min(float(np.nanmin(picture)), 0.0), max(float(np.nanmax(picture)), 1.0)
        # Dividing by alpha makes errors as large as can be.
        if picture.shape[2] == 4 or not math.isfinite(high - low):
            return Light(same, 0.0, math.inf)
        if same:
            return Light(same, 0.0, high - low)
        # Floats mixed in display values and decoded again: steepest at the brightest.
        low, high = linear_to_srgb(np.array([low, high])).tolist()
        slope = 2.4 / 1.055 * ((max(high, -low) + 0.055) / 1.055) ** 1.4
        return Light(same, 0.0, slope * (high - low))

    def price(self, layer: float = 0.0, gone: float = 0.0) -> float:
        """Return the price of an effect's errors: where it is laid over the picture, and is not."""
        if self.step == 0.0 or not self.same:
            return self.factor * (layer + gone)
        # A layer that errs is rounded up or down; one that is gone leaves an integer.
        up = math.ceil((layer + ROUNDING) / self.step) if layer > 0.0 else 0
        return self.step * (up + math.floor((gone + ROUNDING) / self.step + 0.5))

    def error(self, price: float) -> float:
        """Return the largest error of the frame's values for prices together."""
        if self.step == 0.0 or self.same or price == 0.0:
            return price
        return self.step * math.ceil((price + ROUNDING) / self.step)


def choose(
    asked: Sequence[tuple[int, str, Needs]],
    light: Light,
    tolerance: float,
    *,
    values: int,
    shares: Iterable[tuple[float, float]] = (),
) -> Choice:
    """Return the choice that saves most of a frame.

    Parameters
    ----------
    asked : sequence of (place, name, Needs)
        The effects that run.
    light : Light
        How their errors count.
    tolerance : float
        Of the frame's values, of full scale.
    values : int
        Numbers in the frame.
    shares : iterable of (level, share)
        The share of the frame in which no more than the level is let through, and something is.
    """
    if not math.isfinite(light.factor):
        return EXACT
    limit = tolerance * (1.0 + 1e-9)
    brightest = max((needs.brightest for _, _, needs in asked), default=1.0)
    scene = [EXACT]
    if light.step > 0.0 and not light.same:
        saved = milliseconds({"encoded value": values, "looked up value": -values})
        scene.append(_one("display values from a table of 16 bits", TABLE, saved, table=True))
    effects = []
    for place, name, needs in asked:
        work = sum(milliseconds(step.cost().work) for step in needs.steps)
        steps = tuple((place, step.name) for step in needs.steps)
        gone = _one(name, needs.most, work + milliseconds({"layer": 1.0}), without=steps)
        gone = gone._replace(error=light.price(gone=brightest * needs.most))
        ways = [_ways(place, name, step) for step in needs.steps if step.error is not None]
        effects.append((work, gone, _best_of(ways, math.inf)))
    best = EXACT
    for level, share in [(0.0, 0.0), *shares]:
        groups = [scene]
        for work, gone, kept in effects:
            # An effect is laid over the picture with errors, and made only where the level lets it
            # be seen; or it is not laid over the picture at all.
            laid = [
                way._replace(
                    error=light.price(brightest * way.error, brightest * level),
                    saved=way.saved + share * max(work - way.saved, 0.0),
                )
                for way in kept
            ]
            groups.append([*laid, gone])
        found = [one for one in _best_of(groups, limit) if light.error(one.error) <= limit]
        if found and found[-1].saved > best.saved:
            best = found[-1]._replace(hidden=level)
    if best.hidden > 0.0:
        saved = best.saved - sum(one.milliseconds for one in best.spent)
        rest = Spent("what hardly shows past what stands in front", best.hidden, saved)
        best = best._replace(spent=(*best.spent, rest))
    return best._replace(error=light.error(best.error))


def _one(what: str, error: float, saved: float, **done: Any) -> Choice:
    return Choice(error, saved, (Spent(what, error, saved),), **done)


def _ways(place: int, name: str, step: Step) -> list[Choice]:
    """Return the ways to save at a step: not, by leaving it out, or by letting it err."""
    most, work = step.error or 0.0, milliseconds(step.cost().work)
    if not step.spares:
        return [EXACT, _one(f"{name}: no {step.name}", most, work, without=((place, step.name),))]
    saved = [(level, work - milliseconds(step.cost(level).work)) for level in LEVELS]
    what = f"{name}: {step.spares}"
    return [EXACT, *(_one(what, e * most, ms, errors=((place, e),)) for e, ms in saved)]


def _best_of(groups: Iterable[Sequence[Choice]], limit: float) -> list[Choice]:
    """Return the best sums of one of each group: each saves more than all that err less."""
    kept = [EXACT]
    for group in groups:
        pairs = [(a, b) for a in kept for b in group if a.error + b.error <= limit]
        kept = []
        sums = (Choice(*map(add, *pair)) for pair in pairs)
        for one in sorted(sums, key=lambda one: (one.error, -one.saved)):
            if not kept or one.saved > kept[-1].saved:
                kept.append(one)
        # Of a scene with very many effects some are enough; the one that saves most stays.
        if len(kept) > _MOST_KEPT:
            kept = [*kept[:: len(kept) // _MOST_KEPT + 1], kept[-1]]
    return kept

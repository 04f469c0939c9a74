"""Where a tolerance is spent: what a frame does without, or does less exactly, to take less time.

Each effect says what it can do so and what error that makes, of an opacity (`Saving`). Here errors
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
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from flurries._contract import Array
from flurries.frame.costs import nanoseconds
from flurries.frame.needs import Needs, Saving
from flurries.io.color import linear_to_srgb

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# What the encoding's table errs by, display values: half a step of 16 bits at the steepest place.
TABLE = 0.5 * STEEPEST / 65535.0

# What float32 may add to an error.
ROUNDING = 1e-6

# Errors that a setting may be given, and opacities under which weather is not made: steps of 8 bits
# and one and a half of them, which integers round to one, times powers of two.
LEVELS = tuple(part * 2.0**k / 255.0 for k in range(-12, 5) for part in (1.0, 1.5))

# Choices that are held at a time.
_MOST_KEPT = 500


@dataclass(frozen=True)
class Spent:
    """What a tolerance is spent on."""

    what: str
    error: float  # The most that an opacity is off.
    milliseconds: float  # The time that it saves, by the cost model.


@dataclass(frozen=True)
class Choice:
    """What is done less exactly in a frame: steps left out and settings, by an effect's place."""

    without: dict[int, frozenset[str]] = field(default_factory=dict)
    settings: dict[int, dict[str, float]] = field(default_factory=dict)
    hidden: float = 0.0  # Where all but this is covered, the weather behind is not made.
    table: bool = False  # Whether display values are looked up in a table of 16 bits.
    spent: tuple[Spent, ...] = ()
    error: float = 0.0  # The most that a value of the frame may differ, of full scale.


EXACT = Choice()


class Light(NamedTuple):
    """How errors of opacities become errors of a frame."""

    same: bool  # Whether layers are mixed in the light that the background holds.
    step: float  # Of a picture of integers, of full scale; 0 of floats.
    reach: float  # The most that a color and the background differ, in the light of the mix.
    slope: float  # Of the way back to the background's encoding.
    brightest: float = 1.0  # The largest of the layers' colors, at least 1.

    @staticmethod
    def of(picture: Array, linear: bool, encoding: str) -> Light:
        """Return how errors count over a background, with layers mixed in linear light or not."""
        same = linear == (encoding == "linear")
        if picture.shape[2] == 4:
            # Dividing by alpha makes errors as large as can be.
            return Light(same, 0.0, math.inf, 1.0)
        if picture.dtype.kind == "u":
            step = 1.0 / float(np.iinfo(picture.dtype).max)
            return Light(same, step, 1.0, 1.0 if same else STEEPEST)
        low, high = (float(end) for end in (np.nanmin(picture), np.nanmax(picture)))
        if not (math.isfinite(low) and math.isfinite(high)):
            return Light(same, 0.0, math.inf, 1.0)
        low, high = min(low, 0.0), max(high, 1.0)
        if same:
            return Light(same, 0.0, high - low, 1.0)
        # Floats mixed in display values and decoded again: steepest at the brightest.
        low, high = linear_to_srgb(np.array([low, high])).tolist()
        slope = 2.4 / 1.055 * ((max(high, -low) + 0.055) / 1.055) ** 1.4
        return Light(same, 0.0, high - low, slope)

    def price(self, layer: float = 0.0, gone: float = 0.0) -> float:
        """Return what an effect's errors take: where it is laid over the picture, and is not."""
        layer, gone = self.brightest * layer, self.brightest * gone
        if self.step == 0.0:
            return self.reach * self.slope * (layer + gone) if layer + gone else 0.0
        if not self.same:
            return self.slope * (layer + gone)
        # A layer that errs is rounded up or down; one that is gone leaves an integer.
        up = math.ceil((layer + ROUNDING) / self.step) if layer > 0.0 else 0
        return self.step * (up + math.floor((gone + ROUNDING) / self.step + 0.5))

    def error(self, price: float) -> float:
        """Return how far values of the frame are off, at most, for prices together."""
        if self.step == 0.0 or self.same or price == 0.0:
            return price
        return self.step * math.ceil((price + ROUNDING) / self.step)


class _Saved(NamedTuple):
    """One saving: of the effect at a place of the scene, and what it leaves out or sets."""

    place: int
    what: str
    error: float
    nanoseconds: float
    steps: frozenset[str] = frozenset()
    setting: tuple[tuple[str, float], ...] = ()


class _Bundle(NamedTuple):
    """Savings together: the error of an opacity, later its price in the frame, and their time."""

    price: float = 0.0
    saved: float = 0.0
    taken: tuple[_Saved, ...] = ()

    @staticmethod
    def of(one: _Saved) -> _Bundle:
        return _Bundle(one.error, one.nanoseconds, (one,))


# The place of the table, which belongs to no effect.
_SCENE = -1


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
    if not math.isfinite(light.reach):
        return EXACT
    light = light._replace(brightest=max((n.brightest for _, _, n in asked), default=1.0))
    limit = tolerance * (1.0 + 1e-9)
    scene = [_Bundle()]
    if light.step > 0.0 and not light.same:
        saved = nanoseconds({"encoded value": values, "looked up value": -values})
        what = "display values from a table of 16 bits"
        scene.append(_Bundle.of(_Saved(_SCENE, what, TABLE, saved)))
    effects = []
    for place, name, needs in asked:
        work = sum(nanoseconds(step.cost().work) for step in needs.steps)
        steps = frozenset(step.name for step in needs.steps)
        all_of_it = _Saved(place, name, needs.most, work + nanoseconds({"layer": 1.0}), steps)
        gone = _Bundle.of(all_of_it)._replace(price=light.price(gone=needs.most))
        ways = [_ways(place, name, saving, light, limit) for saving in needs.savings]
        effects.append((work, gone, _best_of(ways, math.inf)))
    best, hidden, rest = _Bundle(), 0.0, 0.0
    for level, share in [(0.0, 0.0), *shares]:
        groups = [scene]
        for work, gone, kept in effects:
            # An effect is laid over the picture with errors, and made only where the level lets it
            # be seen; or it is not laid over the picture at all.
            laid = (
                _Bundle(light.price(error, level), ns + share * max(work - ns, 0.0), taken)
                for error, ns, taken in kept
            )
            groups.append([*laid, gone])
        found = [b for b in _best_of(groups, limit) if light.error(b.price) <= limit]
        if found and found[-1].saved > best.saved:
            best, hidden, rest = found[-1], level, share
    without: dict[int, frozenset[str]] = {}
    settings: dict[int, dict[str, float]] = {}
    for one in best.taken:
        without[one.place] = without.get(one.place, frozenset()) | one.steps
        settings[one.place] = settings.get(one.place, {}) | dict(one.setting)
    spent = [Spent(one.what, one.error, 1e-6 * one.nanoseconds) for one in best.taken]
    if rest > 0.0:
        ms = 1e-6 * best.saved - sum(one.milliseconds for one in spent)
        spent.append(Spent("what hardly shows past what stands in front", hidden, ms))
    table, error = _SCENE in without, light.error(best.price)
    return Choice(without, settings, hidden, table, tuple(spent), error)


def _ways(place: int, name: str, saving: Saving, light: Light, limit: float) -> list[_Bundle]:
    """Return the ways to take a saving: not, by leaving out its step, or at levels of a setting."""
    ways, what = [_Bundle()], f"{name}: {saving.what}"
    if not saving.setting:
        saved, step = saving.saved(saving.error), frozenset({saving.name})
        ways.append(_Bundle.of(_Saved(place, what, saving.error, saved, step)))
    for level in LEVELS if saving.setting else ():
        error = saving.error * level
        if level <= 0.5 and light.price(error) <= limit:
            setting = ((saving.name, level),)
            one = _Saved(place, what, error, saving.saved(level), setting=setting)
            ways.append(_Bundle.of(one))
    return ways


def _best_of(groups: Iterable[Sequence[_Bundle]], limit: float) -> list[_Bundle]:
    """Return the best bundles with one of each group: each saves more than all that cost less."""
    kept = [_Bundle()]
    for group in groups:
        together = [
            _Bundle(one.price + more.price, one.saved + more.saved, one.taken + more.taken)
            for one in kept
            for more in group
            if one.price + more.price <= limit
        ]
        kept = []
        for bundle in sorted(together, key=lambda one: (one.price, -one.saved)):
            if not kept or bundle.saved > kept[-1].saved:
                kept.append(bundle)
        # Of a scene with very many effects some are enough; the one that saves most stays.
        if len(kept) > _MOST_KEPT:
            kept = [*kept[:: len(kept) // _MOST_KEPT + 1], kept[-1]]
    return kept

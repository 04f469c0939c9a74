"""Where a tolerance is spent: what a frame does without, or does less exactly, to take less time.

Each effect says what it can do so and what error that makes, of an opacity (`Saving`); here the
errors are brought to values of the frame and added up, and of all choices within the tolerance the
one is taken that saves most by the fixed cost model. No choice follows a clock.

A layer of opacity a and color c makes v into v + a (c - v): an error e of a is at most e |c - v|
of the frame, and layers over it only lessen it. In pictures of integers each layer is rounded: one
that errs by e < n steps before it is rounded errs by n steps after it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array
from flurries.frame.costs import nanoseconds
from flurries.frame.needs import Needs, Saving, Spent

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# What the encoding's table errs by, display values: half a step of 16 bits at the steepest place.
TABLE = 0.5 * STEEPEST / 65535.0

# What float32 may add to an error.
ROUNDING = 1e-6

# From so many savings on they are taken one by one, the best first.
_MOST_TRIED = 10


@dataclass(frozen=True)
class Choice:
    """What is done less exactly in a frame.

    Attributes
    ----------
    without : dict of int to set of str
        Steps that an effect, by its place in the scene, does without.
    settings : dict of int to dict
        Its settings.
    hidden : float
        Of what covers all but this the weather behind is not made.
    table : bool
        Whether display values are looked up in a table of 16 bits.
    spent : tuple of Spent
        For people.
    error : float
        The most that a value of the frame may differ, of full scale.
    """

    without: dict[int, frozenset[str]] = field(default_factory=dict)
    settings: dict[int, dict[str, float]] = field(default_factory=dict)
    hidden: float = 0.0
    table: bool = False
    spent: tuple[Spent, ...] = ()
    error: float = 0.0


EXACT = Choice()


class Light(NamedTuple):
    """How errors of opacities become errors of a frame.

    Attributes
    ----------
    linear : bool
        Whether layers are mixed in linear light.
    same : bool
        Whether that is what the background holds.
    step : float
        Of a picture of integers, of full scale; 0 of floats.
    reach : float
        The most that a color and a value of the background differ, in the light of the mix.
    slope : float
        Of the way back to the background's encoding.
    brightest : float
        The largest of the layers' colors, at least 1.
    """

    linear: bool
    same: bool
    step: float
    reach: float
    slope: float
    brightest: float = 1.0

    @staticmethod
    def of(picture: Array, *, linear: bool, encoding: str) -> Light:
        """Return how it is for a background."""
        from flurries.io.color import linear_to_srgb

        same = linear == (encoding == "linear")
        if picture.dtype.kind == "u":
            step = 1.0 / float(np.iinfo(picture.dtype).max)
            return Light(linear, same, step, 1.0, 1.0 if same else STEEPEST)
        low, high = (float(end) for end in (np.nanmin(picture), np.nanmax(picture)))
        if not (math.isfinite(low) and math.isfinite(high)):
            return Light(linear, same, 0.0, math.inf, 1.0)
        if same:
            return Light(linear, same, 0.0, max(high, 1.0) - min(low, 0.0), 1.0)
        # Floats mixed in display values and decoded again: steepest at the brightest.
        low, high = (
            float(end) for end in linear_to_srgb(np.array([min(low, 0.0), max(high, 1.0)]))
        )
        slope = 2.4 / 1.055 * ((max(high, -low) + 0.055) / 1.055) ** 1.4
        return Light(linear, same, 0.0, high - low, slope)

    def total(self, errors: Sequence[Error], *, table: bool = False) -> float:
        """Return what errors of the layers' opacities make of the frame's values."""
        errors = [Error(*(self.brightest * part for part in error)) for error in errors]
        whole = sum(error.layer + error.gone for error in errors)
        if self.step == 0.0:
            return self.reach * self.slope * whole if whole else 0.0
        if self.same:
            return self.step * sum(
                self._up(error.layer) + self._nearest(error.gone) for error in errors
            )
        return self.step * self._up(self.slope * whole + (TABLE if table else 0.0))

    def _up(self, error: float) -> int:
        """Return the steps that a value may be off after it is rounded."""
        return math.ceil((error + ROUNDING) / self.step) if error > 0.0 else 0

    def _nearest(self, error: float) -> int:
        """Return the same where the value was an integer, and stays it without the layer."""
        return math.floor((error + ROUNDING) / self.step + 0.5)

    def most(self, left: float, effects: int, *, gone: bool) -> float:
        """Return the error that each of some effects may make, so that all make no more."""
        if self.step == 0.0:
            return (1.0 - 1e-9) * left / (self.reach * self.slope * self.brightest * effects)
        steps = math.floor(left / self.step + 1e-9)
        if self.same:
            more = 0.5 if gone else 0.0
            each = max(self.step * (steps // effects + more) - 2.0 * ROUNDING, 0.0)
            return each / self.brightest
        return max((self.step * steps - 2.0 * ROUNDING) / self.slope, 0.0) / (
            self.brightest * effects
        )


class Error(NamedTuple):
    """What an effect's opacity is off by, at most.

    Attributes
    ----------
    layer : float
        Where it is laid over the picture.
    gone : float
        Where it is not.
    """

    layer: float = 0.0
    gone: float = 0.0


@dataclass(frozen=True)
class Asking:
    """An effect with what it can save.

    Attributes
    ----------
    index : int
        Its place in the scene.
    name : str
        What people call it.
    needs : Needs
    """

    index: int
    name: str
    needs: Needs


class _Item(NamedTuple):
    place: int
    saving: Saving
    nanoseconds: float


def choose(
    asked: Sequence[Asking],
    light: Light,
    tolerance: float,
    *,
    values: int,
    hides: Callable[[float], float],
) -> Choice:
    """Return the choice that saves most.

    Parameters
    ----------
    asked : sequence
        What runs.
    light : Light
    tolerance : float
        Of the frame's values, of full scale.
    values : int
        Numbers in the frame.
    hides : callable
        From an opacity to the share of the frame that is covered by all but it.
    """
    if not math.isfinite(light.reach):
        return EXACT
    bright = max((one.needs.brightest for one in asked), default=1.0)
    light = light._replace(brightest=bright)
    limit = tolerance * (1.0 + 1e-9)
    table = not light.same and light.step > 0.0 and light.total([], table=True) <= limit
    items = [
        _Item(place, saving, saving.saved(saving.error))
        for place, one in enumerate(asked)
        for saving in one.needs.savings
        if not saving.setting and light.total([_error(saving)], table=table) <= limit
    ]
    taken = _best(items, light, limit, table)
    errors = _errors(taken, len(asked))
    spent: list[Spent] = []
    without: dict[int, frozenset[str]] = {}
    for item in taken:
        one, saving = asked[item.place], item.saving
        steps = {step.name for step in one.needs.steps} if saving.all else {saving.name}
        without[one.index] = without.get(one.index, frozenset()) | steps
        what = one.name if saving.all else f"{one.name}: {saving.what}"
        spent.append(Spent(what, saving.error, 1e-6 * item.nanoseconds))
    if table:
        saved = nanoseconds({"encoded value": values}) - nanoseconds({"looked up value": values})
        spent.append(Spent("display values from a table of 16 bits", TABLE, 1e-6 * saved))
    # What cannot be divided is taken; what can be takes the rest.
    whole = {item.place for item in taken if item.saving.all}
    kept = [place for place in range(len(asked)) if place not in whole]
    left = max(tolerance - light.total(errors, table=table), 0.0)
    tuned, settings, gain = _tuned(asked, kept, light, left)
    under, hiding = _hiding(asked, kept, light, left, hides)
    if hiding > 0.0 and hiding >= gain:
        for place in kept:
            errors[place] = errors[place]._replace(gone=under)
        spent.append(Spent("what hardly shows past what stands in front", under, 1e-6 * hiding))
        error = light.total(errors, table=table)
        return Choice(without, {}, under, table, tuple(spent), error)
    for place, more in tuned.items():
        errors[place] = errors[place]._replace(layer=errors[place].layer + more.error)
        spent.append(more)
    return Choice(without, settings, 0.0, table, tuple(spent), light.total(errors, table=table))


def _error(saving: Saving) -> Error:
    return Error(gone=saving.error) if saving.all else Error(layer=saving.error)


def _errors(chosen: Sequence[_Item], effects: int) -> list[Error]:
    """Return what savings make of the effects' opacities."""
    errors = [Error()] * effects
    for place, saving, _ in chosen:
        layer, gone = errors[place]
        errors[place] = Error(layer + _error(saving).layer, gone + _error(saving).gone)
    return errors


def _best(items: list[_Item], light: Light, limit: float, table: bool) -> list[_Item]:
    """Return the savings that save most within a limit."""

    def fits(chosen: Sequence[_Item]) -> bool:
        places = [item.place for item in chosen]
        for item in chosen:
            # All of an effect has its parts in it.
            if item.saving.all and places.count(item.place) > 1:
                return False
        return light.total(_errors(chosen, max(places) + 1), table=table) <= limit

    if len(items) <= _MOST_TRIED:
        best: tuple[_Item, ...] = ()
        most = 0.0
        for number in range(1, len(items) + 1):
            for chosen in combinations(items, number):
                saved = sum(item.nanoseconds for item in chosen)
                if saved > most and fits(chosen):
                    best, most = chosen, saved
        return list(best)
    found: list[_Item] = []
    order = sorted(items, key=lambda item: -item.nanoseconds / (item.saving.error + 1e-12))
    for item in order:
        if fits([*found, item]):
            found.append(item)
    return found


def _tuned(
    asked: Sequence[Asking], kept: list[int], light: Light, left: float
) -> tuple[dict[int, Spent], dict[int, dict[str, float]], float]:
    """Return what effects' settings may be, the same error for each, and what that saves."""
    able = [(p, s) for p in kept for s in asked[p].needs.savings if s.setting]
    if not able:
        return {}, {}, 0.0
    each = light.most(left, len(able), gone=False)
    spent: dict[int, Spent] = {}
    settings: dict[int, dict[str, float]] = {}
    total = 0.0
    for place, saving in able:
        value = min(each / saving.error, 0.5)
        saved = saving.saved(value) if value > 0.0 else 0.0
        if saved <= 0.0:
            continue
        total += saved
        settings[asked[place].index] = {saving.name: value}
        what = f"{asked[place].name}: {saving.what}"
        spent[place] = Spent(what, saving.error * value, 1e-6 * saved)
    return spent, settings, total


def _hiding(
    asked: Sequence[Asking],
    kept: list[int],
    light: Light,
    left: float,
    hides: Callable[[float], float],
) -> tuple[float, float]:
    """Return the opacity under which what is covered is not made, and what that saves."""
    under = light.most(left, len(kept), gone=True) if kept else 0.0
    if under <= 0.0 or (share := hides(under)) == 0.0:
        return 0.0, 0.0
    work = sum(nanoseconds(step.cost().work) for p in kept for step in asked[p].needs.steps)
    return under, share * work


def light_of(scene: Any, t: float) -> Light:
    """Return how errors count in a frame of a scene."""
    backdrop = scene._backdrop
    return Light.of(backdrop.frame(t), linear=scene.linear, encoding=backdrop.encoding)

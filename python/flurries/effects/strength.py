"""Strength: how much falls, how far one sees in it and how much it hides, of one population.

Water that falls is number times the mean of mass and fall speed (`Matter.flux`); the extinction is
number times opacity times the mean area (`Population.extinction`), and one sees as far as leaves
5 % of a contrast (`gas.visibility`). Of `rate`, `visibility`, `density`, sizes, `opacity` and
`fall` any that are given hold, and the others follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import gas
from flurries._contract import real
from flurries.effects.checks import optional, positive
from flurries.effects.severity import HIGHEST, LOWEST, rate_of
from flurries.effects.weather import times
from flurries.motion.keys import Keys, largest, value_at
from flurries.particles.population import Population
from flurries.particles.sizes import Matter, Sizes

OPACITY, OPAQUE = 0.9, 0.99  # Mean over a flake's disc where nothing is said, and at most.

BACKDROP = 60.0  # The wall where no depth is known, for weather of a visibility, metres.

_SAME = 0.01  # The share by which numbers that say the same may differ: users round.

# What is solved for falls at most so many times faster or slower than was measured.
_FASTER = 5.0

# Straight pieces between two keyed visibilities, which stand for a number that goes with 1/V.
_PIECES = 16


@dataclass(frozen=True)
class Strength:
    """How strong weather is at a time."""

    visibility: float  # Metres, at which 5 % of a contrast are left; infinite in clear air.
    cover: float | None = None  # Share of the background that it hides; None of uneven mist.
    rate: float | None = None  # mm/h of water; None of mist.
    density: float | None = None  # Flakes or drops per m3; None of mist.

    def __str__(self) -> str:
        falls = "" if self.rate is None else f"{self.rate:.3g} mm/h, {self.density:.4g} per m3, "
        covers = "" if self.cover is None else f", covers {100.0 * self.cover:.3g} %"
        return f"{falls}visibility {self.visibility:.4g} m{covers}"


def reach(visibility: float) -> float:
    """Return how far weather of a visibility reaches, metres."""
    return max(2.0 * visibility, BACKDROP)


def strength_of(effect: Any, t: float = 0.0) -> Strength:
    """Return how strong the weather is.

    Parameters
    ----------
    t : float
        Frame; numbers that are keyed have their values of this frame.

    Returns
    -------
    Strength
        With `rate`, mm/h of water, and `density`, flakes or drops per cubic metre, each times the
        share `amount` that is shown; `visibility`, metres, in the air of the effect; and `cover`,
        the share of a background without a depth that the flakes and the veil hide, 0 to 1.
    """
    parts = getattr(effect.parts, "parts", [effect.parts])
    rate = density = extinction = 0.0
    for part in parts:
        weather, shown = part.front.weather, part.shown(t)
        population = weather.population
        fall = float(value_at(part.motion.fall, t))
        density += shown * population.density
        rate += shown * population.density * effect.MATTER.flux(population.sizes, fall)
        extinction += part.air(t)
    far = min(effect.far, effect.far if effect.backdrop is None else effect.backdrop)
    # Flakes fade in before the near depth: they begin at its nine tenths.
    clear = math.exp(-extinction * max(far - 0.9 * effect.near, 0.0))
    clear *= 1.0 - float(value_at(effect.amount, t)) * float(value_at(effect.haze, t))
    seen = gas.visibility(extinction) if extinction > 0.0 else math.inf
    return Strength(seen, 1.0 - clear, rate, density)


def solved(
    kind: str, matter: Matter, sizes: str, check: Callable[[str, Any], Any],
    turned: Mapping[str, Any], given: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """Return the fields that follow from knobs and other fields, or refuse what contradicts."""
    known = {name: given.get(name) for name in ("density", sizes, "opacity", "fall")}
    wanted = {"rate": rate_of(turned, kind)}
    wanted["visibility"] = optional(positive)("visibility", turned.get("visibility"))
    wanted = {name: value for name, value in wanted.items() if value is not None}
    keyed = next((name for name in wanted if isinstance(wanted[name], Keys)), None)
    for name, value in known.items():
        if isinstance(value, Keys):
            raise ValueError(f"{name} must not be keyed beside {' and '.join(wanted)}: key these")
        if value is not None and name != sizes:
            most = OPAQUE if name == "opacity" else math.inf
            known[name] = real(name, value, above=0.0, high=most)
    if known[sizes] is not None:
        known[sizes] = Sizes.with_mean(*check(sizes, known[sizes]))
    if keyed and (len(wanted) > 1 or known["density"] is not None):
        raise ValueError(f"{keyed} is keyed: give no density and no other knob, which follow")
    fields = {name: value for name, value in given.items() if name == "backdrop"}
    if "visibility" in wanted and given.get("far") is None:
        fields = {"backdrop": BACKDROP, **fields, "far": reach(largest(wanted["visibility"]))}
    numbers = _Numbers(kind, matter, sizes, known)
    if keyed is None:
        return fields | numbers.solve(wanted)
    keys: Keys = wanted[keyed]
    if keyed == "visibility":
        keys = _straight(keys)
    most = real(keyed, largest(keys), above=0.0)
    fields |= numbers.solve({keyed: most if keyed == "rate" else 1.0 / most})
    return fields | {"density": times(keys, fields["density"] / most)}


class _Numbers:
    """The numbers that are known of a population, and those that follow."""

    def __init__(self, kind: str, matter: Matter, sizes: str, known: dict[str, Any]) -> None:
        self.kind, self.matter, self.sizes, self.known = kind, matter, sizes, known
        small, large = 1e3 * matter.smallest, 1e3 * matter.largest
        self.all_sizes = f"{sizes} of {small:g} to {large:g} mm"

    def each(self, name: str, sizes: Sizes) -> float:
        """Return the rate, mm/h, or the extinction, 1/m, of one per m3."""
        if name == "rate":
            return self.matter.flux(sizes, self.known["fall"])
        opacity = OPACITY if self.known["opacity"] is None else self.known["opacity"]
        return Population(1.0, sizes, opacity, self.matter.speed).extinction

    def solve(self, wanted: dict[str, float]) -> dict[str, Any]:
        """Return the fields that were not given."""
        known, size = self.known, self.sizes
        given = {name for name, value in known.items() if value is not None}
        left = {name: v if name == "rate" else gas.visibility(v) for name, v in wanted.items()}
        if not given & {"density", size}:
            known[size] = self._law(left)
        if not given >= {"density", size}:
            # The other one of two is met by the opacity, by the fall, or not at all.
            by_fall = len(left) == 2 and "opacity" in given and "fall" not in given
            name = "visibility" if by_fall or "rate" not in left else "rate"
            value, density = left.pop(name), known["density"]
            if density is None:
                known["density"] = value / self.each(name, known[size])
            else:
                about = f"density {density:g} and {self.all_sizes}"
                known[size] = self._found(
                    name, value, about, lambda _, sizes: density * self.each(name, sizes)
                )
        for name, value in left.items():
            self._last(name, value, given)
        law: Sizes = known[size]
        found = {**known, size: (law.smallest, law.mean, law.largest)}
        return {name: v for name, v in found.items() if v is not None and name not in given}

    def _law(self, left: dict[str, float]) -> Sizes:
        """Return the sizes of a rate, or of a visibility, or of both, of which one is then met."""
        if "visibility" not in left:
            return self.matter.sizes(left["rate"])

        def thick(rate: float, sizes: Sizes) -> float:
            return rate / self.each("rate", sizes) * self.each("visibility", sizes)

        extinction, rate = left["visibility"], left.get("rate")
        if rate is None:
            low, high = LOWEST, HIGHEST[self.kind]
            about = f"{self.kind} of {low:g} to {high:g} mm/h without density or {self.sizes}"
            return self._found("visibility", extinction, about, thick, low, high, self.matter.sizes)
        del left["visibility"]
        about = f"rate {rate:g} and {self.all_sizes}"
        return self._found("visibility", extinction, about, lambda _, sizes: thick(rate, sizes))

    def _last(self, name: str, value: float, given: set[str]) -> None:
        """Set the fall or the opacity so that a knob holds, or refuse it."""
        known, free = self.known, "fall" if name == "rate" else "opacity"
        sizes: Sizes = known[self.sizes]
        own = known["density"] * self.each(name, sizes)
        usual = self.matter.fall(sizes) if free == "fall" else OPACITY
        least, most = (usual / _FASTER, usual * _FASTER) if free == "fall" else (0.0, OPAQUE)
        if free not in given and least <= usual * value / own <= most:
            known[free] = usual * value / own
        elif free not in given or abs(own / value - 1.0) > _SAME:
            others = given - {"opacity" if name == "rate" else "fall"}
            raise self._refused(name, value, " and ".join(sorted(others)), own)

    def _found(
        self, name: str, wanted: float, about: str, law: Callable[[float, Sizes], float],
        low: float = 1.0, high: float = 1e5, family: Callable[[float], Sizes] | None = None,
    ) -> Sizes:  # fmt: skip
        """Return those of a family of sizes for which a law has a value, by halving a ratio."""
        # If not given those of all slopes, 1/m: from all sizes alike to nearly all the smallest.
        smallest, largest = self.matter.smallest, self.matter.largest
        sizes = family or (lambda slope: Sizes.with_slope(smallest, slope, largest))
        ends = law(low, sizes(low)), law(high, sizes(high))
        if not min(ends) <= wanted <= max(ends):
            raise self._refused(name, wanted, about, *ends)
        for _ in range(100):
            middle = math.sqrt(low * high)
            if (law(middle, sizes(middle)) > wanted) == (ends[1] > ends[0]):
                high = middle
            else:
                low = middle
        return sizes(math.sqrt(low * high))

    @staticmethod
    def _refused(name: str, wanted: float, about: str, *found: float) -> ValueError:
        said = sorted(found) if name == "rate" else sorted(map(gas.visibility, found))
        got, unit = (wanted, "mm/h") if name == "rate" else (gas.visibility(wanted), "m")
        numbers = " to ".join(f"{one:.4g}" for one in said)
        return ValueError(f"{name} contradicts {about}: these give {numbers} {unit}, got {got:.4g}")


def _straight(keys: Keys) -> Keys:
    """Return keys of 1 / V, close enough between keys of V that straight pieces stand for it."""
    found = [(t, 1.0 / seen) for t, seen in keys.keys[:1]]
    for (start, near), (end, far) in zip(keys.keys, keys.keys[1:], strict=False):
        # Even ratios make all pieces as straight.
        seen = near * (far / near) ** (np.arange(1, _PIECES + 1) / _PIECES)
        at = np.linspace(start, end, _PIECES + 1)[1:]
        if far != near:
            at = start + (seen - near) / (far - near) * (end - start)
        found += zip(at.tolist(), (1.0 / seen).tolist(), strict=True)
    return Keys(found)

"""Strength: how much falls, how far one sees in it and how much it hides, of one population."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flurries import gas
from flurries._contract import integer, real
from flurries.effects.checks import checks_of
from flurries.effects.motion import times
from flurries.motion.keys import Keys, as_number, largest, value_at
from flurries.particles.population import Population
from flurries.particles.sizes import Matter, Sizes

# Of the severities 1 to 5: rates, mm/h, and visibilities, metres.
RATES = {"snow": (0.5, 1.0, 2.5, 5.0, 10.0), "rain": (2.5, 10.0, 25.0, 50.0, 100.0)}
VISIBILITIES = (1000.0, 500.0, 200.0, 100.0, 50.0)
SEVERITIES = len(VISIBILITIES)

LOWEST, HIGHEST = 0.001, {"snow": 50.0, "rain": 500.0}  # Rates that are taken, mm/h.
OPACITY, OPAQUE = 0.9, 0.99  # Mean over a flake's disc where nothing is said, and at most.
BACKDROP = 60.0  # The wall where no depth is known, for weather of a visibility, metres.
_SAME = 0.01  # The share by which numbers that say the same may differ: users round.
_FASTER = 5.0  # What is solved for falls at most so many times faster or slower than was measured.

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
    """Return how strong the weather is at frame `t`, where keyed numbers have its values.

    A `Strength` with `rate`, mm/h of water, and `density`, flakes or drops per cubic metre, each
    times the share `amount` that is shown; `visibility`, metres, in the air of the effect; and
    `cover`, the share of a background without a depth that the flakes and the veil hide, 0 to 1.
    """
    rate = density = extinction = 0.0
    for part in getattr(effect.parts, "parts", [effect.parts]):
        population, fall = part.flakes.population, float(value_at(part.motion.fall, t))
        shown = part.shown(t) * population.density
        density += shown
        rate += shown * effect.MATTER.flux(population.sizes, fall)
        extinction += part.air(t)
    far = min(effect.far, effect.far if effect.backdrop is None else effect.backdrop)
    # Flakes fade in before the near depth: they begin at its nine tenths.
    clear = math.exp(-extinction * max(far - 0.9 * effect.near, 0.0))
    clear *= 1.0 - float(value_at(effect.amount, t)) * float(value_at(effect.haze, t))
    seen = gas.visibility(extinction) if extinction > 0.0 else math.inf
    return Strength(seen, 1.0 - clear, rate, density)


def knob_of(name: str, given: Mapping[str, Any], kind: str = "") -> Any:
    """Return the `rate` or `visibility` that is given, or that of a `severity`; None without."""
    value, severity = given.get(name), given.get("severity")
    table, unit, limits = VISIBILITIES, "m", {"above": 0.0}
    if name == "rate":
        table, unit, limits = RATES[kind], "mm/h", {"low": LOWEST, "high": HIGHEST[kind]}
        limits |= {"low": 0.0} if isinstance(value, Keys) else {}
    value = None if value is None else as_number(name, value, **limits)
    if severity is None:
        return value
    said = table[integer("severity", severity, low=1, high=SEVERITIES) - 1]
    if value not in (None, said):
        raise ValueError(
            f"severity and {name} contradict: severity {severity} is {said:g} {unit}, "
            f"{name} is {value}"
        )
    return said


def solved(effect: Any, turned: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a class of effects that follow from knobs and other fields."""
    size, kind = effect.SIZES, effect.NAME
    known = {name: given.get(name) for name in ("density", size, "opacity", "fall")}
    wanted = {"rate": knob_of("rate", turned, kind)}
    wanted["visibility"] = knob_of("visibility", {**turned, "severity": None})
    wanted = {name: value for name, value in wanted.items() if value is not None}
    keyed = next((name for name in wanted if isinstance(wanted[name], Keys)), None)
    for name, value in known.items():
        if isinstance(value, Keys):
            raise ValueError(f"{name} must not be keyed beside {' and '.join(wanted)}: key these")
        if value is not None and name != size:
            most = OPAQUE if name == "opacity" else math.inf
            known[name] = real(name, value, above=0.0, high=most)
    if known[size] is not None:
        known[size] = Sizes.with_mean(*checks_of(effect)[size](size, known[size]))
    if keyed and (len(wanted) > 1 or known["density"] is not None):
        raise ValueError(f"{keyed} is keyed: give no density and no other knob, which follow")
    fields: dict[str, Any] = {}
    if "visibility" in wanted and given.get("far") is None:
        fields = {"far": reach(largest(wanted["visibility"]))}
        fields |= {} if "backdrop" in given else {"backdrop": BACKDROP}
    numbers = _Numbers(kind, effect.MATTER, size, known)
    if keyed is None:
        return fields | numbers.solve(wanted)
    keys: Keys = wanted[keyed]
    if keyed == "visibility":
        keys = _straight(keys)
    most = real(keyed, largest(keys), above=0.0)
    fields |= numbers.solve({keyed: most if keyed == "rate" else 1.0 / most})
    return fields | {"density": times(keys, fields["density"] / most)}


@dataclass
class _Numbers:
    """The numbers that are known of a population, and those that follow."""

    kind: str
    matter: Matter
    size: str  # The name of the field of sizes.
    known: dict[str, Any]  # By fields; None where it is not known yet.
    given: set[str] = field(init=False)

    def each(self, name: str, sizes: Sizes) -> float:
        """Return the rate, mm/h, or the extinction, 1/m, of one per m3."""
        if name == "rate":
            return self.matter.flux(sizes, self.known["fall"])
        opacity = OPACITY if self.known["opacity"] is None else self.known["opacity"]
        return Population(1.0, sizes, opacity, self.matter.speed).extinction

    def solve(self, wanted: dict[str, float]) -> dict[str, Any]:
        """Return the fields that were not given."""
        known, size = self.known, self.size
        self.given = given = {name for name, value in known.items() if value is not None}
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
                law = lambda _, sizes: density * self.each(name, sizes)  # noqa: E731
                known[size] = self._found(name, value, f"density {density:g}", law)
        for name, value in left.items():
            self._last(name, value)
        law_: Sizes = known[size]
        found = {**known, size: (law_.smallest, law_.mean, law_.largest)}
        return {name: v for name, v in found.items() if v is not None and name not in given}

    def _law(self, left: dict[str, float]) -> Sizes:
        """Return the sizes of a rate, or of a visibility, or of both, of which one is then met."""
        if "visibility" not in left:
            return self.matter.sizes(left["rate"])

        def thick(rate: float, sizes: Sizes) -> float:
            return rate / self.each("rate", sizes) * self.each("visibility", sizes)

        extinction, rate = left["visibility"], left.get("rate")
        if rate is None:
            ends = LOWEST, HIGHEST[self.kind]
            return self._found("visibility", extinction, "", thick, ends, self.matter.sizes)
        del left["visibility"]
        beside = f"rate {rate:g}"
        return self._found("visibility", extinction, beside, lambda _, sizes: thick(rate, sizes))

    def _last(self, name: str, value: float) -> None:
        """Set the fall or the opacity so that a knob holds, or refuse it."""
        known, free = self.known, "fall" if name == "rate" else "opacity"
        sizes: Sizes = known[self.size]
        own = known["density"] * self.each(name, sizes)
        usual = self.matter.fall(sizes) if free == "fall" else OPACITY
        least, most = (usual / _FASTER, usual * _FASTER) if free == "fall" else (0.0, OPAQUE)
        if free not in self.given and least <= usual * value / own <= most:
            known[free] = usual * value / own
        elif free not in self.given or abs(own / value - 1.0) > _SAME:
            others = self.given - {"opacity" if name == "rate" else "fall"}
            raise _refused(name, value, " and ".join(sorted(others)), own)

    def _found(
        self, name: str, wanted: float, beside: str, law: Callable[[float, Sizes], float],
        ends: tuple[float, float] = (1.0, 1e5), family: Callable[[float], Sizes] | None = None,
    ) -> Sizes:  # fmt: skip
        """Return those of a family of sizes for which a law has a value, by halving a ratio."""
        # If not given those of all slopes, 1/m: from all sizes alike to nearly all the smallest.
        small, large = self.matter.smallest, self.matter.largest
        sizes = family or (lambda slope: Sizes.with_slope(small, slope, large))
        low, high = ends
        about = f"{beside} and {self.size} of {1e3 * small:g} to {1e3 * large:g} mm"
        if family:
            about = f"{self.kind} of {low:g} to {high:g} mm/h without density or {self.size}"
        first, last = law(low, sizes(low)), law(high, sizes(high))
        if not min(first, last) <= wanted <= max(first, last):
            raise _refused(name, wanted, about, first, last)
        for _ in range(100):
            middle = math.sqrt(low * high)
            below = (law(middle, sizes(middle)) > wanted) == (last > first)
            low, high = (low, middle) if below else (middle, high)
        return sizes(math.sqrt(low * high))


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

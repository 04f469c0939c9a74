"""How much gas a box holds: as many particles of such an opacity as a visibility wants."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from flurries import gas
from flurries.effects.cloud import MOST
from flurries.motion.keys import Keys, Number, value_at


@dataclass(frozen=True, kw_only=True)
class Filling:
    """Particles in a box; where a visibility is given, number or opacity follow from it.

    Attributes
    ----------
    asked : int, optional
        Particles; as many as the visibility needs if not given.
    visibility : Number, optional
        Metres.
    opacity : Number
        Of a particle's middle, 0 to 1; not that where number and visibility are given.
    radius : float
        Of a particle, metres.
    volume : float
        Of the box, cubic metres.
    """

    asked: int | None
    visibility: Number | None
    opacity: Number
    radius: float
    volume: float

    @cached_property
    def count(self) -> int:
        """The number of particles."""
        if self.asked is not None:
            return self.asked
        # Of keyed values the pair that needs the most.
        assert self.visibility is not None
        least, most = min(values_of(self.visibility)), max(values_of(self.opacity))
        if most == 0.0:
            return 0
        count = gas.count_for_visibility(least, self.volume, self.radius, most)
        if count > MOST:
            raise ValueError(
                f"visibility: {least:g} m wants {count} particles of radius {self.radius:g} in the "
                f"box, at most {MOST} are drawn; a larger radius wants fewer"
            )
        return count

    def density(self, t: float) -> float:
        """Return the opacity of a particle's middle at `t`."""
        opacity = float(value_at(self.opacity, t))
        if self.visibility is None:
            return opacity
        far = float(value_at(self.visibility, t))
        if self.asked is None:
            return opacity * min(values_of(self.visibility)) / far
        try:
            return gas.density_for_visibility(far, max(self.asked, 1), self.volume, self.radius)
        except ValueError as error:
            text = str(error).replace("distance", "visibility", 1)
            raise ValueError(text) from None

    def extinction(self, density: float) -> float:
        """Return beta of particles of a density, per metre; see :func:`flurries.gas.extinction`."""
        return gas.extinction(self.count, self.volume, self.radius, density)

    def require(self) -> None:
        """Refuse a visibility that no such gas has, at any time."""
        numbers = (self.opacity, self.visibility)
        keyed = [t for number in numbers if isinstance(number, Keys) for t, _ in number.keys]
        for t in keyed or [0.0]:
            self.density(t)


def values_of(number: Number) -> list[float]:
    """Return the values that a number has at its keys, or its one."""
    return [float(v) for _, v in number.keys] if isinstance(number, Keys) else [float(number)]

"""What snow and rain of populations share: their fields, and the parts that they are made of.

Numbers may change over time: by what is there, never by what a flake is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import InitVar, dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import real, seed_of, vector
from flurries._warnings import warn
from flurries.effects import checks
from flurries.effects.color import AMBIENT, LOCAL, PlacedColor, as_color
from flurries.effects.drawn import DrawnFlakes
from flurries.effects.flake_texture import FlakeTexture
from flurries.effects.knobs import Described
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation
from flurries.effects.strength import OPACITY, OPAQUE, strength_of
from flurries.effects.veil import Veil
from flurries.effects.weather import Weather, times
from flurries.frame.layer import Layer
from flurries.frame.needs import Needs
from flurries.frame.view import Frame
from flurries.light.phase import FLAKES, Optics
from flurries.motion.keys import Keys, Number, Vector, as_number, largest, value_at
from flurries.motion.wind import Wind
from flurries.particles.population import Population
from flurries.particles.sizes import Matter, Sizes

Method: TypeAlias = Literal["flakes", "simulated", "tent", "cone"]
Shape: TypeAlias = Literal["natural", "round"]

# What the fields of a population may be.
POPULATION: dict[str, Any] = {
    "density": partial(as_number, low=0.0, high=1e6),
    "opacity": lambda name, value: real(name, value, low=0.0, high=OPAQUE),
    "amount": checks.share,
    "emission": checks.share,
    "fall": checks.optional(as_number),
    "wind": checks.wind,
    "color": lambda _, value: as_color(value, (AMBIENT, LOCAL)),
    "haze": checks.share,
    "shutter": checks.optional(checks.shutter),
    "sway": checks.pair,
    "clumps": checks.part,
    "near": checks.length,
    "far": checks.length,
    "backdrop": checks.optional(checks.length),
    "cloud": checks.length,
    "handover": checks.optional(checks.length),
    "method": checks.one_of(get_args(Method)),
    "shape": checks.one_of(get_args(Shape)),
    "gain": checks.optional(partial(as_number, low=0.0, high=100.0)),
    "look": checks.one_of(("v2",)),
    "seed": checks.optional(lambda _, value: seed_of(value)),
}

# Metres: flakes and drops of a larger mean are sizes in another unit.
_LARGEST_MEAN = 0.2

# Sparse rain shines so much more than the shot, and less by an optical depth over metres: by eye.
THIN, DIMS = 3.0, 390.0

# Straight pieces between two keys that stand for the product of two keyed numbers.
_PIECES = 8


def size_law(name: str, value: object) -> Any:
    """Return (smallest, mean, largest) diameters in metres, plain or keyed, or refuse them."""
    if isinstance(value, Keys):
        if value.width != 3:
            raise ValueError(f"{name} must be keyed with (smallest, mean, largest)")
        for _, part in value.keys:
            size_law(name, part)
        return value
    low, mean, high = vector(name, value, 3).tolist()
    if not (0.0 < low < mean < high or 0.0 < low == mean == high):
        raise ValueError(
            f"{name} must be 0 < smallest < mean < largest in metres, or three times the same, "
            f"got {(low, mean, high)}"
        )
    if mean > _LARGEST_MEAN:
        warn(f"{name} is taken as metres: {low:g}, {mean:g} and {high:g} m are no flakes or drops")
    return low, mean, high


@dataclass(frozen=True, kw_only=True)
class Falling(metaclass=Described):
    """The fields of snow and of rain."""

    density: Number
    opacity: float = OPACITY
    amount: Number = 1.0
    emission: Number = 1.0
    fall: Number | None = None
    wind: Vector | Wind
    color: PlacedColor = "ambient"
    haze: Number = 0.0
    shutter: Number | None = None
    clumps: float = 0.0
    near: float = 0.4
    far: float = 60.0
    backdrop: float | None = None
    cloud: float = 10.0
    handover: float | None = None
    method: Method = "flakes"
    shape: Shape = "natural"
    look: str = "v2"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate: InitVar[Number | None] = None
    visibility: InitVar[Number | None] = None

    NAME: ClassVar[str]
    MATTER: ClassVar[Matter]
    SIZES: ClassVar[str]  # The field of sizes.
    NATURAL: ClassVar[str]  # What large ones are near the camera.
    OPTICS: ClassVar[Optics] = FLAKES

    strength = strength_of

    def __post_init__(self, *_: Any) -> None:
        checks.settle(self, {**POPULATION, self.SIZES: size_law})

    @cached_property
    def parts(self) -> Precipitation | Mixture:
        """The parts; of keyed sizes a population for each."""
        wind, sizes = self.wind, getattr(self, self.SIZES)
        if isinstance(wind, Wind) and wind.profile is not None and isinstance(self.emission, Keys):
            # Flakes are there or not by the heights that they fell through.
            raise ValueError("emission: cannot be keyed in a wind with a profile over depth")
        if not isinstance(sizes, Keys):
            return self._made(sizes, self.amount)
        frames = [frame for frame, _ in sizes.keys]
        parts = []
        for frame, size in sizes.keys:
            # 1 at its own key, 0 at the others.
            share = Keys([(other, float(other == frame)) for other in frames])
            parts.append(self._made(size, product(self.amount, share if len(frames) > 1 else 1.0)))
        return Mixture(parts)

    def _made(self, size: Any, amount: Number) -> Precipitation:
        law, density, most = Sizes.with_mean(*size), self.density, largest(self.density)
        # The air holds as many as there ever are; fewer are shown where the density is less.
        if isinstance(density, Keys):
            amount = product(amount, times(density, 1.0 / most)) if most > 0.0 else 0.0
        speed = self.MATTER.speed
        mean = float(speed(np.array([law.mean]))[0])
        motion = Motion(mean if self.fall is None else self.fall, self.wind, self.shutter)
        air, gain = Population(most, law, self.opacity, speed), getattr(self, "gain", 1.0)
        weather = checks.part_of(
            Weather, self, population=air, motion=motion,
            sway=getattr(self, "sway", (0.0, 0.0)), simulated=self.method == "simulated",
            shape=self.NATURAL if self.shape == "natural" else "round",
            keyed=isinstance(amount, Keys),
        )  # fmt: skip
        return Precipitation(
            name=self.NAME, amount=amount, color=self.color,
            brightness=1.0 + THIN * math.exp(-air.extinction * DIMS) if gain is None else gain,
            optics=self.OPTICS, motion=motion, texture=FlakeTexture(weather),
            flakes=DrawnFlakes(weather), veil=Veil(self.haze, self.far),
        )  # fmt: skip


def product(first: Number, second: Number) -> Number:
    """Return two numbers multiplied; of two keyed ones by straight pieces between their keys."""
    if not isinstance(first, Keys):
        return times(second, first)
    if not isinstance(second, Keys):
        return times(first, second)
    frames = sorted({frame for one in (first, second) for frame, _ in one.keys})
    if len(frames) > 1:
        at = np.linspace(0.0, len(frames) - 1.0, _PIECES * (len(frames) - 1) + 1)
        frames = np.interp(at, np.arange(len(frames)), frames).tolist()
    return Keys([(t, float(value_at(first, t)) * float(value_at(second, t))) for t in frames])


@dataclass(frozen=True, eq=False)
class Mixture:
    """Populations that take turns: between two keys one goes as the next comes."""

    parts: Sequence[Precipitation]  # One for each key, with its share in its amount.

    @property
    def motion(self) -> Any:
        return self.parts[0].motion

    def _now(self, frame: Frame) -> list[Precipitation]:
        return [part for part in self.parts if value_at(part.amount, frame.t) > 0.0]

    def needs(self, frame: Frame) -> Needs:
        asked = [part.needs(frame) for part in self._now(frame) or self.parts[:1]]
        return Needs(
            tuple(step for needs in asked for step in needs.steps),
            tuple(one for needs in asked for one in needs.left_out),
            frozenset[str]().union(*(needs.reads for needs in asked)),
            most=1.0 - float(np.prod([1.0 - needs.most for needs in asked])),
            by_rows=True,
        )

    def render(self, frame: Frame) -> tuple[Layer, ...]:
        layers: list[Layer] = []
        for one in self._now(frame):
            made = one.render(frame)
            layers += made if isinstance(made, tuple) else [made]
        return tuple(layers)

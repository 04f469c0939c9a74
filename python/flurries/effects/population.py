"""What snow and rain of populations share: their fields, and the parts that they are made of."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import Float64, real, seed_of, vector
from flurries._warnings import warn
from flurries.effects.checks import (
    DEPTH_MODES,
    length,
    one_of,
    optional,
    pair,
    part_of,
    share,
    wind,
)
from flurries.effects.color import AMBIENT, LOCAL, as_color
from flurries.effects.drawn import DrawnFlakes
from flurries.effects.flake_texture import FlakeTexture
from flurries.effects.haze import Haze
from flurries.effects.keyed import Mixture, highest, product, shares_of
from flurries.effects.motion import Motion
from flurries.effects.precipitation import Precipitation
from flurries.effects.weather import Weather, times
from flurries.light.phase import FLAKES, Optics
from flurries.motion.keys import Keys, Number, as_number
from flurries.motion.wind import Wind
from flurries.particles.population import Population
from flurries.particles.sizes import Sizes

Method: TypeAlias = Literal["hybrid", "simulated"]
METHODS = get_args(Method)
LOOKS = ("v2",)
Shape: TypeAlias = Literal["natural", "round"]
SHAPES = get_args(Shape)


# What the fields of a population may be.
POPULATION: dict[str, Any] = {
    "density": partial(as_number, low=0.0, high=1e6),
    "opacity": lambda name, value: real(name, value, low=0.0, high=0.99),
    "amount": share,
    "emission": share,
    "fall": optional(as_number),
    "wind": wind,
    "color": lambda _, value: as_color(value, (AMBIENT, LOCAL)),
    "haze": share,
    "shutter": partial(as_number, low=0.0),
    "sway": pair,
    "near": length,
    "far": length,
    "cloud": length,
    "handover": optional(length),
    "method": one_of(METHODS),
    "depth_mode": one_of(DEPTH_MODES),
    "shape": one_of(SHAPES),
    "look": one_of(LOOKS),
    "seed": optional(lambda _, value: seed_of(value)),
}


# Metres: flakes and drops of a larger mean are sizes in another unit.
_LARGEST_MEAN = 0.2


def size_law(name: str, value: object) -> Any:
    """Return (smallest, mean, largest) diameters in metres, plain or keyed, or refuse them."""
    if isinstance(value, Keys):
        if value.width != 3:
            raise ValueError(f"{name} must be keyed with (smallest, mean, largest)")
        for _, part in value.keys:
            size_law(name, part)
        return value
    low, mean, high = vector(name, value, 3).tolist()
    try:
        Sizes.with_mean(low, mean, high)
    except ValueError:
        raise ValueError(
            f"{name} must be 0 < smallest < mean < largest in metres, or three times the same, "
            f"got {(low, mean, high)}"
        ) from None
    if mean > _LARGEST_MEAN:
        warn(f"{name} is taken as metres: {low:g}, {mean:g} and {high:g} m are no flakes or drops")
    return low, mean, high


def parts_of(
    effect: Any, *, sizes: Any, speed: Callable[[Float64], Float64], shape: str,
    sway: tuple[float, float] = (0.0, 0.0), gain: Number = 1.0, optics: Optics = FLAKES,
) -> Precipitation[FlakeTexture] | Mixture:  # fmt: skip
    """Return the parts of snow or rain; of keyed sizes, a population for each.

    `sizes` are diameters (smallest, mean, largest) in metres, from which `speed` makes speeds of
    fall; `shape` is what is near the camera. What both effects have is read from the effect.
    """
    wind, most = effect.wind, highest(effect.density)
    if isinstance(wind, Wind) and wind.profile is not None and isinstance(effect.emission, Keys):
        # Flakes are there or not by the heights that they fell through.
        raise ValueError("emission: cannot be keyed in a wind with a profile over depth")

    def made(size: Any, amount: Number) -> Precipitation[FlakeTexture]:
        law = Sizes.with_mean(*size)
        # The air holds as many as there ever are; fewer are shown where the density is less.
        if isinstance(effect.density, Keys):
            amount = product(amount, times(effect.density, 1.0 / most)) if most > 0.0 else 0.0
        mean = float(speed(np.array([law.mean]))[0])
        motion = Motion(mean if effect.fall is None else effect.fall, wind, effect.shutter)
        weather = part_of(
            Weather,
            effect,
            population=Population(most, law, effect.opacity, speed),
            motion=motion,
            sway=sway,
            simulated=effect.method == "simulated",
            shape=shape,
            keyed=isinstance(amount, Keys),
        )
        return Precipitation(
            name=effect.NAME,
            amount=amount,
            color=effect.color,
            brightness=gain,
            optics=optics,
            motion=motion,
            texture=FlakeTexture(weather),
            flakes=DrawnFlakes(weather),
            veil=Haze(weather, effect.haze),
        )

    if not isinstance(sizes, Keys):
        return made(sizes, effect.amount)
    return Mixture([made(size, product(effect.amount, part)) for size, part in shares_of(sizes)])

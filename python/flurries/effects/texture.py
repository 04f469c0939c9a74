"""The tent's texture of all that is far: its opacity at the picture's size, before a scene."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from flurries._contract import Array
from flurries.effects.field import Field
from flurries.effects.motion import Way
from flurries.effects.occlusion import before_scene
from flurries.effects.resolution import map_at, power_share
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at
from flurries.spectral.contrast import kept_power
from flurries.spectral.frame import Map


@dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """A field of waves as opacity; the other fields are those of `TentSnow` and `TentRain`."""

    field: Field  # The waves.
    opacity: Number  # The largest, 0 to 1.
    mean: Number
    spread: Number
    power: Number
    depth_mode: str
    renormalise: bool = False  # Whether the waves that are left get the contrast that all had.

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none, and the tiles of which nothing is seen."""
        opacity = amount * value_at(self.opacity, frame.t)
        if opacity == 0.0:
            return Needs((), (LeftOut("texture", "its opacity is 0"),), most=0.0)
        still = frame.settled and self.field.motion.still and not has_keys(self)
        visible, out = None if frame.run is None else frame.run.visible, []
        if visible is not None:
            hidden = int((~visible.tiles(*self.field.layout(frame).tiling)).sum())
            why = "they are behind what stands in front"
            out = [LeftOut(f"{hidden} tiles", why)] if hidden else []
        return Needs((Step("texture", once=still),), tuple(out), most=opacity)

    def map(self, frame: Frame, amount: float, way: Way) -> Map:
        """Return mean, spread, power and amount of the map to opacity at the picture's size."""
        t, field = frame.t, self.field
        most, power = amount * value_at(self.opacity, t), value_at(self.power, t)
        mean, spread = value_at(self.mean, t), value_at(self.spread, t)
        if field.wavelengths is None:
            share = power_share(field.tuned, field.exponent, frame.shape[1])
            mean, spread = map_at(mean, spread, power, share)
        if self.renormalise:
            kept = kept_power(field.cycles(frame, way), field.alias)
            spread = max(spread * math.sqrt(kept), 1e-3)
        return mean, spread, power, most

    def alpha(self, frame: Frame, amount: float) -> Array:
        way = self.field.motion.way(frame)
        # What blur takes of the mean is added again; renormalised, it has lost nothing.
        mapped, keep = self.map(frame, amount, way), not self.renormalise
        if frame.depth is None:
            return self.field.pixels(frame, way, mapped, keep)
        return before_scene(self.field, frame, way, mapped, keep, self.depth_mode)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        return self.field.passes(frame, others)

    def warn_ambiguous(
        self, shape: tuple[int, int], focal: float, distance: float, index: int
    ) -> None:
        """Warn if two eyes see the longest wave, and so every wave, half a cycle apart or more."""
        cycles = focal * distance / (self.field.near_depth * self.field.band(shape)[1])
        if cycles < 0.5 or self.opacity == 0.0:
            return
        warnings.warn(
            f"effects[{index}]: eyes {distance:g} apart see its texture {cycles:.2g} cycles apart, "
            f"which is ambiguous from 0.5 on; take near_depth above "
            f"{2.0 * cycles * self.field.near_depth:.3g}, or longer waves, or eyes closer together",
            UserWarning,
            stacklevel=3,
        )

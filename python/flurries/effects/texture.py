"""The tent's texture of all that is far: its opacity at the picture's size, before a scene."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from flurries._contract import Array
from flurries.effects.field import Field, Map
from flurries.effects.layout import tiles_cost, tiles_touched
from flurries.effects.motion import Way
from flurries.effects.occlusion import before_scene
from flurries.effects.passes import Other
from flurries.effects.resolution import map_at, power_share
from flurries.frame.needs import Cost, LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at
from flurries.spectral.contrast import TABLE_BYTES, kept_power


@dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """A field of waves as opacity; the fields are those of `TentSnow` and `TentRain` but for these.

    Attributes
    ----------
    field : Field
        The waves.
    opacity : Number
        The largest, 0 to 1.
    renormalise : bool
        Whether the waves that are left get the contrast that all had.
    """

    field: Field
    opacity: Number
    mean: Number
    spread: Number
    power: Number
    depth_mode: str
    renormalise: bool = False

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none."""
        opacity = amount * value_at(self.opacity, frame.t)
        if opacity == 0.0:
            return Needs((), (LeftOut("texture", "its opacity is 0"),), most=0.0)
        still = frame.settled and self.field.motion.still and not has_keys(self)
        deep = frame.deep or frame.depth is not None
        step = Step("texture", lambda: self._cost(frame), still, opacity)
        return Needs((step,), most=opacity, in_one_pass=not (still or deep))

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

    def alpha(self, frame: Frame, amount: float, way: Way) -> Array:
        """Return its opacity over the window, (h, w) float32, as far as a depth leaves it."""
        # What blur takes of the mean is added again; renormalised, it has lost nothing.
        mapped, keep = self.map(frame, amount, way), not self.renormalise
        if frame.depth is None:
            return self.field.pixels(frame, way, mapped, keep)
        return before_scene(self.field, frame, way, mapped, keep, self.depth_mode)

    def passes(self, frame: Frame, way: Way, others: Sequence[Other]) -> tuple[list[Array], Array]:
        """Return motions to other frames (h, w, 2) and depth (h, w) of what the window shows."""
        return self.field.passes(frame, way, others)

    def _cost(self, frame: Frame) -> Cost:
        field = self.field
        layout = field.layout(frame)
        tiling, window = layout.tiling, frame.window
        torus = tiling.tile == frame.shape and tiling.overlap == 0
        left_out = [LeftOut("tiles" if torus else "one torus instead of tiles", layout.why)]
        visible = None if frame.run is None else frame.run.visible
        hidden, passes = 0, 1
        if visible is not None:
            shown = visible.tiles(*tiling)
            touched = math.prod(tiles_touched(frame.shape, window, tiling))
            hidden = min(int(shown.size - shown.sum()), touched)
        if hidden:
            left_out.append(LeftOut(f"{hidden} tiles", "they are behind what stands in front"))
        if self.depth_mode == "pixel" and frame.deep:
            octaves = math.log2(field.far_depth / field.near_depth)
            passes = max(math.ceil(octaves - 1e-9), 1)
        cost = tiles_cost(
            frame.shape, window, tiling, layout.band, hidden=hidden, passes=passes,
            jitter=field.jitter,
        )  # fmt: skip
        cost = replace(cost, left_out=tuple(left_out))
        if not frame.deep:
            return cost
        pixels = (window[1] - window[0]) * (window[3] - window[2])
        work: dict[str, Any] = {**cost.work, "limited pixel": passes * pixels}
        # The map of a depth that stays is left there, see `standing`; in bands it is made anew.
        left = 0 if frame.banded else 12 * pixels
        scratch = cost.scratch + (32 if passes > 1 else 16) * pixels - left
        # The waves, and what the depth leaves of them, are there when the means are looked up.
        return replace(
            cost, work=work, kept=cost.kept + left, scratch=max(scratch, TABLE_BYTES + 8 * pixels)
        )

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

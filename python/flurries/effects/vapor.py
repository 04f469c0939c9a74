"""One layer of gas: particles, or a bank with structure, and how bright they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries.effects.bank import Bank
from flurries.effects.cloud import Cloud
from flurries.effects.color import color_at, is_local, reads_of
from flurries.effects.filling import Filling
from flurries.effects.lighting import Base, even_shade
from flurries.frame.layer import Layer
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.io.color import linear_to_srgb
from flurries.motion.keys import Number, value_at
from flurries.trace import current

# How many times as bright as white lamps may make it.
LAMPS = 100.0

BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Vapor:
    """The parts of mist, and the layer that they make.

    Attributes
    ----------
    name : str
        Of the layer.
    amount : Number
        0 to 1; scales the density.
    color : color
        Display values.
    lit : bool
        Whether the scene's sun shades it.
    filling : Filling
        How much gas there is.
    cloud : Cloud
        The particles.
    bank : Bank or None
        What is drawn in their place where the gas has structure.
    """

    name: str
    amount: Number
    color: Any
    lit: bool
    filling: Filling
    cloud: Cloud
    bank: Bank | None

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of a frame: one step, "gas", or "lit gas" with its colors and a sort."""
        cloud, density = self.cloud, self._density(frame)
        if density == 0.0 or cloud.count == 0:
            return Needs((), (LeftOut(self.name, "it has no density"),), most=0.0)
        lit = self._is_lit(frame) or bool(frame.lights)
        bright = LAMPS if frame.lights else 1.0
        bright = max(bright, cloud.scatter.brightest if self._is_lit(frame) else 1.0)
        # The background's light may change from frame to frame; without a sun or lamps it is no
        # more than the color of what is kept.
        moves = has_keys(self) or np.any(value_at(cloud.wind, 0.0))
        still = not (moves or frame.lights or (lit and isinstance(self.color, str)))
        steps = (Step("lit gas" if lit else "gas", once=still),)
        if self.bank is not None:
            return Needs(
                steps,
                (LeftOut(f"{self.name}: particles", "it has structure, and is drawn in slices"),),
                reads_of(self.color),
                most=1.0,
                brightest=bright,
            )
        return Needs(
            steps,
            () if lit else (LeftOut(f"{self.name}: sort", "its particles have one color"),),
            reads_of(self.color),
            most=min(density * cloud.filled(frame)[1], 1.0),
            by_rows=True,
            brightest=bright,
        )

    def render(self, frame: Frame) -> Layer:
        """Return the layer of a frame."""
        run, lit = frame.run or frame.steps_of(self), self._is_lit(frame)
        local = is_local(self.color) and frame.plate is not None
        color = color_at(self.color, frame)
        base = Base.even(color)
        if is_local(self.color) and frame.plate is not None:
            base = Base.airlight(frame.plate)
            red, green, blue = linear_to_srgb(base.dim).tolist()
            color = red, green, blue
        density, bank = self._density(frame), self.bank
        step = "lit gas" if lit or frame.lights else "gas"
        top, bottom, left, right = frame.window
        alpha, light = np.zeros((bottom - top, right - left), np.float32), None
        shade = even_shade(frame, color)
        if bank is None:
            drawn = run(step, lambda: self.cloud.draw(frame, density, base, lit=lit))
            alpha, light = drawn or (alpha, light)
        else:
            thick = self.filling.extinction(density)
            made = run(step, lambda: bank.draw(frame, thick, base, lit=lit))
            if made is not None:
                alpha, light, sky = made
                # What is kept of a picture has the light of the next.
                shade = sky.shade(frame, base.dim) if local else shade
        if lit and light is not None and bank is not None:
            # All of its light is a glow, which is mixed as light.
            layer = Layer(self.name, alpha, color, shade=even_shade(frame, BLACK), glow=light)
        elif lit and light is not None:
            layer = Layer(self.name, alpha, rgb=light)
        elif light is not None or local:
            layer = Layer(self.name, alpha, color, shade=shade, glow=light)
        else:
            layer = Layer(self.name, alpha, color)
        if not frame.whole:
            return layer
        with current.get().stage("passes"):
            motion, backward, depth = self.cloud.passes(frame, density)
        return replace(layer, motion=motion, backward=backward, depth=depth)

    def _density(self, frame: Frame) -> float:
        """Return the opacity of a particle's middle."""
        return float(value_at(self.amount, frame.t)) * self.filling.density(frame.t)

    def _is_lit(self, frame: Frame) -> bool:
        return self.lit and frame.sun is not None

"""One layer of what falls: a texture behind, flakes in front, and a veil over all that is far."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries._trace import current
from flurries.effects.air import Flakes
from flurries.effects.color import bright, color_at, is_local, reads_of
from flurries.effects.drawn import DrawnFlakes
from flurries.effects.lighting import add_light, even_shade, local_shade, veil_layer
from flurries.effects.motion import Motion
from flurries.effects.passes import passes_of
from flurries.effects.veil import Veil
from flurries.frame.layer import Layer, Shade
from flurries.frame.needs import LeftOut, Needs, Step
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.light.phase import FLAKES, Optics
from flurries.motion.keys import Keys, Number, value_at


@dataclass(frozen=True, eq=False, kw_only=True)
class Precipitation:
    """The parts of an effect, and the layer that they make.

    A part has ``needs(frame, amount)``, its step or why there is none, and ``alpha(frame,
    amount)``, its opacity over the window, (h, w) float32; one behind the flakes also a `name`.
    """

    name: str  # Of the layer.
    amount: Number  # 0 to 1; scales all parts.
    color: Any  # Of them all, display values.
    motion: Motion  # What moves them.
    texture: Any  # Behind the flakes: a `Texture`, a cone's sheet, or a part of one's own; None.
    flakes: Any = None  # In front of it: `Flakes`, or a part.
    veil: Veil  # Over all.
    brightness: Number = 1.0  # Factor of the color's light.
    # What its particles do with the light of a place, where the color is "local".
    optics: Optics = FLAKES

    @cached_property
    def front(self) -> Any:
        return DrawnFlakes(self.flakes) if isinstance(self.flakes, Flakes) else self.flakes

    def air(self, t: float) -> float:
        """Return the extinction of the air at `t`, per metre: that of a population, 0 of others."""
        weather: Any = getattr(self.front, "weather", None)
        if not hasattr(weather, "population"):
            return 0.0
        return self.shown(t) * float(weather.population.extinction)

    def shown(self, t: float) -> float:
        """Return the share of a population that is there at `t`."""
        weather: Any = getattr(self.front, "weather", None)
        return float(value_at(self.amount, t)) * float(value_at(weather.emission, t))

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of a frame: the parts' steps, and "join", which makes them one plane."""
        parts = [part for part in (self.texture, self.front, self.veil) if part is not None]
        amount = value_at(self.amount, frame.t)
        if amount == 0.0:
            return Needs.none(self.name, "its amount is 0")
        asked = [part.needs(frame, amount) for part in parts]
        clear = float(np.prod([1.0 - needs.most for needs in asked]))
        if clear == 1.0:
            return Needs.none(self.name, "nothing of it has any opacity")
        varies = isinstance(self.amount, Keys)
        steps = [replace(s, once=s.once and not varies) for needs in asked for s in needs.steps]
        lamps = frame.lights and hasattr(self.front, "lit") and hasattr(self.texture, "lamp_shade")
        if lamps and any(step.name == "texture" for step in steps):
            steps.append(Step("lamps"))
        steps.append(Step("join"))
        out = [
            LeftOut(f"{self.name}: {one.what}", one.why)
            for needs in asked
            for one in needs.left_out
        ]
        reads = reads_of(self.color)
        steps += [Step("local light")] if "plate" in reads else []
        return Needs(
            tuple(steps),
            tuple(out),
            reads,
            most=1.0 - clear,
            by_rows=True,
        )

    @cached_property
    def _local(self) -> bool:
        return is_local(self.color)

    def render(self, frame: Frame) -> Layer | tuple[Layer, ...]:
        """Return the layer of a frame; of local light the veil is one of its own, behind."""
        back, front = self.texture, self.front
        amount = value_at(self.amount, frame.t)
        haze: Any = amount * value_at(self.veil.haze, frame.t)
        brightness = float(value_at(self.brightness, frame.t))
        behind = near = glow = None
        if back is not None:
            behind = frame.run(self, back.name, back.alpha, frame, amount)
        if frame.lights and hasattr(front, "lit"):
            under = self._under(frame, behind)
            lit = frame.run(self, "flakes", front.lit, frame, amount, self.optics, under)
            if lit is not None:
                near, glow = lit
            elif under is not None:
                glow = np.zeros((*frame.size, 3), np.float32)
                add_light(glow, *under)
        elif front is not None:
            near = frame.run(self, "flakes", front.alpha, frame, amount)
        planes = [np.ascontiguousarray(one) for one in (behind, near) if one is not None]
        light = None if self._local else color_at(self.color, frame)
        color = None if light is None else bright(light, brightness)
        if frame.depth is not None:
            haze = frame.run(self, "veil", self.veil.alpha, frame, amount)
        shown = haze is not None and (frame.depth is not None or haze > 0.0)
        far: tuple[Layer, ...] = ()
        # A veil does not shine as drops do.
        if shown and (self._local or brightness != 1.0):
            far, shown = (veil_layer(f"{self.name}.veil", frame, haze, light),), False
        elif shown and frame.depth is not None:
            planes.append(haze)
        even = haze if shown and frame.depth is None else 0.0
        alpha = plane(frame.size)
        with current.get().stage("join"):
            _core.join(alpha, planes or [np.zeros_like(alpha)], even)
        if color is None:
            shade = frame.run(self, "local light", local_shade, frame, self.optics)
            layer = Layer(self.name, alpha, shade=shade, glow=glow)
        else:
            shade = None if glow is None else even_shade(frame, color)
            layer = Layer(self.name, alpha, color, shade=shade, glow=glow)
        known = back is None or hasattr(back, "passes")
        if frame.whole and known and (front is not None or back is not None):
            layer = replace(layer, **passes_of(back, front, frame, amount, (behind, near), alpha))
        return (*far, layer) if far else layer

    def _under(self, frame: Frame, behind: Array | None) -> tuple[Array, Shade] | None:
        back = self.texture
        if behind is None or not hasattr(back, "lamp_shade"):
            return None
        with current.get().stage("lamps"):
            return np.ascontiguousarray(behind), back.lamp_shade(frame, self.optics)

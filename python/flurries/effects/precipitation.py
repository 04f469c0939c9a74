"""One layer of what falls: a texture behind, flakes in front, and a veil over all that is far."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries._trace import current
from flurries.effects.color import bright, color_at, even_shade, is_local, local_shade, reads_of
from flurries.effects.motion import STEPS, Motion
from flurries.effects.notes import Where
from flurries.frame.layer import Layer
from flurries.frame.mixing import behind as hidden
from flurries.frame.needs import LeftOut, Needs, Step
from flurries.frame.planes import blank, plane
from flurries.frame.view import Frame
from flurries.light.lamp import FLAKES, Optics
from flurries.motion.keys import Keys, Number, value_at


@dataclass(frozen=True, eq=False)
class Veil:
    """An even veil of what is too far and too fine for anything else."""

    haze: Number  # Its opacity before the sky, 0 to 1.
    far: float  # The depth from which on it is whole, metres.
    flakes: Any = None  # `Flakes`, of which it stands for those that are too small to be drawn.

    def even(self, frame: Frame, amount: float) -> float:
        """Return its opacity before the sky at a frame."""
        haze = amount * float(value_at(self.haze, frame.t))
        thick = 0.0 if self.flakes is None else self.flakes.faint(frame, amount)[0]
        return haze - (1.0 - haze) * math.expm1(-thick)

    def needs(self, frame: Frame, amount: float) -> Needs:
        haze = self.even(frame, amount)
        if haze == 0.0:
            return Needs((), (LeftOut("veil", "its opacity is 0"),), most=0.0)
        deep = frame.deep or frame.depth is not None
        return Needs((Step("veil"),) if deep else (), most=haze)

    def alpha(self, frame: Frame, amount: float) -> Array:
        depth, haze = frame.depth, amount * float(value_at(self.haze, frame.t))
        faint = (0.0, 0.0, 1.0) if self.flakes is None else self.flakes.faint(frame, amount)
        thick, near, far = faint
        assert depth is not None

        def before() -> Array:
            # Its optical depth grows with the way.
            deep = frame.crop(depth).astype(np.float64 if thick > 0.0 else np.float32, copy=False)
            left = (1.0 - haze) ** np.minimum(deep / np.float32(self.far), np.float32(1.0))
            if thick > 0.0:
                left *= np.exp(-thick * np.clip((deep - near) / (far - near), 0.0, 1.0))
            return np.asarray(1.0 - left, np.float32)

        return frame.standing(self, (haze, faint), before)


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
    holdout: Where | None = None  # What stands in front of it, and of nothing else.
    # What its particles do with the light of a place, where the color is "local".
    optics: Optics = FLAKES

    def air(self, t: float) -> float:
        """Return the extinction of the air at `t`, per metre: that of a population, 0 of others."""
        population = getattr(self.flakes, "population", None)
        return self.shown(t) * float(population.extinction) if population else 0.0

    def shown(self, t: float) -> float:
        """Return the share of a population that is there at `t`."""
        # Of layers by depth the farthest stands for all.
        notes = self.flakes.notes
        if notes is not None and notes.between[1] < math.inf:
            return 0.0
        return float(value_at(self.amount, t)) * float(value_at(self.flakes.emission, t))

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of a frame: the parts' steps, and "join", which makes them one plane."""
        parts = [part for part in (self.texture, self.flakes, self.veil) if part is not None]
        amount = value_at(self.amount, frame.t)
        if amount == 0.0:
            return Needs.none(self.name, "its amount is 0")
        needs = _together([part.needs(frame, amount) for part in parts])
        if needs.most == 0.0:
            return Needs.none(self.name, "nothing of it has any opacity")
        varies = isinstance(self.amount, Keys)
        steps = [replace(step, once=step.once and not varies) for step in needs.steps]
        lamps = frame.lights and hasattr(self.flakes, "lit") and hasattr(self.texture, "lamp_shade")
        if lamps and any(step.name == "texture" for step in steps):
            steps.append(Step("lamps"))
        out = tuple(LeftOut(f"{self.name}: {one.what}", one.why) for one in needs.left_out)
        reads = reads_of(self.color)
        steps += [Step("join")] + [Step("local light")] * ("plate" in reads)
        return replace(needs, steps=tuple(steps), left_out=out, reads=reads)

    def render(self, frame: Frame) -> tuple[Layer, ...]:
        """Return the layer of a frame; of local light the veil is one of its own, behind."""
        made = self._whole(frame)
        if self.holdout is None:
            return made
        cover = frame.crop(self.holdout.shares(frame.shape, frame.t))
        return tuple(hidden(layer, cover) for layer in made)

    def _whole(self, frame: Frame) -> tuple[Layer, ...]:
        back, front = self.texture, self.flakes
        amount = value_at(self.amount, frame.t)
        haze: Any = amount * value_at(self.veil.haze, frame.t)
        if self.veil.flakes is not None:
            haze = self.veil.even(frame, amount)
        brightness = float(value_at(self.brightness, frame.t))
        near = glow = under = None
        behind = None if back is None else frame.run(self, back.name, back.alpha, frame, amount)
        if frame.lights and hasattr(front, "lit"):
            if behind is not None and hasattr(back, "lamp_shade"):
                with current.get().stage("lamps"):
                    shade = back.lamp_shade(frame, self.optics).given()
                under = np.ascontiguousarray(behind), shade
            lit = frame.run(self, "flakes", front.lit, frame, amount, self.optics, under)
            if lit is not None:
                near, glow = lit
            elif under is not None:
                glow = blank((*frame.size, 3))
                _core.shade_add(glow, *under)
        elif front is not None:
            near = frame.run(self, "flakes", front.alpha, frame, amount)
        planes = [np.ascontiguousarray(one) for one in (behind, near) if one is not None]
        local = is_local(self.color)
        light = None if local else color_at(self.color, frame)
        color = None if light is None else bright(light, brightness)
        if frame.depth is not None:
            haze = frame.run(self, "veil", self.veil.alpha, frame, amount)
        shown = haze is not None and (frame.depth is not None or haze > 0.0)
        far: tuple[Layer, ...] = ()
        # A veil does not shine as drops do; its own light is as bright as what it hides.
        if shown and (local or brightness != 1.0):
            cover = np.broadcast_to(np.asarray(haze, np.float32), frame.size)
            veil = Layer(f"{self.name}.veil", np.ascontiguousarray(cover), light or (1.0, 1.0, 1.0))
            far = (replace(veil, shade=local_shade(frame, None) if local else None),)
            haze, shown = 0.0, False
        elif shown and frame.depth is not None:
            planes.append(haze)
        alpha = plane(frame.size)
        with current.get().stage("join"):
            even = haze if shown and frame.depth is None else 0.0
            _core.join(alpha, planes or [np.zeros_like(alpha)], even)
        if color is None:
            shade = frame.run(self, "local light", local_shade, frame, self.optics)
        else:
            shade = None if glow is None else even_shade(frame, color)
        layer = Layer(self.name, alpha, color or (1.0, 1.0, 1.0), shade=shade, glow=glow)
        known = hasattr(front, "seen") if back is None else hasattr(back, "passes")
        if frame.whole and known:
            layer = replace(layer, **self._passes(frame, amount, behind, near, alpha))
        return (*far, layer)

    def _passes(
        self, frame: Frame, amount: float, behind: Array | None, near: Array | None, alpha: Array
    ) -> dict[str, Any]:
        """Return motion to both sides, depth, coverage and ids of the window; see `Layer`."""
        with current.get().stage("passes"):
            others = [frame.later(step) for step in STEPS]
            if behind is not None:
                (motion, backward), depth = self.texture.passes(frame, others)
            else:
                motion, backward = (blank((*alpha.shape, 2)) for _ in others)
                depth = np.full(alpha.shape, np.inf, np.float32)
            # What shows lies before the scene, wherever its layer's mean is.
            scene = None if frame.depth is None else frame.crop(frame.depth)
            coverage = blank(alpha.shape) if near is None else np.ascontiguousarray(near)
            seen, ids = None, plane(alpha.shape, np.int64)
            if near is not None:
                flakes, nearest, _ = self.flakes.seen(frame, amount)
                seen = flakes, nearest, coverage, behind
            _core.layer_finish(motion, backward, depth, ids, alpha, scene, seen)
        return {
            "motion": motion, "backward": backward, "depth": depth, "coverage": coverage, "ids": ids
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Mixture:
    """Populations that take turns: between two keys one goes as the next comes."""

    parts: Sequence[Precipitation]  # One for each key, with its share in its amount.

    @property
    def motion(self) -> Any:
        return self.parts[0].motion

    def air(self, t: float) -> float:
        return sum(part.air(t) for part in self.parts)

    def _now(self, frame: Frame) -> list[Precipitation]:
        return [part for part in self.parts if value_at(part.amount, frame.t) > 0.0]

    def needs(self, frame: Frame) -> Needs:
        return _together([part.needs(frame) for part in self._now(frame) or self.parts[:1]])

    def render(self, frame: Frame) -> tuple[Layer, ...]:
        return tuple(layer for part in self._now(frame) for layer in part.render(frame))


def _together(asked: Sequence[Needs]) -> Needs:
    """Return the needs of parts that lie over each other."""
    return Needs(
        tuple(step for needs in asked for step in needs.steps),
        tuple(one for needs in asked for one in needs.left_out),
        frozenset[str]().union(*(needs.reads for needs in asked)),
        most=1.0 - float(np.prod([1.0 - needs.most for needs in asked])), by_rows=True,
    )  # fmt: skip

"""Mist by its visibility: one extinction up to twice as far, even or with structure.

Without a `center` it is all around the camera, and what is farther than it reaches is seen through
all of it. With one it is a bank or a cloud that stands in the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from flurries import _core, gas
from flurries._contract import Array
from flurries._trace import current
from flurries.effects.bank_density import Density, Rays, Slices
from flurries.effects.bank_light import lit_by_sun, optics_of, skylit, sunny
from flurries.effects.color import Base, base_of, even_shade
from flurries.effects.vapor import moved_with, needs_of_gas
from flurries.frame.layer import Layer, Shade
from flurries.frame.needs import LeftOut, Needs
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Of a frame: opacity (H, W), the light (H, W, 3) of sky, sun and lamps multiplied by it, and the
# mean depth (H, W) of what shows.
Drawn: TypeAlias = tuple[Array, Array | None, Array | None]


@dataclass(frozen=True, eq=False)
class Bank:
    mist: Any  # A `Mist`, settled.

    def extinction(self, t: float) -> float:
        """Return the extinction of an even gas of the same mean transmittance at `t`, per metre."""
        visible = float(value_at(self.mist.visibility, t))
        return float(value_at(self.mist.amount, t)) * gas.visibility(visible)

    def air(self, t: float) -> float:
        return 0.0 if self._topped else self.extinction(t)

    @property
    def _topped(self) -> bool:
        return self.mist.center is not None or self.mist.top is not None

    def needs(self, frame: Frame) -> Needs:
        mist = self.mist
        drawn = LeftOut(f"{mist.NAME}: particles", "it has a visibility, and is drawn in slices")
        out: tuple[LeftOut, ...] = (drawn,)
        if mist.center is None and not frame.deep:
            why = f"nobody gave one: mist takes a wall at {mist.backdrop:g} m (backdrop)"
            out += (LeftOut(f"{mist.NAME}: depth", why),)
        shows = self.extinction(frame.t) > 0.0
        return needs_of_gas(mist, frame, out, shows=shows, most=1.0, by_rows=False)

    def render(self, frame: Frame) -> Layer:
        mist = self.mist
        base, color, local = base_of(mist.color, frame)
        # Under the plate's sky gas with a top is dimmer below its own.
        lit = lit_by_sun(mist, frame) or (local and self._topped)
        step = "lit gas" if lit_by_sun(mist, frame) or frame.lights else "gas"

        def whole() -> Drawn:
            make = partial(self._drawn, frame, base, lit=lit)
            return frame.once(self, "bank", make, eye=True, depth=True)

        made = frame.run(self, step, whole)
        if made is None:
            return Layer(mist.NAME, np.zeros(frame.size, np.float32), color)
        alpha, light, depth = (None if plane is None else frame.crop(plane) for plane in made)
        assert alpha is not None
        shade: Shade | None = None
        if lit:
            # All of its light is a glow, which is mixed as light.
            shade = even_shade(frame, (0.0, 0.0, 0.0))
        elif local or light is not None:
            shade = even_shade(frame, color)
        layer = Layer(mist.NAME, alpha, color, shade=shade, glow=light)
        if depth is None:
            return layer
        with current.get().stage("passes"):
            return moved_with(layer, depth, frame, mist.wind)

    def _drawn(self, frame: Frame, base: Base, *, lit: bool) -> Drawn:
        mist, slopes, extinction = self.mist, Rays(frame).slopes, self.extinction(frame.t)

        def dense() -> tuple[Density, list[Slices]]:
            density = Density(mist, frame, extinction, gas.visibility(mist.farthest))
            return density, list(density.slices())

        density, parts = frame.once(self, "density", dense, eye=True)
        alpha = np.zeros(frame.shape, np.float32)
        for part in parts:
            _core.gas_slices(alpha, (part.dense, part.edges, frame.depth, slopes), part.detail)
        _opacity(alpha)
        if not (lit or frame.lights or frame.whole):
            return alpha, None, None
        light = np.zeros((*frame.shape, 3), np.float32) if lit or frame.lights else None
        far, total = np.zeros(frame.shape, np.float32), np.zeros(frame.shape, np.float32)
        for part in parts:
            for number, place in enumerate(part.places):
                one = (part.dense[number][None], part.edges[number : number + 2])
                taken = np.zeros(frame.shape, np.float32)
                _core.gas_slices(taken, (*one, frame.depth, slopes), None)
                _opacity(taken)
                taken *= 1.0 - total
                total += taken
                far += np.float32(place) * taken
                if lit and light is not None:
                    shade = skylit(density, part.dense[number], base)
                    if lit_by_sun(mist, frame):
                        shade = sunny(density, place, part.lumps[number], base)
                    _core.shade_add(light, taken, shade.given())
        if light is not None and frame.lights and parts:
            edges = [*parts[0].edges, *(edge for part in parts[1:] for edge in part.edges[1:])]
            bank = (np.concatenate([part.dense for part in parts]), edges, frame.depth, slopes)
            (x, y, z), lamps = frame.camera.offset, frame.lamps(without=self.air(frame.t))
            _core.gas_glow(light, bank, lamps, optics_of(mist), (float(x), float(y), float(z)))
        # Slices are lit without their short waves, which the opacity has.
        np.maximum(total, np.float32(1e-12), out=total)
        if light is not None:
            light *= (alpha / total)[..., None]
        depth = np.where(alpha > 0.0, far / total, np.float32(np.inf))
        return alpha, light, depth if frame.whole else None


def _opacity(thick: Array) -> None:
    # In float32 the exponential is on vector lanes, that less one is not.
    np.exp(np.negative(thick, out=thick), out=thick)
    np.subtract(np.float32(1.0), thick, out=thick)

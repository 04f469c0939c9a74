"""One layer of gas: particles in a box that wraps (Johnson 2005), or a bank with structure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from flurries import _core, gas
from flurries._contract import Array, Float64
from flurries._trace import current
from flurries.effects.bank import Bank
from flurries.effects.color import color_at, is_local, reads_of
from flurries.effects.lighting import Base, even_shade
from flurries.effects.passes import NEAREST, STEPS, plane_motion
from flurries.effects.sunlight import brightest, optics_of, sunlit
from flurries.frame.layer import Layer
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.gas.splatting import gas_of, sorted_gas
from flurries.io.color import linear_to_srgb
from flurries.light.lamp import radiance
from flurries.motion.keys import Keys, Number, value_at

# How many times as bright as white lamps may make it.
LAMPS = 100.0

BLACK = (0.0, 0.0, 0.0)

# The outer share of the box, on each side, in which particles fade.
RIM = 0.075

# Where a film begins again: the stream of the order in which particles give way, and over which
# share of them the one that does fades.
RANKS, FADE = 211, 0.25

# The most particles in the box of the given sides; one that grows to the view has four times them.
MOST = 2_000_000


def values_of(number: Number) -> list[float]:
    """Return the values that a number has at its keys, or its one."""
    return [float(v) for _, v in number.keys] if isinstance(number, Keys) else [float(number)]


@dataclass(frozen=True, eq=False)
class Vapor:
    """The layer of a mist; where it has a visibility, number or opacity follow from that."""

    mist: Any  # A `Mist`, settled.

    @cached_property
    def count(self) -> int:
        """The number of particles in the box of the given sides."""
        mist = self.mist
        if mist.count is not None:
            return int(mist.count)
        # Of keyed values the pair that needs the most.
        least, most = min(values_of(mist.visibility)), max(values_of(mist.density))
        if most == 0.0:
            return 0
        count = gas.visibility(least) / gas.extinction(1.0, self._volume, mist.radius, most)
        if count > MOST:
            raise ValueError(
                f"visibility: {least:g} m wants {count:.0f} particles of radius {mist.radius:g} in "
                f"the box, at most {MOST} are drawn; a larger radius wants fewer"
            )
        return round(count)

    @property
    def _volume(self) -> float:
        return float(np.prod(self.mist.box))

    def opacity(self, t: float) -> float:
        """Return the opacity of a particle's middle at `t`, whatever the amount."""
        mist, opacity = self.mist, float(value_at(self.mist.density, t))
        if mist.visibility is None:
            return opacity
        far = float(value_at(mist.visibility, t))
        if mist.count is None:
            return opacity * min(values_of(mist.visibility)) / far
        wanted = gas.visibility(far)
        most = gas.extinction(max(mist.count, 1), self._volume, mist.radius, 1.0)
        if wanted > most:
            raise ValueError(
                f"visibility must be at least {gas.visibility(most):.4g} with {mist.count} "
                f"particles of radius {mist.radius:g}, got {far:g}"
            )
        return wanted / most

    def density(self, t: float) -> float:
        """Return the opacity of a particle's middle at `t`."""
        return float(value_at(self.mist.amount, t)) * self.opacity(t)

    def extinction(self, density: float) -> float:
        """Return beta of particles of a density, per metre."""
        return gas.extinction(self.count, self._volume, self.mist.radius, density)

    def require(self) -> None:
        """Refuse a visibility that no such gas has, at any time."""
        numbers = (self.mist.density, self.mist.visibility)
        keyed = [t for number in numbers if isinstance(number, Keys) for t, _ in number.keys]
        for t in keyed or [0.0]:
            self.extinction(self.opacity(t))

    @cached_property
    def bank(self) -> Bank | None:
        """What is drawn in place of particles where the gas has structure."""
        mist = self.mist
        return Bank(mist, self.extinction(self.opacity(0.0))) if mist.structure > 0.0 else None

    @property
    def through(self) -> float:
        """The way of a look through the box, its fading rims half, metres."""
        side, radius = float(self.mist.box[2]), float(self.mist.radius)
        if self.mist.center is not None:
            return side * (1.0 - RIM)
        return max(side * (1.0 - 1.5 * RIM) - radius, 0.0)

    def needs(self, frame: Frame) -> Needs:
        """Return the needs of a frame: one step, "gas", or "lit gas" with its colors and a sort."""
        mist, density = self.mist, self.density(frame.t)
        if density == 0.0 or self.count == 0:
            return Needs((), (LeftOut(mist.NAME, "it has no density"),), most=0.0)
        sunny = self._sunny(frame)
        lit = sunny or bool(frame.lights)
        bright = max(LAMPS if frame.lights else 1.0, brightest(mist) if sunny else 1.0)
        # The background's light may change from frame to frame; without a sun or lamps it is no
        # more than the color of what is kept.
        moves = has_keys(mist) or np.any(value_at(mist.wind, 0.0))
        still = not (moves or frame.lights or (lit and isinstance(mist.color, str)))
        out: tuple[LeftOut, ...] = ()
        if self.bank is not None:
            out = (LeftOut(f"{mist.NAME}: particles", "it has structure, and is drawn in slices"),)
        elif not lit:
            out = (LeftOut(f"{mist.NAME}: sort", "its particles have one color"),)
        return Needs(
            (Step("lit gas" if lit else "gas", once=still),),
            out,
            reads_of(mist.color),
            most=1.0 if self.bank else min(density * self.filled(frame)[1], 1.0),
            by_rows=self.bank is None,
            brightest=bright,
        )

    def render(self, frame: Frame) -> Layer:
        """Return the layer of a frame."""
        mist, run, lit = self.mist, frame.run or frame.steps_of(self), self._sunny(frame)
        plate = frame.plate if is_local(mist.color) else None
        color = color_at(mist.color, frame)
        base = Base.even(color)
        if plate is not None:
            base = Base.airlight(plate)
            red, green, blue = linear_to_srgb(base.dim).tolist()
            color = red, green, blue
        density, bank = self.density(frame.t), self.bank
        step = "lit gas" if lit or frame.lights else "gas"
        top, bottom, left, right = frame.window
        alpha, light = np.zeros((bottom - top, right - left), np.float32), None
        shade = even_shade(frame, color)
        if bank is None:
            drawn = run(step, lambda: self._draw(frame, density, base, lit=lit))
            alpha, light = drawn or (alpha, light)
        else:
            thick = self.extinction(density)
            made = run(step, lambda: bank.draw(frame, thick, base, lit=lit))
            if made is not None:
                alpha, light, sky = made
                # What is kept of a picture has the light of the next.
                shade = shade if plate is None else sky.shade(frame, base.dim)
        if lit and light is not None and bank is None:
            layer = Layer(mist.NAME, alpha, rgb=light)
        else:
            if lit and light is not None:
                # All of its light is a glow, which is mixed as light.
                shade = even_shade(frame, BLACK)
            even = light is None and plate is None
            layer = Layer(mist.NAME, alpha, color, shade=None if even else shade, glow=light)
        if not frame.whole:
            return layer
        with current.get().stage("passes"):
            motion, backward, depth = self._passes(frame, density)
        return replace(layer, motion=motion, backward=backward, depth=depth)

    def _sunny(self, frame: Frame) -> bool:
        return bool(self.mist.lit) and frame.sun is not None

    def filled(self, frame: Frame) -> tuple[Float64, int]:
        """Return the sides of the box and how many particles fill it."""
        sides = np.array(self.mist.box)
        if self.mist.center is not None:
            return sides, self.count
        # The path's lens, so that both eyes see the same gas.
        cx, cy = frame.path.widest.principal(frame.shape)
        height, width = frame.shape
        slopes = np.array([max(cx, width - cx), max(cy, height - cy)]) / frame.path.widest.focal
        # The outer part fades; the view's far corners stay inside of that. Up to 1 : 1 either way.
        wide = 2.0 * np.minimum(slopes, 1.0) * sides[2] * (1.0 - RIM) / (1.0 - 2.0 * RIM)
        grown = sides.copy()
        if not frame.path.turns and not np.any(frame.camera.rotation):
            grown[:2] = np.maximum(sides[:2], wide)
        return grown, min(round(self.count * float(np.prod(grown / sides))), 4 * MOST)

    def places(self, frame: Frame, density: float) -> tuple[Float64, Float64]:
        """Return middles in the eye's axes (n, 3) and the density that each shows (n,)."""
        sides, count = self.filled(frame)
        if self.mist.center is not None:
            middle = np.array(self.mist.center) - frame.path.place(frame.t, fps=frame.fps)
        else:
            # The wall behind the camera fades where no particle reaches the eye any more.
            ahead = max(0.5 * sides[2] - RIM * sides[2] - self.mist.radius, 0.0)
            middle = np.asarray(ahead * frame.camera.matrix()[:, 2])
        box = tuple(sides.tolist()), tuple(middle.tolist())
        rounds = []
        for t, part in self._rounds(frame, count):
            moved = -frame.path.relative(t, fps=frame.fps, fall=0.0, wind=self.mist.wind)[0]
            points, shown = np.empty((count, 3)), np.empty(count)
            _core.particle_positions(points, *box, frame.seed, moved.reshape(1, 3), 1.0, None)
            _core.particle_edge_fade(shown, points, *box)
            rounds.append((points, shown * part))
        points, shown = (np.concatenate(parts) for parts in zip(*rounds, strict=True))
        shown *= density
        local = frame.to_camera(points)
        if self.mist.depths is not None:
            # The share of each particle that lies between the two.
            ends = np.array(self.mist.depths)[:, None] + frame.camera.offset[2] - local[:, 2]
            low, high = _normal(ends * 3.0 / self.mist.radius)
            shown = shown * (high - low)
        there = shown > 0.0
        return np.ascontiguousarray(local[there]), shown[there]

    def _rounds(self, frame: Frame, count: int) -> list[tuple[float, Any]]:
        """Return the times that are shown, of a loop two, and how much of each particle then."""
        lap = frame.lap
        if lap is None:
            return [(frame.t, 1.0)]
        # One by one particles give way to those of the next round, which begins with all of them.
        rank = np.empty(count)
        _core.uniform(rank, frame.seed, RANKS)
        part = (1.0 + FADE) * lap.part(frame.t)
        next_ = np.clip((part - rank) / FADE, 0.0, 1.0)
        rounds = [(frame.t, 1.0 - next_), (frame.t - lap.frames, next_)]
        return [(t, shown) for t, shown in rounds if shown.any()]

    def _draw(
        self, frame: Frame, density: float, base: Base, *, lit: bool
    ) -> tuple[Array, Array | None]:
        """Return opacity (h, w) and light (h, w, 3) of the window: all of it, or what lamps add."""
        top, bottom, left, right = frame.window
        shape = (bottom - top, right - left)

        def sort() -> tuple[_core.SortedGas, bool]:
            points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
            colored = (lit or bool(frame.lights)) and len(points) > 0
            colors: Any = 0.0
            if colored and lit:
                colors = sunlit(self.mist, frame, points, shown, base)
            if colored and frame.lights:
                eye = np.array(frame.camera.offset)
                colors = colors + radiance(points, frame.lamps(), optics_of(self.mist), eye)
            return self._sorted(frame, points, shown, colors), colored

        found, colored = frame.once_each(self, "gas", sort)
        layer = np.empty((*shape, 4) if colored else shape, np.float32)
        _core.gas_draw(layer, found, frame.window, frame.depth)
        return (layer[..., 3], layer[..., :3]) if colored else (layer, None)

    def _sorted(
        self, frame: Frame, points: Float64, shown: Float64, colors: Any
    ) -> _core.SortedGas:
        grains = gas_of(points, self.mist.radius, shown)
        how = {"footprint": self.mist.footprint, "near": self.mist.near}
        return sorted_gas(frame.shape, grains, colors, frame.camera, **how)

    def _passes(self, frame: Frame, density: float) -> tuple[Array, Array, Array]:
        """Return motion (h, w, 2), backward and depth (h, w): a mean of the particles that show."""
        points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
        top, bottom, left, right = frame.window
        layer = np.zeros((bottom - top, right - left, 4), np.float32)
        if len(points) > 0:
            far = np.maximum(points[:, 2] - frame.camera.offset[2], NEAREST)
            found = self._sorted(frame, points, shown, far)
            _core.gas_draw(layer, found, frame.window, frame.depth)
        mean, cover = layer[..., 0], layer[..., 3]
        depth = np.full_like(mean, np.inf)
        np.divide(mean, cover, out=depth, where=cover > 0.0)
        if frame.depth is not None:
            scene = frame.crop(frame.depth)
            depth = np.where(np.isfinite(depth), np.minimum(depth, scene), depth)
        motions = []
        for step in STEPS:
            other = frame.later(step)
            wind = self.mist.wind
            moved = other.displacement(wind=wind) - frame.displacement(wind=wind)
            motions.append(plane_motion(depth, frame, other, moved))
        return motions[0], motions[1], np.ascontiguousarray(depth)


def _normal(u: Float64) -> Float64:
    """Return the normal law up to each u."""
    flat = [0.5 * math.erfc(-v * 0.7071067811865476) for v in u.ravel().tolist()]
    return np.reshape(flat, u.shape)

"""One layer of gas: particles in a box that wraps (Johnson 2005), and what a bank shares."""

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from flurries import _core, gas
from flurries._contract import Array, Float64, uniforms
from flurries._trace import current
from flurries.effects.color import base_of, even_shade, reads_of
from flurries.effects.motion import NEAREST, STEPS, air_motions
from flurries.frame.layer import Layer
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.gas.splatting import gas_of, sorted_gas
from flurries.light.lamp import DROPS, Optics, radiance
from flurries.motion.keys import Vector, value_at

Law: TypeAlias = Literal["even", "rayleigh", "henyey"]

LAMPS = 100.0  # How many times as bright as white lamps may make it.
RIM = 0.075  # The outer share of the box, on each side, in which particles fade.

# Where a film begins again: the stream of the order in which particles give way, and over which
# share of them the one that does fades.
RANKS, FADE = 211, 0.25

MOST = 2_000_000  # The most particles in a box.


def optics_of(mist: Any) -> Optics:
    return Optics(mist.asymmetry, 1.0) if mist.scatter == "henyey" else DROPS


def lit_by_sun(mist: Any, frame: Frame) -> bool:
    return bool(mist.lit) and frame.sun is not None


def needs_of_gas(
    mist: Any, frame: Frame, out: dict[str, str], *, shows: bool, most: float, by_rows: bool
) -> Needs:
    """Return the needs of a frame: one step, "gas", or "lit gas" with its colors and a sort."""
    if not shows:
        return Needs.none(mist.NAME, "it has no density")
    sunny = lit_by_sun(mist, frame)
    lit = sunny or bool(frame.lights)
    # The background's light may change from frame to frame; without a sun or lamps it is no more
    # than the color of what is kept.
    moves = frame.lights or has_keys(mist) or np.any(value_at(mist.wind, 0.0))
    by_places = lit or mist.top is not None or mist.center is not None
    still = not (moves or (by_places and isinstance(mist.color, str)))
    bright = LAMPS if frame.lights else 1.0
    if sunny and mist.scatter != "even":
        straight = gas.phase([1.0], kind=mist.scatter, asymmetry=abs(mist.asymmetry))
        bright = max(bright, straight.item())
    step = Step("lit gas" if lit else "gas", once=still)
    less = tuple(LeftOut(f"{mist.NAME}: {what}", why) for what, why in out.items())
    reads = reads_of(mist.color)
    return Needs((step,), less, reads, most=most, by_rows=by_rows, brightest=bright)


def moved_with(layer: Layer, depth: Array, frame: Frame, wind: Vector) -> Layer:
    """Return a layer with the mean depth (h, w) of what it shows, which moves as the air does."""
    if frame.depth is not None:
        depth = np.where(np.isfinite(depth), np.minimum(depth, frame.crop(frame.depth)), depth)
    motions = air_motions(depth, frame, [frame.later(step) for step in STEPS], wind=wind)
    return replace(layer, motion=motions[0], backward=motions[1], depth=np.ascontiguousarray(depth))


@dataclass(frozen=True, eq=False)
class Vapor:
    mist: Any  # A `Mist`, settled.

    def density(self, t: float) -> float:
        return float(value_at(self.mist.amount, t)) * float(value_at(self.mist.density, t))

    def extinction(self, t: float) -> float:
        volume = float(np.prod(self.mist.box))
        return gas.extinction(self.mist.count, volume, self.mist.radius, self.density(t))

    def air(self, t: float) -> float:
        return self.extinction(t) if self.mist.center is None else 0.0

    def needs(self, frame: Frame) -> Needs:
        density = self.density(frame.t)
        out = {} if frame.lights else {"sort": "its particles have one color"}
        shows = density > 0.0 and self.mist.count > 0
        most = min(density * self.mist.count, 1.0)
        return needs_of_gas(self.mist, frame, out, shows=shows, most=most, by_rows=True)

    def render(self, frame: Frame) -> Layer:
        mist, density = self.mist, self.density(frame.t)
        _, color, local = base_of(mist.color, frame)
        step = "lit gas" if lit_by_sun(mist, frame) or frame.lights else "gas"
        drawn = frame.run(self, step, self._draw, frame, density)
        alpha, light = drawn or (np.zeros(frame.size, np.float32), None)
        shade = even_shade(frame, color) if local or light is not None else None
        layer = Layer(mist.NAME, alpha, color, shade=shade, glow=light)
        if not frame.whole:
            return layer
        with current.get().stage("passes"):
            return moved_with(layer, self._depth(frame, density), frame, mist.wind)

    def places(self, frame: Frame, density: float) -> tuple[Float64, Float64]:
        sides, count = np.array(self.mist.box), self.mist.count
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
        there = shown > 0.0
        return np.ascontiguousarray(frame.to_camera(points)[there]), shown[there]

    def _rounds(self, frame: Frame, count: int) -> list[tuple[float, Any]]:
        """Return the times that are shown, of a loop two, and how much of each particle then."""
        if (lap := frame.lap) is None:
            return [(frame.t, 1.0)]
        # One by one particles give way to those of the next round, which begins with all of them.
        part = (1.0 + FADE) * lap.part(frame.t)
        next_ = np.clip((part - uniforms(frame.seed, RANKS, count)) / FADE, 0.0, 1.0)
        rounds = [(frame.t, 1.0 - next_), (frame.t - lap.frames, next_)]
        return [(t, shown) for t, shown in rounds if shown.any()]

    def _draw(self, frame: Frame, density: float) -> tuple[Array, Array | None]:
        """Return opacity (h, w) of the window, and what lamps add to its light (h, w, 3)."""

        def sort() -> tuple[_core.SortedGas, bool]:
            points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
            colored, colors = bool(frame.lights) and len(points) > 0, np.zeros(1)
            if colored:
                optics, eye = optics_of(self.mist), np.array(frame.camera.offset)
                colors = radiance(points, frame.lamps(), optics, eye)
            return self._sorted(frame, points, shown, colors), colored

        found, colored = frame.once(self, "gas", sort, eye=True)
        layer = np.empty((*frame.size, 4) if colored else frame.size, np.float32)
        _core.gas_draw(layer, found, frame.window, frame.depth)
        return (layer[..., 3], layer[..., :3]) if colored else (layer, None)

    def _sorted(
        self, frame: Frame, points: Float64, shown: Float64, colors: Any
    ) -> _core.SortedGas:
        mist, grains = self.mist, gas_of(points, self.mist.radius, shown)
        how = {"footprint": mist.footprint, "near": mist.near}
        return sorted_gas(frame.shape, grains, colors, frame.camera, **how)

    def _depth(self, frame: Frame, density: float) -> Array:
        """Return the depth (h, w) of a window: a mean of the particles that show."""
        points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
        layer = np.zeros((*frame.size, 4), np.float32)
        if len(points) > 0:
            far = np.maximum(points[:, 2] - frame.camera.offset[2], NEAREST)
            found = self._sorted(frame, points, shown, far)
            _core.gas_draw(layer, found, frame.window, frame.depth)
        mean, cover = layer[..., 0], layer[..., 3]
        return np.divide(mean, cover, out=np.full_like(mean, np.inf), where=cover > 0.0)

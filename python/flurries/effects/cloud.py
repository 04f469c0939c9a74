"""A box of gas particles that the wind moves, before or around the camera (Johnson 2005)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.effects.lighting import Base
from flurries.effects.passes import NEAREST, STEPS, plane_motion
from flurries.effects.sunlight import Scatter
from flurries.frame.view import Frame
from flurries.gas.splatting import FINISHED, sorted_gas
from flurries.light.lamp import radiance
from flurries.motion.keys import Vector

# The outer share of the box, on each side, in which particles fade.
RIM = 0.075

# Sigma (px) from which particles are drawn on a lattice: each errs by at most .0015 of its density,
# and a frame by less than half a step of 8 bits (docs/gas.md).
SMOOTH = 24.0

# Where a film begins again: the stream of the order in which particles give way, and over which
# share of them the one that does fades.
RANKS, FADE = 211, 0.25

# The most particles in the box of the given sides; one that grows to the view has four times them.
MOST = 2_000_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Cloud:
    """Particles of one radius in a box that wraps.

    Attributes
    ----------
    wind : Vector
        Metres per second, house axes.
    sides : (3,)
        Of the box, metres.
    center : (3,), optional
        Its middle in the world; the box goes with the camera if not given.
    depths : (near, far), optional
        Only what lies between.
    count : int
        In the box of these sides.
    radius : float
        Three sigma, metres.
    footprint, near
        See :func:`flurries.gas.splat`.
    scatter : Scatter
        How it is lit.
    """

    wind: Vector
    sides: tuple[float, float, float]
    center: tuple[float, float, float] | None
    depths: tuple[float, float] | None
    count: int
    radius: float
    footprint: str
    near: float
    scatter: Scatter

    @property
    def through(self) -> float:
        """The way of a look through the box, its fading rims half, metres."""
        if self.center is not None:
            return self.sides[2] * (1.0 - RIM)
        return max(self.sides[2] * (1.0 - 1.5 * RIM) - self.radius, 0.0)

    def filled(self, frame: Frame) -> tuple[Float64, int]:
        """Return the sides of the box and how many particles fill it."""
        sides = np.array(self.sides)
        if self.center is not None:
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
        box = tuple(sides.tolist()), tuple(self._middle(frame, sides).tolist())
        rounds = []
        for t, part in self._rounds(frame, count):
            moved = -frame.path.relative(t, fps=frame.fps, fall=0.0, wind=self.wind)[0]
            points, shown = np.empty((count, 3)), np.empty(count)
            _core.particle_positions(points, *box, frame.seed, moved.reshape(1, 3), 1.0, None)
            _core.particle_edge_fade(shown, points, *box)
            rounds.append((points, shown * part))
        points, shown = (np.concatenate(parts) for parts in zip(*rounds, strict=True))
        shown *= density
        local = frame.to_camera(points)
        if self.depths is not None:
            shown = shown * self._between(local[:, 2] - frame.camera.offset[2])
        there = shown > 0.0
        return np.ascontiguousarray(local[there]), shown[there]

    def _rounds(self, frame: Frame, count: int) -> list[tuple[float, Any]]:
        """Return the times that are shown, and how much of each particle then.

        Of a film that begins again two rounds: one by one particles of this one give way to those
        of the next, which are there in full when it begins.
        """
        lap = frame.lap
        if lap is None:
            return [(frame.t, 1.0)]
        rank = np.empty(count)
        _core.uniform(rank, frame.seed, RANKS)
        part = (1.0 + FADE) * lap.part(frame.t)
        next_ = np.clip((part - rank) / FADE, 0.0, 1.0)
        rounds = [(frame.t, 1.0 - next_), (frame.t - lap.frames, next_)]
        return [(t, shown) for t, shown in rounds if shown.any()]

    def draw(
        self, frame: Frame, density: float, base: Base, *, lit: bool
    ) -> tuple[Array, Array | None]:
        """Return opacity over the window (h, w), and light (h, w, 3) times opacity or None.

        Where the sun lights it that is all of its light, of a gas that is as bright as `base` where
        it is lit in full; else it is what lamps add.
        """
        found, colored = frame.once_each(
            self, "gas", lambda: self._sort(frame, density, base, lit=lit)
        )
        top, bottom, left, right = frame.window
        shape = (bottom - top, right - left)
        layer = np.empty((*shape, 4) if colored else shape, np.float32)
        _core.gas_draw(layer, found, frame.window, frame.depth)
        if colored:
            return layer[..., 3], layer[..., :3]
        return layer, None

    def passes(self, frame: Frame, density: float) -> tuple[Array, Array, Array]:
        """Return motion (h, w, 2), backward and depth (h, w) of what the window shows.

        The depth is the mean of the particles', each weighed by what it shows before those behind
        it: the gas is drawn once more, with depths in place of colors. The motion is that of the
        air at this depth.
        """
        points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
        top, bottom, left, right = frame.window
        layer = np.zeros((bottom - top, right - left, 4), np.float32)
        if len(points) > 0:
            far = np.maximum(points[:, 2] - frame.camera.offset[2], NEAREST)
            gas = sorted_gas(
                frame.shape, points, self.radius, shown, far, frame.camera,
                footprint=self.footprint, near=self.near, near_mode="exact", depth=frame.depth,
                error=FINISHED["float32"], smooth=SMOOTH,
            )  # fmt: skip
            _core.gas_draw(layer, gas, frame.window, frame.depth)
        mean, cover = layer[..., 0], layer[..., 3]
        depth = np.full_like(mean, np.inf)
        np.divide(mean, cover, out=depth, where=cover > 0.0)
        if frame.depth is not None:
            scene = frame.crop(frame.depth)
            depth = np.where(np.isfinite(depth), np.minimum(depth, scene), depth)
        motions = []
        for step in STEPS:
            other = frame.later(step)
            moved = other.displacement(wind=self.wind) - frame.displacement(wind=self.wind)
            motions.append(plane_motion(depth, frame, other, moved))
        return motions[0], motions[1], np.ascontiguousarray(depth)

    def _sort(
        self, frame: Frame, density: float, base: Base, *, lit: bool
    ) -> tuple[_core.SortedGas, bool]:
        """Return the gas, to be drawn in any band of the frame, and whether it has colors."""
        points, shown = frame.once(self, "particles", lambda: self.places(frame, density))
        colored = (lit or bool(frame.lights)) and len(points) > 0
        colors: Any = 0.0
        if colored and lit:
            colors = self.scatter.colors(frame, points, shown, self.radius, *base)
        if colored and frame.lights:
            eye = np.array(frame.camera.offset)
            colors = colors + radiance(points, frame.lamps(), self.scatter.optics, eye)
        given = sorted_gas(
            frame.shape, points, self.radius, shown, colors, frame.camera,
            footprint=self.footprint, near=self.near, near_mode="exact", depth=frame.depth,
            error=FINISHED["float32"], smooth=SMOOTH,
        )  # fmt: skip
        return given, colored

    def _middle(self, frame: Frame, sides: Float64) -> Float64:
        """Return the middle of the box, house axes, from the camera's place."""
        if self.center is not None:
            return np.array(self.center) - frame.path.place(frame.t, fps=frame.fps)
        # The wall behind the camera fades where no particle reaches the eye any more.
        ahead = max(0.5 * sides[2] - RIM * sides[2] - self.radius, 0.0)
        return np.asarray(ahead * frame.camera.matrix()[:, 2])

    def _between(self, depth: Float64) -> Float64:
        """Return the share of particles that lies between the two depths."""
        assert self.depths is not None
        low, high = (_normal((limit - depth) * 3.0 / self.radius) for limit in self.depths)
        return np.asarray(high - low)


def _normal(u: Float64) -> Float64:
    """Return the normal law up to u."""
    return np.array([0.5 * math.erfc(-v * 0.7071067811865476) for v in u.tolist()])

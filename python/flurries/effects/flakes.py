"""Flakes and drops: many points in a box that goes with the camera, seen through its lens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries.camera.lens import seen_at
from flurries.camera.path import CameraPath
from flurries.effects.drawing import (
    MOST_IN_BOX,
    NEAR,
    draw_numbered,
    draw_sorted,
    gust_room,
    lens_of,
    sight_of,
    triple,
)
from flurries.effects.motion import Motion, Way
from flurries.effects.passes import Other
from flurries.effects.places import FADE_IN, SHOWN, SIZES, Listed, Places, list_flakes, place_flakes
from flurries.effects.resolution import TUNED
from flurries.frame.needs import Cost, LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at
from flurries.particles.crowd import Flurry, Lens
from flurries.particles.looks import image_of

# Pixels that are drawn together.
RUN = 32


class Box(NamedTuple):
    """The box of flakes that the view of a film fits into.

    Attributes
    ----------
    sides : (3,)
        Metres, along the camera's axes; of a camera that turns along those of the house, a cube
        that holds the view however it is turned.
    ball : float
        Radius of the ball through the eye and the view's far corners, metres. Its centre lies on
        the axis at the same distance from the eye, or in the middle of the far end where the view
        is wider than deep.
    view : float
        Volume that the view fills up to the far end, cubic metres.
    alike : bool
        Whether all flakes move alike.
    largest : (low, high)
        Sigma in pixels from which flakes fade, and at which they are gone.
    """

    sides: Float64
    ball: float
    view: float
    alike: bool
    largest: tuple[float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Flakes:
    """A population of flakes or drops that are drawn one by one.

    Attributes
    ----------
    motion : Motion
        What moves them.
    name : str
        What the effect calls their number.
    number : int
        How many are in view.
    density : float, optional
        Per cubic metre, in place of the number in view.
    reach : float
        Depth up to which they are drawn, metres.
    sizes : (smallest, largest)
        Diameters, metres.
    opacity : Number
        Of a resting one's middle.
    sway : (amplitude, rate)
        Metres, and radians per second.
    largest : (low, high)
        Sigma on a picture 1024 px wide from which flakes fade, and at which they are gone:
        out-of-focus puffs look like dirt.
    """

    motion: Motion
    name: str = "flakes"
    number: int
    density: float | None = None
    reach: float
    sizes: tuple[float, float]
    opacity: Number
    sway: tuple[float, float] = (0.0, 0.0)
    largest: tuple[float, float] = (3.5, 6.0)

    @property
    def empty(self) -> bool:
        """Whether there are none."""
        return (self.number if self.density is None else self.density) == 0

    def box(self, frame: Frame) -> Box:
        """Return the box of the film that a frame belongs to."""
        return _box(self, frame.shape, frame.path)

    def count(self, frame: Frame) -> int:
        """Return the number of flakes in the box, so that the view has the number asked for."""
        return _count(self, frame.shape, frame.path)

    def number_in_view(self, frame: Frame) -> float:
        """Return the number of flakes in view."""
        return self.number if self.density is None else self.density * self.box(frame).view

    def places(self, frame: Frame) -> Places:
        """Return the places of a frame's flakes, their velocities and the shares that are shown."""
        return self._places(frame, self.motion.way(frame))

    def alpha(self, frame: Frame, amount: float, way: Way) -> Array:
        """Return the opacity of the flakes over the window, (h, w) float32."""
        if frame.whole:
            return self._numbered(frame, amount, way)[0]
        return draw_sorted(frame, self.sort(frame, amount, way))

    def sort(self, frame: Frame, amount: float, way: Way) -> SortedFlakes:
        """Return the flakes, to be drawn in any band of the frame."""
        if frame.shared is None:
            return self._sort(frame, amount, way)
        frame = frame.around
        assert frame.shared is not None
        if self.box(frame).alike and len(frame.shared.cameras) == 2:
            both = frame.once(self, "flakes", lambda: self._sort_pair(frame, amount, way))
            return both[frame.eye]
        return frame.once_each(self, "flakes", lambda: self._sort(frame, amount, way))

    def ids(self, frame: Frame, amount: float, way: Way) -> npt.NDArray[np.int32]:
        """Return the number of the flake that each pixel of the window shows, (h, w); -1 for none.

        Its number in the box is the same in every frame.
        """
        return self._numbered(frame, amount, way)[1]

    def _numbered(self, frame: Frame, amount: float, way: Way) -> tuple[Array, Array]:
        def make() -> tuple[Array, Array]:
            alike = self.box(frame).alike
            known = None if alike else self._listed(frame, amount, way).numbers
            return draw_numbered(frame, self.sort(frame, amount, way), known)

        # One frame is asked for twice where something stands in the air, with two depths.
        return frame.once_each(self, f"numbered before {id(frame.depth)}", make)

    def _listed(self, frame: Frame, amount: float, way: Way) -> Listed:
        return frame.once_each(self, "listed", lambda: self._list(frame, amount, way))

    def passes(
        self, frame: Frame, amount: float, way: Way, others: Sequence[Other], numbers: Array
    ) -> tuple[list[Array], Array]:
        """Return motions to other frames (n, 2) and depth (n,) of flakes by their numbers."""
        some = numbers.astype(np.int64)
        points, velocity, _ = self._places(frame, way, some).of(some)
        local, half = points - frame.camera.offset, 0.5 * float(self.box(frame).sides.min())
        start, depth = seen_at(local, frame.camera, frame.shape)
        motions = []
        for other, its_way in others:
            after, _, known = self._places(other, its_way, some).of(some)
            end, ahead = seen_at(after - other.camera.offset, other.camera, other.shape)
            motion = end - start
            # One that flies past the eye before the next frame, or comes back at the other side of
            # the box: as fast as now.
            jumps = np.abs(after - points).max(axis=1, initial=0.0) > half
            gone = ~known | (ahead <= NEAR) | jumps
            speed, (x_y, z) = (other.t - frame.t) * velocity[gone], np.split(local[gone], [2], 1)
            motion[gone] = frame.camera.focals * (speed[:, :2] - speed[:, 2:] * x_y / z) / z
            motions.append(motion.astype(np.float32))
        return motions, depth.astype(np.float32)

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return their one step, or why there is none."""
        opacity = 0.0 if self.empty else value_at(self.opacity, frame.t)
        if opacity == 0.0:
            why = "there are none" if self.empty else "their opacity is 0"
            return Needs((), (LeftOut(self.name, why),), most=0.0)
        still = frame.settled and self.motion.still and 0.0 in self.sway and not has_keys(self)
        most = 1.0
        if amount < FADE_IN:
            # Of rank r from 0 to 1 a flake shows by (amount - 0.9 r) / 0.1: the first, and the
            # integral. A bound on the opacity: the sum of all of theirs, since few are shown.
            shown = amount / FADE_IN + self.count(frame) * amount**2 / (
                2.0 * FADE_IN * (1.0 - FADE_IN)
            )
            most = min(shown * opacity, 1.0)
        step = Step("flakes", lambda: self._cost(frame, amount), still, most)
        return Needs((step,), most=most)

    def footprints(self, frame: Frame) -> tuple[float, float]:
        """Return the numbers of flakes drawn and of runs of pixels in their rows, on average."""
        way = self.motion.way(frame)
        # Depths of equal numbers of flakes: the view is a pyramid.
        depth = self.reach * ((np.arange(64) + 0.5) / 64.0) ** (1.0 / 3.0)
        radius = 0.5 * np.linspace(*self.sizes, 8)[:, None]
        focal = frame.camera.focal
        sigma = focal * radius / (3.0 * depth)
        drawn = (sigma < self.box(frame).largest[1]) & (depth > NEAR)
        wide = 8.0 * np.sqrt(image_of(sigma)[0])
        blur = focal * way.shutter / depth
        across, down = (blur * abs(rate) for rate in way.rate[:2])
        rows = np.minimum(wide + down, frame.shape[0])
        runs = rows * np.ceil(np.minimum(wide + across, frame.shape[1]) / RUN)
        number = self.number_in_view(frame)
        return number * float(drawn.mean()), number * float((drawn * runs).mean())

    def _cost(self, frame: Frame, amount: float) -> Cost:
        placed = self.count(frame)
        drawn, runs = self.footprints(frame)
        height, width = frame.shape
        top, bottom, left, right = frame.window
        plane = (bottom - top) * (right - left)
        # The last flakes in are fading.
        part = min(amount / (1.0 - FADE_IN), 1.0)
        share = min(plane / (height * width), 1.0)
        name = "streak" if value_at(self.motion.shutter, frame.t) > 0.0 else "disc"
        shown = round(drawn * part * share)
        work = {
            "flake placed": placed * part,
            name: drawn * part * share,
            f"{name} run": runs * part * share,
            "mask pixel": float(height * width),
        }
        out = (LeftOut(f"{self.name} out of view", f"some {placed - shown} of {placed}"),)
        if self.box(frame).alike:
            return Cost(work, f"{shown} {self.name}", 4 * plane, 0, out)
        # First, of each placed: place, fade, its columns, how far it reaches, and one more; for a
        # camera that turns its velocity as well, and that across. Then what is left of those in the
        # view, with sizes still of all. The plane comes when these have gone.
        first = (129 if frame.path.turns else 73) * placed
        scratch = max(first, 8 * placed + 90 * round(drawn * part), 4 * plane) - 4 * plane
        work["flake listed"] = float(placed)
        return Cost(work, f"{shown} {self.name}", 4 * plane, scratch, out)

    def _sort(self, frame: Frame, amount: float, way: Way) -> SortedFlakes:
        if self.box(frame).alike:
            return _core.particle_sort(frame.shape, self._flurry(frame, amount, way))
        return _core.particle_sort_listed(
            frame.shape, *self._given(frame, self._listed(frame, amount, way), way)
        )

    def _sort_pair(
        self, frame: Frame, amount: float, way: Way
    ) -> tuple[SortedFlakes, SortedFlakes]:
        """Return the layers of two eyes, each flake placed once."""
        assert frame.shared is not None
        left, right = frame.shared.cameras
        asked = self._flurry(replace(frame, camera=left), amount, way)
        return _core.particle_sort_pair(frame.shape, asked, lens_of(right, frame.shape))

    def _flurry(self, frame: Frame, amount: float, way: Way) -> Flurry:
        """Return the box of flakes before the frame's camera."""
        # Everything is as much higher as pixels are.
        stretch = np.array([1.0, frame.camera.aspect, 1.0])
        box, number, opacity = self.box(frame), self.count(frame), value_at(self.opacity, frame.t)
        return Flurry(
            number=number,
            sides=triple(stretch * box.sides),
            center=(0.0, 0.0, 0.5 * self.reach),
            seed=frame.seed,
            way=triple(-stretch * way.moved),
            sway=(self.sway[0], self.sway[1] * frame.t / frame.fps),
            travel=triple(way.shutter * stretch * -way.rate),
            radius=(0.5 * self.sizes[0], 0.5 * self.sizes[1]),
            opacity=opacity,
            amount=amount,
            fade_in=FADE_IN,
            largest=box.largest,
            sizes=SIZES,
            lens=lens_of(frame.camera, frame.shape),
            window=frame.window,
        )

    def _places(
        self, frame: Frame, way: Way, numbers: npt.NDArray[np.int64] | None = None
    ) -> Places:
        box, middle = self.box(frame), np.array([0.0, 0.0, 0.5 * self.reach])
        if frame.path.turns:
            middle = frame.camera.matrix() @ (0.0, 0.0, min(box.ball, self.reach))
        return place_flakes(
            frame, self.motion, way, self.count(frame), box.sides, middle, self.reach, self.sway,
            numbers,
        )  # fmt: skip

    def _list(self, frame: Frame, amount: float, way: Way) -> Listed:
        """Return the flakes to draw one by one: any wind, any camera."""
        return list_flakes(
            frame,
            self._places(frame, way),
            way.shutter,
            self.sizes,
            amount,
            self.box(frame).largest,
            self.count(frame),
        )

    def _given(
        self, frame: Frame, rows: Listed, way: Way
    ) -> tuple[tuple[Float64, Float64, Float64, Float64, float], Lens]:
        """Return a list of flakes and the lens before them, as the kernels read them."""
        stretch, lens = frame.camera.aspect, lens_of(frame.camera, frame.shape)
        points, velocity = rows.points, rows.velocity
        if stretch != 1.0:
            higher = np.array([1.0, stretch, 1.0])
            points, velocity = points * higher, velocity * higher
        opacity = rows.weight * value_at(self.opacity, frame.t)
        return (points, rows.radius, opacity, velocity, way.shutter), lens


@lru_cache(maxsize=64)
def _box(flakes: Flakes, shape: tuple[int, int], path: CameraPath) -> Box:
    height, width = shape
    reach, wind = flakes.reach, flakes.motion.varied
    across, down, ball = sight_of(path, shape, reach)
    room = gust_room(flakes.motion)
    # The outer 15 % of the box fade; the view's far corners stay inside of that.
    sides = np.array([across / SHOWN + 2.0 * room, down / SHOWN + 2.0 * room, reach])
    if path.turns:
        sides = np.full(3, 2.0 * ball / SHOWN + 2.0 * room)
    # The view is a pyramid: a third of the prism around it.
    fx, fy = (reach / focal for focal in path.widest.focals)
    view = width * fx * height * fy * reach / 3.0
    alike = wind is None and not (path.turns or path.zooms)
    low, high = (limit * (width / TUNED) for limit in flakes.largest)
    return Box(sides, ball, view, alike, (low, high))


@lru_cache(maxsize=64)
def _count(flakes: Flakes, shape: tuple[int, int], path: CameraPath) -> int:
    box = _box(flakes, shape, path)
    each = flakes.number / box.view if flakes.density is None else flakes.density
    count = round(each * float(np.prod(box.sides)))
    if count > MOST_IN_BOX:
        many = flakes.density
        given = f"{flakes.number} in view" if many is None else f"{many:g} per m3"
        raise ValueError(
            f"{flakes.name}: {given} are {count} in the box around a lens whose "
            f"center is so far off the middle; at most {MOST_IN_BOX} are drawn"
        )
    return count

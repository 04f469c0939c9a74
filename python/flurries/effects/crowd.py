"""The near flakes of a population, drawn one by one; or all of them, where the method says so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries.camera.lens import seen_at
from flurries.effects.boxes import crowd_of, room_of
from flurries.effects.drawing import (
    draw_numbered,
    draw_sorted,
    lens_of,
)
from flurries.effects.gusts import flakes_in_profile, flakes_in_waves
from flurries.effects.motion import Motion, Way
from flurries.effects.passes import Other
from flurries.effects.weather import Weather
from flurries.frame.layer import Shade
from flurries.frame.needs import Cost, LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.phase import Optics
from flurries.motion.keys import value_at
from flurries.particles.crowd import Crowd

# Metres beside the view that no box is as wide as.
_WHOLE_BOX = 1e9

# Places, radii, opacities, ways during the exposure and numbers of flakes.
Listed: TypeAlias = tuple[Float64, Float64, Float64, Float64, npt.NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class DrawnFlakes:
    """The flakes that are drawn.

    Attributes
    ----------
    weather : Weather
    """

    weather: Weather

    name = "flakes"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return their one step, or why there is none."""
        weather = self.weather
        if weather.population.density == 0.0 or weather.population.opacity == 0.0:
            return Needs((), (LeftOut("flakes", "there are none"),), most=0.0)
        still = frame.settled and weather.motion.still and 0.0 in weather.sway
        # Shapes tumble.
        shaped = weather.shape != "round"
        still = still and not shaped and not has_keys(weather.emission)
        most = min(1.0, amount * self.number_in_view(frame) * weather.population.opacity)
        step = Step("flakes", lambda: self._cost(frame, amount), still, most)
        return Needs((step,), most=most)

    def number_in_view(self, frame: Frame) -> float:
        """Return the number of flakes that are drawn in view, on average."""
        height, width = frame.shape
        focal = frame.camera.focal
        film = self.weather.film(frame)
        view = width * height / focal**2 / (3.0 * frame.camera.aspect)
        return view * sum(one.size.density * one.reach**3 for one in film.shares)

    @property
    def motion(self) -> Motion:
        """The motion of a flake of the mean size."""
        return self.weather.motion

    def alpha(self, frame: Frame, amount: float, way: Way) -> Array:
        """Return the opacity of the flakes over the window, (h, w) float32."""
        if frame.whole:
            near = self._numbered(frame, amount, way)[0]
        else:
            near = draw_sorted(frame, self.sort(frame, amount, way))
        if not self.weather.simulated:
            return near
        far = frame.once_each(self, "far", lambda: self._exact(frame.around, amount))
        both = np.empty_like(near)
        _core.join(both, [near, frame.part_of(far)], 0.0)
        return both

    def lit(
        self,
        frame: Frame,
        amount: float,
        way: Way,
        optics: Optics,
        behind: tuple[Array, Shade] | None,
    ) -> tuple[Array, Array]:
        """Return opacity and light of the flakes under the frame's lamps, (h, w) and (h, w, 3).

        The light of what lies behind them, an opacity and its colors, is added to theirs.
        """
        top, bottom, left, right = frame.window
        near = np.empty((bottom - top, right - left), np.float32)
        glow = np.empty((*near.shape, 3), np.float32)
        flakes = self.sort(frame, amount, way)
        lamps = frame.lamps()
        under = None if behind is None else (behind[0], behind[1].given())
        window, depth = frame.window, frame.depth
        _core.particle_draw_lit(near, glow, flakes, window, lamps, optics, depth, under)
        return near, glow

    def sort(self, frame: Frame, amount: float, way: Way) -> SortedFlakes:
        """Return the near flakes, to be drawn in any band of the frame."""
        if frame.shared is None:
            return self._sort(frame, amount)
        frame = frame.around
        assert frame.shared is not None
        if len(frame.shared.cameras) == 2 and self._alike:
            both = frame.once(self, "flakes", lambda: self._sort_pair(frame, amount))
            return both[frame.eye]
        return frame.once_each(self, "flakes", lambda: self._sort(frame, amount))

    @property
    def _alike(self) -> bool:
        return self.weather.motion.varied is None

    def _sort(self, frame: Frame, amount: float) -> SortedFlakes:
        crowd = crowd_of(self.weather, frame, amount)
        if self._alike:
            return _core.crowd_sort(frame.shape, crowd)
        rows = self._listed(frame, amount)
        points, radius, opacity, way = (np.ascontiguousarray(part) for part in rows[:4])
        return _core.particle_sort_listed(
            frame.shape, (points, radius, opacity, way, 1.0), crowd.lens, crowd.closeup, rows[4]
        )

    def _sort_pair(self, frame: Frame, amount: float) -> tuple[SortedFlakes, SortedFlakes]:
        assert frame.shared is not None
        left, right = frame.shared.cameras
        crowd = crowd_of(self.weather, replace(frame, camera=left), amount)
        return _core.crowd_sort_pair(frame.shape, crowd, lens_of(right, frame.shape))

    def _exact(self, frame: Frame, amount: float) -> Array:
        """Return the opacity of what the texture would stand for, flake by flake, (h, w)."""
        top, bottom, left, right = frame.window
        result = np.empty((bottom - top, right - left), np.float32)
        depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
        if self._alike:
            _core.crowd_exact(result, crowd_of(self.weather, frame, amount, beyond=True), depth)
            return result
        rows = self.listed(frame, amount, beyond=True)
        points, radius, opacity, travel = (np.ascontiguousarray(part) for part in rows[:4])
        given, lens = (points, radius, opacity, travel, 1.0), lens_of(frame.camera, frame.shape)
        _core.particle_exact(result, given, lens, (top, left), depth)
        return result

    def listed(self, frame: Frame, amount: float, *, beyond: bool = False) -> Listed:
        """Return places in the eye's axes, radii, opacities, ways while exposed, and numbers.

        Everything is as much higher as pixels are. Of the near flakes, or of those `beyond`.
        """
        crowd = crowd_of(self.weather, frame, amount, beyond=beyond)
        motion = self.weather.motion
        profile = motion.varied is not None and motion.varied.profile is not None
        # A profile carries flakes into view from anywhere in the box.
        asked = crowd._replace(room=_WHOLE_BOX) if profile else crowd
        rows = _core.crowd_list(asked).reshape(-1, 9)
        if profile:
            rows = self._in_profile(frame, crowd, rows)
        points, way = rows[:, :3], rows[:, 5:8]
        if motion.varied is not None and motion.varied.waves is not None and len(rows):
            stretch = np.array([1.0, frame.camera.aspect, 1.0])
            moved, rate = flakes_in_waves(motion, frame, np.ascontiguousarray(points / stretch))
            points = points + moved * stretch
            way = way + value_at(motion.shutter, frame.t) * rate * stretch
        return points, rows[:, 3], rows[:, 4], way, rows[:, 8].astype(np.int64)

    def _in_profile(self, frame: Frame, crowd: Crowd, rows: Float64) -> Float64:
        """Return the rows of flakes that may be seen, carried by a profile and wrapped again."""
        exposure = value_at(self.weather.motion.shutter, frame.t)
        stretch = np.array([1.0, frame.camera.aspect, 1.0])
        shares = self.weather.film(frame).shares
        # Boxes that hold nothing have no rows and no numbers.
        ends = np.cumsum([box.number for box in crowd.boxes])
        kept = []
        motions = [share.motion for share in shares]
        if len(crowd.boxes) < len(shares):
            motions = [share.motion for share in shares if share.reach < self.weather.far]
        for box, end, motion in zip(crowd.boxes, ends, motions, strict=True):
            own = rows[(rows[:, 8] >= end - box.number) & (rows[:, 8] < end)]
            if not len(own):
                continue
            moved, rate = flakes_in_profile(motion, frame, np.ascontiguousarray(own[:, 2]))
            for axis in range(2):
                side, middle = box.sides[axis] * stretch[axis], box.center[axis] * stretch[axis]
                place = own[:, axis] + moved[:, axis] * stretch[axis] - middle
                own[:, axis] = middle + place - side * np.floor(place / side + 0.5)
            own[:, 5:8] += exposure * rate * stretch
            kept.append(own)
        found = np.concatenate([rows[:0], *kept])
        # As the kernel leaves out what cannot be seen.
        height, width = frame.shape
        focal, cx, cy, offset, _ = crowd.lens
        room = crowd.room + self.weather.sway[0] + 2.0 * self.weather.population.sizes.largest
        room += exposure * float(np.abs(found[:, 5:8]).sum(axis=1).max(initial=0.0))
        halves = max(cx, width - cx), max(cy, height - cy)
        beside = [
            np.abs(found[:, axis] - offset[axis]) < half / focal * found[:, 2] + room
            for axis, half in enumerate(halves)
        ]
        return np.asarray(found[beside[0] & beside[1]])

    def ids(self, frame: Frame, amount: float, way: Way) -> npt.NDArray[np.int32]:
        """Return the number of the flake that each pixel of the window shows, (h, w); -1 for none.

        Its number is the same in every frame.
        """
        return self._numbered(frame, amount, way)[1]

    def _numbered(self, frame: Frame, amount: float, way: Way) -> tuple[Array, Array]:
        def make() -> tuple[Array, Array]:
            known = None if self._alike else self._listed(frame, amount)[4]
            return draw_numbered(frame, self.sort(frame, amount, way), known)

        # One frame is asked for twice where something stands in the air, with two depths.
        return frame.once_each(self, f"numbered before {id(frame.depth)}", make)

    def _listed(self, frame: Frame, amount: float) -> Listed:
        return frame.once_each(self, "listed", lambda: self.listed(frame, amount))

    def passes(
        self, frame: Frame, amount: float, way: Way, others: Sequence[Other], numbers: Array
    ) -> tuple[list[Array], Array]:
        """Return motions to other frames (n, 2) and depth (n,) of flakes by their numbers."""
        points, _, _, travel, known = self._listed(frame, amount)
        stretch = np.array([1.0, frame.camera.aspect, 1.0])
        at = np.minimum(np.searchsorted(known, numbers), max(len(known) - 1, 0))
        points, travel = points[at] / stretch, travel[at] / stretch
        exposure = value_at(self.weather.motion.shutter, frame.t)
        start, depth = seen_at(points - frame.camera.offset, frame.camera, frame.shape)
        resting = np.broadcast_to(-way.rate, points.shape)
        speed = travel / exposure if exposure > 0.0 else resting
        motions = []
        for other, _ in others:
            moved = points + (other.t - frame.t) * speed - other.camera.offset
            end, _ = seen_at(moved, other.camera, other.shape)
            motions.append((end - start).astype(np.float32))
        return motions, depth.astype(np.float32)

    def _cost(self, frame: Frame, amount: float) -> Cost:
        placed = 0.0
        for share in self.weather.film(frame).shares:
            room = room_of(self.weather, frame.shape, frame.path, share.end)
            placed += share.size.density * math.prod(room.sides)
        drawn = amount * self.number_in_view(frame)
        name = "streak" if value_at(self.weather.motion.shutter, frame.t) > 0.0 else "disc"
        top, bottom, left, right = frame.window
        plane = (bottom - top) * (right - left)
        work = {
            "flake placed": placed * amount,
            name: drawn,
            f"{name} run": 12.0 * drawn,
            "mask pixel": float(frame.shape[0] * frame.shape[1]),
        }
        out = (LeftOut(f"{name} out of view", f"some {placed - drawn:.0f} of {placed:.0f}"),)
        return Cost(work, f"{drawn:.0f} {name}", 4 * plane, 0, out)

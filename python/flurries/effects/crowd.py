"""The near flakes of a population, drawn one by one; or all of them, where the method says so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries.camera.lens import seen_at
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.effects.drawing import (
    MOST_IN_BOX,
    draw_numbered,
    draw_sorted,
    gust_room,
    lens_of,
    sight_of,
    triple,
)
from flurries.effects.gusts import flakes_in_profile, flakes_in_waves
from flurries.effects.motion import Motion, Way
from flurries.effects.passes import Other
from flurries.effects.weather import FAR_FADE, HEIGHTS, NEAR_FADE, Film, Share, Weather
from flurries.frame.layer import Shade
from flurries.frame.needs import Cost, LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.phase import Optics
from flurries.motion.keys import value_at
from flurries.particles.crowd import Box, Closeup, Crowd, Triple

# What a class adds to the seed: boxes of one population must not be copies of each other.
_CLASS = 0x632BE59BD9B4E019
_BEYOND = 0x2545F4914F6CDD1D

# The widest angle between the axis and what a lens that turns may see of a box is in its ball.
_MARGIN = 0.3

# Sigma of a flake's image in px between which it gets a shape: below, no shape can be told.
SWITCH = (2.5, 3.5)

# Metres beside the view that no box is as wide as.
_WHOLE_BOX = 1e9

# Places, radii, opacities, ways during the exposure and numbers of flakes.
Listed: TypeAlias = tuple[Float64, Float64, Float64, Float64, npt.NDArray[np.int64]]


class Room(NamedTuple):
    """The box that holds what a film sees up to a depth.

    Attributes
    ----------
    sides : (3,)
        Metres; of a camera that turns a cube.
    middle : float
        Distance of its centre ahead, metres.
    """

    sides: tuple[float, float, float]
    middle: float


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
        """Return how many flakes are drawn in view, on average."""
        height, width = frame.shape
        focal = frame.camera.focal
        film = self.weather.film(frame)
        view = width * height / focal**2 / (3.0 * frame.camera.aspect)
        return view * sum(one.size.density * one.reach**3 for one in film.shares)

    @property
    def motion(self) -> Motion:
        """What moves a flake of the mean size."""
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

    def closeup(self, frame: Frame) -> Closeup | None:
        """Return how flakes look from near; None where all are sharp round dots."""
        blur = frame.blur
        if self.weather.shape == "round" and blur is None:
            return None
        seconds = frame.t / frame.fps
        return Closeup(self.weather.shape, SWITCH, blur, frame.seed, seconds)

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
        crowd = self.crowd(frame, amount)
        if self._alike:
            return _core.crowd_sort(frame.shape, crowd)
        rows = self._listed(frame, amount)
        points, radius, opacity, way = (np.ascontiguousarray(part) for part in rows[:4])
        return _core.particle_sort_listed(
            frame.shape, points, radius, opacity, way, 1.0, crowd.lens, crowd.closeup, rows[4]
        )

    def _sort_pair(self, frame: Frame, amount: float) -> tuple[SortedFlakes, SortedFlakes]:
        assert frame.shared is not None
        left, right = frame.shared.cameras
        crowd = self.crowd(replace(frame, camera=left), amount)
        return _core.crowd_sort_pair(frame.shape, crowd, lens_of(right, frame.shape))

    def _exact(self, frame: Frame, amount: float) -> Array:
        """Return the opacity of what the texture would stand for, flake by flake, (h, w)."""
        top, bottom, left, right = frame.window
        result = np.empty((bottom - top, right - left), np.float32)
        depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
        if self._alike:
            _core.crowd_exact(result, self.crowd(frame, amount, beyond=True), depth)
            return result
        rows = self.listed(frame, amount, beyond=True)
        points, radius, opacity, travel = (np.ascontiguousarray(part) for part in rows[:4])
        lens = lens_of(frame.camera, frame.shape)
        _core.particle_exact(result, points, radius, opacity, travel, 1.0, lens, (top, left), depth)
        return result

    def crowd(self, frame: Frame, amount: float, *, beyond: bool = False) -> Crowd:
        """Return the flakes before the frame's camera; `beyond` those behind the near ones."""
        weather, path, camera = self.weather, frame.path, frame.camera
        film = weather.film(frame)
        exposure = value_at(weather.motion.shutter, frame.t)
        stretch = np.diag([1.0, camera.aspect, 1.0])
        axes = camera.matrix()
        turn = stretch @ (axes.T if path.turns else np.eye(3))
        spin, zoom = frame.spin(), path.zoom(frame.t)[1]
        spread = -np.array(
            [[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]]
        ) + zoom * np.diag([1.0, 1.0, 0.0])
        spread = exposure * stretch @ spread @ np.linalg.inv(stretch)
        deepest = weather.far * (1.0 + FAR_FADE) if beyond else max(s.end for s in film.shares)
        down = np.array([0.0, 1.0, 0.0])
        boxes = []
        most = 0.0
        for index, share in enumerate(film.shares):
            box, travel = self._box(frame, film, share, index, amount, exposure, stretch, beyond)
            if box is not None:
                boxes.append(box)
                most = max(most, travel)
        most += float(np.abs(spread).sum()) * deepest
        waves = None if weather.motion.varied is None else weather.motion.varied.waves
        blur = frame.blur
        if blur is not None:
            # As far as a flake out of focus reaches, at its own depth.
            near = max(weather.near, 1e-3)
            widest = max(depth * blur.circle(depth) for depth in (near, deepest))
            most += 0.75 * widest / frame.camera.focal
        room = most if waves is None else most + 3.0 * waves.spread()
        return Crowd(
            boxes=boxes,
            opacity=weather.population.opacity,
            turn=_rows3(turn),
            spread=_rows3(spread),
            down=triple(down if path.turns else down @ axes),
            heights=(-deepest, deepest),
            room=room,
            lens=lens_of(camera, frame.shape),
            window=frame.window,
            closeup=None if beyond else self.closeup(frame),
        )

    def _box(
        self,
        frame: Frame,
        film: Film,
        share: Share,
        index: int,
        amount: float,
        exposure: float,
        stretch: Float64,
        beyond: bool,
    ) -> tuple[Box | None, float]:
        weather, path = self.weather, frame.path
        all_drawn = share.reach >= weather.far
        last = (weather.far * (1.0 - FAR_FADE), weather.far * (1.0 + FAR_FADE))
        near = (weather.near, weather.near * NEAR_FADE)
        if beyond:
            if all_drawn:
                return None, 0.0
            shown = (share.end, share.end, *last)
        elif all_drawn:
            shown = (*near, *last)
        elif weather.simulated:
            shown = (*near, share.end, share.end)
        else:
            shown = (*near, share.reach, share.end)
        room = _room(self, frame.shape, path, shown[3])
        volume = math.prod(room.sides)
        wanted = share.size.density * volume
        count = max(math.ceil(wanted), 1)
        if count > MOST_IN_BOX:
            raise ValueError(
                f"density: {weather.population.density:g} per m3 are {count} in the box that holds "
                f"the view up to {shown[3]:.3g} m; at most {MOST_IN_BOX} are drawn"
            )
        moved, rate = path.relative(
            frame.t, fps=frame.fps, fall=share.motion.fall, wind=share.motion.mean_wind
        )
        axes = frame.camera.matrix()
        rotation = (0.0, 0.0, 0.0) if path.turns else frame.camera.rotation
        center = np.array([0.0, 0.0, room.middle])
        travel = -exposure * stretch @ (rate @ axes)
        heights = np.linspace(-shown[3], shown[3], HEIGHTS)
        if weather.steady:
            heights = heights[:1]
        amounts = weather.amounts(frame, share, amount, heights) * (wanted / count)
        seed = frame.seed ^ (_CLASS * (index + 1) & (2**63 - 1)) ^ (_BEYOND if beyond else 0)
        box = Box(
            number=count,
            sides=room.sides,
            center=triple(axes @ center if path.turns else center),
            seed=seed,
            way=triple(-moved if path.turns else -moved @ axes),
            order=_order(share.motion, path, frame.fps, rotation, room.sides),
            sway=(weather.sway[0], weather.sway[1] * frame.t / frame.fps),
            travel=triple(travel),
            sizes=(share.size.smallest, share.size.largest),
            slope=weather.population.sizes.slope,
            shown=shown,
            amounts=amounts.tolist(),
        )
        return box, float(np.linalg.norm(travel))

    def listed(self, frame: Frame, amount: float, *, beyond: bool = False) -> Listed:
        """Return places in the eye's axes, radii, opacities, ways while exposed, and numbers.

        Everything is as much higher as pixels are. Of the near flakes, or of those `beyond`.
        """
        crowd = self.crowd(frame, amount, beyond=beyond)
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
        """Return which flake each pixel of the window shows, (h, w); -1 for none.

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
            room = _room(self, frame.shape, frame.path, share.end)
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


@lru_cache(maxsize=256)
def _room(drawn: DrawnFlakes, shape: tuple[int, int], path: CameraPath, depth: float) -> Room:
    """Return the box of what a film sees up to a depth: nothing of its walls is ever seen."""
    # With room for the distance of two eyes.
    across, down, ball = sight_of(path, shape, depth)
    room = gust_room(drawn.weather.motion)
    room += _MARGIN + drawn.weather.sway[0] + drawn.weather.population.sizes.largest
    if path.turns:
        side = 2.0 * (ball + room)
        return Room((side, side, side), min(ball, depth))
    return Room((across + 2.0 * room, down + 2.0 * room, depth), 0.5 * depth)


@lru_cache(maxsize=256)
def _order(
    motion: Motion, path: CameraPath, fps: float, rotation: Triple, sides: Triple
) -> tuple[int, int, int]:
    """Return the axes of a box, that which the air of frame 0 passes in the least time first."""
    _, rate = path.relative(0.0, fps=fps, fall=motion.fall, wind=motion.mean_wind)
    share = np.abs(rate @ rotation_matrix(rotation)) / sides
    first, second, third = sorted((1, 0, 2), key=lambda axis: -share[axis])
    return first, second, third


def _rows3(matrix: Float64) -> Any:
    return tuple(triple(row) for row in matrix)

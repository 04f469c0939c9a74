"""Flakes and drops: many points in a box that goes with the camera, seen through its lens."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import particles, trace
from flurries._contract import Array, Float64
from flurries._core import (
    SortedFlakes,
    particle_draw,
    particle_sort,
    particle_sort_listed,
    particle_sort_pair,
    uniform,
)
from flurries.camera.lens import Camera
from flurries.effects.moving import profile_of_flakes, waves_of_flakes
from flurries.effects.textured import Textured
from flurries.frame.layer import Frame
from flurries.motion.keys import value_at
from flurries.motion.wind import Wind
from flurries.particles.splatting import settled

# Streams of counter-based numbers; the flakes' places and sway have their own in the kernel.
SIZES = 101

# Over this share of the flakes the last one fades in while `amount` rises, so that none pops.
FADE_IN = 0.1

# The share of a box in which flakes are shown in full; beyond they fade to its walls.
SHOWN = 0.85

# Nothing nearer than this is drawn, metres; what `particles.splat` has for a default.
NEAR = 0.1

# What the most flakes in view need behind a centred lens; a small scene must not ask for more work.
MOST_IN_BOX = 420_000_000


class Population(NamedTuple):
    """The flakes of an effect at one time.

    Attributes
    ----------
    name : str
        What the effect calls their number.
    number : int
        How many are in view.
    reach : float
        Depth up to which they are drawn, metres.
    sizes : (smallest, largest)
        Diameters, metres.
    opacity : float
        Of a resting one's middle.
    sway : (amplitude, rate)
        Metres, and radians per second.
    density : float, optional
        Per cubic metre, in place of the number in view.
    """

    name: str
    number: int
    reach: float
    sizes: tuple[float, float]
    opacity: float
    sway: tuple[float, float]
    density: float | None = None

    @property
    def empty(self) -> bool:
        """Whether there are none."""
        return (self.number if self.density is None else self.density) == 0


Triple = tuple[float, float, float]


class Flurry(NamedTuple):
    """A box of flakes that all move alike, settled; the kernel reads its fields by name.

    Attributes
    ----------
    number : int
        Flakes in the box.
    sides, center : (3,)
        The box in the eye's axes, metres.
    seed : int
        Of places, sway and sizes.
    way, travel : (3,)
        Metres since frame 0, and during the exposure.
    sway : (amplitude, angle)
        Metres, radians.
    radius : (smallest, largest)
        Metres.
    opacity, amount, fade_in : float
        Of a flake's middle; the share of flakes that is there; over which the last ones fade in.
    largest : (low, high)
        Sigma in pixels from which flakes fade, and at which they are gone.
    sizes : int
        Stream of the numbers that their sizes are.
    lens : (focal, cx, cy, offset, near)
        See :class:`flurries.Camera`.
    window : (top, bottom, left, right)
        Pixels; the rest of the frame may lack flakes.
    """

    number: int
    sides: Triple
    center: Triple
    seed: int
    way: Triple
    sway: tuple[float, float]
    travel: Triple
    radius: tuple[float, float]
    opacity: float
    amount: float
    fade_in: float
    largest: tuple[float, float]
    sizes: int
    lens: tuple[float, float, float, Triple, float]
    window: tuple[int, int, int, int]


def triple(values: Float64) -> Triple:
    """Return three numbers."""
    x, y, z = values.tolist()
    return x, y, z


@dataclass(frozen=True, kw_only=True)
class Peopled(Textured, ABC):
    """A texture with particles in front."""

    # Flakes larger than this on a picture 1024 px wide fade out: out-of-focus puffs look like dirt.
    _LARGEST_SIGMA = (3.5, 6.0)

    @abstractmethod
    def population(self, t: float) -> Population:
        """Return what is drawn one by one at `t`."""

    def box(self, frame: Frame) -> Float64:
        """Return the sides in metres of the box of flakes that the view fits into.

        Along the camera's axes; for a camera that turns along those of the house, a cube that holds
        the view however it is turned. Gusts get room aside.
        """
        reach = self.population(frame.t).reach
        across, down = self._wide(frame)
        room = self._room()
        if frame.path.turns:
            return np.full(3, 2.0 * self._ball(frame) / SHOWN + 2.0 * room)
        # The outer 15 % of the box fade; the view's far corners stay inside of that.
        return np.array([across / SHOWN + 2.0 * room, down / SHOWN + 2.0 * room, reach])

    def _room(self) -> float:
        """Return how far gusts carry flakes aside, with few exceptions, metres.

        One that is carried farther is missed at the view's border; none ever jumps, since flakes
        are faded out where the box wraps.
        """
        if not isinstance(self.wind, Wind) or self.wind.waves is None:
            return 0.0
        return 1.5 * self.wind.waves.spread()

    def _wide(self, frame: Frame) -> tuple[float, float]:
        """Return the view's width and height at the far end, metres, as if the lens were centred.

        The path's camera counts, so that both eyes see the same flakes; and the farther side of a
        lens that is off the middle, since the box is centred on the axis.
        """
        height, width = frame.shape
        lens = frame.path.widest
        cx, cy = lens.principal(frame.shape)
        across, down = (2.0 * max(c, n - c) for c, n in ((cx, width), (cy, height)))
        fx, fy = (self.population(frame.t).reach / focal for focal in lens.focals)
        return across * fx, down * fy

    def _ball(self, frame: Frame) -> float:
        """Return the radius of the ball through the eye and the view's far corners, metres.

        Its centre lies on the axis at the same distance from the eye, or in the middle of the far
        end where the view is wider than deep.
        """
        across, down = self._wide(frame)
        reach = self.population(frame.t).reach
        corner = 0.25 * (across**2 + down**2)
        return max(0.5 * (reach + corner / reach), math.sqrt(corner))

    def count(self, frame: Frame) -> int:
        """Return how many flakes the box holds, so that the view has as many as were asked for."""
        kind = self.population(frame.t)
        each = kind.number / self._view(frame) if kind.density is None else kind.density
        count = round(each * float(np.prod(self.box(frame))))
        if count > MOST_IN_BOX:
            given = f"{kind.number} in view" if kind.density is None else f"{kind.density:g} per m3"
            raise ValueError(
                f"{kind.name}: {given} are {count} in the box around a lens whose "
                f"center is so far off the middle; at most {MOST_IN_BOX} are drawn"
            )
        return count

    def number_in_view(self, frame: Frame) -> float:
        """Return how many flakes are in view."""
        kind = self.population(frame.t)
        return kind.number if kind.density is None else kind.density * self._view(frame)

    def _view(self, frame: Frame) -> float:
        """Return the volume that the view fills up to the far end, cubic metres."""
        reach = self.population(frame.t).reach
        height, width = frame.shape
        fx, fy = (reach / focal for focal in frame.path.widest.focals)
        # The view is a pyramid: a third of the prism around it.
        return width * fx * height * fy * reach / 3.0

    def places(self, frame: Frame) -> tuple[Float64, Float64, Float64]:
        """Return where the flakes of a frame are, how fast, and how much they show.

        Returns
        -------
        points, velocity : (n, 3)
            Metres and metres per frame in the eye's axes, from the camera. In gusts only those that
            may be in view.
        shown : (n,)
            0 at the walls of the box, 1 inside.
        """
        points, velocity, shown, _ = self._placed(frame)
        return points, np.broadcast_to(velocity, points.shape), shown

    def _placed(self, frame: Frame) -> tuple[Float64, Float64, Float64, Any]:
        """Return the same with one velocity for all where it is one, and which flakes they are."""
        kind, count, box = self.population(frame.t), self.count(frame), self.box(frame)
        # The way is known as a whole, so it is the velocity of one unit of time, and the swing's
        # angle of now is its rate.
        swing = (kind.sway[0], kind.sway[1] * frame.t / frame.fps)
        ahead = np.array([0.0, 0.0, 0.5 * kind.reach])
        turns = frame.path.turns
        way = -self.displacement(frame) if turns else -frame.to_camera(self.displacement(frame))
        velocity = np.broadcast_to(-frame.to_camera(self.velocity(frame)), (1, 3))
        # Flakes stay in axes that do not turn; the box goes round with the view inside.
        middle = frame.camera.matrix() @ (0.0, 0.0, min(self._ball(frame), kind.reach))
        middle = middle if turns else ahead

        def placed(way: Float64) -> Float64:
            return particles.positions(
                count, box, seed=frame.seed, velocity=way, time=1.0, center=middle, sway=swing
            )

        points = placed(way)
        which: Any = slice(None)
        wind = self.wind if isinstance(self.wind, Wind) else None
        if wind is not None and wind.profile is not None and count:
            moved, rate = profile_of_flakes(self, frame, points[:, 2])
            points, velocity = placed(way + moved), velocity + rate
        shown = particles.edge_fade(points, box, center=middle)
        if turns:
            points = frame.to_camera(points)
            # The far end fades as in the box of a camera that does not turn.
            deep = (1e3 * kind.reach, 1e3 * kind.reach, kind.reach)
            shown = shown * particles.edge_fade(points, deep, center=ahead)
        if wind is not None and wind.waves is not None and count:
            # Only those that may come into view are worth their waves.
            near = self._in_view(frame, points, 3.0 * wind.waves.spread())
            which, points, shown = near, points[near], shown[near]
            moved, rate = waves_of_flakes(self, frame, points)
            velocity = velocity[near] if len(velocity) > 1 else velocity
            points, velocity = points + moved, velocity + rate
        if turns:
            velocity = velocity - np.cross(frame.spin(), points)
        if frame.path.zooms:
            # What is aside goes outwards as if it moved.
            velocity = velocity + frame.path.zoom(frame.t)[1] * points * (1.0, 1.0, 0.0)
        return points, velocity, shown, which

    def _in_view(self, frame: Frame, points: Float64, room: float) -> npt.NDArray[np.intp]:
        """Return which points are in view or at most so many metres beside it."""
        camera, reach = frame.camera, self.population(frame.t).reach
        cx, cy = camera.principal(frame.shape)
        x, y, z = (points - camera.offset).T
        deep = np.maximum(z + room, 0.0) / camera.focal
        height, width = frame.shape
        inside = (z > -room) & (z < reach + room)
        inside &= (x > -cx * deep - room) & (x < (width - cx) * deep + room)
        deep = deep / camera.aspect
        inside &= (y > -cy * deep - room) & (y < (height - cy) * deep + room)
        return np.flatnonzero(inside)

    def particles(self, frame: Frame, amount: float) -> Array:
        """Return the alpha of the flakes over the window, (h, w) float32."""
        return self._drawn(frame, self.sorted(frame, amount))

    @staticmethod
    def _drawn(frame: Frame, flakes: SortedFlakes) -> Array:
        top, bottom, left, right = frame.window
        result = np.empty((bottom - top, right - left), np.float32)
        particle_draw(result, flakes, frame.window, frame.depth)
        return result

    def sorted(self, frame: Frame, amount: float) -> SortedFlakes:
        """Return the flakes, to be drawn in any band of the frame."""
        frame, alike = frame.around, self.alike(frame)
        if frame.shared is not None and alike and len(frame.shared.cameras) == 2:
            both = frame.once(self, "flakes", lambda: self._flurry_pair(frame, amount))
            return both[frame.eye]
        sort = self._flurry if alike else self._listed
        return frame.once_each(self, "flakes", lambda: sort(frame, amount))

    def alike(self, frame: Frame) -> bool:
        """Whether all flakes move alike."""
        wind = self.wind if isinstance(self.wind, Wind) else None
        alike = wind is None or wind.uniform
        return alike and not (frame.path.turns or frame.path.zooms)

    def _listed(self, frame: Frame, amount: float) -> SortedFlakes:
        """Return the flakes from arrays of their places: any wind, any camera."""
        flakes, _ = self._to_draw(frame, amount)
        given, _ = settled(near=NEAR, **{**flakes, "depth": None})
        return particle_sort_listed(frame.shape, *given[:-1])

    def ids(self, frame: Frame, amount: float) -> npt.NDArray[np.int32]:
        """Return which flake each pixel of the whole frame shows, (H, W); -1 for none.

        Its number in the box is the same in every frame.
        """
        flakes, numbers = self._to_draw(frame, amount)
        return np.append(numbers, -1).astype(np.int32)[particles.ids(**flakes)]

    def placed(
        self, frame: Frame, numbers: npt.NDArray[Any]
    ) -> tuple[Float64, Float64, npt.NDArray[np.bool_]]:
        """Return where flakes with these numbers are, how fast, and whether they may be in view."""
        points, velocity, _, which = self._placed(frame)
        known = np.arange(len(points)) if isinstance(which, slice) else which
        at = np.minimum(np.searchsorted(known, numbers), max(len(known) - 1, 0))
        if len(known) == 0:
            return np.zeros((len(numbers), 3)), np.zeros((len(numbers), 3)), numbers < 0
        speeds = np.broadcast_to(velocity, points.shape)
        return points[at], speeds[at], known[at] == numbers

    def _to_draw(self, frame: Frame, amount: float) -> tuple[dict[str, Any], npt.NDArray[np.intp]]:
        """Return the flakes to draw, and their numbers in the box."""
        t, camera = frame.t, frame.camera
        kind = self.population(t)
        points, velocity, shown, which = self._placed(frame)
        exposure = value_at(self.shutter, t)
        near = in_view(frame, points, velocity, exposure, 0.5 * kind.sizes[1])
        inside = np.flatnonzero(near & (shown > 0.0))
        points, shown = points[inside], shown[inside]
        velocity = velocity if len(velocity) == 1 else velocity[inside]
        inside = inside if isinstance(which, slice) else which[inside]
        count = self.count(frame)
        sizes = np.empty(count)
        uniform(sizes, frame.seed, SIZES)
        rank = (inside + 0.5) / count
        radius = 0.5 * (kind.sizes[0] + sizes[inside] * (kind.sizes[1] - kind.sizes[0]))
        weight = np.clip((amount - rank * (1.0 - FADE_IN)) / FADE_IN, 0.0, 1.0) * shown
        low, high = (limit * frame.width_scale for limit in self._LARGEST_SIGMA)
        sigma = camera.focal * radius / (3.0 * np.maximum(points[:, 2], 1e-6))
        part = np.clip((sigma - low) / (high - low), 0.0, 1.0)
        weight *= 1.0 - part * part * (3.0 - 2.0 * part)
        seen = weight > 0.0
        trace.count("particles", int(seen.sum()))
        flakes = {
            "shape": frame.shape,
            "points": points[seen],
            "radius": radius[seen],
            "camera": camera,
            "opacity": weight[seen] * kind.opacity,
            "velocity": velocity[0] if len(velocity) == 1 else velocity[seen],
            "shutter": exposure,
            "depth": frame.depth,
        }
        return flakes, inside[seen]

    def _flurry(self, frame: Frame, amount: float) -> SortedFlakes:
        """Return the same where all flakes move alike, without arrays of them."""
        return particle_sort(frame.shape, self._request(frame, amount))

    def _flurry_pair(self, frame: Frame, amount: float) -> tuple[SortedFlakes, SortedFlakes]:
        """Return what two eyes see, each flake placed once."""
        assert frame.shared is not None
        left, right = frame.shared.cameras
        asked = self._request(replace(frame, camera=left), amount)
        return particle_sort_pair(frame.shape, asked, self._lens(frame, right))

    def _lens(self, frame: Frame, camera: Camera) -> tuple[float, float, float, Triple, float]:
        """Return a camera as the kernel takes it."""
        x, y = camera.principal(frame.shape)
        # Everything is as much higher as pixels are.
        stretch = np.array([1.0, camera.aspect, 1.0])
        return (camera.focal, x, y, triple(stretch * camera.offset), NEAR)

    def _request(self, frame: Frame, amount: float) -> Flurry:
        """Return the box of flakes before the frame's camera."""
        t, camera, kind = frame.t, frame.camera, self.population(frame.t)
        low, high = (limit * frame.width_scale for limit in self._LARGEST_SIGMA)
        velocity = -frame.to_camera(self.velocity(frame))
        stretch = np.array([1.0, camera.aspect, 1.0])
        return Flurry(
            number=self.count(frame),
            sides=triple(stretch * self.box(frame)),
            center=(0.0, 0.0, 0.5 * kind.reach),
            seed=frame.seed,
            way=triple(-stretch * frame.to_camera(self.displacement(frame))),
            sway=(kind.sway[0], kind.sway[1] * t / frame.fps),
            travel=triple(value_at(self.shutter, t) * stretch * velocity),
            radius=(0.5 * kind.sizes[0], 0.5 * kind.sizes[1]),
            opacity=kind.opacity,
            amount=amount,
            fade_in=FADE_IN,
            largest=(low, high),
            sizes=SIZES,
            lens=self._lens(frame, camera),
            window=frame.window,
        )


def in_view(
    frame: Frame, points: Float64, velocity: Float64, shutter: float, radius: float
) -> npt.NDArray[np.bool_]:
    """Return which flakes may touch the frame's window during the exposure, (n,) bool.

    With f x + (c - left) z + R > 0 for the left side, and so on: linear in the place, so that a
    path whose two ends fail fails everywhere, clipped at the near plane or not. R holds a flake of
    `radius` up to where it ends, 4 sigma_e, and is never too small: sigma_e is at most sigma + 0.62
    px, and sigma that of at least half the depth.
    """
    camera = frame.camera
    cx, cy = camera.principal(frame.shape)
    top, bottom, left, right = frame.window
    f = camera.focal
    sides = (
        (0, f, cx - left + 3.1),
        (0, -f, right - cx + 3.1),
        (1, f * camera.aspect, cy - top + 3.1),
        (1, -f * camera.aspect, bottom - cy + 3.1),
    )
    # Columns by themselves: a matrix product of three terms wakes the threads of BLAS.
    place = [np.ascontiguousarray(points[:, axis]) - camera.offset[axis] for axis in range(3)]
    half = 0.5 * shutter * velocity.T
    inside = place[2] + np.abs(half[2]) > 0.0
    room = 10.0 * f * radius / 3.0
    for axis, along, deep in sides:
        reach = along * place[axis]
        reach += deep * place[2]
        reach += room + np.abs(along * half[axis] + deep * half[2])
        inside &= reach > 0.0
    return np.asarray(inside)

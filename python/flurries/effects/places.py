"""Where flakes are, how fast they go, and which are drawn: as arrays, for any wind and camera."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import trace
from flurries._contract import Float64
from flurries._core import particle_edge_fade, particle_positions, uniform
from flurries.effects.gusts import flakes_in_profile, flakes_in_waves
from flurries.effects.motion import Motion, Way
from flurries.frame.view import Frame
from flurries.particles.looks import presence, size_fade

# The stream of counter-based numbers; the flakes' places and sway have their own in the kernel.
SIZES = 101

# The share of a box in which flakes are shown in full; beyond they fade to its walls.
SHOWN = 0.85


# Over this share of the flakes the last one fades in while the amount rises, so that none pops.
FADE_IN = 0.1


class Places(NamedTuple):
    """The flakes of a box in the eye's axes, from the camera.

    Attributes
    ----------
    points : (n, 3)
        Metres. In gusts only those that may be in view.
    velocity : (1, 3) or (n, 3)
        Metres per frame, flake minus camera; one for all where it is one.
    shown : (n,)
        0 at the walls of the box, 1 inside.
    which : (n,) int or None
        Their numbers in the box; None where all are there.
    """

    points: Float64
    velocity: Float64
    shown: Float64
    which: npt.NDArray[np.intp] | None

    def of(self, numbers: npt.NDArray[Any]) -> tuple[Float64, Float64, npt.NDArray[np.bool_]]:
        """Return points and velocities of flakes by number, and whether they may be in view."""
        if len(self.points) == 0:
            return np.zeros((len(numbers), 3)), np.zeros((len(numbers), 3)), numbers < 0
        if self.which is numbers:
            # They were placed for this question.
            whole = np.broadcast_to(self.velocity, self.points.shape)
            return self.points, whole, np.ones(len(numbers), bool)
        known = np.arange(len(self.points)) if self.which is None else self.which
        at = np.minimum(np.searchsorted(known, numbers), len(known) - 1)
        speeds = np.broadcast_to(self.velocity, self.points.shape)
        return self.points[at], speeds[at], known[at] == numbers


class Listed(NamedTuple):
    """The flakes to draw.

    Attributes
    ----------
    points : (n, 3)
        Metres, eye's axes.
    radius : (n,)
        Metres.
    weight : (n,)
        How much each shows, above 0.
    velocity : (1, 3) or (n, 3)
        Metres per frame.
    numbers : (n,) int
        In the box.
    """

    points: Float64
    radius: Float64
    weight: Float64
    velocity: Float64
    numbers: npt.NDArray[np.intp]


def place_flakes(
    frame: Frame,
    motion: Motion,
    way: Way,
    count: int,
    sides: Float64,
    middle: Float64,
    reach: float,
    sway: tuple[float, float],
    numbers: npt.NDArray[np.int64] | None = None,
) -> Places:
    """Return the flakes of a box around `middle`, in the eye's axes; or some by number."""
    path, turns, wind = frame.path, frame.path.turns, motion.varied
    moved = -way.moved
    if turns:
        # Flakes stay in axes that do not turn; the box goes round with the view inside.
        moved = -frame.displacement(fall=motion.fall, wind=motion.mean_wind)
    velocity = -way.rate.reshape(1, 3)
    # The swing's angle of now is its rate in the unit of time, of which there is one.
    box = tuple(sides.tolist()), tuple(middle.tolist()), frame.seed
    swing = (sway[0], sway[1] * frame.t / frame.fps)

    which, count = numbers, count if numbers is None else len(numbers)

    def placed(moved: Float64) -> Float64:
        rows = np.empty((count, 3))
        particle_positions(rows, *box, moved.reshape(-1, 3), 1.0, swing, numbers)
        return rows

    points = placed(moved)
    if wind is not None and wind.profile is not None and count:
        more, rate = flakes_in_profile(motion, frame, points[:, 2])
        points, velocity = placed(moved + more), velocity + rate
    shown = _edge_fade(points, *box[:2])
    if turns:
        points = frame.to_camera(points)
        # The far end fades as in the box of a camera that does not turn.
        deep = (1e3 * reach, 1e3 * reach, reach)
        shown = shown * _edge_fade(points, deep, (0.0, 0.0, 0.5 * reach))
    if wind is not None and wind.waves is not None and count:
        # Only those that may come into view are worth their waves.
        near = _near_view(frame, points, reach, 3.0 * wind.waves.spread())
        points, shown = points[near], shown[near]
        more, rate = flakes_in_waves(motion, frame, points)
        velocity = velocity[near] if len(velocity) > 1 else velocity
        which = near if which is None else which[near]
        points, velocity = points + more, velocity + rate
    if turns:
        velocity = velocity - np.cross(frame.spin(), points)
    if path.zooms:
        # What is aside goes outwards as if it moved.
        velocity = velocity + path.zoom(frame.t)[1] * points * (1.0, 1.0, 0.0)
    return Places(points, velocity, shown, which)


def list_flakes(
    frame: Frame,
    places: Places,
    shutter: float,
    sizes: tuple[float, float],
    amount: float,
    largest: tuple[float, float],
    count: int,
) -> Listed:
    """Return the flakes that show in the window; see `Flakes` for what they depend on."""
    points, velocity, shown, which = places
    near = in_window(frame, points, velocity, shutter, 0.5 * sizes[1])
    inside = np.flatnonzero(near & (shown > 0.0))
    points, shown = points[inside], shown[inside]
    velocity = velocity if len(velocity) == 1 else velocity[inside]
    inside = inside if which is None else which[inside]
    draws = np.empty(count)
    uniform(draws, frame.seed, SIZES)
    radius = 0.5 * (sizes[0] + draws[inside] * (sizes[1] - sizes[0]))
    sigma = frame.camera.focal * radius / (3.0 * np.maximum(points[:, 2], 1e-6))
    weight = presence(inside, count=count, amount=amount, fade_in=FADE_IN) * shown
    weight *= size_fade(sigma, largest)
    kept = weight > 0.0
    trace.count("particles", int(kept.sum()))
    velocity = velocity if len(velocity) == 1 else velocity[kept]
    return Listed(points[kept], radius[kept], weight[kept], velocity, inside[kept])


def in_window(
    frame: Frame, points: Float64, velocity: Float64, shutter: float, radius: float
) -> npt.NDArray[np.bool_]:
    """Return the flakes that may touch the frame's window during the exposure, (n,) bool.

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


def _near_view(frame: Frame, points: Float64, reach: float, room: float) -> npt.NDArray[np.intp]:
    """Return the indices of points that are in view or at most so many metres beside it."""
    camera = frame.camera
    cx, cy = camera.principal(frame.shape)
    x, y, z = (points - camera.offset).T
    deep = np.maximum(z + room, 0.0) / camera.focal
    height, width = frame.shape
    inside = (z > -room) & (z < reach + room)
    inside &= (x > -cx * deep - room) & (x < (width - cx) * deep + room)
    deep = deep / camera.aspect
    inside &= (y > -cy * deep - room) & (y < (height - cy) * deep + room)
    return np.flatnonzero(inside)


def _edge_fade(points: Float64, sides: Any, middle: Any) -> Float64:
    """Return the share of each flake that is shown, so that none pops where the box wraps."""
    shown = np.empty(len(points))
    particle_edge_fade(shown, points, sides, middle)
    return shown

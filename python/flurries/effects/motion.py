"""What moves the weather, a fall, a wind and a camera, and the pixels of what is at a depth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.camera.lens import Camera, axes_of
from flurries.camera.path import CameraPath, air_moved
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.motion.keys import Course, Keys, Number, Vector, air_courses, sum_of, value_at
from flurries.motion.wind import Wind

STEPS = (1.0, -1.0)  # From a frame to the next one and to the one before.
NEAREST = 1e-3  # Metres before the eye that no depth is below.
_ROWS = 32  # Rows of a picture that are worked on together.
_PIECES = 8  # Straight pieces between two keys that stand for the product of two keyed numbers.

# Seconds that a photograph of falling snow is exposed by day, and frames that a film is.
STILL, HALF_OPEN = 1.0 / 250.0, 0.5


class Way(NamedTuple):
    """The camera's motion through the flakes, by the mean wind, in the eye's axes."""

    moved: Float64  # (3,): camera minus flake since frame 0, metres.
    rate: Float64  # The same per frame.
    shutter: float  # Exposure, frames.


@dataclass(frozen=True, eq=False)
class Motion:
    """The fall of flakes in a wind, and the time that the shutter is open."""

    fall: Number  # Metres per second in still air, down.
    wind: Vector | Wind  # Metres per second, house axes.
    # Exposure, frames; None for a photograph's in a still, and half a frame in a film.
    shutter: Number | None = 0.0
    clock: Number = 1.0  # How fast its time goes, over that of the film.
    pace: Number = 1.0  # How fast uneven wind changes by this time, over its own.

    def now(self, t: float) -> float:
        """Return the frame that the weather's own clock shows at `t`."""
        return self.clock.integral(t) if isinstance(self.clock, Keys) else self.clock * t

    def clocks(self, t: float, steps: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return the times some steps from `t`, and `now` at each."""
        times = [t + step for step in steps]
        return times, times if self.clock == 1.0 else [self.now(t) for t in times]

    @property
    def mean_wind(self) -> Vector:
        """The part of the wind that is the same everywhere."""
        return self.wind.steady if isinstance(self.wind, Wind) else self.wind

    @property
    def varied(self) -> Wind | None:
        """The wind where it differs from place to place; None where it is the same all over."""
        wind = self.wind
        return wind if isinstance(wind, Wind) and not wind.uniform else None

    @property
    def still(self) -> bool:
        """Whether the air and what falls in it stand still at all times."""
        plain = not isinstance(self.wind, (Wind, Keys)) and not isinstance(self.fall, Keys)
        return plain and self.fall == 0.0 and not any(self.wind)  # type: ignore[arg-type]

    def way(self, frame: Frame) -> Way:
        """Return the camera's way through the mean wind at a frame."""
        wind, shutter = self.mean_wind, self.exposure(frame)
        moved, rate = frame.path.relative(frame.t, fps=frame.fps, fall=self.fall, wind=wind)
        axes = frame.camera.matrix()
        return Way(moved @ axes, rate @ axes, shutter)

    def exposure(self, frame: Frame) -> float:
        """Return how long the shutter is open at a frame, frames."""
        if self.shutter is None:
            return float(frame.fps) * STILL if frame.still else HALF_OPEN
        return float(value_at(self.shutter, frame.t))

    def places(self, path: CameraPath, fps: float, times: list[float]) -> list[Any]:
        """Return the camera's places (3,) in the air that falls so, house axes, metres."""
        if (line := self.line(path, fps)) is not None:
            (x, y, z), (u, v, w) = line
            return [(x + u * t, y + v * t, z + w * t) for t in times]
        air = partial(air_moved, fps=fps, fall=self.fall, wind=self.mean_wind)
        ways = (path.place(t, fps=fps) - air(self.now(t)) for t in times)
        return [tuple(way.tolist()) for way in ways]

    def line(self, path: CameraPath, fps: float) -> tuple[list[float], list[float]] | None:
        """Return that place at frame 0 and what it changes by per frame; None if that changes."""
        fall, wind, clock = self.fall, self.mean_wind, self.clock
        if isinstance(fall, Keys) or isinstance(wind, Keys) or isinstance(clock, Keys):
            return None
        if (line := _line(path, fps)) is None:
            return None
        start, rate = line
        return start, (rate - clock * np.add(wind, (0.0, fall, 0.0)) / fps).tolist()

    def rate(self, path: CameraPath, fps: float, t: float) -> Any:
        """Return the change of that place per frame at `t`."""
        if (line := self.line(path, fps)) is not None:
            return line[1]
        air = np.array(value_at(self.mean_wind, self.now(t)))
        air[1] += value_at(self.fall, self.now(t))
        return path.rate(t, fps=fps) - value_at(self.clock, t) * air / fps

    def spreads(self, path: CameraPath, rotation: tuple[float, float, float]) -> bool:
        """Whether the air ever comes nearer a camera or recedes: the flow of tiles then differs."""
        bends, axis = path.turns or path.zooms, axes_of(rotation)[:, 2]
        return bends or comes_nearer(path, axis, self.fall, self.mean_wind)

    def fastest(self, path: CameraPath, fps: float) -> float:
        """Return the largest speed of the camera through the air, metres per frame."""
        course = sum_of([path.course(fps), *air_courses(self.mean_wind, self.fall, -1.0 / fps)])
        times = np.concatenate([course.knots, [0.0]])
        before = course.line(times, times - 1e-6)[0]
        speeds = np.concatenate([before, course.line(times, times + 1e-6)[0], course.values])
        return float(np.linalg.norm(speeds, axis=1).max())


def times(number: Number, factor: float) -> Number:
    if isinstance(number, Keys):
        return Keys([(frame, factor * value) for frame, value in number.keys])
    return factor * number


def product(first: Number, second: Number) -> Number:
    """Return two numbers multiplied; of two keyed ones by straight pieces between their keys."""
    if not isinstance(first, Keys):
        return times(second, first)
    if not isinstance(second, Keys):
        return times(first, second)
    frames = sorted({frame for one in (first, second) for frame, _ in one.keys})
    if len(frames) > 1:
        at = np.linspace(0.0, len(frames) - 1.0, _PIECES * (len(frames) - 1) + 1)
        frames = np.interp(at, np.arange(len(frames)), frames).tolist()
    return Keys([(t, float(value_at(first, t)) * float(value_at(second, t))) for t in frames])


def comes_nearer(path: CameraPath, axis: Float64, fall: Number, wind: Vector) -> bool:
    """Whether the air ever moves along a view's axis, (3,) of the house axes."""
    winds = wind.keys if isinstance(wind, Keys) else [(0.0, wind)]
    falls = fall.keys if isinstance(fall, Keys) else [(0.0, fall)]
    parts = [np.dot(axis, wind) for _, wind in winds] + [axis[1] * fall for _, fall in falls]
    return any(part != 0.0 for part in parts) or path.goes_along(axis)


@kept(64)
def _line(path: CameraPath, fps: float) -> tuple[list[float], Float64] | None:
    """Return the camera's place at frame 0 and its rate, if that never changes."""
    course = path.course(fps)
    if len(course.knots) or (course.slopes is not None and course.slopes.any()):
        return None
    return path.place(0.0, fps=fps).tolist(), path.rate(0.0, fps=fps)


@kept(32)
def air_course(fps: float, fall: Number, wind: Vector) -> Course:
    """Return the velocity of flakes in the wind over a film, house axes, metres per frame."""
    return sum_of(air_courses(wind, fall, 1.0 / fps))


def plane_motions(
    depth: Array, frame: Frame, others: Sequence[Frame], moved: Sequence[Float64]
) -> list[Array]:
    """Return the motions to other frames of depths, a window's or one (1, 1), (h, w, 2) px."""
    here, turns = frame.camera, frame.path.turns
    own, middle, focals = here.matrix(), here.principal(frame.shape), here.focals
    x, y = _middles(frame)
    a, b = (x - middle[0]) / focals[0], (y[:, None] - middle[1]) / focals[1]
    motions, views = [plane((*frame.size, 2)) for _ in others], []
    for other, way in zip(others, moved, strict=True):
        axes, offset = other.camera.matrix(), np.array(other.camera.offset)
        shifted = np.subtract(other.camera.principal(frame.shape), middle)
        aside = (own @ np.array(here.offset) - way) @ axes - offset
        views.append((own.T @ axes - np.eye(3), aside, other.camera.focals, shifted))
    # At one depth x goes by columns and y by rows: each is a line of pairs whose other half
    # is 0, and the bits of both lines make all pairs. Else blocks of rows stay in a cache.
    even = depth.size == 1 and not turns
    step = len(b) if even else _ROWS
    for first in range(0, len(b), step):
        rows, pair = slice(first, first + step), []
        far = np.maximum(depth[rows if len(depth) > 1 else slice(1)].astype(np.float64), NEAREST)
        seen, down, nearest = np.isfinite(far), b[rows], far.min()
        if not (whole := bool(seen.all())):
            np.copyto(far, 1.0, where=~seen)
        for motion, (turned, aside, ends, shifted) in zip(motions, views, strict=True):
            x, y, z = aside
            if turns:
                ray = (turned[0, i] * a + (turned[1, i] * down + turned[2, i]) for i in range(3))
                x, y, z = (way * far + part for way, part in zip(ray, aside, strict=True))
            later = far + z
            # What passes the eye meanwhile: as fast as now.
            passing = (turns or nearest < -3.0 * z) and later < 0.5 * far
            scale = np.divide(1.0, np.maximum(later, NEAREST, out=later), out=later)
            if np.any(passing):
                np.divide(1.0, far, out=scale, where=passing)
            if not whole:
                scale *= seen
            for axis, (side, at) in enumerate(((x, a), (y, down))):
                change = ends[axis] * (side - z * at) * scale
                grown = ends[axis] - focals[axis]
                if grown or shifted[axis]:
                    change += (grown * at + shifted[axis]) * seen
                both = np.zeros((*change.shape, 2), np.float32) if even else motion[rows]
                both[..., axis] = change
                pair.append(both.view(np.uint64)[..., 0])
            if even:
                np.bitwise_or(pair[-2], pair[-1], out=motion.view(np.uint64)[..., 0])
    return motions


def air_motions(depth: Array, frame: Frame, others: Sequence[Frame], **air: Any) -> list[Array]:
    """Return the motions to other frames of what is at depths and goes with the air."""
    here = frame.displacement(**air)
    return plane_motions(depth, frame, others, [at.displacement(**air) - here for at in others])


def rays(frame: Frame) -> Float64:
    """Return the ray of each pixel of the window, (h, w, 3) in the eye's axes, with z = 1."""
    return rays_at(frame.camera, frame.shape, *_middles(frame))


def rays_at(camera: Camera, shape: tuple[int, int], x: Any, y: Any) -> Float64:
    """Return the rays (h, w, 3) of places x (w,) and y (h,) of a picture, px, with z = 1."""
    (cx, cy), (fx, fy) = camera.principal(shape), camera.focals
    rays = np.ones((len(y), len(x), 3))
    rays[..., 0], rays[..., 1] = (x - cx) / fx, (y[:, None] - cy) / fy
    return rays


def _middles(frame: Frame) -> tuple[Any, Any]:
    top, bottom, left, right = frame.window
    return np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5

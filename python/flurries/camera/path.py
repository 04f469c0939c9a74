"""The camera's way through the air: one path drives the texture, the flakes and both eyes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from flurries._contract import Float64, choice, suggesting, table
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.rotation import rotation_vector
from flurries.camera.turning import Turning, turning_of
from flurries.camera.zoom import lengths_of, weigh
from flurries.motion.keys import (
    Course,
    Integral,
    Keys,
    Number,
    Vector,
    air_courses,
    as_vector,
    course_of,
    integral_of,
    integral_to,
    sum_of,
    value_at,
)

__all__ = ["CameraPath"]

EXTEND = ("on", "stop")


@suggesting
@dataclass(frozen=True, eq=False)
class CameraPath:
    """A camera that moves and turns.

    Give one of `position` and `velocity`, or neither for a camera that stands still.

    Parameters
    ----------
    camera : Camera
        Lens and orientation.
    position : (n, 3) array or Keys, optional
        Places in world units, x right, y down, z forward: one for each frame from 0 on, or keyed.
        Linear between them; outside they go on with the first and the last rate.
    velocity : (3,) or Keys, optional
        World units per second, house axes; integrated in closed form from frame 0.
    orientation : (n, 3), (n, 4) or (n, 3, 3) array, or Keys, optional
        Rotation vectors (axis times angle in radians, as `Camera.rotation`), unit quaternions
        (w, x, y, z), or matrices from the camera's axes to the house's: one for each frame from 0
        on, or keyed (vectors and quaternions). Between them the camera turns at one rate about one
        axis; outside it goes on with the first and the last rate. It turns the shorter way, less
        than half a turn from one to the next; rotation vectors may mean more: (0, 0, 0) to
        (0, 7, 0) is 7 radians. `camera.rotation` is how the camera sits on what turns.
    focal : (n,) array or Keys, optional
        Focal length in pixels, in place of the camera's, for a lens that zooms: one for each frame
        from 0 on, or keyed; linear between them, held outside.
    extend : {"on", "stop"}
        "on": outside its frames the path goes on with the first and the last rate. "stop": the
        scene's own `extend` decides. Paths from files have "stop".

    Notes
    -----
    Langer 2004, section 7, where the camera never turns; ``docs/internals/deviations.md``, 17.

    Examples
    --------
    >>> import flurries as fl
    >>> path = fl.CameraPath(fl.camera.Camera(1200.0), velocity=(0.0, -0.5, 3.0))
    >>> path.place(60.0, fps=30.0).tolist()
    [0.0, -1.0, 6.0]
    """

    camera: Camera
    position: Any = None
    velocity: Any = None
    orientation: Any = None
    focal: Any = None
    extend: str = "on"
    _places: Keys | None = field(init=False, repr=False)
    _turning: Turning | None = field(init=False, repr=False)
    # Of the lens over time, pixels.
    _lengths: Keys = field(init=False, repr=False)

    def __post_init__(self) -> None:
        settle = partial(object.__setattr__, self)
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera must be a Camera, got {type(self.camera).__name__}")
        if self.position is not None and self.velocity is not None:
            raise ValueError("position and velocity must not both be given")
        choice("extend", self.extend, EXTEND)
        if self.velocity is not None:
            settle("velocity", as_vector("velocity", self.velocity, 3))
        settle("_places", self.position)
        if isinstance(self.position, Keys):
            as_vector("position", self.position, 3)
        elif self.position is not None:
            places = table("position", self.position)
            if places.shape[1] != 3 or len(places) == 0:
                raise ValueError(f"position must have shape (n, 3), got {places.shape}")
            settle("position", _frozen(places))
            settle("_places", Keys(list(enumerate(places.tolist()))))
        turning = None if self.orientation is None else turning_of(self.orientation)
        settle("_turning", turning)
        if turning is not None and not isinstance(self.orientation, Keys):
            settle("orientation", _frozen(table("orientation", self.orientation, ndim=None)))
        lengths = Keys([(0.0, self.camera.focal)])
        if self.focal is not None:
            lengths = lengths_of(self.focal)
            settle("camera", replace(self.camera, focal=lengths.value(0.0)))
            if not isinstance(self.focal, Keys):
                settle("focal", _frozen(table("focal", self.focal, ndim=1)))
        settle("_lengths", lengths)

    def __reduce__(self) -> tuple[Any, ...]:
        given = (self.camera, self.position, self.velocity, self.orientation, self.focal)
        return CameraPath, (*given, self.extend)

    @property
    def still(self) -> bool:
        """Whether the camera never moves, turns nor zooms."""
        moves = self.position is not None or self.velocity is not None
        return not (moves or self.turns or self.zooms)

    @cached_property
    def turns(self) -> bool:
        """Whether the camera ever turns."""
        return self._turning is not None and self._turning.moves

    @cached_property
    def zooms(self) -> bool:
        """Whether the focal length ever changes."""
        return bool(np.ptp(self._lengths.columns[1]) > 0.0)

    @property
    def widest(self) -> Camera:
        """The camera with the shortest focal length of the film."""
        return self.camera.derive(focal=float(self._lengths.columns[1].min()))

    @property
    def longest_focal(self) -> float:
        """The longest focal length of the film, pixels."""
        return float(self._lengths.columns[1].max())

    def zoom(self, t: float) -> tuple[float, float]:
        """Return the logarithm of the focal length over that of frame 0, and its change."""
        now = self._lengths.value(t)
        return math.log(now / self._lengths.value(0.0)), self._lengths.slope(t) / now

    def turn(self, t: float) -> Float64:
        """Return the matrix (3, 3) at frame `t` from the camera's axes to the house's."""
        return np.asarray(self.rig(t) @ self.camera.matrix())

    def rig(self, t: float) -> Float64:
        """Return the matrix (3, 3) at frame `t` of what the camera sits on, without its own."""
        return np.eye(3) if self._turning is None else self._turning.at(t)

    def spin(self, t: float) -> Float64:
        """Return the spin at `t`, (3,) radians per frame, house axes, right-handed."""
        if self._turning is None:
            return np.zeros(3)
        return np.asarray(self._turning.at(t) @ self._turning.rate(t))

    def pose(self, camera: Camera, t: float) -> Camera:
        """Return a camera that sits on the path as it looks at `t`: its rotation is the whole."""
        if self.zooms:
            ratio = math.exp(self.zoom(t)[0])
            shift = (ratio * camera.center_shift[0], ratio * camera.center_shift[1])
            camera = camera.derive(focal=ratio * camera.focal, center_shift=shift)
        if self._turning is None:
            return camera
        whole = rotation_vector(self._turning.at(t) @ camera.matrix())
        return camera.derive(rotation=tuple(whole.tolist()))

    def travel(self, t: float, *, fps: float, fall: Number, wind: Vector) -> Float64:
        """Return P, the camera's way through air that falls and blows, as the camera felt it.

        The integral from frame 0 of R^T v, v = camera minus air, in the camera's own axes; given in
        house axes as the camera stands at `t`, (3,) world units. Where the camera does not turn it
        is the difference of the places. While it zooms the way across the view is weighed by the
        focal length of its time over that at `t`, so that f P is how far the picture has moved.
        """
        if not self.turns:
            way = self.place(t, fps=fps) - air_moved(t, fps=fps, fall=fall, wind=wind)
        else:
            way = self.rig(t) @ _kept(_relative_way, self, fps, fall, wind).to(t)
        if not self.zooms:
            return np.asarray(way)
        weighted = self.rig(t) @ _kept(_weighted_way, self, fps, fall, wind).to(t)
        weighted = weighted / self._lengths.value(t)
        axis = self.turn(t)[:, 2]
        return np.asarray(weighted + axis * (axis @ (way - weighted)))

    def rotation(self, t: float) -> Float64:
        """Return the integral of the rate of turning in the camera's own axes since frame 0.

        Given in house axes as the camera stands at `t`, (3,) radians. A zoom weighs what is not
        about the view's axis as it does the way in `travel`.
        """
        if self._turning is None:
            return np.zeros(3)
        angle = self._turning.at(t) @ self._turning.angle(t)
        if not (self.zooms and self.turns):
            return np.asarray(angle)
        weighted = self._turning.at(t) @ _kept(_weighted_turn, self).to(t) / self._lengths.value(t)
        axis = self.turn(t)[:, 2]
        return np.asarray(weighted + axis * (axis @ (angle - weighted)))

    def resize(self, scale: float) -> CameraPath:
        """Return the same view on a picture that is `scale` times as wide and high."""
        lens = self.camera
        center = None if lens.center is None else (scale * lens.center[0], scale * lens.center[1])
        shift = (scale * lens.center_shift[0], scale * lens.center_shift[1])
        changed = replace(lens, focal=lens.focal * scale, center=center, center_shift=shift)
        focal = self.focal
        if isinstance(focal, Keys):
            focal = Keys([(frame, scale * value) for frame, value in focal.keys])
        elif focal is not None:
            focal = scale * focal
        return replace(self, camera=changed, focal=focal)

    @kept(32)
    def course(self, fps: float) -> Course:
        """Return the velocity over time, house axes, world units per frame."""
        if self.velocity is not None:
            return course_of(self.velocity, 1.0 / fps)
        if self._places is None or len(self._places.keys) == 1:
            return Course(np.empty(0), np.zeros((1, 3)))
        frames, places = self._places.columns
        return Course(frames[1:-1], np.diff(places, axis=0) / np.diff(frames)[:, None])

    def goes_along(self, axis: Float64) -> bool:
        """Whether the camera ever moves along a direction of the house axes, (3,)."""
        if self.velocity is not None:
            keyed = isinstance(self.velocity, Keys)
            values = self.velocity.columns[1] if keyed else [self.velocity]
            return any(np.dot(axis, value) != 0.0 for value in values)
        if self._places is None:
            return False
        return bool((np.diff(self._places.columns[1], axis=0) @ axis != 0.0).any())

    def place(self, t: float, *, fps: float) -> Float64:
        """Return the place at frame `t`, (3,) world units."""
        if self.velocity is not None:
            return np.asarray(integral_to(self.velocity, t) / fps, dtype=np.float64)
        return np.zeros(3) if self._places is None else np.array(self._places.value(t, extend=True))

    def rate(self, t: float, *, fps: float) -> Float64:
        """Return the change of place per frame at `t`, (3,) world units."""
        if self.velocity is not None:
            return np.asarray(value_at(self.velocity, t)) / fps
        return np.zeros(3) if self._places is None else np.array(self._places.slope(t, extend=True))

    def relative(
        self, t: float, *, fps: float, fall: Number, wind: Vector
    ) -> tuple[Float64, Float64]:
        """Return camera minus what falls in the wind: since frame 0 and per frame, house axes."""
        gone = air_moved(t, fps=fps, fall=fall, wind=wind)
        air = np.array(value_at(wind, t))
        air[1] += value_at(fall, t)
        return self.place(t, fps=fps) - gone, self.rate(t, fps=fps) - air / fps


def _frozen(given: Float64) -> Float64:
    own: Float64 = given.copy()
    own.flags.writeable = False
    return own


def air_moved(t: float, *, fps: float, fall: Number, wind: Vector) -> Float64:
    """Return the way of flakes in the wind since frame 0, house axes, (3,)."""
    moved = integral_to(wind, t) / fps
    moved[1] += float(integral_to(fall, t)) / fps
    return np.asarray(moved)


@kept(96)
def _kept(make: Callable[..., Integral], *given: Any) -> Integral:
    """Return an integral along a path; its sums are made once for a film."""
    return make(*given)


def _relative_way(path: CameraPath, fps: float, fall: Number, wind: Vector) -> Integral:
    """Return P of a camera that turns."""
    assert path._turning is not None
    return path._turning.integral(sum_of([path.course(fps), *air_courses(wind, fall, -1.0 / fps)]))


def _weighted_way(path: CameraPath, fps: float, fall: Number, wind: Vector) -> Integral:
    """Return the integral of f R^T v, in the rig's axes."""
    way = sum_of([path.course(fps), *air_courses(wind, fall, -1.0 / fps)])
    course = weigh(path._lengths, way)
    if path._turning is not None and path.turns:
        return path._turning.integral(course)
    # The rig stands still: house axes, turned back into its own.
    rig = path.rig(0.0)
    slopes = None if course.slopes is None else course.slopes @ rig
    return integral_of(Course(course.knots, course.values @ rig, slopes, course.times))


def _weighted_turn(path: CameraPath) -> Integral:
    """Return the integral of f w, in the rig's axes."""
    assert path._turning is not None
    turning = path._turning
    return integral_of(weigh(path._lengths, Course(turning.frames[1:-1], turning.rates)))


def as_path(camera: object, default_focal: float) -> CameraPath:
    """Return a path from what a scene was given: nothing, a camera, or a path."""
    if camera is None:
        return CameraPath(Camera(default_focal))
    if isinstance(camera, Camera):
        return CameraPath(camera)
    if isinstance(camera, CameraPath):
        return camera
    raise TypeError(f"camera must be a Camera or a CameraPath, got {type(camera).__name__}")

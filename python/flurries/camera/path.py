"""The camera's way through the air: one path drives the texture, the flakes and both eyes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from flurries._contract import Float64, choice, sealed, suggesting, table
from flurries._kept import kept
from flurries.camera.lens import Camera, quaternions_of, rotation_vector
from flurries.camera.turning import Turning, lengths_of, turning_of, weigh
from flurries.motion import keys
from flurries.motion.keys import Course, Integral, Keys, Number, Vector


@suggesting
@dataclass(frozen=True, eq=False)
class CameraPath:
    """A camera that moves and turns.

    Give one of `position` and `velocity`, or neither for a camera that stands still. Langer 2004,
    section 7, where the camera never turns; ``docs/internals/deviations.md``, 17.

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
        Rotation vectors (as `Camera.rotation`), unit quaternions (w, x, y, z), or matrices from the
        camera's axes to the house's: one for each frame from 0 on, or keyed (not matrices). Between
        them it turns at one rate about one axis the shorter way, but for rotation vectors, which
        may mean more: (0, 0, 0) to (0, 7, 0) is 7 radians. Outside it goes on with the first and
        the last rate. `camera.rotation` is how the camera sits on what turns.
    focal : (n,) array or Keys, optional
        Focal length in pixels, in place of the camera's, for a lens that zooms: one for each frame
        from 0 on, or keyed; linear between them, held outside.
    extend : {"on", "stop"}
        "on": outside its frames the path goes on with the first and the last rate. "stop": the
        scene's own `extend` decides. Paths from files have "stop".

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
    _lengths: Keys = field(init=False, repr=False)  # Of the lens over time, pixels.

    def __post_init__(self) -> None:
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera must be a Camera, got {type(self.camera).__name__}")
        if self.position is not None and self.velocity is not None:
            raise ValueError("position and velocity must not both be given")
        choice("extend", self.extend, ("on", "stop"))
        own: dict[str, Any] = {"_places": self.position}
        if self.velocity is not None:
            own["velocity"] = keys.as_vector("velocity", self.velocity, 3)
        if isinstance(self.position, Keys):
            keys.as_vector("position", self.position, 3)
        elif self.position is not None:
            places = table("position", self.position)
            if places.shape[1] != 3 or len(places) == 0:
                raise ValueError(f"position must have shape (n, 3), got {places.shape}")
            own["_places"] = Keys(list(enumerate(places.tolist())))
        own["_turning"] = None if self.orientation is None else turning_of(self.orientation)
        own["_lengths"] = Keys([(0.0, self.camera.focal)])
        if self.focal is not None:
            own["_lengths"] = lengths_of(self.focal)
            own["camera"] = replace(self.camera, focal=own["_lengths"].value(0.0))
        for name in ("position", "orientation", "focal"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, Keys):
                own[name] = sealed(table(name, given, ndim=None).copy())
        vars(self).update(own)

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
        return self._turning is not None and bool((self._turning.rates != 0.0).any())

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
        return np.zeros(3) if self._turning is None else self.rig(t) @ self._turning.rate(t)

    def pose(self, camera: Camera, t: float) -> Camera:
        """Return a camera that sits on the path as it looks at `t`: its rotation is the whole."""
        if self.zooms:
            camera = camera.magnified(math.exp(self.zoom(t)[0]))
        if self._turning is None:
            return camera
        whole = rotation_vector(self._turning.at(t) @ camera.matrix())
        return camera.derive(rotation=tuple(whole.tolist()))

    def travel(self, t: float, *, fps: float, fall: Number, wind: Vector) -> Float64:
        """Return P, the camera's way through air that falls and blows, as the camera felt it."""
        # The integral from frame 0 of R^T v, v = camera minus air, in the camera's own axes; given
        # in house axes as it stands at `t`, (3,) world units. While it zooms the way across the
        # view is weighed by the focal length of its time over that at `t`, so that f P is how far
        # the picture has moved.
        if self.turns:
            way = self.rig(t) @ _way(self, fps, fall, wind, zoomed=False).to(t)
        else:
            way = self.place(t, fps=fps) - air_moved(t, fps=fps, fall=fall, wind=wind)
        if not self.zooms:
            return np.asarray(way)
        return self._across(t, way, _way(self, fps, fall, wind, zoomed=True))

    def rotation(self, t: float) -> Float64:
        """Return the integral of the rate of turning since frame 0, (3,) radians, as `travel`."""
        if self._turning is None:
            return np.zeros(3)
        angle = self._turning.at(t) @ self._turning.angle(t)
        return self._across(t, angle, _turned(self)) if self.zooms and self.turns else angle

    def _across(self, t: float, whole: Float64, zoomed: Integral) -> Float64:
        """Return an integral along the view's axis, and one weighed by the focal length across."""
        weighted = self.rig(t) @ zoomed.to(t) / self._lengths.value(t)
        axis = self.turn(t)[:, 2]
        return np.asarray(weighted + axis * (axis @ (whole - weighted)))

    def resize(self, scale: float) -> CameraPath:
        """Return the same view on a picture that is `scale` times as wide and high."""
        center, focal = self.camera.center, self.focal
        if center is not None:
            center = scale * center[0], scale * center[1]
        if isinstance(focal, Keys):
            focal = Keys([(frame, scale * value) for frame, value in focal.keys])
        elif focal is not None:
            focal = scale * focal
        camera = replace(self.camera.magnified(scale), center=center)
        return replace(self, camera=camera, focal=focal)

    @property
    def extent(self) -> tuple[int, int] | None:
        """The first and last whole frame of a camera that must not go on by itself, or None."""
        keyed = [own for own in (self._places, self._lengths) if own is not None]
        frames = [own.columns[0] for own in keyed]
        frames += [] if self._turning is None else [self._turning.frames]
        # One pose stands for all frames.
        several = [own for own in frames if len(own) > 1]
        if self.extend != "stop" or not several:
            return None
        first, last = max(own[0] for own in several), min(own[-1] for own in several)
        return math.ceil(first), math.floor(last)

    def holding(self) -> CameraPath:
        """Return the path with a camera that stands still before its first and after its last."""
        # Outside their frames paths go on with the first and the last rate: a rate of 0. Keys may
        # hold quaternions, and no matrices.
        turned = self.orientation
        if turned is not None and not isinstance(turned, Keys):
            rows = quaternions_of(turned) if turned.ndim == 3 else turned
            turned = Keys(list(enumerate(rows.tolist())))

        def padded(given: Keys | None) -> Keys | None:
            if given is None or len(given.keys) < 2:
                return given
            (first, start), (last, end) = given.keys[0], given.keys[-1]
            return Keys([(first - 1.0, start), *given.keys, (last + 1.0, end)])

        places = padded(self._places)
        return replace(self, position=places, orientation=padded(turned), extend="on")

    @kept(32)
    def course(self, fps: float) -> Course:
        """Return the velocity over time, house axes, world units per frame."""
        if self.velocity is not None:
            return keys.course_of(self.velocity, 1.0 / fps)
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
            return np.asarray(keys.integral_to(self.velocity, t) / fps, dtype=np.float64)
        return np.zeros(3) if self._places is None else np.array(self._places.value(t, extend=True))

    def rate(self, t: float, *, fps: float) -> Float64:
        """Return the change of place per frame at `t`, (3,) world units."""
        if self.velocity is not None:
            return np.asarray(keys.value_at(self.velocity, t)) / fps
        return np.zeros(3) if self._places is None else np.array(self._places.slope(t, extend=True))

    def relative(
        self, t: float, *, fps: float, fall: Number, wind: Vector
    ) -> tuple[Float64, Float64]:
        """Return camera minus what falls in the wind: since frame 0 and per frame, house axes."""
        gone = air_moved(t, fps=fps, fall=fall, wind=wind)
        air = np.array(keys.value_at(wind, t))
        air[1] += keys.value_at(fall, t)
        return self.place(t, fps=fps) - gone, self.rate(t, fps=fps) - air / fps


def air_moved(t: float, *, fps: float, fall: Number, wind: Vector) -> Float64:
    """Return the way of flakes in the wind since frame 0, house axes, (3,)."""
    moved = keys.integral_to(wind, t) / fps
    moved[1] += float(keys.integral_to(fall, t)) / fps
    return np.asarray(moved)


@kept(96)
def _way(path: CameraPath, fps: float, fall: Number, wind: Vector, *, zoomed: bool) -> Integral:
    """Return the integral of R^T v in the rig's axes, or of f R^T v."""
    course = keys.sum_of([path.course(fps), *keys.air_courses(wind, fall, -1.0 / fps)])
    if zoomed:
        course = weigh(path._lengths, course)
    if path._turning is not None and path.turns:
        return path._turning.integral(course)
    # The rig stands still: house axes, turned back into its own.
    rig = path.rig(0.0)
    slopes = None if course.slopes is None else course.slopes @ rig
    return keys.integral_of(Course(course.knots, course.values @ rig, slopes, course.times))


@kept(96)
def _turned(path: CameraPath) -> Integral:
    """Return the integral of f w, in the rig's axes."""
    assert path._turning is not None
    turning = path._turning
    return keys.integral_of(weigh(path._lengths, Course(turning.frames[1:-1], turning.rates)))


def as_path(camera: object, default_focal: float) -> CameraPath:
    """Return a path from what a scene was given: nothing, a camera, or a path."""
    if camera is None:
        return CameraPath(Camera(default_focal))
    if isinstance(camera, Camera):
        return CameraPath(camera)
    if isinstance(camera, CameraPath):
        return camera
    raise TypeError(f"camera must be a Camera or a CameraPath, got {type(camera).__name__}")

"""One eye's view of the air at one time: what an effect is asked with, and what eyes share."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from flurries._contract import Array, Float64
from flurries._kept import Kept
from flurries._threads import reproducible
from flurries._trace import current
from flurries.camera.lens import Camera, rotation_vector
from flurries.camera.optics import Blur, Lens
from flurries.camera.path import CameraPath
from flurries.frame.bands import Visible, Window, crop
from flurries.frame.matte import Deep
from flurries.frame.needs import Step
from flurries.light.lamp import ROW, Lamp, Sun
from flurries.light.plate import PlateLight
from flurries.motion.keys import Number, Vector

_Made = TypeVar("_Made")
_P = ParamSpec("_P")


class Shared:
    """The objects that eyes and bands of rows of one frame share while they are made."""

    # `cameras` are the eyes as they are at the frame's time, `window` that of all bands together.

    def __init__(self, cameras: tuple[Camera, ...], window: Window, bands: int = 1) -> None:
        self.cameras, self.window, self.bands = cameras, window, bands
        # With the owner, which must not go while its id is known.
        self._known: dict[Any, tuple[object, Any]] = {}

    def once(self, key: Any, owner: object, make: Callable[[], _Made]) -> _Made:
        """Return the object of this effect, seed and name, made by `make` the first time."""
        if key not in self._known:
            self._known[key] = owner, make()
        made: _Made = self._known[key][1]
        return made


class Lap(NamedTuple):
    """The frames of a film that come over and over."""

    first: int
    frames: int  # How many: frame `first + frames` is frame `first` again.

    @property
    def end(self) -> int:
        return self.first + self.frames

    def place(self, t: float) -> float:
        """Return the frame of the first round that a frame is."""
        return self.first + (t - self.first) % self.frames

    def part(self, t: float) -> float:
        """Return the share of the round that has passed, 0 to 1."""
        return (t - self.first) / self.frames


@dataclass(frozen=True)
class Frame:
    """One eye's view of the air at one time. An effect may depend on nothing else.

    Attributes
    ----------
    shape, window : (H, W), (top, bottom, left, right)
        Size of the whole frame, and the part that is wanted, pixels.
    t, fps : float
        Frame number, and frames per second.
    camera, path : Camera, CameraPath
        The eye as it is at `t`, its rotation from its own axes to the house's then; and its path.
    seed : int
        The effect's own.
    depth : (H, W) float32 or None
        Planar depth of the background in world units, of the whole frame; infinity where nothing
        stands, None where nobody said. Read-only.
    sun, lights, lens : Sun or None, tuple of Lamp, Lens or None
        The scene's sun and lamps, and its lens; without one everything is sharp.
    ambient, plate : (r, g, b) or None, PlateLight or None
        Display values of white in the background's own light, where an effect's color is "ambient",
        and that light by places, where it is "local".
    lap : Lap or None
        The loop of a film that repeats; `t` is a frame of it.
    still : bool
        Whether the scene is one picture, exposed as a photograph is.
    air : (float, float)
        Extinction of the scene's effects, per metre: of them all, which the light of a lamp goes
        through, and of those that lie behind this one and so do not cover it.
    steps : mapping of str to Step, or None
        The effect's steps that are planned; None where a frame was made without a plan: all.
    visible : Visible or None
        Where anything of the effect can be seen; None is everywhere.
    deep, whole : bool
        Whether the scene has a depth, read or not, and whether layers are asked for with all that
        they can say of their pixels.
    """

    shape: tuple[int, int]
    window: Window
    t: float
    fps: float
    camera: Camera
    path: CameraPath
    seed: int
    depth: Array | None = None
    sun: Sun | None = None
    ambient: tuple[float, float, float] | None = None
    plate: PlateLight | None = None
    lights: tuple[Lamp, ...] = ()
    lens: Lens | None = None
    lap: Lap | None = None
    still: bool = False
    air: tuple[float, float] = (0.0, 0.0)
    steps: Mapping[str, Step] | None = None
    visible: Visible | None = None
    # Where results that other frames have as well are found, if the depth never changes.
    kept: Kept | None = field(default=None, compare=False, repr=False)
    settled: bool = False  # Whether neither the camera nor the depth ever changes.
    deep: bool = False
    whole: bool = False
    # What stands in a share of pixels before `depth`, of the whole frame: an effect is asked once
    # more for each, with it in `depth` and its number in `side`, and need not look at it.
    nearer: tuple[Deep, ...] = field(default=(), compare=False, repr=False)
    side: int = 0
    shared: Shared | None = field(default=None, compare=False, repr=False)

    def derive(self, **changes: Any) -> Frame:
        """Return this view with other values, which `replace` does at ten times the cost."""
        made = object.__new__(Frame)
        made.__dict__.update(self.__dict__, **changes)
        for found in ("blur", "size"):
            made.__dict__.pop(found, None)
        return made

    def run(
        self, owner: object, name: str, make: Callable[_P, _Made], *args: _P.args, **more: _P.kwargs
    ) -> _Made | None:
        """Return the product of a step; None where it is left out, and one for all frames once."""
        if self.steps is not None and name not in self.steps:
            return None

        def made() -> _Made:
            with current.get().stage(name):
                return make(*args, **more)

        once = self.settled and self.steps is not None and self.steps[name].once
        if not once or self.kept is None:
            return made()
        key = id(owner), name, self.camera, self.window, self.whole, self.side, reproducible()
        return self.kept.once(key, lambda: _read_only(made()))

    def standing(self, owner: object, key: Hashable, make: Callable[[], _Made]) -> _Made:
        """Return what is made of the depth over the window and a key; of one that stays, once."""
        # A frame in bands makes it anew: it would be as large as many of its bands.
        if self.shared is not None and self.shared.bands > 1:
            return make()
        if self.kept is None:
            return self.once(owner, key, make, depth=True)
        key = id(owner), key, self.window, self.side, reproducible()
        return self.kept.once(key, make)

    def once(
        self, owner: object, name: Hashable, make: Callable[[], _Made], *, eye: bool = False,
        depth: bool = False,
    ) -> _Made:  # fmt: skip
        """Return what `make` returns; for a second eye or band what it returned for the first."""
        # Not so where it depends on the `eye`, or on which `depth` stands behind the weather.
        if self.shared is None:
            return make()
        key = id(owner), self.seed, name, eye and self.eye, depth and self.side
        return self.shared.once(key, owner, make)

    @cached_property
    def blur(self) -> Blur | None:
        """The lens as it is now; None where all is sharp."""
        if self.lens is None:
            return None
        return self.lens.blur(self.t, focal=self.camera.focal, width=self.shape[1])

    def lamps(self, without: float = 0.0) -> Float64:
        """Return the lamps as they are now, as kernels read them, (n, 15); in the eye's axes."""
        matrix, place = self.camera.matrix(), self.path.place(self.t, fps=self.fps)
        found = [lamp.row(self.t, matrix, place) for lamp in self.lights]
        rows = np.ascontiguousarray(found, np.float64).reshape(-1, ROW)
        rows[:, -2:] = max(self.air[0] - without, 0.0), self.air[1]
        return rows

    @property
    def eye(self) -> int:
        return int(self.shared is not None and self.camera != self.shared.cameras[0])

    @cached_property
    def size(self) -> tuple[int, int]:
        top, bottom, left, right = self.window
        return bottom - top, right - left

    def crop(self, plane: Array) -> Array:
        """Return the window of a plane of the whole frame, C-contiguous."""
        return np.ascontiguousarray(crop(plane, self.window))

    def later(self, step: float = 1.0) -> Frame:
        """Return what the same eye is asked `step` frames later, without depth and light."""
        after, camera = self.t + step, self.camera
        if self.path.turns:
            turn = self.path.rig(after) @ self.path.rig(self.t).T @ camera.matrix()
            camera = camera.derive(rotation=tuple(rotation_vector(turn).tolist()))
        if self.path.zooms:
            zoom = self.path.zoom(after)[0] - self.path.zoom(self.t)[0]
            camera = camera.magnified(math.exp(zoom))
        less = {"depth": None, "ambient": None, "nearer": (), "plate": None, "shared": None}
        return self.derive(t=after, camera=camera, **less)

    def displacement(self, *, fall: Number = 0.0, wind: Vector = (0.0, 0.0, 0.0)) -> Float64:
        """Return camera minus air since frame 0, house axes, (3,) world units.

        The air falls and blows, world units per second: numbers or keys.
        """
        return self.path.relative(self.t, fps=self.fps, fall=fall, wind=wind)[0]

    def travel(self, *, fall: Number = 0.0, wind: Vector = (0.0, 0.0, 0.0)) -> Float64:
        """Return P, camera minus air since frame 0, (3,) world units in the eye's turning axes."""
        return self.to_camera(self.path.travel(self.t, fps=self.fps, fall=fall, wind=wind))

    def rotation(self) -> Float64:
        """Return the integral of `spin` since frame 0, (3,) radians."""
        return self.to_camera(self.path.rotation(self.t))

    def spin(self) -> Float64:
        """Return the eye's spin, (3,) radians per frame in its own axes, right-handed."""
        return self.to_camera(self.path.spin(self.t))

    def to_camera(self, vectors: Float64) -> Float64:
        """Return house axes turned into the camera's."""
        return np.ascontiguousarray(vectors @ self.camera.matrix())


def _read_only(found: _Made) -> _Made:
    for part in (found, getattr(found, "alpha", None), getattr(found, "rgb", None)):
        if isinstance(part, np.ndarray):
            part.flags.writeable = False
    return found

"""What an effect is asked, and what it answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from flurries._contract import Array, Float64
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath, air_moved
from flurries.camera.rotation import rotation_vector
from flurries.frame.needs import Run, needs_of
from flurries.light.sun import Sun
from flurries.motion.keys import Number, Vector, value_at

_Made = TypeVar("_Made")
_Key = tuple[int, int, str]


@dataclass(frozen=True)
class Frame:
    """One eye's view of the air at one time: all that an effect may depend on.

    Attributes
    ----------
    shape : (H, W)
        Size of the whole frame, pixels.
    window : (top, bottom, left, right)
        The part that is wanted, pixels.
    t : float
        Frame number.
    fps : float
        Frames per second.
    camera : Camera
        The eye as it is at `t`: its rotation is from its own axes to the house's then.
    path : CameraPath
        Its way.
    seed : int
        The effect's own.
    depth : (H, W) float32 or None
        Planar depth of the background in world units, of the whole frame; infinity where nothing
        stands, None where nobody said. Read-only.
    sun : Sun or None
        What shines.
    ambient : (r, g, b) or None
        Display values of white in the background's own light, where an effect's color is
        "ambient".
    run : Run or None
        What the plan lets the effect do; None where a frame was made without a plan.
    settled : bool
        Whether neither the camera nor the depth ever changes.
    deep : bool
        Whether the scene has a depth, read or not.
    whole : bool
        Whether layers are asked for with all that they can say of their pixels.
    shared : Shared or None
        Where both eyes are asked for, or the bands of a large frame one after the other: what need
        not be found for each.
    """

    shape: tuple[int, int]
    window: tuple[int, int, int, int]
    t: float
    fps: float
    camera: Camera
    path: CameraPath
    seed: int
    depth: Array | None = None
    sun: Sun | None = None
    ambient: tuple[float, float, float] | None = None
    run: Run | None = None
    settled: bool = False
    deep: bool = False

    def running(self, effect: Any) -> Run:
        """Return the plan's hand, or that of the effect's own needs."""
        if self.run is not None:
            return self.run
        return Run({step.name: step for step in needs_of(effect, self).steps})

    whole: bool = False
    shared: Shared | None = field(default=None, compare=False, repr=False)

    def once(self, owner: object, name: str, make: Callable[[], _Made]) -> _Made:
        """Return what `make` returns; for a second eye or band what it returned for the first.

        Only for what depends neither on the eye's place and principal point nor on the window, and
        for nothing that is written to afterwards.
        """
        if self.shared is None:
            return make()
        return self.shared.once((id(owner), self.seed, name), owner, make)

    def once_each(self, owner: object, name: str, make: Callable[[], _Made]) -> _Made:
        """Return the same for what depends on the eye, but not on the window."""
        return self.once(owner, f"{name}, eye {self.eye}", make)

    def here(self, owner: object, name: str, make: Callable[[], _Made]) -> _Made:
        """Return the same for what depends on the window, but not on the eye."""
        if self.shared is None:
            return make()
        return self.shared.here((id(owner), self.seed, name), owner, self.window, make)

    @property
    def eye(self) -> int:
        """Which of two eyes sees it, 0 or 1."""
        return int(self.shared is not None and self.camera != self.shared.cameras[0])

    @property
    def banded(self) -> bool:
        """Whether the window is one of several bands of rows, which come from the top down."""
        return self.shared is not None and self.shared.bands > 1

    @property
    def around(self) -> Frame:
        """The frame with the window that all bands make together."""
        return replace(self, window=self.shared.window) if self.shared is not None else self

    @property
    def width_scale(self) -> float:
        """Size of the picture against one of 1024 px, so that looks do not change with it."""
        return self.shape[1] / 1024.0

    def crop(self, plane: Array) -> Array:
        """Return the window of a plane of the whole frame."""
        top, bottom, left, right = self.window
        return plane[top:bottom, left:right]

    def later(self, step: float = 1.0) -> Frame:
        """Return what the same eye is asked `step` frames later, without depth and light."""
        after, camera = self.t + step, self.camera
        if self.path.turns:
            turn = self.path.rig(after) @ self.path.rig(self.t).T @ camera.matrix()
            camera = camera.derive(rotation=tuple(rotation_vector(turn).tolist()))
        if self.path.zooms:
            ratio = math.exp(self.path.zoom(after)[0] - self.path.zoom(self.t)[0])
            shift = (ratio * camera.center_shift[0], ratio * camera.center_shift[1])
            camera = camera.derive(focal=ratio * camera.focal, center_shift=shift)
        return replace(self, t=after, camera=camera, depth=None, ambient=None, shared=None)

    def displacement(self, *, fall: Number = 0.0, wind: Vector = (0.0, 0.0, 0.0)) -> Float64:
        """Return camera minus air since frame 0, house axes, (3,) world units.

        Parameters
        ----------
        fall : float or Keys
            World units per second, down.
        wind : (x, y, z) or Keys
            World units per second, house axes.
        """
        moved = air_moved(self.t, fps=self.fps, fall=fall, wind=wind)
        return self.path.place(self.t, fps=self.fps) - moved

    def velocity(self, *, fall: Number = 0.0, wind: Vector = (0.0, 0.0, 0.0)) -> Float64:
        """Return camera minus what falls in the wind, house axes, (3,) world units per frame."""
        air = np.array(value_at(wind, self.t))
        air[1] += value_at(fall, self.t)
        return self.path.rate(self.t, fps=self.fps) - air / self.fps

    def travel(self, *, fall: Number = 0.0, wind: Vector = (0.0, 0.0, 0.0)) -> Float64:
        """Return P, camera minus air since frame 0, (3,) world units in the eye's axes.

        While the camera turns it is the integral of the relative velocity in the eye's turning
        axes, and no longer a difference of places.
        """
        return self.to_camera(self.path.travel(self.t, fps=self.fps, fall=fall, wind=wind))

    def turned(self) -> Float64:
        """Return the integral of `spin` since frame 0, (3,) radians."""
        return self.to_camera(self.path.turned(self.t))

    def spin(self) -> Float64:
        """Return how fast the eye turns, (3,) radians per frame in its own axes, right-handed."""
        return self.to_camera(self.path.spin(self.t))

    def to_camera(self, vectors: Float64) -> Float64:
        """Return house axes turned into the camera's."""
        return np.ascontiguousarray(vectors @ self.camera.matrix())


class Shared:
    """What the eyes and the bands of rows of one frame have in common while they are made.

    Attributes
    ----------
    cameras : (eye,) or (left, right)
        The eyes as they are at the frame's time.
    window : (top, bottom, left, right)
        Of all bands together, pixels.
    bands : int
        How many there are.
    """

    def __init__(
        self, cameras: tuple[Camera, ...], window: tuple[int, int, int, int], bands: int = 1
    ) -> None:
        self.cameras, self.window, self.bands = cameras, window, bands
        # With the owner, which must not go while its id is known.
        self._known: dict[_Key, tuple[object, Any]] = {}
        self._here: dict[_Key, tuple[object, Any]] = {}
        self._at = window

    def once(self, key: _Key, owner: object, make: Callable[[], _Made]) -> _Made:
        """Return what `make` returned for this effect, seed and name, or make it."""
        if key not in self._known:
            self._known[key] = owner, make()
        made: _Made = self._known[key][1]
        return made

    def here(
        self,
        key: _Key,
        owner: object,
        window: tuple[int, int, int, int],
        make: Callable[[], _Made],
    ) -> _Made:
        """Return the same for a window; it is kept for the other eye, until the next window."""
        if len(self.cameras) == 1:
            return make()
        if window != self._at:
            self._here, self._at = {}, window
        if key not in self._here:
            self._here[key] = owner, make()
        made: _Made = self._here[key][1]
        return made


# From a display color to the light that layers are mixed in, one number per channel.
Light = Callable[[tuple[float, float, float]], list[float]]


@dataclass(frozen=True)
class Layer:
    """One effect's part of a frame.

    Attributes
    ----------
    name : str
        What it is: letters, digits and "_", parts joined by "." as in layers of an EXR.
    alpha : (h, w) float32
        Opacity over the window, 0 to 1.
    color : (r, g, b)
        Its one color, display values 0 to 1; not used where `rgb` is given.
    rgb : (h, w, 3) float32, optional
        Color of each pixel, linear light multiplied by alpha. Light without opacity (a glow) shows
        in linear light only: display values have no way to add it.
    depth : (h, w) float32, optional
        Where it is: planar depth in world units, for files with layers; infinity where nothing is.
    motion : (h, w, 2) float32, optional
        How what the pixel shows moves until the next frame: pixels, (x, y), y down.
    coverage : (h, w) float32, optional
        Opacity of what is drawn one by one, flakes and drops, without texture and veil.
    ids : (h, w) int32, optional
        The number of the flake or drop that shows most, the same in every frame; -1 for none.
    """

    name: str
    alpha: Array
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    rgb: Array | None = None
    depth: Array | None = None
    motion: Array | None = None
    coverage: Array | None = None
    ids: Array | None = None

    def rgba(self, color: Any) -> Array:
        """Return (h, w, 4) float32, premultiplied with `color` (3,)."""
        result = np.empty((*self.alpha.shape, 4), np.float32)
        np.multiply(self.alpha[..., None], np.asarray(color, np.float32), out=result[..., :3])
        result[..., 3] = self.alpha
        return result


def layers_of(answer: object, effect: object, shape: tuple[int, int]) -> tuple[Layer, ...]:
    """Return what an effect rendered as layers, or refuse what is none."""
    layers = []
    for layer in answer if isinstance(answer, (tuple, list)) else (answer,):
        if not isinstance(layer, Layer):
            raise TypeError(
                f"effects: {type(effect).__name__}.render must return a Layer or a tuple of them, "
                f"got {type(layer).__name__}"
            )
        planes: dict[str, tuple[Any, tuple[int, ...]]] = {
            "alpha": (layer.alpha, shape),
            "rgb": (layer.rgb, (*shape, 3)),
            "depth": (layer.depth, shape),
            "motion": (layer.motion, (*shape, 2)),
            "coverage": (layer.coverage, shape),
            "ids": (layer.ids, shape),
        }
        for name, (plane, wanted) in planes.items():
            if plane is None and name != "alpha":
                continue
            kind = getattr(plane, "dtype", type(plane).__name__)
            own = np.dtype(np.int32 if name == "ids" else np.float32)
            if not isinstance(plane, np.ndarray) or kind != own or plane.shape != wanted:
                raise TypeError(
                    f"effects: {name} of the layer {layer.name!r} must be {own} of shape "
                    f"{wanted}, got {kind} of shape {np.shape(plane)}"
                )
        parts = {name: plane for name, (plane, _) in planes.items() if plane is not None}
        if not all(plane.flags.c_contiguous for plane in parts.values()):
            # Windows cut out of a whole frame; kernels read rows that follow each other.
            parts = {name: np.ascontiguousarray(plane) for name, plane in parts.items()}
            layer = replace(layer, **parts)
        layers.append(layer)
    return tuple(layers)

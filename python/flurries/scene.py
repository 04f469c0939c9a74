"""The scene: a frame is a pure function of it and the frame number."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, choice, integer, real, seed_of
from flurries.background import Backdrop, backdrop
from flurries.camera import Camera
from flurries.effects import Frame, Layer, Snow
from flurries.foreground import Foreground, foreground_of
from flurries.path import CameraPath, as_path
from flurries.trace import stage

__all__ = ["Rendered", "Scene"]

SPACES = ("auto", "display", "linear")

# A focal length in picture widths, where none is given: 45 degrees across.
DEFAULT_FOCAL = 1.2


@dataclass(frozen=True, eq=False)
class Rendered:
    """A frame with what it is made of.

    Attributes
    ----------
    image : (h, w, 3)
        The composite, as `Scene.render` returns it.
    alpha : (h, w) float32
        Opacity of all effects together, in front of the background and behind the foreground.
    layers : dict of str to (h, w, 4) float32
        One premultiplied RGBA layer for each effect, back to front, in the light of the composite.
    """

    image: Array
    alpha: Array
    layers: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Scene:
    """What a film is made of: a background, a camera's way, and the weather.

    Parameters
    ----------
    size : (width, height), optional
        Of the frame in pixels; the background's own if not given. Files and colours are fitted to
        it (scaled to cover, cut at the sides); an array must have it.
    background : path, "#rrggbb", (r, g, b) floats, array, or source
        A picture, an image sequence (``plate.%04d.png``), or a video file; a colour; an array
        (H, W, 3) of uint8, uint16 or float. Integers hold display values, floats linear light.
    camera : Camera or CameraPath, optional
        A still camera of 1.2 picture widths if not given.
    effects : sequence
        The weather, back to front.
    fps : float
        Frames per second; where seconds become frames.
    seed : int
        Of all random numbers; each effect draws its own from it.
    foreground : path or array, optional
        What stands in front of the weather: a mask (H, W) of the background's own pixels, 1 in
        front; or a picture with alpha (H, W, 4), straight for integers, premultiplied for floats.
    space : {"auto", "display", "linear"}
        Where layers are mixed. "auto": integers in display values as the paper does, floats in
        linear light.

    Raises
    ------
    ValueError, TypeError, OSError
        For an argument that is not as described, or a file that cannot be read.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene((320, 240), "#203040", effects=[fl.Snow.preset("heavy")])
    >>> frame = scene.render(17)
    >>> frame.shape, frame.dtype.name
    ((240, 320, 3), 'uint8')
    """

    size: tuple[int, int] | None = None
    background: Any = "#000000"
    camera: Any = None
    effects: Sequence[Any] = ()
    fps: float = 30.0
    seed: int = 0
    foreground: Any = None
    space: str = "auto"
    _backdrop: Backdrop = field(init=False, repr=False)
    _foreground: Foreground | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        if self.size is not None:
            settle("size", parse_size(self.size))
        settle("fps", real("fps", self.fps, above=0.0))
        settle("seed", seed_of(self.seed))
        choice("space", self.space, SPACES)
        settle("_backdrop", backdrop(self.background, self.size))
        settle("size", self._backdrop.size)
        settle("camera", as_path(self.camera, DEFAULT_FOCAL * self.shape[1]))
        if isinstance(self.effects, Snow):
            settle("effects", (self.effects,))
        if not isinstance(self.effects, (list, tuple)):
            raise TypeError(f"effects must be a sequence of effects, got {self.effects!r}")
        effects = tuple(self.effects)
        for index, effect in enumerate(effects):
            if isinstance(effect, type) or not callable(getattr(effect, "render", None)):
                raise TypeError(f"effects[{index}] must be an effect, got {effect!r}")
        settle("effects", effects)
        front = None if self.foreground is None else foreground_of(self.foreground, self.shape)
        settle("_foreground", front)

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of a frame."""
        width, height = self.size or (0, 0)
        return height, width

    @property
    def frames(self) -> int | None:
        """How many frames the background has; None for a still."""
        return self._backdrop.count

    def __reduce__(self) -> tuple[Any, ...]:
        # What it was made from, not what was made of it: a colour is not a picture of it.
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        return _rebuilt, (values,)

    def replace(self, **changes: Any) -> Scene:
        """Return the scene with some arguments changed."""
        return replace(self, **changes)

    def render(
        self,
        t: float,
        *,
        eye: Camera | None = None,
        layers: bool = False,
        region: tuple[slice, slice] | None = None,
    ) -> Any:
        """Return the frame at `t`.

        Parameters
        ----------
        t : float
            Frame number, any float; frame 0 is the first. A background film shows its frame
            floor(t), the last one beyond its end.
        eye : Camera, optional
            Another eye, in place of the path's camera; the background stays.
        layers : bool
            Return a :class:`Rendered` with the layers apart.
        region : (rows, cols), optional
            Two slices, as from ``np.s_[100:200, 50:80]``: only that part, with the whole's bits.

        Returns
        -------
        (H, W, 3), or the region's
            uint8 or uint16 where the background is, else float32. The same bits whatever else was
            rendered before, in any process and with any number of threads.
        """
        time = real("t", t)
        window = self._window(region)
        top, bottom, left, right = window
        parts = [effect.render(frame) for effect, frame in self._asks(time, eye, window)]
        with stage("background"):
            picture = self._backdrop.frame(time)[top:bottom, left:right]
            working = self._working(picture)
        matte = None if self._foreground is None else self._foreground.window(window)
        with stage("composite"):
            return self._mixed(parts, working, picture, matte, layers)

    def _mixed(
        self,
        parts: list[Layer],
        working: Array,
        picture: Array,
        matte: Foreground | None,
        layers: bool,
    ) -> Any:
        """Return the composite of the layers, with themselves if asked for."""
        whole = None
        done: dict[str, Array] = {}
        for part in parts:
            colour = self._light(part.colour)
            # A mask keeps the weather from the background's own pixels in front.
            alpha = part.alpha
            if matte is not None:
                alpha = np.ascontiguousarray(alpha * (1.0 - matte.cover))
            working = _snow_over(working, alpha, colour)
            if layers:
                name = part.name if part.name not in done else f"{part.name}{len(done) + 1}"
                done[name] = Layer(part.name, alpha, part.colour).rgba(colour)
                whole = alpha if whole is None else 1.0 - (1.0 - whole) * (1.0 - alpha)
        if matte is not None and matte.light is not None:
            working = matte.over(working, linear=self.linear)
        image = self._finished(working, picture)
        if not layers:
            return image
        cover = np.zeros(image.shape[:2], np.float32) if whole is None else whole
        return Rendered(image, cover, done)

    def write(self, pattern: str | Path, frames: Any = None, **options: Any) -> Any:
        """Render frames to files; see :func:`flurries.render.write`."""
        from flurries.render import write

        return write(self, pattern, frames, **options)

    @staticmethod
    def load(path: str | Path) -> Scene:
        """Return the scene of a TOML file; see :mod:`flurries.scenefile`."""
        from flurries.scenefile import load

        return load(path)

    def save(self, path: str | Path) -> None:
        """Write the scene to a TOML file; backgrounds must be files or colours."""
        from flurries.scenefile import save

        save(self, path)

    @property
    def linear(self) -> bool:
        """Whether layers are mixed in linear light."""
        if self.space == "auto":
            return self._backdrop.encoding == "linear"
        return self.space == "linear"

    def _window(self, region: Any) -> tuple[int, int, int, int]:
        if region is None:
            return (0, self.shape[0], 0, self.shape[1])
        wanted = "region must be two slices, as from np.s_[100:200, 50:80]"
        if not isinstance(region, tuple) or len(region) != 2:
            raise TypeError(f"{wanted}, got {region!r}")
        window: list[int] = []
        for part, length in zip(region, self.shape, strict=True):
            if not isinstance(part, slice):
                raise TypeError(f"{wanted}, got {region!r}")
            try:
                start, stop, step = part.indices(length)
            except (TypeError, ValueError):
                raise TypeError(f"{wanted}, got {region!r}") from None
            if step != 1 or stop <= start:
                raise ValueError(f"{wanted}, inside {self.shape} and not empty, got {region!r}")
            window += [start, stop]
        return window[0], window[1], window[2], window[3]

    def _asks(
        self, t: float, eye: Camera | None, window: tuple[int, int, int, int]
    ) -> list[tuple[Any, Frame]]:
        path: CameraPath = self.camera
        if eye is not None and not isinstance(eye, Camera):
            raise TypeError(f"eye must be a Camera, got {eye!r}")
        asks = []
        for index, effect in enumerate(self.effects):
            own = getattr(effect, "seed", None)
            seed = effect_seed(self.seed, index) if own is None else own
            asks.append(
                (
                    effect,
                    Frame(
                        shape=self.shape,
                        window=window,
                        t=t,
                        fps=self.fps,
                        camera=path.camera if eye is None else eye,
                        path=path,
                        seed=seed,
                    ),
                )
            )
        return asks

    def _light(self, colour: tuple[float, float, float]) -> list[float]:
        """Return a display colour in the light that layers are mixed in."""
        if not self.linear:
            return list(colour)
        from flurries.io import srgb_to_linear

        light: list[float] = srgb_to_linear(np.asarray(colour, np.float64)).tolist()
        return light

    def _working(self, picture: Array) -> Array:
        """Return the background in the light that layers are mixed in."""
        from flurries.io.color import to_display, to_linear

        encoding = self._backdrop.encoding
        if self.linear == (encoding == "linear"):
            return np.ascontiguousarray(picture)
        return to_linear(picture, encoding) if self.linear else to_display(picture, encoding)

    def _finished(self, working: Array, picture: Array) -> Array:
        """Return the composite in the background's own encoding and dtype."""
        from flurries.io.color import to_display, to_integer, to_linear

        if self.linear == (self._backdrop.encoding == "linear"):
            # The background's own pixels where nothing lay over them: the caller gets a copy.
            return working if working.flags.writeable else working.copy()
        if not self.linear:
            return to_linear(working, "display")
        return to_integer(to_display(working, "linear"), 8 * picture.dtype.itemsize)


def _rebuilt(values: dict[str, Any]) -> Scene:
    return Scene(**values)


def effect_seed(seed: int, index: int) -> int:
    """Return the seed of the effect at a place of the list; the first one's is the scene's own."""
    if index == 0:
        return seed
    draw = np.empty(index + 1)
    _core.uniform(draw, seed, -1)
    return int(draw[index] * 2**53)


def _snow_over(background: Array, alpha: Array, colour: list[float]) -> Array:
    result = np.empty_like(background)
    _core.snow(result, background, alpha, colour)
    return result


def parse_size(size: object) -> tuple[int, int]:
    """Return (width, height) from a pair or "WIDTHxHEIGHT"."""
    if isinstance(size, str):
        parts = size.lower().split("x")
        if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
            raise ValueError(f"size must be (width, height) or 'WIDTHxHEIGHT', got {size!r}")
        size = tuple(map(int, parts))
    if not isinstance(size, (tuple, list, np.ndarray)) or len(size) != 2:
        raise TypeError(f"size must be (width, height), got {size!r}")
    width, height = (operator.index(integer("size", v, low=1, high=2**17)) for v in size)
    return width, height

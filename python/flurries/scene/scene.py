"""The scene: a frame is a pure function of it and the frame number."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

import numpy as np

from flurries._contract import Array, choice, integer, rate_of, real, seed_of, suggesting
from flurries.camera.extent import holding
from flurries.camera.lens import Camera
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath, as_path
from flurries.frame.effect import Effect
from flurries.frame.lap import Lap
from flurries.frame.picture import images
from flurries.frame.program import Program
from flurries.frame.truth import Rendered, truth
from flurries.io import open_background
from flurries.io.colorspace import ColorSpace
from flurries.io.sequences import MOST_FRAMES
from flurries.io.sources import Source
from flurries.io.spans import EXTEND
from flurries.light.lamp import Lamp
from flurries.light.sun import Sun
from flurries.scene.arguments import (
    effects_of,
    lights_of,
    parse_region,
    parse_size,
    parse_tolerance,
)
from flurries.scene.background import Backdrop, backdrop
from flurries.scene.depth import DepthMap, Distance, distance_of
from flurries.scene.files import Sources
from flurries.scene.foreground import Foreground, Mattes, frozen, mattes_of
from flurries.scene.loop import Looped, looped_scene
from flurries.scene.numbers import Frames, frames_of
from flurries.scene.output import Output
from flurries.scene.overscan import Display
from flurries.scene.words import line_of, page_of
from flurries.stereo import eyes

if TYPE_CHECKING:
    import dask.array
    from distributed import Client

    from flurries.frame.report import Plan
    from flurries.output.write import Summary

__all__ = ["Rendered", "Scene"]

Background: TypeAlias = str | Path | Sequence[float] | Array | Source
Depth: TypeAlias = float | Array | str | Path | DepthMap
Space: TypeAlias = Literal["auto", "display", "linear"]
Extend: TypeAlias = Literal["stop", "hold", "loop"]
Matte: TypeAlias = str | Path | Array | Foreground
Front: TypeAlias = Matte | Sequence[Matte] | None
Region: TypeAlias = tuple[slice, slice]

SPACES = ("auto", "display", "linear")

# Frames per second, where neither the caller nor a film says it.
DEFAULT_FPS = 30.0

# A focal length in picture widths, where none is given: 45 degrees across.
DEFAULT_FOCAL = 1.2


@suggesting
@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene(Sources):
    """What a film is made of: a background, a camera's way, and the weather.

    Parameters
    ----------
    size : (width, height), optional
        Of the frame in pixels; the background's own if not given. Files and colors are fitted to
        it (scaled to cover, cut at the sides); an array must have it.
    background : path, "#rrggbb", (r, g, b) floats, array, or source
        A picture, an image sequence (``plate.%04d.png``), or a video file; a color; an array
        (H, W, 3) of uint8, uint16 or float. Integers hold display values, floats linear light. With
        alpha, (H, W, 4), frames have it too: the weather over the picture, premultiplied for
        floats and straight for integers.
    camera : Camera or CameraPath, optional
        A still camera of 1.2 picture widths if not given.
    effects : sequence
        The weather, back to front; 1,000 at most.
    fps : float, optional
        Frames per second; where seconds become frames. A background film's own if not given, else
        30.
    seed : int
        Of all random numbers; each effect draws its own from it.
    foreground : path, array or Foreground, or a list of them, optional
        What stands in front of the weather: a mask (H, W) of the background's own pixels, 1 in
        front; or a picture with alpha (H, W, 4), straight for integers, premultiplied for floats.
        Files, sequences and films go by the frame numbers of the background. :class:`Foreground`
        gives one a depth of its own.
    space : {"auto", "display", "linear"}
        Where layers are mixed. "auto": integers in display values as the paper does, floats in
        linear light.
    depth : float, array, path or DepthMap, optional
        How far away what stands in the background is, planar depth in world units: a wall at one
        depth; an array (H, W) of float with infinity where nothing stands; an EXR or float TIFF, or
        a sequence of them, with a channel "Z" or "depth"; or a grey picture, see :class:`DepthMap`.
        Files are fitted to the frame as the background is, each pixel with the depth of one.
    sun : Sun, optional
        What shines on the gas.
    lights : sequence of Lamp
        What shines on flakes and drops; the frame is then mixed in linear light.
    lens : Lens, optional
        With an opening: flakes and drops out of its focus are soft. Everything is sharp without.
    tolerance : float
        How far values of a frame may be off, of full scale, if it saves time; see `render`.
    extend : {"stop", "hold", "loop"}
        What stands for a frame number that a sequence, a film or a camera's file does not have: an
        error, its first or last frame, or its frames over again (a camera cannot loop).
    colorspace : str, optional
        The background's color space by its name in ``$OCIO`` or the built-in configuration, such as
        "ACEScg". Layers are mixed in it if it is linear, else in the configuration's scene_linear,
        and the weather's colors are turned into it: over an ACEScg plate snow has the color that
        it has over one of Rec. 709.
    start : int, optional
        The number of the first frame of films, which have no numbers of their own. If not given
        that of the background's files, else 0.
    period : int, optional
        After so many frames the film begins again, without a jump; see `loop`.
    output : Output, optional
        How frames are written where :meth:`write` does not say.

    Raises
    ------
    ValueError, TypeError, OSError
        For an argument that is not as described, or a file that cannot be read.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene((320, 240), "#203040", effects=[fl.TentSnow.preset("heavy")])
    >>> frame = scene.render(17)
    >>> frame.shape, frame.dtype.name
    ((240, 320, 3), 'uint8')
    """

    size: tuple[int, int]
    background: Background
    camera: CameraPath
    effects: tuple[Any, ...]
    fps: float
    seed: int
    foreground: Front
    space: Space
    depth: Depth | None
    sun: Sun | None
    tolerance: float
    extend: Extend
    start: int | None
    colorspace: str | None
    lights: tuple[Lamp, ...]
    lens: Lens | None
    period: int | None
    output: Output
    _backdrop: Backdrop = field(init=False)
    _mattes: Mattes | None = field(init=False)
    # What was found in the background, such as its light: also of scenes derived from this one.
    _found: dict[tuple[str, int], Any] = field(init=False, compare=False)
    _distance: Distance | None = field(init=False)
    _path: CameraPath = field(init=False)

    def __init__(
        self,
        size: tuple[int, int] | None = None,
        background: Background = "#000000",
        camera: Camera | CameraPath | None = None,
        effects: Effect | Sequence[Effect] = (),
        fps: float | None = None,
        seed: int = 0,
        foreground: Front = None,
        space: Space = "auto",
        depth: Depth | None = None,
        sun: Sun | None = None,
        tolerance: float = 0.0,
        extend: Extend = "stop",
        start: int | None = None,
        colorspace: str | None = None,
        lights: Lamp | Sequence[Lamp] = (),
        lens: Lens | None = None,
        period: int | None = None,
        output: Output | None = None,
    ) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        wanted = None if size is None else parse_size(size)
        if fps is not None:
            fps = rate_of(fps)
        settle("seed", seed_of(seed))
        choice("space", space, SPACES)
        settle("space", space)
        settle("tolerance", parse_tolerance(tolerance))
        settle("extend", choice("extend", extend, EXTEND))
        if start is not None:
            start = integer("start", start, low=0, high=MOST_FRAMES)
        settle("start", start)
        numbers: dict[str, Any] = {"extend": extend, "start": start}
        settle("_backdrop", backdrop(background, wanted, **numbers))
        if isinstance(background, np.ndarray):
            # The copy that it was made into: the caller's array may change.
            background = self._backdrop.source
        settle("background", background)
        settle("colorspace", colorspace)
        if self.color is not None:
            if space == "display":
                raise ValueError("space must not be 'display' where a colorspace is given")
            settle("_backdrop", self._backdrop.decoded(self.color))
        if start is None and self.range is not None:
            numbers["start"] = self.range[0]
        settle("size", self._backdrop.size)
        numbers["display"] = self._backdrop.display
        if fps is None:
            fps = rate_of(self._backdrop.fps or DEFAULT_FPS)
        settle("fps", fps)
        usual = Camera(DEFAULT_FOCAL * self.display[2], aspect=self._backdrop.aspect)
        settle("camera", as_path(usual if camera is None else camera, usual.focal))
        path = holding(self.camera) if self._holds else self.camera
        settle("_path", replace(path, camera=self._in_frame(path.camera)))
        settle("effects", effects_of(effects))
        several = isinstance(foreground, (list, tuple))
        front: Any = tuple(map(frozen, foreground)) if several else frozen(foreground)  # type: ignore[arg-type]
        settle("foreground", front)
        settle("_mattes", mattes_of(front, self.shape, **numbers))
        if sun is not None and not isinstance(sun, Sun):
            raise TypeError(f"sun must be a flurries.Sun, got {sun!r}")
        settle("sun", sun)
        settle("lights", lights_of(lights))
        if lens is not None and not isinstance(lens, Lens):
            raise TypeError(f"lens must be a flurries.Lens, got {lens!r}")
        settle("lens", lens)
        if period is not None:
            period = integer("period", period, low=2, high=MOST_FRAMES)
        settle("period", period)
        if output is not None and not isinstance(output, Output):
            raise TypeError(f"output must be a flurries.Output, got {output!r}")
        settle("output", Output() if output is None else output)
        distance = None if depth is None else distance_of(depth, self.shape, **numbers)
        settle("_distance", distance)
        settle("_found", {})
        if distance is not None and np.ndim(depth) == 2:  # type: ignore[arg-type]
            # The copy that it was made into: the caller's array may change.
            depth = distance.source
        settle("depth", depth)

    def __repr__(self) -> str:
        return line_of(self)

    def _repr_html_(self) -> str:
        return page_of(self)

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of a frame."""
        width, height = self.size
        return height, width

    @property
    def display(self) -> Display:
        """Where the display window lies in the frame: (left, top, width, height), px.

        All of it, but for a background with overscan. Cameras count from its first pixel.
        """
        return self._backdrop.display or (0, 0, *self.size)

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height, as the background says."""
        return self._backdrop.aspect

    @cached_property
    def color(self) -> ColorSpace | None:
        """The background's color space, where it is said."""
        return None if self.colorspace is None else ColorSpace.of("colorspace", self.colorspace)

    def _in_frame(self, camera: Camera) -> Camera:
        """Return a camera of the display window as one of the frame."""
        if self._backdrop.display is None:
            return camera
        left, top, width, height = self._backdrop.display
        x, y = (width / 2, height / 2) if camera.center is None else camera.center
        return camera.derive(center=(left + x, top + y))

    def __reduce__(self) -> tuple[Any, ...]:
        # What it was made from, not what was made of it: a color is not a picture of it.
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        return _scene_of, (values,)

    def replace(self, **changes: Any) -> Scene:
        """Return the scene with some arguments changed."""
        return replace(self, **changes)

    def derive(self, **changes: Any) -> Scene:
        """Return the scene with some attributes changed, which are known to be right: unchecked."""
        made = object.__new__(Scene)
        # What runs belongs to the scene that it was found for.
        if "camera" in changes:
            changes["_path"] = changes["camera"]
        own = {
            name: value
            for name, value in vars(self).items()
            if name not in ("program", "fine", "_looped")
        }
        vars(made).update(own, **changes)
        return made

    @overload
    def render(
        self, t: float, *, eye: Camera | None = None, layers: Literal[False] = False,
        region: Region | None = None, tolerance: float | None = None,
    ) -> Array: ...  # fmt: skip

    @overload
    def render(
        self, t: float, *, eye: Camera | None = None, layers: Literal[True],
        region: Region | None = None, tolerance: float | None = None,
    ) -> Rendered: ...  # fmt: skip

    @overload
    def render(
        self, t: float, *, eye: Camera | None = None, layers: bool,
        region: Region | None = None, tolerance: float | None = None,
    ) -> Array | Rendered: ...  # fmt: skip

    def render(
        self,
        t: float,
        *,
        eye: Camera | None = None,
        layers: bool = False,
        region: Region | None = None,
        tolerance: float | None = None,
    ) -> Array | Rendered:
        """Return the frame at `t`.

        Parameters
        ----------
        t : float
            Frame number, any float: that of the background's files, a film's first frame being 0
            or `start`. A background that moves shows its frame floor(t).
        eye : Camera, optional
            Another eye, in place of the path's camera, that moves and turns with the path; the
            background stays.
        layers : bool
            Return a :class:`Rendered` with the layers apart.
        region : (rows, cols), optional
            Two slices, as from ``np.s_[100:200, 50:80]``: only that part, with the whole's bits.
        tolerance : float, optional
            How far any value may be off, of full scale, from the frame without a tolerance; the
            scene's own if not given. Spent where it saves most time by a fixed cost model, so that
            all machines choose alike; `plan` says on what. Layers are exact.

        Returns
        -------
        (H, W, 3), or the region's; (H, W, 4) where the background has alpha
            uint8 or uint16 where the background is, else float32. The same bits whatever else was
            rendered before, in any process and with any number of threads. Processors with other
            vector instructions may differ in the last bits, but not in the reproducible mode
            (:func:`flurries.set_reproducible`).
        """
        if eye is not None and not isinstance(eye, Camera):
            raise TypeError(f"eye must be a Camera, got {eye!r}")
        (seen,) = self._see(t, [eye], layers, region, tolerance)
        return seen

    def _see(
        self,
        t: float,
        views: Sequence[Camera | None],
        layers: bool,
        region: Region | None,
        tolerance: float | None,
    ) -> Sequence[Array | Rendered]:
        """Return what each eye sees, None being the path's camera."""
        time, window = self._in_lap(real("t", t)), parse_region(region, self.shape)
        if self.camera.extend == "stop":
            self.require([math.floor(time)], gaps=False)
        limit = self.tolerance if tolerance is None else parse_tolerance(tolerance)
        views = [None if eye is None else self._in_frame(eye) for eye in views]
        if layers:
            return truth(self.program, time, views, window)
        return images(self.program, time, views, window, limit)

    def loop(self, frames: int) -> Scene:
        """Return the scene as a film that begins again after so many frames, without a jump.

        Frame `frames` is the first one to the bit. Flakes, drops and puffs of one round give way,
        one by one, to those of the next; waves of a texture and a cone's tiles are bent to the
        nearest whole number of turns; what is keyed goes back to its first value over the last
        quarter; a camera ends as it began where that is seen. :attr:`bent` says what was changed.

        Parameters
        ----------
        frames : int
            2 or more. They count from the background's first frame, else from 0.
        """
        return self.replace(period=integer("frames", frames, low=2, high=MOST_FRAMES))

    @property
    def lap(self) -> Lap | None:
        """Which frames come over and over, of a scene with a `period`."""
        if self.period is None:
            return None
        return Lap(0 if self.range is None else self.range[0], self.period)

    def _in_lap(self, t: float) -> float:
        lap = self.lap
        return t if lap is None else lap.place(t)

    @cached_property
    def _looped(self) -> Looped:
        assert self.lap is not None
        return looped_scene(
            self.lap, effects=self.effects, path=self._path, lights=self.lights, lens=self.lens,
            seed=self.seed, fps=self.fps, moves=self.frames is not None,
        )  # fmt: skip

    @property
    def bent(self) -> tuple[str, ...]:
        """What was changed for a scene with a `period` to begin again, in words."""
        return () if self.period is None else self._looped.bent

    def holding(self) -> Scene:
        """Return the scene with a background that holds its last good frame where one is bad."""
        source = self._source
        if not isinstance(source, Source) or source.damaged == "hold":
            return self
        return self.replace(
            background=open_background(source.spec, damaged="hold", overscan=source.overscan)
        )

    @cached_property
    def fine(self) -> Scene:
        """The scene with a background of 8 bits in 16: weather over it has their steps."""
        return self if self.deep else self.derive(_backdrop=self._backdrop.fine())

    def anew(self) -> Scene:
        """Return the scene with all files to be read again, whatever is kept of them."""
        # A copy of an opened source forgets its pictures.
        given = self.background
        return self.replace(background=copy(given) if hasattr(given, "spec") else given)

    def plan(self, frames: Frames = None, *, tolerance: float | None = None) -> Plan:
        """Return what rendering costs: its steps, their sizes and times, and what is left out.

        Parameters
        ----------
        frames : str, int or iterable of int, optional
            As for :meth:`write`; of a long film a few frames stand for all.
        tolerance : float, optional
            As for :meth:`render`: the plan says what it is spent on, and the error to expect.

        Returns
        -------
        Plan
            To print, to show in a notebook, or as JSON.
        """
        from flurries.frame.estimate import plan_of

        limit = self.tolerance if tolerance is None else parse_tolerance(tolerance)
        return plan_of(self.program, frames_of(self, frames), limit)

    @cached_property
    def program(self) -> Program:
        """What runs for each frame, resolved when it is first asked for."""
        parts = (self.effects, self._path, self.lights, self.lens)
        effects, path, lights, lens = parts if self.period is None else self._looped[:4]
        return Program(
            effects=effects,
            shape=self.shape,
            fps=self.fps,
            path=path,
            seed=self.seed,
            sun=self.sun,
            backdrop=self._backdrop,
            distance=self._distance,
            mattes=self._mattes,
            linear=self.linear,
            primaries=None if self.color is None else self.color.working.from_rec709(),
            lights=lights,
            lens=lens,
            lap=self.lap,
            found=self._found,
        )

    @overload
    def stereo(
        self, t: float, *, distance: float, convergence: float | None = None,
        layers: Literal[False] = False, region: Region | None = None,
        tolerance: float | None = None,
    ) -> tuple[Array, Array]: ...  # fmt: skip

    @overload
    def stereo(
        self, t: float, *, distance: float, convergence: float | None = None,
        layers: Literal[True], region: Region | None = None, tolerance: float | None = None,
    ) -> tuple[Rendered, Rendered]: ...  # fmt: skip

    def stereo(
        self,
        t: float,
        *,
        distance: float,
        convergence: float | None = None,
        layers: bool = False,
        region: Region | None = None,
        tolerance: float | None = None,
    ) -> tuple[Array | Rendered, Array | Rendered]:
        """Return the frame at `t` as the left and the right eye see it.

        The weather lies in depth; the background and what stands in front of the weather are flat
        pictures at the depth of convergence, the same for both.

        Parameters
        ----------
        t, layers, region, tolerance
            See :meth:`render`.
        distance, convergence : float
            See :func:`flurries.stereo.eyes`.

        Returns
        -------
        left, right
            Each with the bits that :meth:`render` returns for that eye; what does not depend on the
            eye is found once for both. One and the same at distance 0.

        Warns
        -----
        UserWarning
            If an effect's texture begins so near that its disparity is half a wavelength or more:
            it is then ambiguous, and only flakes tell the depth.
        """
        pair = eyes(self.camera.camera, distance=distance, convergence=convergence)
        for index, effect in enumerate(self.effects):
            warned = getattr(effect, "warn_ambiguous", None)
            if warned is not None:
                warned(self.shape, self.camera.camera.focal, distance, index)
        if pair[0] == pair[1]:
            (both,) = self._see(t, pair[:1], layers, region, tolerance)
            return both, both
        left, right = self._see(t, pair, layers, region, tolerance)
        return left, right

    def depth_at(self, t: float) -> Array | None:
        """Return the background's planar depth at `t`, (H, W) float32, or None.

        World units, infinity where nothing stands. A sequence of depths goes by frames as the
        background does.
        """
        return None if self._distance is None else self.program.depth_at(self._in_lap(real("t", t)))

    def write(
        self,
        pattern: str | Path,
        frames: Frames = None,
        *,
        bits: Literal[8, 10, 16, "half", "float"] | None = None,
        codec: str | None = None,
        motion: Literal["y-down", "y-up"] | None = None,
        colorspace: str | None = None,
        compression: Literal["zip", "zips", "piz", "rle", "none", "dwaa", "dwab"] | None = None,
        layers: bool | None = None,
        alone: bool | None = None,
        deep: bool | None = None,
        eyes: Mapping[str, Camera] | None = None,
        overwrite: bool = False,
        damaged: Literal["stop", "skip", "hold"] | None = None,
        sound: bool | None = None,
        manifest: bool | None = None,
        quality: Literal["high", "medium", "draft"] | None = None,
        dask: Client | str | bool | None = None,
        dask_patience: float = 60.0,
        progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
    ) -> Summary:
        """Render frames to files: a sequence, a film or a still.

        Run again, it makes what is missing. Bits, codec and the like that are not given are those
        of the scene's :class:`Output`. :func:`flurries.output.write.write` says more of each
        option.

        Parameters
        ----------
        pattern : str or path
            ``frames/%04d.exr``, a sequence; ``film.mp4``, a film; ``still.png``, one picture.
        frames : str, int or iterable of int, optional
            "1-60", "1-100x2", "7", or numbers: those of the background's files. For a still one
            number will do. If not given, all that the background has, or three seconds from 1 on.
        bits : 8, 10, 16, "half" or "float", optional
            Of a color, as far as the file holds them.
        codec : str, optional
            Of a film: "h264", "h265", "prores-hq", "prores-4444", "dnxhr", ...
        motion : {"y-down", "y-up"}
            Which way motion vectors in layers count.
        colorspace : str, optional
            What is written, by its name in ``$OCIO``; the scene's own if not given.
        compression : {"zip", "zips", "piz", "rle", "none", "dwaa", "dwab"}
            How an EXR packs its pixels; the last two are lossy.
        layers : bool
            EXR only: the weather, depth and motion as channels beside the composite.
        alone : bool
            The weather alone as RGBA: .exr, .png or .tif.
        deep : bool
            EXR only: the weather alone as deep samples.
        eyes : mapping of str to Camera, optional
            EXR only: a view for each eye.
        overwrite : bool
            Replace files that are there, whatever they are.
        damaged : {"stop", "skip", "hold"}
            What becomes of frames whose background is missing or damaged.
        sound : bool
            Keep the sound of a background film.
        manifest : bool
            Write ``flurries.json`` beside a sequence.
        quality : {"high", "medium", "draft"}
            Of a film.
        dask : True, str or distributed.Client, optional
            Work on a Dask cluster: one made here, one at an address, or a client's.
        dask_patience : float
            How long to wait while the cluster has no worker, seconds.
        progress : callable, optional
            Wraps the frames, as tqdm does.

        Returns
        -------
        Summary
            What was written, what was there, and the files.

        Raises
        ------
        ValueError, TypeError
            For an unusable pattern or range, or where something else is in the way.
        OSError
            If something cannot be read or written; no half-written file stays.
        """
        from flurries.output.write import write

        return write(
            self, pattern, frames, bits=bits, codec=codec, motion=motion, colorspace=colorspace,
            compression=compression, layers=layers, alone=alone, deep=deep,
            eyes=eyes,
            overwrite=overwrite, damaged=damaged, sound=sound, manifest=manifest,
            quality=quality, dask=dask, dask_patience=dask_patience, progress=progress,
        )  # fmt: skip

    def to_dask(self, frames: Frames = None, *, group: int | None = None) -> dask.array.Array:
        """Return frames as a lazy Dask array; see :func:`flurries.output.groups.to_dask`."""
        from flurries.output.groups import to_dask

        made: dask.array.Array = to_dask(self, frames, group=group)
        return made

    @staticmethod
    def load(path: str | Path) -> Scene:
        """Return the scene of a TOML file; see :mod:`flurries.scene.toml`."""
        from flurries.scene.toml import load

        return load(path)

    def save(self, path: str | Path) -> None:
        """Write the scene to a TOML file; backgrounds must be files or colors."""
        from flurries.scene.toml import save

        save(self, path)

    @property
    def linear(self) -> bool:
        """Whether layers are mixed in linear light."""
        if self.space == "auto":
            lit = bool(self.lights) or any(
                getattr(effect, "lit_by_places", False) for effect in self.effects
            )
            return lit or self._backdrop.encoding == "linear"
        return self.space == "linear"


def expect_scene(scene: object) -> Scene:
    """Return a scene, or refuse what is none."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a flurries.Scene, got {type(scene).__name__}")
    return scene


def _scene_of(values: dict[str, Any]) -> Scene:
    return Scene(**values)

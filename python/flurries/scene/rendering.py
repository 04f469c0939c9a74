"""What a scene makes: frames as arrays, for one eye or two, as files, and a plan of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from flurries._contract import Array, real
from flurries.camera.lens import Camera
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath
from flurries.effects.color import is_local
from flurries.effects.mist import Mist
from flurries.effects.texture import Texture
from flurries.frame.needs import renderer_of
from flurries.frame.picture import images
from flurries.frame.program import Program
from flurries.frame.truth import Rendered, truth
from flurries.frame.view import Frame, Lap
from flurries.io.colorspace import ColorSpace
from flurries.light.lamp import Lamp, Sun
from flurries.light.shot import Light
from flurries.scene.arguments import parse_region
from flurries.scene.files import Frames, Sources, frames_of
from flurries.scene.loop import looped_scene
from flurries.scene.numbered import Display
from flurries.scene.output import OutputFields, takes_output
from flurries.stereo import eyes

if TYPE_CHECKING:
    import dask.array
    from distributed import Client
    from typing_extensions import Self, Unpack

    from flurries.frame.plan import Plan
    from flurries.output.write import Summary

Region: TypeAlias = tuple[slice, slice]
Space: TypeAlias = Literal["auto", "display", "linear"]


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Rendering(Sources):
    """The part of a scene that makes its frames."""

    effects: tuple[Any, ...]
    seed: int
    _space: Space
    _sun: Sun | None
    _colorspace: str | None
    lights: tuple[Lamp, ...]
    light: Light | None
    lens: Lens | None
    loop: int | None
    _still: bool = field(init=False)  # Whether it is one picture, exposed as a photograph is.
    _path: CameraPath = field(init=False)
    # What was found in the background, such as its light: also of scenes derived from this one.
    _found: dict[str, tuple[Any, ...]] = field(init=False, compare=False)

    @property
    def _shape(self) -> tuple[int, int]:
        return self.size[1], self.size[0]

    @cached_property
    def _color(self) -> ColorSpace | None:
        return None if self._colorspace is None else ColorSpace.of("colorspace", self._colorspace)

    @property
    def _linear(self) -> bool:
        if self._space == "auto":
            mist = any(isinstance(e, Mist) and is_local(e.color) for e in self.effects)
            return mist or self._backdrop.encoding == "linear" or bool(self.lights)
        return self._space == "linear"

    @property
    def _display(self) -> Display:
        """The display window in the frame: (left, top, width, height), px."""
        return self._backdrop.display or (0, 0, *self.size)

    def _in_frame(self, camera: Camera) -> Camera:
        if self._backdrop.display is None:
            return camera
        left, top, width, height = self._display
        x, y = (width / 2, height / 2) if camera.center is None else camera.center
        return camera.derive(center=(left + x, top + y))

    @property
    def _lap(self) -> Lap | None:
        """Which frames come over and over, of a scene with a `loop`."""
        if self.loop is None:
            return None
        return Lap(0 if self._range is None else self._range[0], self.loop)

    def _time_of(self, t: float) -> float:
        """Return the time that is shown at `t`: another one where a scene has a `loop`."""
        lap, time = self._lap, real("t", t)
        return time if lap is None else lap.place(time)

    @cached_property
    def _looped(self) -> tuple[Rendering, tuple[str, ...]]:
        assert self._lap is not None
        return looped_scene(self, self._lap)

    @property
    def _bent(self) -> tuple[str, ...]:
        """The changes to a scene with a `loop` so that it begins again, in words."""
        return () if self.loop is None else self._looped[1]

    @cached_property
    def _program(self) -> Program:
        """The program of each frame, resolved when it is first asked for."""
        # What runs is bent where it is to begin again; light is mixed as the scene itself says.
        one = self if self.loop is None else self._looped[0]
        base = Frame(
            shape=self._shape, window=(0, self.size[1], 0, self.size[0]), t=0.0, fps=self.fps,
            camera=one._path.camera, path=one._path, seed=0, sun=self._sun, lights=one.lights,
            lens=one.lens, lap=self._lap, still=self._still,
        )  # fmt: skip
        return Program(
            effects=one.effects, base=base, seed=self.seed, backdrop=self._backdrop,
            distance=self._distance, mattes=self._mattes, linear=self._linear,
            primaries=None if self._color is None else self._color.working.from_rec709(),
            light=one.light, found=self._found,
        )  # fmt: skip

    def _derive(self, **changes: Any) -> Self:
        """Return the scene with some attributes changed, without checks."""
        made = object.__new__(type(self))
        if "camera" in changes:
            changes["_path"] = changes["camera"]
        # What runs belongs to the scene that it was found for.
        found = {"_program", "_fine", "_looped"}
        vars(made).update({k: v for k, v in vars(self).items() if k not in found}, **changes)
        return made

    def render(self, t: float, *, region: Region | None = None, eye: Camera | None = None) -> Array:
        """Return the frame at `t`: (H, W, 3), or (H, W, 4) where the background has alpha.

        It is uint8 or uint16 where the background is, else float32. The same bits whatever was
        rendered before, in any process and number of threads; see :func:`flurries.settings`.

        Parameters
        ----------
        t : float
            Frame number, any float: that of the background's files, a film's first frame being 0 or
            `start`. A background that moves shows its frame floor(t).
        region : (rows, cols), optional
            Two slices, as from ``np.s_[100:200, 50:80]``: only that part, with the whole's bits.
        eye : Camera, optional
            Another eye in place of the camera, which goes with its path; the background stays.
        """
        time, window, eyes = self._asked(t, region, [eye])
        return images(self._program, time, eyes, window)[0]

    def layers(
        self, t: float, *, region: Region | None = None, eye: Camera | None = None
    ) -> Rendered:
        """Return the frame at `t` with its layers apart, their depth, motion, coverage and ids."""
        time, window, eyes = self._asked(t, region, [eye])
        return truth(self._program, time, eyes, window)[0]

    def stereo(
        self, t: float, *, distance: float, convergence: float | None = None,
        region: Region | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return the frame at `t` as the left and the right eye see it.

        The weather lies in depth; background and foreground are flat, at the depth of convergence.
        A texture so near that its disparity, half a wavelength or more, is ambiguous is warned of.
        `distance` and `convergence` are those of :func:`flurries.stereo.eyes`, `t` and `region` of
        :meth:`render`.
        """
        pair = eyes(self.camera.camera, distance=distance, convergence=convergence)
        for index, effect in enumerate(self.effects):
            texture = getattr(renderer_of(effect), "texture", None)
            if isinstance(texture, Texture):
                texture.warn_ambiguous(self._shape, self.camera.camera.focal, distance, index)
        time, window, both = self._asked(t, region, pair[:1] if pair[0] == pair[1] else pair)
        seen = images(self._program, time, both, window)
        return seen[0], seen[-1]

    def _asked(
        self, t: float, region: Region | None, views: Sequence[Camera | None]
    ) -> tuple[float, Any, list[Camera | None]]:
        """Return time, window and the eyes in the frame, None being the path's camera."""
        for eye in views:
            if eye is not None and not isinstance(eye, Camera):
                raise TypeError(f"eye must be a Camera, got {eye!r}")
        window = self._program.base.window if region is None else parse_region(region, self._shape)
        eyes = [None if eye is None else self._in_frame(eye) for eye in views]
        time = self._time_of(t)
        if self.camera.extend == "stop":
            self._require([math.floor(time)], gaps=False)
        return time, window, eyes

    def _depth_at(self, t: float) -> Array | None:
        """Return the background's planar depth at `t`, (H, W) float32, or None."""
        return None if self._distance is None else self._program.depth_at(self._time_of(t))

    def plan(self, frames: Frames = None, *, probe: bool = True, accuracy: bool = False) -> Plan:
        """Return the steps of rendering, their times and memory, and what is left out.

        To print, to show in a notebook, or as JSON.

        Parameters
        ----------
        frames : str, int or iterable of int, optional
            As for :meth:`write`, but one for a still. Of a film a few stand for all: the first, the
            middle and the last, and some where something is keyed.
        probe : bool
            Whether to render these, at most five, twice each, for memory and times on this machine.
        accuracy : bool
            Whether to say what the middle one takes and looks like with the hand-over of Snow and
            Rain at half, once and twice its depth, and with every flake drawn.
        """
        from flurries.frame.plan import plan_of
        from flurries.scene.accuracy import accuracy_of

        numbers = frames_of(self, frames)[: 1 if frames is None and self._still else None]
        plan = replace(plan_of(self._program, numbers, probe=probe), bent=self._bent)
        middle = numbers[(len(numbers) - 1) // 2]
        return replace(plan, accuracy=accuracy_of(self, middle) if accuracy else None)

    @takes_output
    def write(
        self, pattern: str | Path, frames: Frames = None, *,
        eyes: Mapping[str, Camera] | None = None, overwrite: bool = False,
        dask: Client | str | bool | None = None, dask_patience: float = 60.0,
        progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
        **output: Unpack[OutputFields],
    ) -> Summary:  # fmt: skip
        """Render frames to files: a sequence, a film or a still.

        Each file has a line in ``flurries.jsonl`` beside it, with its hash and all that it depends
        on; no file is ever half-written, and a run that was killed goes on. Fields of
        :class:`Output` that are not given are those of the scene's own. Frame numbers that a file
        or the camera lacks are a ValueError; files that change meanwhile are an OSError.

        Parameters
        ----------
        pattern : str or path
            ``frames/%04d.png`` (also ``####`` and ``$F4``) or ``.exr``, ``.tif``, ``.jpg``: one
            file a frame; without a token a still. A name in .mp4, .mov, .webm or .mkv is a video;
            one in .usd, .usda or .usdc a USD stage with the flakes as points. A file of this very
            scene stays; any other is refused. Pictures also go to a url, such as
            ``s3://bucket/frames/%04d.png`` (``flurries[stores]`` and the store's own driver).
        frames : str, int or iterable of int, optional
            "1-60", "1-100x2", "7", or numbers: those of the background's files. If not given, all
            that the background has, else camera or depth, else three seconds from 1 on.
        eyes : mapping of str to Camera, optional
            EXR only: views such as ``{"left": ..., "right": ...}``, a part of the file for each.
        overwrite : bool
            Replace what is there, whatever it is.
        dask : True, str or distributed.Client, optional
            Render on a Dask cluster (``flurries[dask]``): one made on this machine, that of an
            address, such as ``tcp://host:8786``, or a client's.
        dask_patience : float
            How long to wait for a worker, and for one that is silent, seconds; then TimeoutError.
        progress : callable, optional
            Wraps the frames, as tqdm does.
        **output
            The fields of :class:`Output`.
        """
        from flurries.output.write import write

        return write(
            self, pattern, frames, output, eyes=eyes, overwrite=overwrite, dask=dask,
            dask_patience=dask_patience, progress=progress,
        )  # fmt: skip

    def to_dask(self, frames: Frames = None, *, group: int | None = None) -> dask.array.Array:
        """Return `render`'s frames as a lazy Dask array (T, H, W, 3), `group` of them a chunk."""
        from flurries.output.cluster import to_dask

        made: dask.array.Array = to_dask(self, frames, group=group)
        return made

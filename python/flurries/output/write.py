"""A scene to files: sequences that go on where they stopped, and videos."""

from __future__ import annotations

import inspect
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import flag, suggestion
from flurries.camera.lens import Camera
from flurries.effects.drawn import STEP, drawn_of, velocities
from flurries.frame.mixing import free_name
from flurries.io import Pattern
from flurries.io.colorspace import ColorSpace
from flurries.io.sequences import VIDEO_EXTENSIONS, with_percent
from flurries.io.stage import PointStage, require_usd
from flurries.io.stores import store_of
from flurries.output.cluster import grouped, run_on
from flurries.output.film import Frames, write_film
from flurries.output.journal import Mark
from flurries.output.sequence import Fates, Job, Progress, run
from flurries.scene.content import Content
from flurries.scene.files import Frames as Numbers
from flurries.scene.files import frames_of
from flurries.scene.fingerprint import fingerprint, short_hash
from flurries.scene.rendering import Rendering
from flurries.scene.scene import Scene, expect_scene

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Summary"]


@dataclass(frozen=True)
class Summary:
    """The frames and files of a call of `write`.

    Attributes
    ----------
    written, kept : list of int
        Frames that were rendered now; and those of this scene that were there already, or that
        another process made meanwhile.
    files : list of Path or str
        All files of the request that are there, in order; the one video. Urls are strings.
    skipped, held : list of int
        Frames that were left out because their background is missing or damaged; and those whose
        background is that of an earlier one, for the same reason.
    seconds : float
        How long it took.
    sound : str
        What became of the background's sound: "kept", "none", or why it was left out.
    """

    written: list[int]
    kept: list[int]
    files: Sequence[Path | str]
    skipped: list[int] = field(default_factory=list)
    held: list[int] = field(default_factory=list)
    seconds: float = 0.0
    sound: str = "none"


def write(
    scene: Rendering, pattern: str | Path, frames: Numbers = None,
    output: Mapping[str, Any] = MappingProxyType({}), *, eyes: Mapping[str, Camera] | None = None,
    overwrite: bool = False, dask: Client | str | bool | None = None, dask_patience: float = 60.0,
    progress: Progress | None = None,
) -> Summary:  # fmt: skip
    """Render frames to files; see :meth:`flurries.Scene.write`."""
    scene = expect_scene(scene)
    started = time.monotonic()
    known = tuple(inspect.signature(Rendering.write).parameters)[1:]
    for name in output:
        if name not in known:
            raise TypeError(f"write has no {name!r}{suggestion(name, known)}")
    flag("overwrite", overwrite)
    asked = scene._output.given(output)
    store, text = store_of(os.fspath(pattern))
    text = with_percent(text)
    suffix = Path(text).suffix.lower()
    bar = progress if progress is not None else iter
    if suffix in USD_EXTENSIONS:
        wanted = _points_of(scene, frames, store, text, {**output, "eyes": eyes, "dask": dask})
        fates = run(Points(scene, Path(text), wanted, overwrite=overwrite), [0], bar)
        return _summary(fates, [Path(text)], started)
    film = suffix in VIDEO_EXTENSIONS
    still = not film and "%" not in Path(text).name
    if not still and isinstance(frames, (int, np.integer)):
        raise ValueError(
            f"frames of a film or a sequence must be a range: '1-{frames}' for {frames} frames, "
            f"'{frames}' for frame {frames} alone; got {frames}"
        )
    if scene._still and film:
        # A film's rate is the scene's from here on, and its frames are exposed as those of films.
        scene = scene.replace(fps=scene.fps)
    wanted = frames_of(scene, frames, film=film)
    target = Pattern(_token_for(text) if still else text)
    if still:
        if frames is not None and len(wanted) > 1:
            raise ValueError(
                f"{text} is one file for {len(wanted)} frames; a name such as "
                f"{Path(_token_for(text, '.%04d')).name} has one for each"
            )
        wanted = wanted[:1]
    scene._require(wanted, gaps=asked.damaged == "stop")
    # The scene's own codec is for films, and its compression for what is packed so.
    asked = replace(asked, codec=asked.codec if film else output.get("codec"))
    packed = text.lower().endswith(".exr") and asked.kind in ("composite", "alone") and not eyes
    if not packed and output.get("compression") is None:
        asked = replace(asked, compression="zip")
    if asked.colorspace is not None and scene._colorspace is None:
        raise ValueError(
            "colorspace of what is written needs the scene's own colorspace, such as "
            "'sRGB - Display' (--colorspace)"
        )
    own = scene._colorspace if asked.colorspace is None else asked.colorspace
    space, views = None if own is None else ColorSpace.of("colorspace", own), _views(eyes)
    asked.require(text, space, film=film, eyes=views is not None)
    if store.local:
        scene._require_apart({n: Path(text) if still else target.path(n) for n in wanted})
    # Workers stand in folders of their own.
    place = text if dask is None or not store.local else str(Path(text).absolute())
    content = Content.of(scene, asked, views, space)
    job = Frames(content, place, store, overwrite=overwrite)
    if film:
        if not store.local:
            raise ValueError(f"{pattern}: a video is written to this machine; copy it from there")
        fates, heard = write_film(job, wanted, bar, dask, dask_patience)
        return _summary(fates, [target.path(0)], started, heard)
    fates = run_on(dask, dask_patience, job, grouped(scene, wanted), bar)
    left_out = set(fates.of("skipped"))
    paths = [Path(text) if still else target.path(n) for n in wanted if n not in left_out]
    return _summary(fates, [store.name_of(path) for path in paths], started)


def _summary(fates: Fates, files: list[Path | str], started: float, heard: str = "none") -> Summary:
    return Summary(
        fates.of("written", "held"), fates.of("kept"), files, fates.of("skipped"), fates.of("held"),
        time.monotonic() - started, heard,
    )  # fmt: skip


def _points_of(
    scene: Scene, frames: Numbers, store: Any, text: str, options: Mapping[str, Any]
) -> list[int]:
    """Return the frames of a stage of points, or refuse what a stage has not."""
    names = ("bits", "codec", "layers", "alone", "deep", "eyes", "dask")
    given = [name for name in names if options.get(name) not in (None, False)]
    if given:
        raise ValueError(f"{text}: a USD stage holds points; it takes no {' and no '.join(given)}")
    if not store.local or "%" in text:
        raise ValueError(f"{text}: a USD stage is one file on this machine")
    wanted = frames_of(scene, frames)
    scene._require(wanted, gaps=False)
    return wanted


def _views(eyes: Any) -> dict[str, Camera] | None:
    if eyes is None:
        return None
    if not isinstance(eyes, Mapping) or not eyes:
        raise TypeError(f"eyes must be a mapping such as {{'left': Camera, ...}}, got {eyes!r}")
    for name, eye in eyes.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"eyes must be called like 'left' and 'right', got {name!r}")
        if not isinstance(eye, Camera):
            raise TypeError(f"eyes: {name!r} must be a Camera, got {eye!r}")
    return dict(eyes)


def _token_for(text: str, token: str = "%d") -> str:
    """Return a pattern of the same folder and format, for its checks."""
    path = Path(text)
    if not path.suffix:
        raise ValueError(f"pattern {text!r} needs an extension such as .png, .exr or .mp4")
    return str(path.with_name(f"{path.stem}{token}{path.suffix}"))


USD_EXTENSIONS = (".usd", ".usda", ".usdc")

MOST_POINTS = 100_000_000  # Points of all frames together: some 4 GB in the file.


class Points(Job):
    """A USD stage with the flakes that are in view, and the camera."""

    def __init__(self, scene: Scene, path: Path, frames: list[int], *, overwrite: bool) -> None:
        require_usd()
        self.scene, self.path, self.numbers, self.overwrite = scene, path, frames, overwrite
        self.folder = path.parent
        self._mark = Mark(short_hash((fingerprint(scene), frames)), frames[0])

    def frames(self, index: int) -> list[int]:
        return self.numbers

    def path_of(self, index: int) -> Path:
        return self.path

    def mark_of(self, index: int) -> Mark:
        return self._mark

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        scene, program = self.scene, self.scene._program
        names: list[str] = []
        for effect in scene.effects:
            names.append(free_name(getattr(effect, "NAME", "effect"), names))
        stage = PointStage(self.numbers, scene.fps, self._mark.scene)
        for number in numbers:
            for name, found in points_at(scene, names, number).items():
                stage.add(name, number, *found)
                if stage.total > MOST_POINTS:
                    raise ValueError(
                        f"{self.path}: more than {MOST_POINTS} points up to frame {number}; take "
                        "fewer frames, or a population with a smaller far or density"
                    )
            t = scene._time_of(number)
            eye = program.camera(None, t)
            lens = eye.focals, eye.principal(scene._shape), scene._shape
            place = program.base.path.place(t, fps=scene.fps) + eye.matrix() @ eye.offset
            stage.see(number, eye.matrix(), place, *lens)
        if not stage.prims:
            raise ValueError(
                f"{self.path}: points are flakes of Snow and Rain; the scene has none that are "
                "drawn one by one"
            )
        return stage

    def save(self, path: Path, made: PointStage, header: dict[str, Any]) -> None:
        made.save(path)


def points_at(scene: Scene, names: list[str], number: float) -> dict[str, Any]:
    """Return the flakes of each effect that has any and their velocities, by its name."""
    program = scene._program
    t = scene._time_of(number)
    found = {}
    for part in program.parts:
        frame = replace(program.frame(t), seed=part.seed)
        moment = frame.t + STEP
        later = replace(frame, t=moment, camera=program.camera(None, moment))
        now, then = drawn_of(part.effect, frame), drawn_of(part.effect, later)
        if now is not None and then is not None:
            found[names[part.place]] = now, velocities(now, then, STEP / scene.fps)
    return found

"""A scene to files: sequences that go on where they stopped, and videos."""

from __future__ import annotations

import inspect
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import flag, suggestion
from flurries.camera.lens import Camera
from flurries.io import Pattern
from flurries.io.colorspace import ColorSpace
from flurries.io.pictures.writer import format_of
from flurries.io.sequences import VIDEO_EXTENSIONS, with_percent
from flurries.output.cluster import cluster
from flurries.output.contents import Content, Frames
from flurries.output.crew import make
from flurries.output.film import write_film
from flurries.output.groups import grouped
from flurries.output.points import EXTENSIONS as USD
from flurries.output.points import write_points
from flurries.output.sequence import Progress, run
from flurries.output.store import store_of
from flurries.scene.files import Frames as Numbers
from flurries.scene.files import frames_of
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
    written : list of int
        Frames that were rendered now.
    kept : list of int
        Frames of this scene that were there already, or that another process made meanwhile.
    files : list of Path or str
        All files of the request that are there, in order; the one video. Urls are strings.
    skipped : list of int
        Frames that were left out because their background is missing or damaged.
    held : list of int
        Frames whose background is that of an earlier one, for the same reason.
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
    asked = scene.output.given(output)
    store, text = store_of(os.fspath(pattern))
    text = with_percent(text)
    bar: Progress = iter if progress is None else progress
    if Path(text).suffix.lower() in USD:
        wanted = _points_of(scene, frames, store, text, {**output, "eyes": eyes, "dask": dask})
        done = write_points(scene, Path(text), wanted, bar, overwrite=overwrite)
        return Summary(done.written, done.kept, [Path(text)], seconds=time.monotonic() - started)
    still = Path(text).suffix.lower() not in VIDEO_EXTENSIONS and "%" not in Path(text).name
    if not still and isinstance(frames, (int, np.integer)):
        raise ValueError(
            f"frames of a film or a sequence must be a range: '1-{frames}' for {frames} frames, "
            f"'{frames}' for frame {frames} alone; got {frames}"
        )
    film = Path(text).suffix.lower() in VIDEO_EXTENSIONS
    if scene._still and film:
        # A film's rate is the scene's from here on, and its frames are exposed as those of films.
        scene = scene.replace(fps=scene.fps)
    wanted = frames_of(scene, frames, film=film)
    if still:
        target = Pattern(_token_for(text))
        if frames is not None and len(wanted) > 1:
            raise ValueError(
                f"{text} is one file for {len(wanted)} frames; a name such as "
                f"{Path(_token_for(text, '.%04d')).name} has one for each"
            )
        wanted = wanted[:1]
    else:
        target = Pattern(text)
    scene._require(wanted, gaps=asked.damaged == "stop")
    kind, packed = asked.kind, asked.compression
    # The scene's own codec is for films, and its compression for what is packed so.
    codec = asked.codec if target.is_video else output.get("codec")
    if output.get("compression") is None and (
        kind in ("layers", "deep") or eyes or not text.lower().endswith(".exr")
    ):
        packed = "zip"
    own = scene.colorspace if asked.colorspace is None else asked.colorspace
    if own is not None and scene.colorspace is None:
        raise ValueError(
            "colorspace of what is written needs the scene's own colorspace, such as "
            "'sRGB - Display' (--colorspace)"
        )
    space = None if own is None else ColorSpace.of("colorspace", own)
    content = Content(kind, asked.bits, codec, asked.motion, _views(eyes), packed, space)
    _require_room(text, content, is_video=target.is_video)
    if store.local:
        places = {n: Path(text) if still else target.path(n) for n in wanted}
        _require_apart(scene, places)
    job = Frames(
        scene._holding() if asked.damaged == "hold" else scene, content,
        # Workers stand in folders of their own.
        text if dask is None or not store.local else str(Path(text).absolute()), store,
        overwrite=overwrite, skip=asked.damaged == "skip",
    )  # fmt: skip
    heard = "none"
    if target.is_video:
        if not store.local:
            raise ValueError(f"{pattern}: a video is written to this machine; copy it from there")
        done, heard = write_film(
            job, wanted, asked.quality, bar, sound=asked.sound, dask=dask, patience=dask_patience
        )
        files: list[Path | str] = [target.path(0)]
    elif dask is None:
        done = run(job, wanted, bar)
    else:
        with cluster(job, dask, dask_patience) as crew:
            done = run(job, wanted, bar, partial(make, crew, grouped(scene, wanted)))
    if not target.is_video:
        left_out = set(done.skipped)
        paths = [Path(text) if still else target.path(n) for n in wanted if n not in left_out]
        files = [store.name_of(path) for path in paths]
    seconds = time.monotonic() - started
    return Summary(done.written, done.kept, files, done.skipped, done.held, seconds, heard)


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


def _require_apart(scene: Scene, places: dict[int, Path]) -> None:
    """Refuse to write over the files that the scene is made of."""
    for name, files in scene._files.items():
        for number, place in places.items():
            if hasattr(files.source, "spec") and place.resolve() == files.file(number).resolve():
                raise ValueError(f"{place} is the {name} itself: write to another name")


def _require_room(text: str, content: Content, *, is_video: bool) -> None:
    """Refuse a kind of file that cannot hold what is asked for."""
    exr, alone = text.lower().endswith(".exr"), content.kind == "alone"
    apart = content.kind in ("layers", "deep") or content.eyes is not None
    tiff = text.lower().endswith((".tif", ".tiff"))
    known = (content.bits,) if is_video else format_of(text).kinds
    space = None if apart and content.kind != "deep" else content.space
    rules = [
        (is_video and alone and content.codec != "prores-4444",
         f"alone needs codec='prores-4444' in a film, or .exr, .png, .tif: {text}"),
        (not is_video and content.codec is not None, f"codec is one of a film, got {text!r}"),
        (not is_video and alone and not (exr or tiff or text.lower().endswith(".png")),
         f"alone needs .exr, .png or .tif, and no layers, got {text!r}"),
        (content.bits is not None and content.bits not in known,
         f"bits must be {', '.join(map(str, known))} in {text}, got {content.bits!r}"),
        (content.kind in ("alone", "deep") and content.eyes is not None,
         f"{content.kind} and eyes must not both be given"),
        (content.compression != "zip" and (apart or not exr),
         "compression is for a composite or the weather alone in an EXR, got "
         f"{content.compression!r} for {text!r}"),
        (space is not None and space.linear and not (exr or tiff),
         f"colorspace {space and space.name!r} is linear, which {text} cannot hold: give another "
         "one for it, such as 'sRGB - Display' (--output-colorspace)"),
        (space is not None and not space.linear and exr,
         f"colorspace {space and space.name!r} is not linear, as an EXR is: {text}"),
        (content.kind in ("layers", "deep") and not exr,
         f"{content.kind} needs an EXR, got {text!r}"),
        (content.eyes is not None and not exr, f"eyes need an EXR, got {text!r}"),
    ]  # fmt: skip
    for refused, why in rules:
        if refused:
            raise ValueError(why)


def _token_for(text: str, token: str = "%d") -> str:
    """Return a pattern of the same folder and format, for its checks."""
    path = Path(text)
    if not path.suffix:
        raise ValueError(f"pattern {text!r} needs an extension such as .png, .exr or .mp4")
    return str(path.with_name(f"{path.stem}{token}{path.suffix}"))

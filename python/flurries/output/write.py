"""A scene to files: sequences that go on where they stopped, and videos."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import Array, choice, flag
from flurries.camera.lens import Camera
from flurries.output.contents import Content
from flurries.output.sequence import Progress
from flurries.scene.numbers import frames_of

if TYPE_CHECKING:
    from flurries.scene.scene import Scene

__all__ = ["Summary", "write"]

DAMAGED = ("stop", "skip", "hold")


@dataclass(frozen=True)
class Summary:
    """What was written.

    Attributes
    ----------
    written : list of int
        Frames that were rendered now.
    kept : list of int
        Frames of this scene that were there already, or that another process made meanwhile.
    files : list of Path
        All files of the request that are there, in order; the one video.
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
    files: list[Path]
    skipped: list[int] = field(default_factory=list)
    held: list[int] = field(default_factory=list)
    seconds: float = 0.0
    sound: str = "none"


def write(
    scene: Scene,
    pattern: str | Path,
    frames: str | int | Iterable[int] | None = None,
    *,
    half: bool = True,
    layers: bool = False,
    alone: bool = False,
    eyes: Mapping[str, Camera] | None = None,
    overwrite: bool = False,
    damaged: str = "stop",
    sound: bool = True,
    manifest: bool = True,
    quality: str = "high",
    dask: Any = None,
    progress: Progress | None = None,
) -> Summary:
    """Render frames to files.

    Several processes, on one machine or many, may write one sequence: each makes the frames that
    no other is making, and returns when all are there. One that is killed loses the frames that it
    was at, which the others or the next run make again; no file is ever half-written.

    Parameters
    ----------
    scene : Scene
        What to render.
    pattern : str or path
        ``frames/%04d.png`` or ``.exr``, ``.tif``, ``.jpg``: one file a frame, each written under a
        temporary name, checked and renamed. Frames of this very scene that are there already stay;
        a frame of another scene is refused. A name that ends in .mp4, .mov, .webm or .mkv is a
        video, which replaces an old one when it is whole. A picture's name without a token is a
        still: the first of `frames`.
    frames : str, int or iterable of int, optional
        "1-60", "1-100x2", "7", or numbers; not negative. If not given, the background's frames from
        0 on, or three seconds from 1 on.
    half : bool
        EXR as half floats, else 32 bits.
    layers : bool
        EXR only: everything that is known of the frame as named channels beside the composite, see
        `flurries.output.contents.planes`.
    alone : bool
        The weather alone as RGBA, without background and foreground's picture: premultiplied linear
        light in EXR, straight display values in PNG. Not for video.
    eyes : mapping of str to Camera, optional
        EXR only: the views of these eyes, such as ``{"left": ..., "right": ...}``, one part of the
        file for each.
    overwrite : bool
        Render again what is there, whatever scene it belongs to.
    damaged : {"stop", "skip", "hold"}
        What becomes of a frame whose background is missing or damaged: an error, left out, or
        rendered over the last good background before it.
    sound : bool
        Keep the sound of a film that is the background in a video, where the frames follow each
        other at the film's own rate.
    manifest : bool
        Write ``flurries.json`` beside a sequence: the frame, the scene, the size and the SHA-256 of
        each file, see `flurries.output.manifest`.
    quality : {"high", "medium", "draft"}
        Of a video.
    dask : True, str or distributed.Client, optional
        Render on a Dask cluster: one made on this machine, the one whose scheduler answers at an
        address such as ``tcp://host:8786``, or a client's. Workers write where this process would;
        one that dies loses nothing. Needs ``flurries[dask]``.
    progress : callable, optional
        Wraps the frames, as tqdm does.

    Returns
    -------
    Summary

    Raises
    ------
    ValueError
        For an unusable pattern or range, or where frames of another scene are in the way.
    OSError
        If something cannot be written; no half-written file stays.
    """
    from flurries.scene.scene import expect_scene

    expect_scene(scene)
    started = time.monotonic()
    for name, value in (
        ("half", half), ("layers", layers), ("alone", alone), ("overwrite", overwrite),
        ("sound", sound), ("manifest", manifest),
    ):  # fmt: skip
        flag(name, value)
    choice("damaged", damaged, DAMAGED)
    if alone and layers:
        raise ValueError("alone and layers must not both be given")
    from flurries.io import Pattern

    wanted = frames_of(scene, frames)
    text = os.fspath(pattern)
    still = Path(text).suffix.lower() not in _video_suffixes() and "%" not in Path(text).name
    if still:
        target = Pattern(_token_for(text))
        wanted = wanted[:1]
    else:
        target = Pattern(text)
    content = Content("layers" if layers else "alone" if alone else "composite", half, _views(eyes))
    _require_room(text, content, is_video=target.is_video)
    bar = progress if progress is not None else _silent
    held_there: set[int] = set()
    if damaged == "hold":
        scene = scene.holding()
    if target.is_video:
        from flurries.output.film import write_film

        path = target.path(0)
        _require_other_file(scene, path)
        done, skipped, heard = write_film(
            scene, path, wanted, quality, bar, skip=damaged == "skip", sound=sound, dask=dask
        )
        made, kept, files = done, [], [path]
    else:
        from flurries.output.sequence import Sequence as Frames

        job = Frames(
            scene, content, text, overwrite, skip=damaged == "skip",
            listed=manifest and not still,
        )  # fmt: skip
        if dask is None:
            job.make(wanted, bar)
        else:
            from flurries.output import cluster

            held_there = cluster.make(job, wanted, bar, dask)
        made, kept, skipped, heard = job.written, job.kept, job.skipped, "none"
        left_out = set(skipped)
        files = [job.path_of(number) for number in wanted if number not in left_out]
    held = [number for number in made if number in scene.held | held_there]
    return Summary(made, kept, files, skipped, held, time.monotonic() - started, heard)


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


def _require_room(text: str, content: Content, *, is_video: bool) -> None:
    """Refuse a kind of file that cannot hold what is asked for."""
    lower = text.lower()
    if content.kind == "alone" and (is_video or not lower.endswith((".exr", ".png", ".tif"))):
        raise ValueError(f"alone needs .exr, .png or .tif, and no layers, got {text!r}")
    if content.kind == "alone" and content.eyes is not None:
        raise ValueError("alone and eyes must not both be given")
    if content.kind == "layers" and not lower.endswith(".exr"):
        raise ValueError(f"layers need an EXR, got {text!r}")
    if content.eyes is not None and not lower.endswith(".exr"):
        raise ValueError(f"eyes need an EXR, got {text!r}")
    if lower.endswith(".hdr"):
        raise ValueError(f"{text}: a .hdr picture cannot say which frame it is; take .exr")


def _video_suffixes() -> tuple[str, ...]:
    from flurries.io.sequences import VIDEO_EXTENSIONS

    return tuple(VIDEO_EXTENSIONS)


def _token_for(text: str) -> str:
    """Return a pattern of the same folder and format, for its checks."""
    path = Path(text)
    if not path.suffix:
        raise ValueError(f"pattern {text!r} needs an extension such as .png, .exr or .mp4")
    return str(path.with_name(f"{path.stem}%d{path.suffix}"))


def _silent(frames: Iterable[int]) -> Iterable[int]:
    return frames


def _require_other_file(scene: Scene, path: Path) -> None:
    """Refuse to write a film over the one that is being read."""
    given = getattr(scene.background, "spec", scene.background)
    if not isinstance(given, (str, os.PathLike)) or not (path.exists() and Path(given).exists()):
        return
    if path.samefile(given):
        raise ValueError(f"{path} is the scene's own background; choose another name")


def display_bytes(image: Array) -> Array:
    """Return (H, W, 3) uint8 display values of a rendered image."""
    if image.dtype == np.uint8:
        return image
    from flurries.io.color import to_display, to_integer

    return to_integer(to_display(image, "display" if image.dtype.kind == "u" else "linear"), 8)

"""A scene to files: sequences that go on where they stopped, and videos."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import Array, flag, integer
from flurries.trace import stage

if TYPE_CHECKING:
    from flurries.scene import Rendered, Scene

__all__ = ["Summary", "write"]

# Three seconds of film, where neither the caller nor the background says how long.
DEFAULT_SECONDS = 3.0

# Frames that are encoded while the next is rendered; each holds a picture in memory.
WRITERS = 2

# How a frame says which scene it belongs to.
SCENE_KEY = "scene"


@dataclass(frozen=True)
class Summary:
    """What was written.

    Attributes
    ----------
    written : list of int
        Frames that were rendered now.
    kept : list of int
        Frames of this scene that were there already.
    files : list of Path
        All files of the request, in order; the one video.
    """

    written: list[int]
    kept: list[int]
    files: list[Path]


def write(
    scene: Scene,
    pattern: str | Path,
    frames: str | int | Iterable[int] | None = None,
    *,
    half: bool = True,
    layers: bool = False,
    alone: bool = False,
    overwrite: bool = False,
    quality: str = "high",
    progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
) -> Summary:
    """Render frames to files.

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
        EXR only: each effect's premultiplied RGBA as named channels beside the composite, and the
        depth of the background and of layers where they are known.
    alone : bool
        The weather alone as RGBA, without background and foreground's picture: premultiplied linear
        light in EXR, straight display values in PNG. Not for video.
    overwrite : bool
        Render again what is there, whatever scene it belongs to.
    quality : {"high", "medium", "draft"}
        Of a video.
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
    flag("half", half)
    flag("layers", layers)
    flag("alone", alone)
    flag("overwrite", overwrite)
    from flurries.io import Pattern

    wanted = frames_of(scene, frames)
    text = os.fspath(pattern)
    still = Path(text).suffix.lower() not in _video_suffixes() and "%" not in Path(text).name
    if still:
        target = Pattern(_token_for(text))
        wanted = wanted[:1]
    else:
        target = Pattern(text)
    if alone and (layers or target.is_video or not text.lower().endswith((".exr", ".png", ".tif"))):
        raise ValueError(f"alone needs .exr, .png or .tif, and no layers, got {text!r}")
    if layers and not text.lower().endswith(".exr"):
        raise ValueError(f"layers need an EXR, got {text!r}")
    if text.lower().endswith(".hdr"):
        raise ValueError(f"{text}: a .hdr picture cannot say which frame it is; take .exr")
    bar = progress if progress is not None else _silent
    if target.is_video:
        _require_other_file(scene, target.path(0))
        _write_video(scene, target, wanted, quality, bar)
        return Summary(wanted, [], [target.path(0)])
    path_of = (lambda _: Path(text)) if still else target.path
    content = "layers" if layers else "alone" if alone else "composite"
    return _write_sequence(scene, path_of, wanted, half, content, overwrite, bar)


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


def frames_of(scene: Scene, frames: str | int | Iterable[int] | None) -> list[int]:
    """Return frame numbers, each once, in the order asked for."""
    from flurries.io import frame_range

    if frames is None:
        if scene.frames is not None:
            return list(range(scene.frames))
        return list(range(1, math.ceil(DEFAULT_SECONDS * scene.fps) + 1))
    if isinstance(frames, str):
        numbers: Sequence[int] = frame_range(frames)
    elif isinstance(frames, (int, np.integer)):
        numbers = [int(frames)]
    elif isinstance(frames, Iterable):
        numbers = list(frames)
    else:
        raise TypeError(f"frames must be a range such as '1-60' or integers, got {frames!r}")
    result = list(dict.fromkeys(integer("frames", n, low=0, high=10**12) for n in numbers))
    if not result:
        raise ValueError("frames must name at least one frame, got none")
    return result


def _require_other_file(scene: Scene, path: Path) -> None:
    """Refuse to write a film over the one that is being read."""
    given = getattr(scene.background, "spec", scene.background)
    if not isinstance(given, (str, os.PathLike)) or not (path.exists() and Path(given).exists()):
        return
    if path.samefile(given):
        raise ValueError(f"{path} is the scene's own background; choose another name")


def _write_video(
    scene: Scene,
    target: Any,
    frames: list[int],
    quality: str,
    bar: Callable[[Iterable[int]], Iterable[int]],
) -> None:
    from flurries.io import VideoWriter

    assert scene.size is not None
    with VideoWriter(target.path(0), scene.size, scene.fps, quality=quality) as video:
        for number in bar(frames):
            image = scene.render(number)
            with stage("encode"):
                video.write(display_bytes(image))


def display_bytes(image: Array) -> Array:
    """Return (H, W, 3) uint8 display values of a rendered image."""
    if image.dtype == np.uint8:
        return image
    from flurries.io.color import to_display, to_integer

    return to_integer(to_display(image, "display" if image.dtype.kind == "u" else "linear"), 8)


def _write_sequence(
    scene: Scene,
    path_of: Callable[[int], Path],
    frames: list[int],
    half: bool,
    content: str,
    overwrite: bool,
    bar: Callable[[Iterable[int]], Iterable[int]],
) -> Summary:
    from flurries import __version__
    from flurries.io.atomic import checked_target, remove_leftovers
    from flurries.io.writing import format_of
    from flurries.scenefile import fingerprint

    files = [path_of(number) for number in frames]
    # Before anything is rendered: a format that can be written, in a place that can be.
    format_of(files[0])
    checked_target(files[0])
    mark = f"{fingerprint(scene)}-{'half' if half else 'float'}-{content}"
    kept = [] if overwrite else [n for n in frames if _is_ours(path_of(n), mark, n)]
    done = set(kept)
    wanted = [number for number in frames if number not in done]
    # What a killed run left under temporary names.
    remove_leftovers(files[0].parent)
    with ThreadPoolExecutor(WRITERS) as writers:
        pending: list[Future[None]] = []
        for number in bar(wanted):
            metadata = {SCENE_KEY: mark, "frame": number, "version": __version__}
            rendered = scene.render(number, layers=content != "composite")
            while len(pending) >= WRITERS:
                pending.pop(0).result()
            pending.append(
                writers.submit(_save, scene, path_of(number), rendered, content, half, metadata)
            )
        for job in pending:
            job.result()
    return Summary(wanted, kept, files)


def _is_ours(path: Path, mark: str, number: int) -> bool:
    """Whether a frame is there and of this very scene; refuses one that is of another."""
    from flurries.io import read_header, read_picture

    if not path.exists():
        return False
    try:
        found = read_header(path).metadata
    except (OSError, ValueError):
        found = {}
    if (found.get(SCENE_KEY), found.get("frame")) == (mark, str(number)):
        try:
            read_picture(path)
        except (OSError, ValueError):
            # Ours, but damaged since: made again.
            return False
        return True
    raise ValueError(
        f"{path} is there already and is not frame {number} of this scene; "
        "choose another name, remove it, or overwrite"
    )


def weather(rendered: Rendered) -> Array:
    """Return (H, W, 4) float32: the layers over each other, premultiplied."""
    whole = np.zeros((*rendered.alpha.shape, 4), np.float32)
    for layer in rendered.layers.values():
        whole = layer + (1.0 - layer[..., 3:]) * whole
    return whole


def _save(
    scene: Scene, path: Path, rendered: Any, content: str, half: bool, metadata: dict[str, Any]
) -> None:
    from flurries.io import write_layers, write_picture
    from flurries.io.color import to_linear

    if isinstance(rendered, np.ndarray):
        write_picture(path, rendered, half=half, metadata=metadata)
        return
    if content == "alone":
        encoding = "linear" if scene.linear else "display"
        write_picture(path, weather(rendered), encoding=encoding, half=half, metadata=metadata)
        return
    image = rendered.image
    image = to_linear(image, "display" if image.dtype.kind == "u" else "linear")
    planes = {"rgba": np.concatenate([image, np.ones_like(image[..., :1])], axis=2)}
    planes.update(rendered.layers)
    if rendered.depth is not None:
        planes["depth"] = rendered.depth
    planes.update({f"{name}.depth": depth for name, depth in rendered.depths.items()})
    write_layers(path, planes, half=half, metadata=metadata)

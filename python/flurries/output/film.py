"""A scene to a video, with the sound of the film that it lies over."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flurries._contract import Array
from flurries.output.sequence import Progress
from flurries.trace import stage

if TYPE_CHECKING:
    from flurries.io.films.sound import Sound
    from flurries.scene.scene import Scene


def write_film(
    scene: Scene,
    path: Path,
    frames: list[int],
    quality: str,
    progress: Progress,
    *,
    skip: bool,
    sound: bool,
    dask: Any = None,
) -> tuple[list[int], list[int], str]:
    """Render frames into a video, which replaces an old one when it is whole.

    Returns
    -------
    written, skipped : list of int
        Frames that are in it, and those whose background cannot be read.
    heard : str
        What became of the sound, see `Summary`.
    """
    from flurries.io import VideoWriter
    from flurries.output.contents import without_alpha
    from flurries.output.write import display_bytes

    assert scene.size is not None
    written: list[int] = []
    skipped: list[int] = []
    heard, part = _sound(scene, frames, skip) if sound else ("none", None)
    with ExitStack() as stack:
        video = stack.enter_context(
            VideoWriter(path, scene.size, scene.fps, quality=quality, sound=part)
        )
        for number, image in _rendered(scene, frames, progress, skip, dask):
            if image is None:
                skipped.append(number)
                continue
            with stage("encode"):
                video.write(display_bytes(without_alpha(image, path)))
            written.append(number)
    return written, skipped, heard


def _rendered(
    scene: Scene, frames: list[int], progress: Progress, skip: bool, dask: Any
) -> Iterator[tuple[int, Array | None]]:
    """Yield frames in order; None where one is left out."""
    if dask is not None:
        if skip:
            raise ValueError("damaged='skip' and dask must not both be given for a video")
        from flurries.output.cluster import images

        blocks = images(scene, frames, dask)
        each = (
            (n, image) for numbers, block in blocks for n, image in zip(numbers, block, strict=True)
        )
        for _ in progress(frames):
            yield next(each)
        return
    for number in progress(frames):
        try:
            if skip:
                scene.look(number)
        except (OSError, ValueError):
            yield number, None
            continue
        yield number, scene.render(number)


def _sound(scene: Scene, frames: list[int], skip: bool) -> tuple[str, Sound | None]:
    """Return what becomes of the background's sound, and the part of it that belongs to frames."""
    from flurries.io.films.codecs import frame_rate
    from flurries.io.films.sound import Sound, has_sound

    film = scene.film
    if film is None or not has_sound(film.spec):
        return "none", None
    rate = frame_rate(scene.fps)
    if film.fps is None or frame_rate(film.fps) != rate:
        return f"left out: the film has {film.fps:g} frames a second", None
    if frames != list(range(frames[0], frames[0] + len(frames))):
        return "left out: the frames do not follow each other", None
    if skip:
        return "left out: frames may be skipped", None
    left = (film.count or 0) - frames[0]
    if left <= 0:
        return "left out: the frames are beyond the film's end", None
    length = Fraction(min(len(frames), left)) / rate
    return "kept", Sound(film.spec, Fraction(frames[0]) / rate, length)

"""A scene to a video, with the sound of the film that it lies over."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from flurries import _core
from flurries._threads import reproducible, threads
from flurries._trace import stage
from flurries.io import VideoWriter
from flurries.io.films.codecs import bits_for, frame_rate
from flurries.io.films.reader import Tags
from flurries.io.films.sound import Sound, has_sound
from flurries.io.films.writer import comment_of
from flurries.output.contents import Frames, is_readable
from flurries.output.groups import images
from flurries.output.journal import Refused
from flurries.output.sequence import Done, Progress
from flurries.scene.fingerprint import short_hash
from flurries.scene.scene import Scene

# Frames that wait for the encoder; each is a picture in memory.
AHEAD = 2


def write_film(
    job: Frames,
    frames: list[int],
    quality: str,
    progress: Progress,
    *,
    sound: bool,
    dask: Any,
    patience: float,
) -> tuple[Done, str]:
    """Render frames into a video, unless the very same one is there."""
    scene, path, done = job.scene, Path(job.pattern), Done()
    assert scene.size is not None
    _require_other_file(scene, path)
    heard, part = _sound(scene, frames, job.skip) if sound else ("none", None)
    mark = _mark(job, frames, quality, part)
    content, tags = job.content, _tags(scene, frames[0])
    alone, bits = content.kind == "alone", content.bits
    if bits is None:
        least = tags.bits if scene._film is not None else 8
        bits = (
            None
            if content.codec is not None and least <= 8
            else bits_for(path.suffix.lower(), content.codec, least)
        )
    elif not isinstance(bits, int):
        raise ValueError(f"bits must be 8, 10 or 16 for a film, got {bits!r}")
    if not job.overwrite and path.exists():
        good = [n for n in frames if is_readable(scene, n)] if job.skip else frames
        if _is_there(path, mark, len(good)):
            done.kept += good
            done.skipped += [number for number in frames if number not in good]
            return done, heard
    comment = f"flurries {mark[0]} {mark[1]}"
    # While a frame is encoded, the next ones are rendered.
    with (
        VideoWriter(
            path, scene.size, scene.fps, quality=quality, sound=part, comment=comment,
            codec=content.codec, bits=bits, alpha=alone, tags=tags,
        ) as video,
        ThreadPoolExecutor(1, "encoder", _core.set_scope, (threads(), reproducible())) as encoder,
    ):  # fmt: skip
        levels = 8 if video.bits == 8 else 16

        def encode(image: Any) -> None:
            with stage("encode"):
                video.write(content.levels(scene, image, levels, path))

        waiting: deque[Future[None]] = deque()
        for number, image in _rendered(job, frames, progress, levels, dask, patience):
            if image is None:
                done.skipped.append(number)
                continue
            # In the context of the caller, whose stages are counted.
            waiting.append(encoder.submit(copy_context().run, encode, image))
            done.written.append(number)
            if len(waiting) > AHEAD:
                waiting.popleft().result()
        for one in waiting:
            one.result()
        if _mark(job, frames, quality, part) != mark:
            raise OSError(f"{path}: what it is made of changed meanwhile; run again")
    done.held += [number for number in done.written if job.stands_in(number)]
    return done, heard


def _mark(job: Frames, frames: list[int], quality: str, part: Sound | None) -> tuple[str, str]:
    first = replace(job.mark_of(frames[0]), inputs="", frame=0)
    heard = part and (part.start, part.length)
    scene = short_hash((first, frames, quality, heard, job.skip))
    return scene, short_hash([job.mark_of(number).inputs for number in frames])


def _is_there(path: Path, mark: tuple[str, str], count: int) -> bool:
    """Whether the very same film is there and whole; refuses another one."""
    found, frames = comment_of(path)
    words = found.split()
    if words[:1] != ["flurries"]:
        raise Refused(path, "is not a film of this scene")
    if words[1:2] != [mark[0]]:
        raise Refused(path, "is a film of another scene, of other frames, or of another version")
    return words[2:] == [mark[1]] and frames == count


def _tags(scene: Scene, first: int) -> Tags:
    """Return a film's tags: those of the background, where it is a film."""
    film = scene._film
    code = scene._slate(first).timecode
    tags: Tags = Tags() if film is None else film.tags
    aspect = Fraction(scene._pixel_aspect).limit_denominator(1000)
    return replace(tags, aspect=aspect, timecode=code)


def _rendered(
    job: Frames, frames: list[int], progress: Progress, levels: int, dask: Any, patience: float
) -> Iterator[tuple[int, Any]]:
    """Yield frames in order, of 16 bits where `levels` is 16; None where one is left out."""
    skip, content, scene = job.skip, job.content, job.scene
    if levels > 8:
        content = replace(content, bits=16)
    if dask is not None:
        if content.kind == "alone":
            raise ValueError("alone and dask must not both be given for a video")
        if skip:
            raise ValueError("damaged='skip' and dask must not both be given for a video")
        each = images(scene, frames, dask, patience)
        for _ in progress(frames):
            yield next(each)
        return
    for number in progress(frames):
        left_out = skip and not is_readable(scene, number)
        yield number, None if left_out else content.render(scene, number)


def _sound(scene: Scene, frames: list[int], skip: bool) -> tuple[str, Sound | None]:
    """Return the fate of the background's sound, and the part of it that belongs to frames."""
    film = scene._film
    if film is None or not has_sound(film.spec):
        return "none", None
    rate = frame_rate(scene.fps)
    if film.fps is None or frame_rate(film.fps) != rate:
        return f"left out: the film has {film.fps:g} frames a second", None
    if frames != list(range(frames[0], frames[0] + len(frames))):
        return "left out: the frames do not follow each other", None
    if skip:
        return "left out: frames may be skipped", None
    assert scene.range is not None
    first, last = scene.range
    if not (first <= frames[0] and frames[-1] <= last):
        return "left out: the film is held or repeated", None
    length = Fraction(len(frames)) / rate
    return "kept", Sound(film.spec, Fraction(frames[0] - first) / rate, length)


def _require_other_file(scene: Scene, path: Path) -> None:
    film = scene._film
    if film is not None and path.exists() and path.samefile(film.spec):
        raise ValueError(f"{path} is the scene's own background; choose another name")

"""A scene to a video, with the sound of the film that it lies over.

It is made in groups of frames, each a file of its own in a folder beside the film until all are
there; so a run that was stopped goes on. The film joins them and encodes nothing again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, suppress
from contextvars import copy_context
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from flurries import _core
from flurries._threads import reproducible, threads
from flurries._trace import current
from flurries.io import VideoWriter, replacing
from flurries.io.atomic import flush_folder
from flurries.io.films.codecs import bits_for, frame_rate
from flurries.io.films.encoding import Film, Plan
from flurries.io.films.process import Remote
from flurries.io.films.reader import Tags
from flurries.io.films.sound import Sound
from flurries.output.contents import Frames, is_readable
from flurries.output.groups import images
from flurries.output.journal import Journal, Mark, Refused, is_journal
from flurries.output.sequence import Done, Progress
from flurries.scene.fingerprint import short_hash
from flurries.scene.scene import Scene

# Frames that wait for the encoder; each is a picture in memory.
AHEAD = 2


def write_film(
    job: Frames, frames: list[int], quality: str, progress: Progress, *, sound: bool, dask: Any,
    patience: float,
) -> tuple[Done, str]:  # fmt: skip
    """Render frames into a video, unless the very same one is there."""
    scene, path = job.scene, Path(job.pattern)
    assert scene.size is not None
    _require_other_file(scene, path)
    heard, part = _sound(scene, frames, job.skip) if sound else ("none", None)
    content, tags = job.content, _tags(scene, frames[0])
    bits = content.bits
    if bits is None:
        least = tags.bits if scene._film is not None else 8
        bits = (
            None
            if content.codec is not None and least <= 8
            else bits_for(path.suffix.lower(), content.codec, least)
        )
    elif not isinstance(bits, int):
        raise ValueError(f"bits must be 8, 10 or 16 for a film, got {bits!r}")
    way = (quality, part and (part.start, part.length))
    mark = _mark(job, frames, way)
    video = VideoWriter(
        path, scene.size, scene.fps, quality=quality, sound=part, bits=bits, tags=tags,
        codec=content.codec, alpha=content.kind == "alone",
        comment=f"flurries {mark.scene} {mark.inputs}",
    )  # fmt: skip
    job.store.require_usable(path)
    job.store.tidy(path.parent)
    journal = Journal(job.store, path.parent)
    line = None if job.overwrite else journal.settled(path, mark)
    groups = _Groups(job, video.plan, frames)
    if line is None:
        try:
            done = groups.make(progress, dask, patience)
            if _mark(job, frames, way) != mark:
                raise OSError(f"{path}: what it is made of changed meanwhile; run again")
            if not job.overwrite:
                journal.settled(path, mark)  # Or refused: a stranger may have put it there.
            try:
                with journal.recording(path, {**mark.facts, "skipped": done.skipped}):
                    groups.join()
            except FileNotFoundError:
                # Another process has joined them meanwhile.
                if journal.settled(path, mark) is None:
                    raise
            # Groups go when the film has its name for certain.
            flush_folder(path.parent)
            groups.remove()
        finally:
            journal.join()
            groups.tidy()
        done.held += [number for number in done.written if job.stands_in(number)]
    else:
        done = Done(skipped=line["skipped"])
        done.kept += [number for number in frames if number not in done.skipped]
        # A run that was killed when the film was there had no time for it.
        journal.join()
        groups.tidy()
        groups.remove()
    return done, heard


def _mark(job: Frames, frames: list[int], way: object) -> Mark:
    """Return the mark of a film, or of a part of it, that is encoded in a way."""
    marks = [job.mark_of(number) for number in frames]
    scene = short_hash(([mark.scene for mark in marks], frames, way, job.skip))
    return replace(marks[0], scene=scene, inputs=short_hash([mark.inputs for mark in marks]))


class _Groups:
    """The groups of frames of a film, each a file of packets."""

    def __init__(self, job: Frames, plan: Plan, frames: list[int]) -> None:
        self._job, self._plan, self._done = job, plan, Done()
        self._folder = plan.path.with_name(f"{plan.path.name}.parts")
        self._journal = Journal(job.store, self._folder)
        self._levels = 8 if plan.codec.bits == 8 else 16
        groups = enumerate(plan.groups(frames))
        self._groups = {self._folder / f"{place:04d}.npz": numbers for place, numbers in groups}

    def make(self, progress: Progress, dask: Any, patience: float) -> Done:
        """Encode the groups that are missing."""
        self.tidy()
        ends: dict[int, Path] = {}
        missing: list[int] = []
        for path, numbers in self._groups.items():
            line = self._settled(path)
            if line is None:
                missing += numbers
                ends[numbers[-1]] = path
            else:
                self._done.skipped += line["skipped"]
                self._done.kept += [n for n in numbers if n not in line["skipped"]]
        if missing:
            self._encode(
                _rendered(self._job, missing, progress, self._levels, dask, patience), ends
            )
        return self._done

    def _settled(self, path: Path) -> dict[str, Any] | None:
        try:
            return self._journal.settled(path, self._mark(path))
        except Refused:
            if not self._journal.lines(path.name):
                raise
            # What a run of another scene has left behind; nobody else wants it.
            return None

    def _mark(self, path: Path) -> Mark:
        plan = self._plan
        way = (plan.size, plan.fps, plan.codec, plan.threads, replace(plan.tags, timecode=None))
        return _mark(self._job, self._groups[path], way)

    def _encode(self, rendered: Iterator[tuple[int, Any]], ends: dict[int, Path]) -> None:
        content, scene, path = self._job.content, self._job.scene, self._plan.path
        # While a frame is encoded, the next ones are rendered.
        with (
            closing(Remote(path, "written", Film, self._plan)) as film,
            ThreadPoolExecutor(1, "encoder", _core.set_scope, (threads(), reproducible())) as pool,
        ):

            def encode(image: Any) -> None:
                with current.get().stage("encode"):
                    film.call("encode", content.levels(scene, image, self._levels, path))

            def save(part: Path, skipped: list[int]) -> None:
                with current.get().stage("encode"):
                    times, data = film.call("end_group")
                facts = {**self._mark(part).facts, "skipped": skipped}
                with self._journal.recording(part, facts), replacing(part) as place:
                    np.savez(place, times=times, data=data)

            waiting: deque[Future[None]] = deque()
            skipped: list[int] = []
            for number, image in rendered:
                # In the context of the caller, whose stages are counted.
                if image is None:
                    skipped.append(number)
                else:
                    waiting.append(pool.submit(copy_context().run, encode, image))
                    self._done.written.append(number)
                if number in ends:
                    waiting.append(pool.submit(copy_context().run, save, ends[number], skipped))
                    self._done.skipped += skipped
                    skipped = []
                while len(waiting) > AHEAD:
                    waiting.popleft().result()
            for one in waiting:
                one.result()

    def join(self) -> None:
        """Put the packets of all groups into the film."""
        path = self._plan.path
        with replacing(path) as place, closing(Remote(path, "written", Film, self._plan)) as film:
            film.call("open", place)
            for part in self._groups:
                with np.load(part, allow_pickle=False) as packets:
                    film.call("join", packets["times"], packets["data"])
            film.call("finish", len(self._done.written) + len(self._done.kept))

    def tidy(self) -> None:
        """Remove what killed processes have left, and the folder if it has no group."""
        self._job.store.tidy(self._folder)
        if not any(path.exists() for path in self._groups):
            self.remove()

    def remove(self) -> None:
        """Remove what the film does not need any more, and nothing else."""
        with suppress(OSError):
            found = list(self._folder.iterdir())
            for part in found:
                if self._journal.lines(part.name):
                    part.unlink()
            # A group without its line would be a stranger's.
            flush_folder(self._folder)
            for part in found:
                if is_journal(part.name):
                    part.unlink()
            self._folder.rmdir()


def _tags(scene: Scene, first: int) -> Tags:
    """Return a film's tags: those of the background, where it is a film."""
    film = scene._film
    code = scene._slate(first).timecode
    tags: Tags = Tags() if film is None else film.tags
    aspect = Fraction(scene._backdrop.aspect).limit_denominator(1000)
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
    if film is None or not film.sound:
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

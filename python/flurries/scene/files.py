"""What the files of a scene say: their numbers, gaps and slates, and which frames they have."""

from __future__ import annotations

import errno
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from flurries._contract import integer, real
from flurries.camera.path import CameraPath
from flurries.io import frame_range
from flurries.io.films.codecs import frame_rate
from flurries.io.films.reader import Tags
from flurries.io.films.sound import Sound
from flurries.io.pictures.slate import Slate, read_slate
from flurries.io.sequences import Span, words_of
from flurries.io.sources import Source, VideoSource
from flurries.scene.background import Backdrop
from flurries.scene.depth import Distance
from flurries.scene.foreground import Mattes
from flurries.scene.numbered import Planes

if TYPE_CHECKING:
    from flurries.scene.rendering import Rendering

# Which frames: "1-60", a number, numbers, or all there are.
Frames: TypeAlias = str | int | Iterable[int] | None

Extend: TypeAlias = Literal["stop", "hold", "loop"]

NUMBERED = r".+\.(-?[0-9]{2,9})\.[^.]+"  # "raw.1001.exr".

# Three seconds of film, where neither the caller nor the background says how long.
DEFAULT_SECONDS = 3.0


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Sources:
    """The part of a scene that answers for its files: background, depth, mattes and camera."""

    size: tuple[int, int]
    fps: float
    camera: CameraPath
    _extend: Extend
    _backdrop: Backdrop = field(init=False)
    _mattes: Mattes | None = field(init=False)
    _distance: Distance | None = field(init=False)

    @property
    def _range(self) -> tuple[int, int] | None:
        """The numbers of the background's first and last frame; None for a still."""
        span = self._backdrop.span
        return None if span is None else (span.first, span.last)

    @property
    def _source(self) -> Any:
        return self._backdrop.source

    @property
    def _film(self) -> VideoSource | None:
        return self._source if isinstance(self._source, VideoSource) else None

    @property
    def _files(self) -> dict[str, Planes]:
        """What is made of files, by the argument that names them."""
        mattes = {} if self._mattes is None else self._mattes.planes
        found = {"background": self._backdrop, "depth": self._distance, **mattes}
        return {name: one for name, one in found.items() if one and one.source is not None}

    @property
    def _holds(self) -> bool:
        return self._extend == "hold" and self.camera.extent is not None

    @property
    def _spans(self) -> list[Span]:
        """The frame numbers of all that has any: files and a camera from a file."""
        found = [files.span for files in self._files.values() if files.span is not None]
        ends = self.camera.extent
        if ends is not None:
            found.append(Span("camera", *ends, "hold" if self._holds else "stop"))
        return found

    def _require(self, frames: Sequence[int], *, gaps: bool = True) -> None:
        """Refuse frame numbers that a file or the camera does not have; files missing: `gaps`."""
        for span in self._spans:
            if outside := span.outside(frames):
                asked = words_of(frames)
                raise ValueError(f"frames {asked} are asked for; {span.complaint(outside)}")
        for name, files in self._files.items() if gaps else ():
            if files.span is not None and (missing := files.gaps(list(frames))):
                words = f"of {files.span.words} the {name} lacks {words_of(missing)}"
                raise FileNotFoundError(errno.ENOENT, words, files.spec)

    def _require_apart(self, places: dict[int, Path]) -> None:
        """Refuse to write over the files that the scene is made of."""
        for name, files in self._files.items():
            for number, place in places.items() if files.spec is not None else ():
                if place.resolve() == files.file(number).resolve():
                    raise ValueError(f"{place} is the {name} itself: write to another name")

    def _look(self, t: float) -> None:
        """Read background, depth and mattes of a frame, as `render` will; raise what it would."""
        for part in (self._backdrop, self._distance, self._mattes):
            if part is not None:
                part.frame(real("t", t))

    def _slate(self, t: float) -> Slate:
        """Return the slate of the background's frame floor(t), at the scene's rate."""
        rate, source = frame_rate(self.fps), self._source
        if not isinstance(source, Source):
            return Slate().at(rate)
        place, beyond = self._backdrop.place(t), self._backdrop.beyond(t)
        if isinstance(source, VideoSource):
            code = source.tags.timecode
            return Slate().at(rate, None if code is None else code.later(place + beyond))
        try:
            found = read_slate(source.file(place))
        except (OSError, ValueError):
            if source.damaged != "hold":
                raise
            # Its frame is that of an earlier plate, which was at another time.
            found = Slate()
        if self.size != source.size:
            # Fitted to another size: other windows and pixels.
            found = found.resized()
        code = found.timecode if beyond else None
        return found.at(rate, None if code is None else code.later(beyond))

    def _tags(self, first: int) -> Tags:
        tags: Tags = Tags() if self._film is None else self._film.tags
        aspect = Fraction(self._backdrop.aspect).limit_denominator(1000)
        return replace(tags, aspect=aspect, timecode=self._slate(first).timecode)

    def _sound(self, frames: list[int], *, skip: bool) -> tuple[str, Sound | None]:
        """The fate of the background's sound, and the part of it that belongs to frames."""
        film, rate = self._film, frame_rate(self.fps)
        if film is None or self._range is None or not film.sound:
            return "none", None
        if film.fps is None or frame_rate(film.fps) != rate:
            return f"left out: the film has {film.fps:g} frames a second", None
        if frames != list(range(frames[0], frames[0] + len(frames))):
            return "left out: the frames do not follow each other", None
        if skip:
            return "left out: frames may be skipped", None
        first, last = self._range
        if not (first <= frames[0] and frames[-1] <= last):
            return "left out: the film is held or repeated", None
        length = Fraction(len(frames)) / rate
        return "kept", Sound(film.spec, Fraction(frames[0] - first) / rate, length)

    @property
    def _held(self) -> set[int]:
        """Frames rendered so far whose background is that of an earlier one."""
        first = 0 if self._range is None else self._range[0]
        return {first + place for place in getattr(self._source, "held", ())}


def frames_of(scene: Rendering, frames: Frames, *, film: bool = False) -> list[int]:
    """Return frame numbers, each once, in the order asked for."""
    if frames is None:
        return list(_all_frames(scene, film))
    if isinstance(frames, str):
        numbers: Iterable[int] = frame_range(frames)
    elif isinstance(frames, (int, np.integer)):
        numbers = [int(frames)]
    elif isinstance(frames, Iterable):
        numbers = frames
    else:
        raise TypeError(f"frames must be a range such as '1-60' or integers, got {frames!r}")
    result = list(dict.fromkeys(integer("frames", n, low=-(10**12), high=10**12) for n in numbers))
    if not result:
        raise ValueError("frames must name at least one frame, got none")
    return result


def _all_frames(scene: Rendering, film: bool) -> Iterable[int]:
    """Return the numbers of the frames that a scene has where none are asked for."""
    # One round of a scene that repeats, else those of the background's files; of a still those of
    # the first that has numbers of camera, depth and foreground; else the number in its name,
    # "raw.1001.exr"; else, and in a film, three seconds from there or 1 on.
    if scene._lap is not None:
        return range(scene._lap.first, scene._lap.end)
    for span in (scene._backdrop.span, *reversed(scene._spans)):
        if span is not None:
            return range(span.first, span.last + 1)
    name = re.fullmatch(NUMBERED, Path(scene._backdrop.spec or "").name)
    if name is not None and not film:
        return [int(name[1])]
    first = 1 if name is None else int(name[1])
    return range(first, first + math.ceil(DEFAULT_SECONDS * scene.fps))

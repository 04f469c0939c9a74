"""Reading video: any frame by its number, the same pixels in whatever order frames are asked for.

Compressed frames build on earlier ones, so a frame is decoded from the last key frame before it.
Reading on from where the decoder stands never seeks.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from flurries.io.color import Array
from flurries.io.files import Budget, plain_file
from flurries.io.films.index import (
    SCALING,
    check_structure,
    has_sound,
    index_frames,
    open_video,
    require_library,
)
from flurries.io.films.process import Remote
from flurries.io.timecode import TimeCode

UNSPECIFIED = 2

_FULL = 2


@dataclass(frozen=True)
class Tags:
    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED  # As ITU-T H.273 counts them; 2 is not said.
    full: bool = False  # Whether numbers go from 0 to the largest, not from 16 to 235.
    aspect: Fraction = Fraction(1)  # Width of a pixel over its height.
    bits: int = 8  # Of a color.
    timecode: TimeCode | None = None  # Of the first frame.
    interlaced: bool = False  # Whether a frame holds two moments.

    @staticmethod
    def of(container: Any, stream: Any, frame: Any) -> Tags:
        context = stream.codec_context

        def said(name: str) -> int:
            own = int(getattr(frame, name))
            return int(getattr(context, name)) if own in (0, UNSPECIFIED) else own

        aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
        rate = stream.average_rate or stream.guessed_rate
        said_of = [container.metadata, *(one.metadata for one in container.streams)]
        texts = [text for one in said_of for key, text in one.items() if key.lower() == "timecode"]
        codes = [TimeCode.of_text(text, Fraction(rate)) for text in texts if rate]
        return Tags(
            primaries=said("color_primaries"),
            transfer=said("color_trc"),
            matrix=UNSPECIFIED if frame.format.is_rgb else said("colorspace"),
            full=said("color_range") == _FULL or frame.format.name.startswith("yuvj"),
            aspect=aspect if Fraction(1, 20) <= aspect <= 20 else Fraction(1),
            bits=max(part.bits for part in frame.format.components),
            timecode=next((code for code in codes if code is not None), None),
            interlaced=bool(frame.interlaced_frame),
        )


class VideoReader:
    """Gives a video's frames as RGB, uint8 or uint16 by its bits; for one thread at a time."""

    def __init__(self, path: str | os.PathLike[str], *, budget: Budget | None = None) -> None:
        require_library()
        self.path, self._budget = plain_file(path), Budget.of(budget)
        check_structure(self.path)
        self._open()
        self.fps, self.count, self.size, self.tags, self.sound = self._decoder.call("facts")

    def _open(self) -> None:
        self._decoder = Remote(self.path, "read", Decoder, self.path, self._budget)

    def close(self) -> None:
        self._decoder.close()

    def frame(self, number: int) -> Array:
        """Return frame `number`, from 0, as (H, W, 3) uint8 or uint16, turned upright."""
        if not 0 <= number < self.count:
            raise IndexError(f"{self.path}: there is no frame {number} among {self.count}")
        if self._decoder.ended:
            # A crash, Ctrl-C while it was asked, or a fork.
            self._open()
        frame: Array = self._decoder.call("frame", number)
        return frame


class Decoder:
    """Decodes a video's frames, in the codecs' process."""

    def __init__(self, path: Path, budget: Budget) -> None:
        self.path, self._budget = path, budget
        self._container, self._stream = open_video(self.path, self._budget)
        rate = self._stream.average_rate or self._stream.guessed_rate
        self._fps = float(rate) if rate else None
        self._index = index_frames(self.path, self._budget)
        self._frames = self._decode()
        # The frame that the decoder will yield next, and those that it yielded ahead of need.
        self._next = 0
        self._ready: dict[int, Any] = {}
        self._broken: set[int] = set()
        self._seeks = self._index.seekable
        self._size: tuple[int, int] | None = None
        self._tags = Tags()
        first = self.frame(0)
        self._size = (first.shape[1], first.shape[0])

    def facts(self) -> tuple[float | None, int, tuple[int, int] | None, Tags, bool]:
        return self._fps, len(self._index.times), self._size, self._tags, has_sound(self._container)

    def frame(self, number: int) -> Array:
        key = self._index.key_of(number)
        if number not in self._ready and not key <= self._next <= number:
            self._go_to(key)
        # Damage shows when a frame is yielded. So all frames decoded before this one are awaited,
        # also those that are shown later, and frames do not depend on what was asked for before.
        overshot = self._read_to(self._index.reach[number], key)
        if overshot and self._seeks and key:
            # Some files seek to a later key frame than they were asked for: never seek in them.
            self._seeks = False
            self._go_to(key)
            self._read_to(self._index.reach[number], key)
        for past in [place for place in self._ready if place < number]:
            del self._ready[past]
        found = self._ready.get(number)
        if found is None or any(self._index.builds_on(number, place) for place in self._broken):
            raise OSError(f"{self.path}: frame {number} of the video is damaged")
        if self._size is None:
            self._tags = Tags.of(self._container, self._stream, found)
        pixels = _to_rgb(found)
        if self._size is not None and self._size != (pixels.shape[1], pixels.shape[0]):
            raise OSError(f"{self.path}: frame {number} of the video has another size")
        return pixels

    def _go_to(self, key: int) -> None:
        """Make `key` or an earlier frame the next one to be decoded."""
        self._ready.clear()
        if self._seeks and key:
            self._container.seek(self._index.times[key], stream=self._stream)
            self._next = key
        else:
            self._container.close()
            self._container, self._stream = open_video(self.path, self._budget)
            self._next = 0
        self._frames = self._decode()

    def _read_to(self, last: int, key: int) -> bool:
        """Decode up to frame `last`; return whether the decoder began after the frame `key`."""
        fresh = self._next == key
        while self._next <= last:
            frame = next(self._frames, None)
            if frame is None:
                self._next = len(self._index.times)
                return False
            place = self._next if self._index.counted else self._index.numbers.get(frame.pts)
            if place is None:
                continue
            if fresh and place > key:
                return True
            fresh = False
            self._next = place + 1
            self._ready[place] = frame
            if frame.is_corrupt:
                self._broken.add(place)
        return False

    def _decode(self) -> Iterator[Any]:
        """Yield decoded frames from where the file stands; note what cannot be decoded."""
        import av

        try:
            for packet in self._container.demux(self._stream):
                try:
                    yield from packet.decode()
                except av.FFmpegError:
                    place = self._index.numbers.get(packet.pts)
                    # Without a time, the frame that comes next is as near as can be told.
                    last = len(self._index.times) - 1
                    self._broken.add(min(self._next, last) if place is None else place)
        except av.FFmpegError:
            return


def read_video(path: str | os.PathLike[str], *, budget: Budget | None = None) -> Iterator[Array]:
    """Yield the frames of a video in order, each (H, W, 3): uint8, of more bits uint16.

    `path`, `budget` and errors are those of `read_picture`; errors come where the damage is.
    """
    reader = VideoReader(path, budget=budget)
    with closing(reader):
        for number in range(reader.count):
            yield reader.frame(number)


def _to_rgb(frame: Any) -> Array:
    from av.video.reformatter import Colorspace

    wishes = dict(SCALING)
    if frame.colorspace == UNSPECIFIED and not frame.format.is_rgb:
        # Unmarked video follows the convention of its size.
        wishes["src_colorspace"] = Colorspace.ITU709 if frame.height >= 720 else Colorspace.ITU601
    deep = max(part.bits for part in frame.format.components) > 8
    pixels = frame.to_ndarray(format="rgb48le" if deep else "rgb24", **wishes)
    # The display matrix turns counterclockwise, as rot90 does.
    return np.ascontiguousarray(np.rot90(pixels, round(frame.rotation / 90)))

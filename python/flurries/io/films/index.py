"""Opening a video, and where its frames are: an index made without decoding any of them."""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

from flurries.io.files import Budget

READABLE = (
    *(".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi"),
    *(".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv"),
)

# A playlist or a concatenation script is text that makes the library open other files, or the
# network. Only real containers in real files are let in.
_CONTAINERS = "mov,matroska,avi,mpegts,mpeg,asf"

# Packets of these do not say when their frames are shown, or say it wrongly. Their frames are
# counted from the start, and going backwards starts over.
_TIMELESS = ("avi", "mpeg")

# Transport streams are searched by time stamps, and a damaged one leads astray.
_SEEKLESS = ("mpegts",)


# How pixel formats are converted: bicubic (4), chroma interpolated in full (0x2000), rounded
# exactly (0x40000), the same bits on every processor (0x80000), and in the calling thread.
SCALING: dict[str, Any] = {"interpolation": 4 | 0x2000 | 0x40000 | 0x80000, "threads": 1}


def require_library() -> None:
    """Refuse to go on without PyAV, which is an extra: pictures do without it."""
    if find_spec("av") is None:
        raise ImportError(
            "films need PyAV, which flurries' extra [video] brings: pip install 'flurries[video]', "
            "or pip install av"
        )


@dataclass(frozen=True)
class FrameIndex:
    """The places of the frames in a video."""

    times: Sequence[int]  # When each frame is shown.
    keys: Sequence[int]  # The frames that build on no other, ascending.
    order: Sequence[int]  # Each frame's place in the file.
    counted: bool = False  # Whether the file does not tell times.
    seekable: bool = True  # Whether the file can be entered at a key frame.

    @cached_property
    def numbers(self) -> dict[int | None, int]:
        """The frame that is shown at each time."""
        return {time: number for number, time in enumerate(self.times)}

    @cached_property
    def reach(self) -> list[int]:
        """The last of the frames that are decoded no later than each frame."""
        reach, last = [0] * len(self.times), 0
        for number in sorted(range(len(self.times)), key=self.order.__getitem__):
            last = max(last, number)
            reach[number] = last
        return reach

    def key_of(self, number: int) -> int:
        return self.keys[bisect_right(self.keys, number) - 1]

    def builds_on(self, number: int, other: int) -> bool:
        """Return whether `other` is decoded between the key frame of a frame and the frame."""
        return self.order[self.key_of(number)] <= self.order[other] <= self.order[number]


def open_video(path: Path, budget: Budget | None = None) -> tuple[Any, Any]:
    import av

    options = {"protocol_whitelist": "file", "format_whitelist": _CONTAINERS}
    try:
        # An absolute path cannot be taken for a protocol.
        container = av.open(str(path.absolute()), container_options=options)
    except (av.FFmpegError, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if path.suffix.lower() in READABLE:
            raise OSError(f"{path}: the video cannot be read: {reason}") from error
        raise ValueError(f"{path}: not a video of a known format") from error
    with ExitStack() as opened:
        opened.callback(container.close)
        if not container.streams.video:
            raise ValueError(f"{path}: the file holds no video")
        stream = container.streams.video[0]
        context, limits = stream.codec_context, Budget.of(budget)
        if context is None:
            raise OSError(f"{path}: the video is damaged, or of a codec that is not known")
        # One thread: renderers have the others.
        context.thread_count = 1
        # Codecs have whole blocks of pixels.
        room = limits.pixels + limits.pixels // 8 + 2**16
        context.options = {"max_pixels": str(room)}
        if context.width and context.height:
            limits.admit(path, (context.width, context.height), 3)
        opened.pop_all()
    return container, stream


def has_sound(container: Any) -> bool:
    return any(stream.codec_context is not None for stream in container.streams.audio)


def index_frames(path: Path, budget: Budget | None = None) -> FrameIndex:
    import av

    container, stream = open_video(path, budget)
    packets = []
    with closing(container):
        kind = container.format.name
        try:
            for packet in container.demux(stream):
                if packet.size and not packet.is_discard:
                    packets.append((packet.pts, packet.is_keyframe))
        except av.FFmpegError as error:
            raise OSError(f"{path}: the video is damaged: {error.strerror}") from error
    times = sorted(time for time, _ in packets if time is not None)
    if kind in _TIMELESS or len({*times}) < len(packets):
        numbers = range(_count_frames(path, budget))
        index = FrameIndex(numbers, [0], numbers, counted=True, seekable=False)
    else:
        # What comes before the first key frame builds on frames that were cut away.
        key_times = {time for time, is_key in packets if is_key} or {*times[:1]}
        times = [time for time in times if time >= min(key_times)]
        stored = {time: place for place, (time, _) in enumerate(packets)}
        index = FrameIndex(
            times,
            [number for number, time in enumerate(times) if time in key_times],
            [stored[time] for time in times],
            seekable=kind not in _SEEKLESS,
        )
    if not index.times:
        raise OSError(f"{path}: the video holds no frames")
    return index


def _count_frames(path: Path, budget: Budget | None) -> int:
    """Decode the whole video to count its frames, where nothing else tells their number."""
    import av

    container, stream = open_video(path, budget)
    count = 0
    with closing(container):
        for packet in container.demux(stream):
            try:
                count += len(packet.decode())
            except av.FFmpegError:
                continue
    return count


_EBML = b"\x1a\x45\xdf\xa3"
_SEGMENT = b"\x18\x53\x80\x67"


def check_structure(path: Path) -> None:
    """Raise OSError if a film is empty or ends before its own structure says that it should."""
    # Decoders stop early and call it a success; a copy that broke off is common.
    size = path.stat().st_size
    if size == 0:
        raise OSError(f"{path}: the file is empty")
    with path.open("rb") as stream:
        head = stream.read(12)
        stream.seek(0)
        if head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
            _check_boxes(path, stream, size)
        elif head.startswith(_EBML):
            _check_matroska(path, stream, size)
        elif head.startswith(b"RIFF") and head[8:12] == b"AVI ":
            _check_end(path, 8 + struct.unpack("<I", head[4:8])[0], size)


def _check_boxes(path: Path, stream: BinaryIO, size: int) -> None:
    """Walk the outermost boxes of an MP4 or MOV file: each must end within the file."""
    position = 0
    while position < size:
        stream.seek(position)
        header = stream.read(16)
        length = int.from_bytes(header[:4], "big")
        if length == 0 and len(header) >= 8:
            return  # This box reaches to the end, wherever that is.
        if length == 1:
            length = int.from_bytes(header[8:], "big")
        if len(header) < 8 or length < 8:
            raise OSError(f"{path}: the video is cut short or damaged: a part of it has no length")
        position += length
    _check_end(path, position, size)


def _check_matroska(path: Path, stream: BinaryIO, size: int) -> None:
    """Compare the length that the outermost element of a WebM or Matroska file states."""
    position = len(_EBML)
    length, width = _variable_integer(stream, position)
    position += width + (length or 0)
    stream.seek(position)
    if stream.read(4) != _SEGMENT:
        raise OSError(f"{path}: the video is cut short or damaged: it has no segment")
    length, width = _variable_integer(stream, position + 4)
    if width == 0:
        raise OSError(f"{path}: the video is cut short")
    if length is not None:
        _check_end(path, position + 4 + width + length, size)


def _variable_integer(stream: BinaryIO, position: int) -> tuple[int | None, int]:
    """Read a length as Matroska writes it; None means that it is not stated, as in live streams."""
    stream.seek(position)
    data = stream.read(8)
    if not data or data[0] == 0:
        return None, 0
    width = 9 - data[0].bit_length()
    if len(data) < width:
        return None, 0
    largest = 2 ** (7 * width) - 1
    value = int.from_bytes(data[:width], "big") & largest
    return (None if value == largest else value), width


def _check_end(path: Path, stated: int, size: int) -> None:
    if stated > size:
        raise OSError(f"{path}: the video is cut short: {size} of {stated} bytes are there")
